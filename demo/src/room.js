// A small room: what stands in it, and what a camera sees of its features.
import { THREE } from "./stage.js";

export const CAMERA = { model: "PINHOLE", params: [520, 520, 320, 240], width: 640, height: 480 };
/** Centre, size and colour of what stands in the room; the goal's camera is at the origin and looks along z. */
const BOXES = [
  [[-0.75, 0.55, 2.6], [0.5, 0.5, 0.5], 0x6a7fb0], [[0.1, 0.45, 3.1], [0.6, 0.7, 0.4], 0x8a6fae],
  [[0.85, 0.5, 2.3], [0.4, 0.6, 0.4], 0x4f8f9d], [[-0.2, -0.45, 3.4], [1.3, 0.08, 0.35], 0x9a7a58],
  [[0.55, -0.7, 3.4], [0.25, 0.42, 0.25], 0xb0606e], [[-0.85, -0.7, 3.3], [0.35, 0.35, 0.2], 0x64a06c],
];
const FLOOR = 0.8, WALL = 3.7;

/** The same numbers for the same seed. */
export function random(seed) {
  let state = seed >>> 0;
  const uniform = () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let x = Math.imul(state ^ (state >>> 15), state | 1);
    x ^= x + Math.imul(x ^ (x >>> 7), x | 61);
    return ((x ^ (x >>> 14)) >>> 0) / 2 ** 32;
  };
  const normal = () => Math.sqrt(-2 * Math.log(1 - uniform())) * Math.cos(2 * Math.PI * uniform());
  return { uniform, normal };
}

/** Features: corners of the boxes that the goal's camera sees, and points on the wall. */
export function features() {
  const { uniform } = random(7);
  const points = BOXES.flatMap(([[x, y, z], [a, b, c]]) =>
    [[-1, -1], [1, -1], [1, 1], [-1, 1]].map(([i, j]) => new THREE.Vector3(x + (i * a) / 2, y + (j * b) / 2, z - c / 2)));
  for (let i = 0; i < 12; i++) points.push(new THREE.Vector3(3 * uniform() - 1.5, 1.5 * uniform() - 1.2, WALL));
  return points.filter((point) => pixel(point));
}

/** The room as shapes. */
export function furniture(points) {
  const group = new THREE.Group();
  for (const [centre, size, color] of BOXES) {
    const box = new THREE.Mesh(new THREE.BoxGeometry(...size), new THREE.MeshLambertMaterial({ color }));
    box.position.set(...centre);
    group.add(box);
  }
  const floor = new THREE.GridHelper(6, 24, 0x3f5178, 0x26334d);
  floor.position.set(0, FLOOR, 1.6);
  const wall = new THREE.Mesh(new THREE.PlaneGeometry(5, 2.4), new THREE.MeshLambertMaterial({ color: 0x2a3650, side: THREE.DoubleSide }));
  wall.position.set(0, FLOOR - 1.2, WALL + 0.01);
  const dots = new THREE.Points(new THREE.BufferGeometry().setFromPoints(points), new THREE.PointsMaterial({ color: 0xfff2b0, size: 0.05 }));
  group.add(floor, wall, dots);
  return group;
}

/** The pixel of a point in a camera's frame; `null` outside of the image. */
export function pixel({ x, y, z }) {
  const [fx, fy, cx, cy] = CAMERA.params;
  if (z < 0.05) return null;
  const [u, v] = [(fx * x) / z + cx, (fy * y) / z + cy];
  return u >= 0 && v >= 0 && u < CAMERA.width && v < CAMERA.height ? [u, v] : null;
}

/** The image from a pose with its disturbances: a pixel or `null` for each feature. */
export function image(points, { q, t }, { noise, outliers, lost }, { uniform, normal }) {
  return points.map((point) => {
    const seen = pixel(point.clone().applyQuaternion(q).add(t));
    // The same random numbers are drawn whatever the sliders say, and both loops get the same.
    const [chance, wrong, u, v] = [uniform(), uniform(), uniform() * CAMERA.width, uniform() * CAMERA.height];
    const [du, dv] = [normal(), normal()];
    if (!seen || chance < lost) return null;
    return wrong < outliers ? [u, v] : [seen[0] + noise * du, seen[1] + noise * dv];
  });
}
