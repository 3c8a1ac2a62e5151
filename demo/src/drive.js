// Drive: both loops in the same room, from the same start, with the same disturbances.
import { advance, essentialLoop, PERIOD, questLoop, rotation } from "./loops.js";
import { distances, view } from "./paint.js";
import { CAMERA, features, furniture, image, pixel, random } from "./room.js";
import { COLOURS, frustum, place, Stage, THREE } from "./stage.js";

const by = (id) => document.getElementById(id);
const TEXTS = { noise: (x) => `${x.toFixed(1)} px`, outliers: (x) => `${x} %`, lost: (x) => `${x} %`, delay: (x) => `${x} images` };
const SIZE = [CAMERA.width, CAMERA.height];
/** The middle of the room, about which "away" turns the camera. */
const MIDDLE = new THREE.Vector3(0, 0, 2.9);

export function startDrive() {
  const points = features();
  const goal = points.map(pixel);
  const stage = new Stage(by("room"));
  const goalCamera = frustum(COLOURS.one, 0.3);
  stage.world.add(furniture(points), goalCamera);
  stage.look([2.6, -1.9, -2.2], [0, 0.1, 1.5]);
  const runs = [
    { name: "quest", colour: COLOURS.two, make: () => questLoop(goal, number("noise")) },
    { name: "essential", colour: COLOURS.other, make: () => essentialLoop(goal) },
  ].map((run) => ({ ...run, css: `#${run.colour.toString(16)}`, camera: frustum(run.colour, 0.3), trail: new THREE.Line(new THREE.BufferGeometry(), new THREE.LineBasicMaterial({ color: run.colour })) }));
  runs.forEach((run) => stage.world.add(run.camera, run.trail));
  let seed = 0, time = 0, driving = false, news = "";

  const number = (id) => Number(by(id).value);

  /** Both cameras at a new start. */
  function begin() {
    const { uniform } = random(++seed);
    const about = new THREE.Vector3(0.25 + 0.25 * uniform(), (seed % 2 ? 1 : -1) * (0.3 + 0.2 * uniform()), 0.5 * uniform() - 0.25);
    const q = rotation(about);
    const t = MIDDLE.clone().sub(MIDDLE.clone().applyQuaternion(q)).add(new THREE.Vector3(0, 0, 0.25 + 0.4 * uniform()));
    for (const run of runs) run.pose = { q: q.clone(), t: t.clone() };
    restart();
  }

  /** The loops forget what they know. */
  function restart() {
    time = 0;
    for (const run of runs) {
      run.loop?.free();
      run.loop = run.make();
      Object.assign(run, { images: [], points: [], trailPoints: [], random: random(1000 + seed), state: "ready", advice: "", arrived: false, speed: 0 });
      run.seen = look(run);
    }
    say("");
    show();
  }

  const look = (run) =>
    image(points, run.pose, { noise: number("noise"), outliers: number("outliers") / 100, lost: number("lost") / 100 }, run.random);
  const distance = ({ pose }) => pose.t.length();

  function step() {
    time += PERIOD;
    for (const run of runs) {
      run.seen = look(run);
      run.images.push(run.seen);
      run.images.splice(0, Math.max(0, run.images.length - 1 - number("delay")));
      const command = run.loop.step(run.images[0]);
      run.pose = advance(run.pose, command, PERIOD);
      run.speed = command.v.length();
      run.state = command.state;
      run.advice = command.advice ?? "";
      run.arrived = command.arrived ?? false;
      run.points.push([time, distance(run)]);
      run.trailPoints.push(position(run.pose));
    }
    if (runs[0].arrived) say(`quest-pose is at the goal after ${time.toFixed(0)} seconds and stands still. The essential matrix's camera moves with ${runs[1].speed.toFixed(2)} metres a second.`);
  }

  /** The moves of the hand: metres in the camera's frame. It turns so that the room stays in its image. */
  function away(x, y, z) {
    for (const run of runs) {
      const turn = rotation(new THREE.Vector3(-y / 2.9, x / 2.9, 0));
      const moved = { q: run.pose.q, t: run.pose.t.clone().sub(new THREE.Vector3(x, y, z)) };
      run.pose = { q: turn.clone().multiply(moved.q), t: moved.t.applyQuaternion(turn) };
    }
    restart();
  }

  function say(text) {
    if (text !== news) by("drive-news").textContent = news = text;
  }

  function show() {
    for (const run of runs) {
      place(run.camera, run.pose.q, run.pose.t);
      run.trail.geometry.dispose();
      run.trail.geometry = new THREE.BufferGeometry().setFromPoints(run.trailPoints);
      view(by(`${run.name}-view`), SIZE, goal, run.seen, run.css);
      const away = distance(run), far = away < 0.1 ? `${(1000 * away).toFixed(1)} mm` : `${away.toFixed(2)} m`;
      by(`${run.name}-state`).textContent = `${far} away, ${run.speed.toFixed(2)} m/s, ${run.state}`;
    }
    by("quest-advice").textContent = runs[0].advice;
    distances(by("distance"), runs.map(({ css, points }) => ({ colour: css, points })), Math.max(15, 5 * Math.ceil(time / 5)));
    by("distance").setAttribute("aria-label", `After ${time.toFixed(0)} s quest-pose is ${distance(runs[0]).toFixed(3)} m from the goal, the essential matrix ${distance(runs[1]).toFixed(3)} m`);
    stage.draw();
  }

  /** Images come at their own rate, whatever the screen's is. */
  let last = 0;
  function frame(now) {
    if (!driving) return;
    const due = Math.min(Math.floor((now - last) / 1000 / PERIOD), 10);
    if (due > 0) {
      last = due === 10 ? now : last + due * PERIOD * 1000;
      for (let i = 0; i < due; i++) step();
      show();
    }
    requestAnimationFrame(frame);
  }

  function drive(on) {
    driving = on;
    by("servo").setAttribute("aria-pressed", String(on));
    by("servo").textContent = on ? "Stop" : "Servo";
    if (on) {
      last = performance.now();
      requestAnimationFrame(frame);
    }
  }

  by("servo").addEventListener("click", () => drive(!driving));
  by("again").addEventListener("click", () => {
    drive(false);
    begin();
  });
  for (const [id, text] of Object.entries(TEXTS)) {
    const write = () => (by(`${id}-text`).value = text(number(id)));
    by(id).addEventListener("input", write);
    write();
  }
  for (const button of document.querySelectorAll("[data-move]")) {
    button.addEventListener("click", () => away(...button.dataset.move.split(",").map((x) => 0.15 * x)));
  }
  for (const run of runs) {
    const canvas = by(`${run.name}-view`);
    canvas.addEventListener("pointerdown", (event) => canvas.setPointerCapture(event.pointerId));
    canvas.addEventListener("pointermove", (event) => {
      // What is dragged to the right makes the camera go to the left, by about as much as the pixels say.
      if (event.buttons) away((-2.4 * event.movementX) / canvas.clientWidth, (-2.4 * event.movementY) / canvas.clientWidth, 0);
    });
  }
  new ResizeObserver(show).observe(by("distance"));
  begin();
  return { stop: () => drive(false) };
}

/** Where a camera is in the goal's frame. */
const position = ({ q, t }) => t.clone().applyQuaternion(q.clone().conjugate()).negate();
