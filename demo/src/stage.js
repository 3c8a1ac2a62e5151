// A picture in three dimensions: a renderer, an orbiting eye, and the shapes that both pages draw.
import * as THREE from "three";
import { OrbitControls } from "three/examples/jsm/controls/OrbitControls.js";

export const COLOURS = { one: 0x8fb4ff, two: 0x3ddbc5, other: 0xffa766, bad: 0xff7b7b, line: 0x34435f };

/** A stage. Its `world` has the axes of a camera: x to the right, y down, z forward. It draws when something changed. */
export class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true, alpha: true });
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.scene = new THREE.Scene();
    this.world = new THREE.Group();
    this.world.rotation.x = Math.PI; // three.js has y up and looks along -z.
    this.scene.add(this.world, new THREE.HemisphereLight(0xdfe9ff, 0x303848, 2.2));
    const sun = new THREE.DirectionalLight(0xffffff, 1.6);
    sun.position.set(2, 4, 3);
    this.scene.add(sun);
    this.eye = new THREE.PerspectiveCamera(45, 1, 0.01, 200);
    this.orbit = new OrbitControls(this.eye, canvas);
    this.orbit.addEventListener("change", () => this.draw());
    canvas.addEventListener("keydown", (event) => this.#turn(event));
    new ResizeObserver(() => this.draw()).observe(canvas);
  }

  /** Looks at `target` from `eye`, both in the world's axes. */
  look(eye, target) {
    const flip = ([x, y, z]) => new THREE.Vector3(x, -y, -z);
    this.eye.position.copy(flip(eye));
    this.orbit.target.copy(flip(target));
    this.orbit.update();
    this.draw();
  }

  draw() {
    if (this.waiting) return;
    this.waiting = true;
    requestAnimationFrame(() => {
      this.waiting = false;
      const { clientWidth: width, clientHeight: height } = this.canvas;
      if (!width || !height) return;
      this.renderer.setSize(width, height, false);
      this.eye.aspect = width / height;
      this.eye.updateProjectionMatrix();
      this.renderer.render(this.scene, this.eye);
    });
  }

  #turn(event) {
    const [around, up] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key] ?? [0, 0];
    if (!around && !up) return;
    event.preventDefault();
    const offset = new THREE.Spherical().setFromVector3(this.eye.position.clone().sub(this.orbit.target));
    offset.theta += 0.1 * around;
    offset.phi = Math.min(Math.max(offset.phi + 0.1 * up, 0.1), 3);
    this.eye.position.setFromSpherical(offset).add(this.orbit.target);
    this.orbit.update();
  }
}

/** A camera as a pyramid of this length, its apex at the origin. */
export function frustum(colour, length) {
  const [x, y, z] = [0.6 * length, 0.45 * length, length];
  const corners = [[-x, -y, z], [x, -y, z], [x, y, z], [-x, y, z]].map((corner) => new THREE.Vector3(...corner));
  const apex = new THREE.Vector3();
  const edges = corners.flatMap((corner, i) => [apex, corner, corner, corners[(i + 1) % 4]]);
  const group = new THREE.Group();
  group.add(new THREE.LineSegments(new THREE.BufferGeometry().setFromPoints(edges), new THREE.LineBasicMaterial({ color: colour })));
  const sides = corners.flatMap((corner, i) => [apex, corner, corners[(i + 1) % 4]]);
  const glass = new THREE.MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.22, side: THREE.DoubleSide, depthWrite: false });
  group.add(new THREE.Mesh(new THREE.BufferGeometry().setFromPoints(sides), glass));
  return group;
}

/** Puts an object where a camera of the pose X2 = R X1 + t is, in frame 1. */
export function place(object, q21, t21) {
  const inverse = q21.clone().conjugate();
  object.quaternion.copy(inverse);
  object.position.copy(t21).applyQuaternion(inverse).negate();
}

/** The quaternion w, x, y, z in the form of three.js. */
export const quaternion = ([w, x, y, z]) => new THREE.Quaternion(x, y, z, w);
export { THREE };
