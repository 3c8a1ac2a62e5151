// Two photographs: OpenCV finds corners in both (ORB) and matches them.

/** Larger photographs are shrunk to so many pixels. */
const LONGEST = 1280;
const FEATURES = 3000;
/** A match has to be closer than this times the next best one. */
const RATIO = 0.8;

let loading = null;

/** OpenCV, from the file beside the page. */
function opencv() {
  loading ??= new Promise((resolve, reject) => {
    const script = document.createElement("script");
    script.src = "opencv.js";
    script.onload = () => resolve(window.questOpenCv.loadOpenCV());
    script.onerror = () => {
      loading = null;
      reject(new Error("opencv.js is not beside this page, expected it there to find matches in photographs"));
    };
    document.head.append(script);
  });
  return loading;
}

export const isPhotograph = (file) => file.type.startsWith("image/");

/** The matches of two photographs, their pictures as canvases, and a guess of their cameras. */
export async function readPhotographs(files) {
  if (files.length !== 2) throw new Error(`${files.length} photograph${files.length === 1 ? " was" : "s were"} given, expected two of the same scene: choose or drop both at once`);
  const pictures = await Promise.all(files.map(picture));
  const matches = match(await opencv(), pictures);
  if (matches.length < 5) throw new Error(`${matches.length} corners look alike in both photographs, expected at least 5: they have to show the same scene`);
  return { name: files.map(({ name }) => name).join(" and "), matches, pictures };
}

/** A photograph, turned as its file says and shrunk. */
async function picture(file) {
  let bitmap;
  try {
    bitmap = await createImageBitmap(file);
  } catch {
    throw new Error(`${file.name} cannot be read as an image`);
  }
  const zoom = Math.min(1, LONGEST / Math.max(bitmap.width, bitmap.height));
  const canvas = document.createElement("canvas");
  canvas.width = Math.round(bitmap.width * zoom);
  canvas.height = Math.round(bitmap.height * zoom);
  const pen = canvas.getContext("2d", { willReadFrequently: true });
  pen.imageSmoothingQuality = "high";
  pen.drawImage(bitmap, 0, 0, canvas.width, canvas.height);
  bitmap.close();
  return canvas;
}

function match(cv, pictures) {
  // What OpenCV makes lives outside of JavaScript's memory.
  const made = [];
  const keep = (thing) => (made.push(thing), thing);
  try {
    const orb = keep(new cv.ORB(FEATURES));
    const views = pictures.map((canvas) => {
      const { width, height } = canvas;
      const colour = keep(cv.matFromImageData(canvas.getContext("2d").getImageData(0, 0, width, height)));
      const grey = keep(new cv.Mat());
      cv.cvtColor(colour, grey, cv.COLOR_RGBA2GRAY);
      const [points, words] = [keep(new cv.KeyPointVector()), keep(new cv.Mat())];
      orb.detectAndCompute(grey, keep(new cv.Mat()), points, words);
      return { points, words };
    });
    if (views.some(({ words }) => words.rows < 2)) return [];
    const matcher = keep(new cv.BFMatcher(cv.NORM_HAMMING, false));
    const [there, back] = [views, [...views].reverse()].map(([from, to]) => nearest(cv, matcher, from.words, to.words, keep));
    const at = (view, i) => {
      const { x, y } = views[view].points.get(i).pt;
      return [x, y];
    };
    return [...there].filter(([i, j]) => back.get(j) === i).map(([i, j]) => [...at(0, i), ...at(1, j)]);
  } finally {
    made.reverse().forEach((thing) => thing.delete());
  }
}

/** For each descriptor the one that is alike, where it is clearly more alike than the next. */
function nearest(cv, matcher, from, to, keep) {
  const pairs = keep(new cv.DMatchVectorVector());
  matcher.knnMatch(from, to, pairs, 2);
  const found = new Map();
  for (let i = 0; i < pairs.size(); i++) {
    const pair = pairs.get(i);
    const [best, next] = [pair.get(0), pair.get(1)];
    if (best.distance < RATIO * next.distance) found.set(best.queryIdx, best.trainIdx);
    pair.delete();
  }
  return found;
}
