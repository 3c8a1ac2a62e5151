// The WebAssembly beside the native library on the recorded pairs: the same poses, and how many times as long.
// node bench/bench.js [ROUNDS] [FOLDER OF PAIRS]
import { execFileSync } from "node:child_process";
import { readdirSync, readFileSync } from "node:fs";
import { estimate } from "quest-pose";

const rounds = Number(process.argv[2] ?? 5);
const folder = process.argv[3] ?? new URL("../../../shared/data/pairs", import.meta.url).pathname;
const native = new URL("../target/release/bench", import.meta.url).pathname;
const ratios = [];
let times = [0, 0], masks = 0, largest = 0;

const names = readdirSync(folder).filter((name) => name.endsWith(".json"));

// An engine compiles in haste first, and well while the code runs.
for (const name of names) {
  const { matches, camera1, camera2 } = JSON.parse(readFileSync(`${folder}/${name}`, "utf8"));
  for (let round = 0; round < 2; round++) estimate(Float64Array.from(matches.flat()), camera2 ? { camera1, camera2 } : { camera1 });
}

for (const name of names) {
  const path = `${folder}/${name}`;
  const { matches, camera1, camera2 } = JSON.parse(readFileSync(path, "utf8"));
  const rows = Float64Array.from(matches.flat());
  let shortest = Infinity, found;
  // Both sides of a comparison are measured one after the other, three times.
  let other = { milliseconds: Infinity };
  for (let turn = 0; turn < 3; turn++) {
    for (let round = 0; round < rounds; round++) {
      const start = performance.now();
      found = estimate(rows, camera2 ? { camera1, camera2 } : { camera1 });
      shortest = Math.min(shortest, performance.now() - start);
    }
    const now = JSON.parse(execFileSync(native, [rounds, path], { encoding: "utf8" }));
    if (now.milliseconds < other.milliseconds) other = now;
  }
  ratios.push(shortest / other.milliseconds);
  times = [times[0] + shortest, times[1] + other.milliseconds];
  masks += Number(found.inliers.some((inlier, i) => inlier !== other.inliers[i]));
  largest = Math.max(largest, ...found.quaternion.map((x, i) => Math.abs(x - other.quaternion[i])), ...found.t.map((x, i) => Math.abs(x - other.t[i])));
}
ratios.sort((a, b) => a - b);
const at = (share) => ratios[Math.min(ratios.length - 1, Math.floor(share * ratios.length))].toFixed(2);
console.log(`${ratios.length} pairs, shortest of ${3 * rounds} rounds: WebAssembly ${times[0].toFixed(1)} ms, native ${times[1].toFixed(1)} ms in all`);
console.log(`WebAssembly / native: median ${at(0.5)}, 90 % ${at(0.9)}, most ${at(1)}`);
console.log(`other masks: ${masks}; largest difference of q or t: ${largest.toExponential(1)}`);
