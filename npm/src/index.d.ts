export * from "./quest_pose.js";
export { default } from "./quest_pose.js";
