// Files of matches: JSON and JSON Lines of quest-pose, CSV with or without a header.

/** The pair in a file: `{name, matches: rows of four numbers, camera1, camera2}`; cameras may be missing. */
export function readPair(name, text) {
  const trimmed = text.trim();
  return trimmed.startsWith("{") ? readJson(name, trimmed) : { name, matches: readCsv(trimmed) };
}

function readJson(name, text) {
  let pair;
  try {
    pair = JSON.parse(text);
  } catch {
    try {
      pair = JSON.parse(text.split("\n", 1)[0]); // JSON Lines: the first pair.
    } catch (error) {
      throw new Error(`${name} is no JSON: ${error.message}`);
    }
  }
  if (!Array.isArray(pair.matches)) {
    throw new Error(`${name} has no list "matches", expected rows u1, v1, u2, v2`);
  }
  pair.matches.forEach((row, i) => check(row, `matches[${i}]`));
  return { name: pair.name ?? name, matches: pair.matches, camera1: pair.camera1, camera2: pair.camera2 ?? pair.camera1 };
}

function readCsv(text) {
  const lines = text.split(/\r?\n/).filter((line) => line.trim() && !line.startsWith("#"));
  const cells = lines.map((line) => line.trim().split(/[,;\t ]+/));
  let columns = [0, 1, 2, 3];
  if (cells.length && cells[0].some((cell) => !Number.isFinite(Number(cell)))) {
    const header = cells.shift().map((cell) => cell.toLowerCase());
    columns = ["u1", "v1", "u2", "v2"].map((column) => header.indexOf(column));
    if (columns.includes(-1)) {
      throw new Error(`the first row is ${header.join(", ")}, expected the columns u1, v1, u2, v2`);
    }
  }
  return cells.map((row, i) => check(columns.map((c) => Number(row[c])), `row ${i + 1}`));
}

function check(row, where) {
  if (!Array.isArray(row) || row.length !== 4 || !row.every(Number.isFinite)) {
    throw new Error(`${where} is ${JSON.stringify(row)}, expected four numbers u1, v1, u2, v2`);
  }
  return row;
}

/** A guess of a camera where pixels come without one: `null` for points on the plane z = 1. */
export function guessCamera({ matches, pictures }) {
  if (pictures) {
    const [{ width, height }] = pictures;
    // Telephones and kit lenses: about 65 degrees across the longer side. Pixels are counted from their middles.
    return { model: "PINHOLE", params: [Math.round(0.8 * Math.max(width, height)), 0, (width - 1) / 2, (height - 1) / 2] };
  }
  const largest = [0, 1].map((k) => Math.max(...matches.map((row) => Math.max(row[k], row[k + 2]))));
  if (!(Math.max(...largest) > 20)) return null;
  const [width, height] = largest;
  return { model: "PINHOLE", params: [1.2 * width, 1.2 * width, width / 2, height / 2].map(Math.round) };
}
