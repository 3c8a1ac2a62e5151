// Flat pictures: matches over two images, ellipses, distances over time.

/** The canvas at the screen's resolution, cleared, with its size in CSS pixels. */
export function begin(canvas) {
  const scale = Math.min(devicePixelRatio, 2);
  const { clientWidth: width, clientHeight: height } = canvas;
  if (canvas.width !== Math.round(width * scale)) canvas.width = Math.round(width * scale);
  if (canvas.height !== Math.round(height * scale)) canvas.height = Math.round(height * scale);
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  pen.font = "12px system-ui, 'DejaVu Sans', sans-serif";
  return { pen, width, height };
}

const SOFT = "#a9b8d0", LINE = "#34435f", IN = "#3ddbc5", OUT = "#ff7b7b";

/** Matches over both images: where each point is, and where it went or came from. */
export function frames(canvas, pair, inliers) {
  const { pen, width, height } = begin(canvas);
  if (!width) return; // On a tab that is not shown.
  const gap = 12, upright = width < 480;
  const box = upright ? [width, (height - gap) / 2] : [(width - gap) / 2, height];
  const corners = upright ? [[0, 0], [0, box[1] + gap]] : [[0, 0], [box[0] + gap, 0]];
  [0, 1].forEach((view) => {
    const [left, top, right, bottom] = extent(pair, view);
    const zoom = Math.min(box[0] / (right - left), box[1] / (bottom - top));
    const size = [(right - left) * zoom, (bottom - top) * zoom];
    const origin = [corners[view][0] + (box[0] - size[0]) / 2, corners[view][1] + (box[1] - size[1]) / 2];
    const at = (row, k) => [origin[0] + (row[k] - left) * zoom, origin[1] + (row[k + 1] - top) * zoom];
    pen.save();
    pen.beginPath();
    pen.rect(...origin, ...size);
    pen.fillStyle = "#111a2a";
    pen.fill();
    if (pair.pictures) {
      pen.globalAlpha = 0.6; // The matches are to be seen.
      pen.drawImage(pair.pictures[view], ...origin, ...size);
      pen.globalAlpha = 1;
    }
    pen.strokeStyle = LINE;
    pen.stroke();
    pen.clip();
    for (const wanted of [true, false]) {
      pen.strokeStyle = pen.fillStyle = wanted ? IN : OUT;
      pair.matches.forEach((row, i) => {
        if (inliers[i] !== wanted) return;
        const [here, there] = [at(row, 2 * view), at(row, 2 - 2 * view)];
        pen.globalAlpha = wanted ? 0.45 : 0.8;
        pen.beginPath();
        pen.moveTo(...here);
        pen.lineTo(...there);
        pen.stroke();
        pen.globalAlpha = 1;
        pen.beginPath();
        pen.arc(...here, 2, 0, 7);
        pen.fill();
      });
    }
    pen.fillStyle = SOFT;
    pen.fillText(`image ${view + 1}`, origin[0] + 8, origin[1] + 18);
    pen.restore();
  });
}

/** The ends of an image: of its camera where that says it, else of its points. */
function extent(pair, view) {
  const camera = view ? pair.camera2 : pair.camera1;
  if (camera?.width) return [0, 0, camera.width, camera.height];
  const [us, vs] = [0, 1].map((k) => pair.matches.flatMap((row) => [row[k], row[k + 2]]));
  const [left, right, top, bottom] = [Math.min(...us), Math.max(...us), Math.min(...vs), Math.max(...vs)];
  const margin = 0.06 * Math.max(right - left, bottom - top, 1e-9);
  return [left - margin, top - margin, right + margin, bottom + margin];
}

/** Ellipses of 95 %, of the rotation in degrees and of the translation seen from above. */
export function ellipses(canvas, covariance) {
  const { pen, width, height } = begin(canvas);
  if (!width) return; // On a tab that is not shown.
  const degrees = 180 / Math.PI;
  ellipse(pen, [0, width / 2, height], covariance, [0, 1], degrees, "rotation about x and y", "°");
  ellipse(pen, [width / 2, width / 2, height], covariance, [3, 5], 1, "t along x and z", "");
}

