// The pose of two images: a file or an example in, the pose in space, numbers and pictures out.
import { estimate, solvers } from "quest-pose";
import general from "../../examples/tumfr3_98072_98172.json";
import plane from "../../examples/hololens_00011_00015.json";
import { ellipses, frames } from "./paint.js";
import { isPhotograph, readPhotographs } from "./photos.js";
import { guessCamera, readPair } from "./read.js";
import { COLOURS, frustum, place, quaternion, Stage, THREE } from "./stage.js";

const EXAMPLES = [["A desk, 500 matches, some wrong", general], ["A floor, where a second pose fits too", plane]];
const MODELS = {
  general: ["Points in space", "The camera moved, and the points are not on one plane."],
  planar: ["A plane", "The points lie on a plane: a second pose may explain them as well."],
  pure_rotation: ["A rotation alone", "No translation stands clear of the noise: the rotation is right, the depths are unknown."],
};
const by = (id) => document.getElementById(id);

export function startPose() {
  const stage = new Stage(by("scene"));
  let pair = general;
  let found = null;

  const references = Object.fromEntries(solvers().map(({ name, reference }) => [name, reference]));
  for (const { name, minMatches } of solvers()) by("solver").append(new Option(`${name}, ${minMatches} matches a sample`, name));
  EXAMPLES.forEach(([text], i) => by("example").append(new Option(text, i)));
  by("example").append(new Option("your own file", "own", false, false));
  by("example").options[EXAMPLES.length].disabled = true;

  const open = (next, example) => {
    pair = next;
    by("example").value = example;
    // A file without a camera may hold pixels.
    const guess = pair.camera1 ? null : guessCamera(pair);
    by("camera").hidden = !guess;
    if (guess) [by("focal").value, , by("centre-u").value, by("centre-v").value] = guess.params;
    run();
  };

  const cameras = () => {
    if (by("camera").hidden) return { camera1: pair.camera1, camera2: pair.camera2 };
    const [f, u, v] = ["focal", "centre-u", "centre-v"].map((id) => Number(by(id).value));
    if (!pair.pictures) return { camera1: { model: "SIMPLE_PINHOLE", params: [f, u, v] } };
    // The same lens; a photograph that is turned or cut has its own middle.
    const [{ width, height }] = pair.pictures;
    const [camera1, camera2] = pair.pictures.map((picture) => ({
      model: "SIMPLE_PINHOLE",
      params: [(f * Math.max(picture.width, picture.height)) / Math.max(width, height), u + (picture.width - width) / 2, v + (picture.height - height) / 2],
      width: picture.width,
      height: picture.height,
    }));
    return { camera1, camera2 };
  };

  function run() {
    const { camera1, camera2 = camera1 } = cameras();
    const pixels = 10 ** Number(by("threshold").value);
    // Without cameras the unit is the plane z = 1: a thousandth of it is about a pixel.
    const threshold = camera1 ? pixels : pixels / 1000;
    by("reference").textContent = references[by("solver").value];
    by("threshold-text").value = camera1 ? `${pixels.toPrecision(2)} px` : threshold.toPrecision(2);
    try {
      const options = { threshold, solver: by("solver").value, loss: by("loss").value };
      if (camera1) Object.assign(options, { camera1, camera2 });
      const matches = Float64Array.from(pair.matches.flat());
      const start = performance.now();
      found = estimate(matches, options);
      show(performance.now() - start, camera1 ? "px" : "");
    } catch (error) {
      refuse(error);
    }
    drawScene(camera1, camera2);
    draw();
  }

  function show(milliseconds, unit) {
    const [title, text] = MODELS[found.model];
    by("verdict").textContent = title;
    by("explain").textContent = text;
    const degrees = 180 / Math.PI;
    const deviation = (first) => Math.sqrt([0, 1, 2].reduce((sum, k) => sum + found.covariance[first + k][first + k], 0));
    const [w, ...axis] = found.quaternion;
    const rows = [
      ["Inliers", `${found.inlierCount} of ${found.inliers.length}`],
      ["Rotation", `${(2 * Math.atan2(Math.hypot(...axis), w) * degrees).toFixed(3)}° ± ${(deviation(0) * degrees).toPrecision(2)}°`],
      ["q (w, x, y, z)", found.quaternion.map((x) => x.toFixed(4)).join("  ")],
      ["t", found.t.map((x) => x.toFixed(4)).join("  ")],
      ["|t|, the parallax", `${found.parallax.toFixed(4)} ± ${deviation(3).toPrecision(2)}`],
      ["Noise", `${found.noisePx.toPrecision(3)} ${unit}`],
      ["Samples", found.iterations.toLocaleString("en")],
      ["Time", `${milliseconds.toFixed(1)} ms`],
    ];
    if (found.runnerUp) {
      const { t, inlierCount } = found.runnerUp;
      rows.push(["Second pose", `${inlierCount} inliers`], ["its t", t.map((x) => x.toFixed(4)).join("  ")]);
    }
    list(rows);
    by("other-row").hidden = !found.runnerUp;
  }

  function refuse(error) {
    found = null;
    by("verdict").textContent = "No pose";
    by("explain").textContent = `${error.message}.`;
    list([["Matches", String(pair.matches.length)]]);
    by("other-row").hidden = true;
  }

  function list(rows) {
    by("numbers").replaceChildren(
      ...rows.flatMap(([term, text]) => {
        const [dt, dd] = [document.createElement("dt"), document.createElement("dd")];
        [dt.textContent, dd.textContent] = [term, text];
        return [dt, dd];
      }),
    );
  }

  function drawScene(camera1, camera2) {
    stage.world.clear();
    const second = found?.runnerUp && by("other").checked;
    by("other-key").hidden = !second;
    by("scene").setAttribute("aria-label", found ? `Both cameras and ${found.inlierCount} points in space` : "No pose to show");
    if (found) {
      const { points, reach } = triangulate(pair.matches, found, camera1, camera2);
      const shape = new THREE.BufferGeometry().setFromPoints(points);
      stage.world.add(new THREE.Points(shape, new THREE.PointsMaterial({ color: 0xdfe9ff, size: 0.018 * reach })));
      const size = Math.min(0.12 * reach, Math.max(0.5 * found.parallax, 0.05 * reach));
      const first = frustum(COLOURS.one, size);
      const moved = frustum(COLOURS.two, size);
      place(moved, quaternion(found.quaternion), new THREE.Vector3(...found.t));
      const every = Math.ceil(points.length / 40);
      const rays = points.filter((_, i) => i % every === 0);
      stage.world.add(first, moved, lines(rays, first.position, COLOURS.one), lines(rays, moved.position, COLOURS.two));
      if (second) {
        const other = frustum(COLOURS.other, size);
        place(other, quaternion(found.runnerUp.quaternion), new THREE.Vector3(...found.runnerUp.t));
        stage.world.add(other);
      }
      if (stage.pair !== pair) stage.look([0.9 * reach, -0.6 * reach, -0.35 * reach], [0, 0, 0.55 * reach]);
      stage.pair = pair;
    }
    stage.draw();
  }

  function draw() {
    const inliers = found?.inliers ?? pair.matches.map(() => false);
    frames(by("frames"), { ...pair, ...cameras() }, inliers);
    by("frames").setAttribute("aria-label", `${pair.matches.length} matches over both images, ${found?.inlierCount ?? 0} of them inliers`);
    if (found) ellipses(by("ellipses"), found.covariance);
    by("ellipses").parentElement.hidden = !found;
  }

  const read = async (list) => {
    const files = [...list];
    if (!files.length) return;
    try {
      if (files.some(isPhotograph)) {
        by("verdict").textContent = "Looking for matches …";
        by("explain").textContent = "OpenCV finds corners in both photographs and compares them.";
        // The words are painted before the work begins.
        await new Promise((resolve) => requestAnimationFrame(() => setTimeout(resolve)));
        open(await readPhotographs(files), "own");
      } else open(readPair(files[0].name, await files[0].text()), "own");
    } catch (error) {
      refuse(error);
    }
  };
  by("example").addEventListener("change", (event) => open(EXAMPLES[event.target.value][1], event.target.value));
  by("file").addEventListener("change", (event) => read(event.target.files));
  for (const id of ["solver", "loss", "other", "focal", "centre-u", "centre-v"]) by(id).addEventListener("change", run);
  by("threshold").addEventListener("input", run);
  document.addEventListener("dragover", (event) => {
    event.preventDefault();
    by("drop").classList.add("over");
  });
  document.addEventListener("dragleave", () => by("drop").classList.remove("over"));
  document.addEventListener("drop", (event) => {
    event.preventDefault();
    by("drop").classList.remove("over");
    read(event.dataTransfer.files);
  });
  new ResizeObserver(draw).observe(by("frames"));
  open(general, 0);
}

