// The page: the library is started, then the tabs.
import init from "quest-pose";
import wasm from "quest-pose/quest_pose_bg.wasm";
import { startDrive } from "./drive.js";
import { startPose } from "./pose.js";

const tabs = [...document.querySelectorAll("[role=tab]")];
let drive = null;

function choose(chosen) {
  for (const tab of tabs) {
    const on = tab === chosen;
    tab.setAttribute("aria-selected", String(on));
    tab.tabIndex = on ? 0 : -1;
    document.getElementById(tab.getAttribute("aria-controls")).hidden = !on;
  }
  if (chosen.id === "tab-drive") drive ??= startDrive();
  else drive?.stop();
}

tabs.forEach((tab, i) => {
  tab.addEventListener("click", () => choose(tab));
  tab.addEventListener("keydown", (event) => {
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (!step) return;
    const next = tabs[(i + step + tabs.length) % tabs.length];
    next.focus();
    choose(next);
  });
});

async function start() {
  await init({ module_or_path: wasm });
  startPose();
  if (location.hash === "#drive") choose(tabs[1]);
  document.documentElement.dataset.ready = "yes";
}

start();
