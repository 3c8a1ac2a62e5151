// Compiled by the tests and never run: the types say what the functions take and give.
import init, { Servo, estimate, solve, solvers, type Candidate, type Command, type Estimate } from "quest-pose";

const matches = new Float64Array(40);
await init();
const found: Estimate = estimate(matches, { camera1: { model: "PINHOLE", params: [500, 500, 320, 240] }, threshold: 1, seed: 1 });
const second: number | undefined = found.runnerUp?.quaternion[0];
const candidates: Candidate[] = solve(matches, { solver: solvers()[0].name, kinds: "exact" });
const command: Command = new Servo(matches, { maxSpeed: 1, maxTurnRate: 1, noise: 1 }).step(matches);
// @ts-expect-error There is no such loss.
estimate(matches, { loss: "square" });
export { candidates, command, second };