function ellipse(pen, [left, width, height], covariance, [i, j], unit, name, sign) {
  const [a, b, c] = [covariance[i][i], covariance[i][j], covariance[j][j]].map((x) => x * unit * unit);
  const [mean, half] = [(a + c) / 2, Math.hypot((a - c) / 2, b)];
  // The square of a 95 % radius in two dimensions.
  const radii = [mean + half, Math.max(mean - half, 0)].map((variance) => Math.sqrt(5.991 * variance));
  const angle = 0.5 * Math.atan2(2 * b, a - c);
  const [x, y, room] = [left + width / 2, height / 2 - 16, Math.min(width / 2 - 12, height / 2 - 28)];
  pen.strokeStyle = LINE;
  pen.beginPath();
  pen.moveTo(x - room, y);
  pen.lineTo(x + room, y);
  pen.moveTo(x, y - room);
  pen.lineTo(x, y + room);
  pen.stroke();
  if (radii[0] > 0 && Number.isFinite(radii[0])) {
    const zoom = (0.9 * room) / radii[0];
    pen.beginPath();
    pen.ellipse(x, y, radii[0] * zoom, Math.max(radii[1] * zoom, 1), -angle, 0, 7);
    pen.fillStyle = "rgba(61, 219, 197, 0.25)";
    pen.strokeStyle = IN;
    pen.fill();
    pen.stroke();
  }
  pen.fillStyle = SOFT;
  pen.textAlign = "center";
  pen.fillText(name, x, height - 24);
  pen.fillText(`at most ±${radii[0].toPrecision(2)}${sign}`, x, height - 8);
  pen.textAlign = "left";
}

/** What a camera sees: rings are the goal image, dots the features now; `null` where one is not seen. */
export function view(canvas, [imageWidth, imageHeight], goal, now, colour) {
  const { pen, width, height } = begin(canvas);
  const [sx, sy] = [width / imageWidth, height / imageHeight];
  goal.forEach((ring, i) => {
    const dot = now[i];
    pen.strokeStyle = "#8fb4ff";
    pen.beginPath();
    pen.arc(ring[0] * sx, ring[1] * sy, 5, 0, 7);
    pen.stroke();
    if (!dot) return;
    pen.strokeStyle = pen.fillStyle = colour;
    pen.globalAlpha = 0.35;
    pen.beginPath();
    pen.moveTo(dot[0] * sx, dot[1] * sy);
    pen.lineTo(ring[0] * sx, ring[1] * sy);
    pen.stroke();
    pen.globalAlpha = 1;
    pen.beginPath();
    pen.arc(dot[0] * sx, dot[1] * sy, 2.6, 0, 7);
    pen.fill();
  });
}

/** Distances in metres over time, on a logarithmic scale from a millimetre to three metres. */
export function distances(canvas, curves, seconds) {
  const { pen, width, height } = begin(canvas);
  const [left, bottom] = [52, height - 24];
  const x = (time) => left + ((width - left - 8) * time) / seconds;
  const y = (metres) => 8 + ((bottom - 8) * (Math.log10(3) - Math.log10(Math.max(metres, 1e-3)))) / (Math.log10(3) + 3);
  pen.fillStyle = SOFT;
  pen.strokeStyle = LINE;
  for (const [metres, text] of [[1, "1 m"], [0.1, "10 cm"], [0.01, "1 cm"], [0.001, "1 mm"]]) {
    pen.fillText(text, 6, y(metres) + 4);
    pen.beginPath();
    pen.moveTo(left, y(metres));
    pen.lineTo(width - 8, y(metres));
    pen.stroke();
  }
  for (let time = 0; time < seconds; time += 5) pen.fillText(`${time} s`, x(time) - 8, height - 6);
  pen.lineWidth = 2;
  pen.lineJoin = "round";
  for (const { colour, points } of curves) {
    pen.strokeStyle = colour;
    pen.beginPath();
    points.forEach(([time, metres]) => pen.lineTo(x(time), y(metres)));
    pen.stroke();
  }
  pen.lineWidth = 1;
}
