// The package in Node: its poses are those of the native tool, its errors are those of the core.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { existsSync, readdirSync, readFileSync } from "node:fs";
import { test } from "node:test";
import init, { estimate, Servo, solve, solvers } from "quest-pose";

const root = new URL("../../", import.meta.url);
const examples = ["tumfr3_98072_98172.json", "hololens_00011_00015.json"].map((name) => new URL(`examples/${name}`, root));
const recorded = new URL("../shared/data/pairs/", root);
// The native tool: QUEST_CLI, or the one that cargo built.
const tool = process.env.QUEST_CLI ?? new URL("target/release/quest-cli", root).pathname;
const read = (url) => JSON.parse(readFileSync(url, "utf8"));
const rows = (pair) => Float64Array.from(pair.matches.flat());

/** The wasm estimate beside what the tool prints for the same file. */
function compare(url) {
  const { matches, camera1, camera2 } = read(url);
  const found = estimate(Float64Array.from(matches.flat()), { camera1, camera2, threshold: 1 });
  const text = execFileSync(tool, ["estimate", url.pathname, "--threshold", "1", "--format", "json", "--quiet"], { encoding: "utf8" });
  const native = JSON.parse(text);
  assert.deepEqual(found.inliers, native.inliers, `${url.pathname}: masks`);
  assert.equal(found.model, native.model);
  // 1e-9 degrees of the rotation and of the translation's direction.
  assert.ok(angle(found.R.flat(), native.R_21.flat(), 2) < 1e-9, `${url.pathname}: rotation`);
  assert.ok(angle(found.t, native.t_21, 1) < 1e-9, `${url.pathname}: translation`);
}

/** Degrees between two rotations (by the chord, which is exact for small angles) or two directions. */
function angle(a, b, factor) {
  const unit = (x) => (factor === 1 ? x.map((c) => c / Math.hypot(...x)) : x);
  const chord = Math.hypot(...unit(a).map((c, i) => c - unit(b)[i]));
  return (factor === 1 ? chord : chord / Math.SQRT2) * (180 / Math.PI);
}

test("it is ready in Node, and init may be awaited as in a browser", async () => {
  await init();
  assert.deepEqual(solvers().map(({ name }) => name).slice(0, 3), ["quest", "quest-eigen", "relinearization"]);
});

test("estimates of the examples are the native tool's", { skip: !existsSync(tool) && `${tool} is not built` }, () => {
  examples.forEach(compare);
});

const skip = (!existsSync(tool) && `${tool} is not built`) || (!existsSync(recorded) && "../shared/data/pairs is not here");
test("estimates of all recorded pairs are the native tool's", { skip }, () => {
  const names = readdirSync(recorded).filter((name) => name.endsWith(".json"));
  assert.ok(names.length >= 90);
  for (const name of names) compare(new URL(name, recorded));
});

test("what an estimate holds", () => {
  const pair = read(examples[0]);
  const found = estimate(rows(pair), { camera1: pair.camera1 });
  assert.equal(found.inlierCount, found.inliers.filter(Boolean).length);
  assert.ok(Math.abs(Math.hypot(...found.quaternion) - 1) < 1e-12 && found.quaternion[0] >= 0);
  // Two ways to round the same length.
  assert.ok(Math.abs(found.parallax - Math.hypot(...found.t)) < 1e-15);
  assert.ok(found.falseShare >= 0 && found.falseShare < 0.1 && found.unmoved === 0 && found.normal === null);
  assert.equal(found.covariance.length, 6);
  assert.ok(found.evidence.generalPx < found.evidence.rotationPx);
  assert.equal(found.runnerUp, null);
  assert.deepEqual(estimate(rows(pair), { camera1: pair.camera1, seed: 0 }), found);
});

test("a plane has a second pose", () => {
  const pair = read(examples[1]);
  const { model, runnerUp, normal } = estimate(rows(pair), { camera1: pair.camera1 });
  assert.equal(model, "planar");
  assert.equal(normal.length, 3);
  assert.equal(runnerUp === null ? 0 : runnerUp.quaternion.length, 4);
});

test("candidates hold the planted pose", () => {
  const pair = read(new URL("examples/points.json", root));
  const [best] = solve(rows(pair));
  assert.deepEqual([best.kind, best.inFront, best.feasible], ["exact", 5, true]);
  // The points are given with 16 digits; a solve keeps all but a few.
  best.t.forEach((x, i) => assert.ok(Math.abs(x - [0.3, -0.1, 0.2][i]) < 1e-12));
  best.quaternion.forEach((x, i) => assert.ok(Math.abs(x - pair.q_21[i]) < 1e-12));
  assert.equal(best.depths.length, 5);
});

test("errors say what was found and what was expected", () => {
  const four = new Float64Array(16);
  const refused = (call, text) => assert.throws(call, (error) => error instanceof Error && text.test(error.message));
  refused(() => solve(four), /found 4 matches, expected at least 5|point/);
  refused(() => solve(new Float64Array(7)), /matches holds 7 numbers, expected a multiple of 4/);
  refused(() => estimate(new Float64Array(40)), /neither cameras nor a threshold are given/);
  refused(() => estimate(new Float64Array(40).fill(NaN), { threshold: 1e-3 }), /match 0: a coordinate in view 1 is NaN/);
  refused(() => estimate(four, { treshold: 1 }), /there is no option "treshold"/);
  refused(() => estimate(four, { threshold: -1 }), /threshold is -1/);
  refused(() => estimate(four, { threshold: 1, solver: "best" }), /best/);
  refused(() => estimate(four, { camera1: { model: "PINHOLE", params: [1, 2] } }), /param/);
});

test("the servo brings a camera home, and holds where features are lost", () => {
  const points = [[-0.5, 0.3, 2], [0.4, 0.5, 2.5], [0.6, -0.4, 3], [-0.7, -0.5, 3.2], [0.1, 0.1, 2.2], [0.3, -0.6, 2.8], [-0.2, 0.6, 2.4], [-0.4, -0.1, 3.1]];
  const seen = ([x, y, z]) => points.flatMap(([a, b, c]) => [(a + x) / (c + z), (b + y) / (c + z)]);
  const period = 0.1;
  const servo = new Servo(Float64Array.from(seen([0, 0, 0])), { maxSpeed: 0.3, maxTurnRate: 0.3, noise: 1e-4, period, unit: 2.5 });
  const t = [0.4, -0.2, 0.5];
  let tracked = 0;
  for (let i = 0; i < 300; i++) {
    const { linear, state } = servo.step(Float64Array.from(seen(t)));
    tracked += state === "tracking" ? 1 : 0;
    linear.forEach((v, k) => (t[k] -= v * period)); // The turn is zero: R stays the identity.
  }
  assert.ok(tracked > 200, `${tracked} images of 300 with a pose`);
  assert.ok(Math.hypot(...t) < 0.01, `${Math.hypot(...t)} m from the goal`);
  const there = servo.step(Float64Array.from(seen(t)));
  assert.ok(there.arrived && there.seen === 8 && /\w+/.test(there.advice));
  const lost = servo.step(new Float64Array(16).fill(NaN));
  assert.equal(lost.pose, null);
  assert.equal(lost.seen, 0);
  assert.throws(() => servo.step(new Float64Array(4)), /points has 2 rows, expected 8/);
  const goal = Float64Array.from(seen([0, 0, 0]));
  goal[7] = NaN;
  const options = { maxSpeed: 0.3, maxTurnRate: 0.3, noise: 1e-4 };
  assert.throws(() => new Servo(goal, options), /row 3 of goal is \(.*NaN\)/);
});
