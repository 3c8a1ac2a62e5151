// The built page in Chromium, from the disc, at the width of a telephone and of a desk. A message on the console fails.
import assert from "node:assert/strict";
import { existsSync, mkdirSync, readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { after, before, test } from "node:test";
import { chromium } from "playwright-core";
import { estimate } from "quest-pose";

const page = new URL("../dist/index.html", import.meta.url).href;
const shots = new URL("../shots/", import.meta.url).pathname;
const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");
const executablePath = [process.env.CHROMIUM, "/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome"].find((path) => path && existsSync(path));
const SIZES = [[1440, 900], [390, 844]];
const example = JSON.parse(readFileSync(new URL("../../examples/tumfr3_98072_98172.json", import.meta.url), "utf8"));
let browser;

before(async () => {
  mkdirSync(shots, { recursive: true });
  browser = await chromium.launch({ executablePath, args: ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--ignore-gpu-blocklist"] });
});
after(() => browser?.close());

/** Opens the page, runs the steps, and fails on anything that the console says. */
async function visit([width, height], hash, steps) {
  const tab = await browser.newPage({ viewport: { width, height } });
  tab.setDefaultTimeout(90_000);
  const said = [];
  // What the driver of a simulated screen says of its own speed is no fault of the page.
  tab.on("console", (message) => ["error", "warning"].includes(message.type()) && !message.text().includes("GL Driver Message") && said.push(message.text()));
  tab.on("pageerror", (error) => said.push(String(error)));
  await tab.goto(page + hash);
  await tab.waitForSelector("html[data-ready=yes]", { state: "attached" });
  await steps(tab);
  await tab.close();
  assert.deepEqual(said, []);
}

async function accessible(tab) {
  await tab.evaluate(axe);
  // Style sheets are not fetched again: from a disc a page may not.
  const { violations } = await tab.evaluate(() => window.axe.run({ preload: false }));
  assert.deepEqual(violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html).join(" ")}`), []);
}

async function fits(tab) {
  const [content, width] = await tab.evaluate(() => [document.documentElement.scrollWidth, innerWidth]);
  assert.ok(content <= width, `the page is ${content} wide in a window of ${width}`);
}

/** Two photographs as PNG: patches at several depths, seen by a camera that moved to the right. Painted in the tab. */
async function photographs(tab) {
  const urls = await tab.evaluate(() => {
    let state = 7;
    const uniform = () => (state = (Math.imul(state, 1103515245) + 12345) & 0x7fffffff) / 0x80000000;
    const patches = Array.from({ length: 260 }, () => ({
      x: 5 * uniform() - 2.5, y: 4 * uniform() - 2, z: 2 + 2.5 * uniform(), size: 0.1 + 0.25 * uniform(),
      tones: Array.from({ length: 9 }, () => Math.round(255 * uniform())),
    })).sort((a, b) => b.z - a.z);
    return [0, 0.35].map((moved) => {
      const canvas = Object.assign(document.createElement("canvas"), { width: 640, height: 480 });
      const pen = canvas.getContext("2d");
      pen.fillStyle = "#777";
      pen.fillRect(0, 0, 640, 480);
      for (const { x, y, z, size, tones } of patches) {
        tones.forEach((tone, i) => {
          const [left, top, side] = [x - moved + ((i % 3) * size) / 3, y + (Math.floor(i / 3) * size) / 3, size / 3].map((m) => (512 * m) / z);
          pen.fillStyle = `rgb(${tone}, ${tone}, ${tone})`;
          pen.fillRect(319.5 + left, 239.5 + top, side, side);
        });
      }
      return canvas.toDataURL("image/png");
    });
  });
  return urls.map((url, i) => ({ name: `view${i + 1}.png`, mimeType: "image/png", buffer: Buffer.from(url.split(",")[1], "base64") }));
}

test("two photographs become a pose, without a server", async () => {
  await visit(SIZES[0], "", async (tab) => {
    await tab.waitForFunction(() => document.getElementById("verdict").textContent === "Points in space");
    const files = await photographs(tab);
    await tab.setInputFiles("#file", files.slice(0, 1));
    await tab.waitForFunction(() => /1 photograph was given, expected two/.test(document.getElementById("explain").textContent));
    await tab.setInputFiles("#file", files);
    await tab.waitForFunction(() => document.getElementById("verdict").textContent === "Points in space");
    const numbers = await tab.textContent("#numbers");
    // The camera moved along x, and kept its direction: X2 = R X1 + t has t along -x.
    const t = numbers.match(/t(-?[0-9.]+)  (-?[0-9.]+)  (-?[0-9.]+)/).slice(1).map(Number);
    assert.ok(t[0] < 0 && Math.hypot(t[1], t[2]) < 0.1 * -t[0], `t is ${t}`);
    assert.ok(await tab.isVisible("#camera"), "photographs get a guess of a camera");
    await accessible(tab);
    await tab.screenshot({ path: `${shots}photographs.png`, fullPage: true });
    await tab.setInputFiles("#file", { name: "no.png", mimeType: "image/png", buffer: Buffer.from("no") });
    await tab.waitForFunction(() => /expected two/.test(document.getElementById("explain").textContent));
  });
});

for (const size of SIZES) {
  test(`the pose of examples and files at ${size[0]} pixels`, async () => {
    await visit(size, "", async (tab) => {
      await tab.waitForFunction(() => document.getElementById("verdict").textContent === "Points in space");
      await tab.waitForFunction(() => performance.getEntriesByName("first-contentful-paint").length > 0);
      const paint = await tab.evaluate(() => performance.getEntriesByName("first-contentful-paint")[0].startTime);
      console.log(`first picture after ${paint?.toFixed(0)} ms at ${size[0]} pixels`);
      const { camera1, matches } = example;
      const { inlierCount } = estimate(Float64Array.from(matches.flat()), { camera1 });
      assert.match(await tab.textContent("#numbers"), new RegExp(`${inlierCount} of ${matches.length}`));
      await fits(tab);
      await accessible(tab);
      await tab.screenshot({ path: `${shots}pose-${size[0]}.png`, fullPage: true });

      await tab.selectOption("#example", "1");
      await tab.waitForFunction(() => document.getElementById("verdict").textContent === "A plane");
      await tab.check("#other");
      await accessible(tab);
      await tab.screenshot({ path: `${shots}plane-${size[0]}.png`, fullPage: true });

      const csv = ["u1,v1,u2,v2", ...example.matches.map((row) => row.join(","))].join("\n");
      await tab.setInputFiles("#file", { name: "mine.csv", mimeType: "text/csv", buffer: Buffer.from(csv) });
      await tab.waitForFunction(() => document.getElementById("verdict").textContent === "Points in space");
      assert.ok(await tab.isVisible("#camera"), "pixels without a camera ask for one");
      await tab.screenshot({ path: `${shots}csv-${size[0]}.png`, fullPage: true });

      await tab.setInputFiles("#file", { name: "bad.csv", mimeType: "text/csv", buffer: Buffer.from("1,2,3\n") });
      await tab.waitForFunction(() => /row 1/.test(document.getElementById("explain").textContent));
      await accessible(tab);
    });
  });

  test(`a drive to the goal at ${size[0]} pixels, by keyboard`, async () => {
    await visit(size, "", async (tab) => {
      await tab.focus("#tab-pose");
      await tab.keyboard.press("ArrowRight");
      await tab.waitForSelector("#drive:not([hidden])");
      await fits(tab);
      await accessible(tab);
      await tab.screenshot({ path: `${shots}start-${size[0]}.png`, fullPage: true });
      await tab.focus("#servo");
      await tab.keyboard.press("Enter");
      await tab.waitForFunction(() => /is at the goal/.test(document.getElementById("drive-news").textContent));
      assert.match(await tab.textContent("#essential-state"), / 0\.[1-9]\d m\/s/);
      await tab.keyboard.press("Enter");
      await tab.screenshot({ path: `${shots}home-${size[0]}.png`, fullPage: true });
      await accessible(tab);
      await tab.focus("[data-move='1,0,0']");
      await tab.keyboard.press("Enter");
      assert.match(await tab.textContent("#quest-state"), /0\.1\d m away|1\d\d\.\d mm/);
    });
  });
}
