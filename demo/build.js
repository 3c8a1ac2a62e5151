// Bundles the page into dist/: one HTML file, one style sheet, one script that holds the WebAssembly. It works from a disc.
import { build } from "esbuild";
import { copyFile, mkdir, readdir, stat } from "node:fs/promises";

await mkdir("dist", { recursive: true });
await build({
  entryPoints: { demo: "src/main.js" },
  bundle: true,
  minify: true,
  format: "iife",
  target: "es2022",
  // The page hands the WebAssembly over itself.
  define: { "import.meta.url": "document.baseURI" },
  loader: { ".wasm": "binary" },
  outdir: "dist",
  legalComments: "eof",
  logLevel: "warning",
});
// OpenCV holds its WebAssembly too. It is loaded for photographs alone, and does not count in the page's size.
await build({
  entryPoints: { opencv: "src/opencv.js" },
  bundle: true,
  minify: true,
  format: "iife",
  globalName: "questOpenCv",
  target: "es2022",
  define: { "import.meta.url": "document.baseURI" },
  external: ["module", "fs", "path", "crypto", "node:*"],
  outdir: "dist",
  legalComments: "none",
  logLevel: "warning",
});
await build({ entryPoints: ["src/demo.css"], minify: true, outdir: "dist", logLevel: "warning" });
await copyFile("index.html", "dist/index.html");
let total = 0;
const page = (await readdir("dist")).filter((name) => name !== "opencv.js");
for (const name of page) total += (await stat(`dist/${name}`)).size;
const opencv = (await stat("dist/opencv.js")).size;
console.log(`the page: ${(total / 1e6).toFixed(2)} MB, and ${(opencv / 1e6).toFixed(1)} MB for photographs`);
if (total > 3e6) throw new Error(`the page has ${total} bytes, expected at most 3,000,000`);