/** The inliers in space: the points nearest to both rays. A lens' distortion is left out, for the picture alone. */
function triangulate(matches, { quaternion: q, t, inliers }, camera1, camera2) {
  const q21 = quaternion(q);
  const t21 = new THREE.Vector3(...t);
  const points = [];
  matches.forEach((row, i) => {
    if (!inliers[i]) return;
    const x1 = ray(camera1, row[0], row[1]).applyQuaternion(q21);
    const x2 = ray(camera2, row[2], row[3]);
    // z1 R x1 + t = z2 x2, least squares.
    const [aa, ab, bb] = [x1.dot(x1), x1.dot(x2), x2.dot(x2)];
    const z1 = (ab * x2.dot(t21) - bb * x1.dot(t21)) / (aa * bb - ab * ab);
    if (z1 > 0 && Number.isFinite(z1)) points.push(ray(camera1, row[0], row[1]).multiplyScalar(z1));
  });
  const depths = points.map((point) => point.z).sort((a, b) => a - b);
  const reach = 1.2 * (depths[Math.floor(0.9 * depths.length)] ?? 1);
  return { points: points.filter((point) => point.z < 3 * reach), reach };
}

function ray(camera, u, v) {
  if (!camera) return new THREE.Vector3(u, v, 1);
  const p = camera.params;
  const two = ["PINHOLE", "OPENCV", "OPENCV_FISHEYE", "FULL_OPENCV"].includes(camera.model);
  const [fx, fy, cx, cy] = two ? p : [p[0], ...p];
  return new THREE.Vector3((u - cx) / fx, (v - cy) / fy, 1);
}

function lines(points, from, colour) {
  const shape = new THREE.BufferGeometry().setFromPoints(points.flatMap((point) => [from, point]));
  return new THREE.LineSegments(shape, new THREE.LineBasicMaterial({ color: colour, transparent: true, opacity: 0.22 }));
}
