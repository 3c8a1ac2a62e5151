// Node reads the WebAssembly from the file beside this one: there is nothing to wait for.
import { readFileSync } from "node:fs";
import { initSync } from "./quest_pose.js";

const wasm = initSync({ module: readFileSync(new URL("./quest_pose_bg.wasm", import.meta.url)) });

/** What a browser has to wait for is done: the same program runs in both. */
export default async function init() {
  return wasm;
}
export { estimate, solve, solvers, Servo } from "./quest_pose.js";
