// Two controllers of the same camera: by quest-pose, and by an essential matrix whose translation has the length one.
import { estimate, Servo } from "quest-pose";
import { CAMERA } from "./room.js";
import { quaternion, THREE } from "./stage.js";

export const PERIOD = 0.05;
const LIMITS = { maxSpeed: 0.4, maxTurnRate: 0.5 };
/** How fast errors decay in 1/s, and about how far the features are in metres. */
const RATE = 0.8, UNIT = 2.9;

/** The controller of quest-pose. */
export function questLoop(goal, noise) {
  const options = { camera: CAMERA, ...LIMITS, noise: Math.max(noise, 0.2), period: PERIOD, unit: UNIT, rate: RATE, explore: 0.04 };
  const servo = new Servo(Float64Array.from(goal.flat()), options);
  return {
    step(image) {
      const { linear, angular, state, advice, arrived } = servo.step(Float64Array.from(image.flatMap((dot) => dot ?? [NaN, NaN])));
      return { v: new THREE.Vector3(...linear), w: new THREE.Vector3(...angular), state: state.replaceAll("_", " "), advice, arrived };
    },
    free: () => servo.free(),
  };
}

/** The same law with the pose of an essential matrix: it knows the translation's direction, not its length. */
export function essentialLoop(goal) {
  return {
    step(image) {
      const rows = goal.flatMap((ring, i) => (image[i] ? [[...ring, ...image[i]]] : []));
      try {
        const options = { camera1: CAMERA, threshold: 3, maxIterations: 300, maxFalseAlarms: Infinity };
        const { quaternion: q, t, parallax } = estimate(Float64Array.from(rows.flat()), options);
        const v = new THREE.Vector3(...t).multiplyScalar((RATE * UNIT) / (parallax || 1));
        return { ...limited(v, rotationVector(quaternion(q)).multiplyScalar(RATE)), state: "moving" };
      } catch {
        return { v: new THREE.Vector3(), w: new THREE.Vector3(), state: "no pose" };
      }
    },
    free() {},
  };
}

/** Both parts slowed alike, so that the path stays the same. */
function limited(v, w) {
  const factor = Math.min(1, LIMITS.maxSpeed / (v.length() || 1), LIMITS.maxTurnRate / (w.length() || 1));
  return { v: v.multiplyScalar(factor), w: w.multiplyScalar(factor) };
}

function rotationVector({ w, x, y, z }) {
  const axis = new THREE.Vector3(x, y, z);
  const sine = axis.length();
  return sine < 1e-12 ? axis.multiplyScalar(2) : axis.multiplyScalar((2 * Math.atan2(sine, w)) / sine);
}

/** The pose of a camera that moved with this velocity, in its own frame, for so long. */
export function advance({ q, t }, { v, w }, seconds) {
  const turn = rotation(w.clone().multiplyScalar(-seconds));
  return { q: turn.clone().multiply(q).normalize(), t: t.clone().addScaledVector(v, -seconds).applyQuaternion(turn) };
}

export function rotation(vector) {
  const angle = vector.length();
  return new THREE.Quaternion().setFromAxisAngle(angle ? vector.clone().divideScalar(angle) : new THREE.Vector3(1, 0, 0), angle);
}
