// Times the page with a floor of many rooms in headless Chromium against a running server, one table in Markdown:
//
//   PAGE_URL=http://127.0.0.1:7171 TOKEN=... [ROOMS=1250,5000,20000] [SHOTS=folder] node e2e/vast.mjs
//
// TOKEN is an administrator's. For each number of walls a site "vast-N" is made: rooms of 4 m, two walls and a doorway each, published.
// *plan*: from opening the page until its plan is painted. *drag*, *wheel*: time between frames while the whole plan is
// dragged, and zoomed into from far to near, median and 95 %. *edit*: from pressing Edit until all objects are there to be edited.

import { gzipSync } from "node:zlib";
import { launchBrowser } from "./browser.mjs";

const PATIENCE_MS = 120_000;
const ROOM_M = 4;
const FRAMES = 60;

const url = (process.env["PAGE_URL"] ?? "http://127.0.0.1:7171").replace(/\/$/, "");
const token = process.env["TOKEN"] ?? "";
const sizes = (process.env["ROOMS"] ?? "1250,5000,20000").split(",").map(Number);
const shots = process.env["SHOTS"] ?? "";

/** @param {string} method @param {string} path @param {object | null} body @param {Record<string, string>} [headers] */
async function ask(method, path, body, headers = {}) {
  const all = { "content-type": "application/json", "content-encoding": "gzip", authorization: `Bearer ${token}`, ...headers };
  const answer = await fetch(`${url}/api/v1${path}`, { method, headers: all, ...(body === null ? {} : { body: gzipSync(JSON.stringify(body)) }) });
  if (!answer.ok) throw new Error(`${method} ${path}: ${answer.status} ${(await answer.text()).slice(0, 300)}`);
}

/** A floor of so many walls, two to a room. @param {number} walls */
function floor(walls) {
  const rooms = Math.ceil(walls / 2);
  const columns = Math.ceil(Math.sqrt(rooms));
  const features = /** @type {object[]} */ ([]);
  /** @param {string} kind @param {number[]} from @param {number[]} to @param {number} upper */
  const box = (kind, [x0 = 0, y0 = 0], [x1 = 0, y1 = 0], upper) => {
    const id = `01900000-0000-7000-8000-${features.length.toString(16).padStart(12, "0")}`;
    const at = /** @param {number[]} p */ (p) => p.map((metres) => Number(metres.toFixed(3)));
    const solid = { box: { from_m: at([x0, y0, 0]), to_m: at([x1, y1, upper]) } };
    features.push({ type: "Feature", id, geometry: null, properties: { kind, solids: [solid] } });
  };
  for (let room = 0; room < rooms; room += 1) {
    const [x, y] = [(room % columns) * ROOM_M, Math.floor(room / columns) * ROOM_M];
    box("wall", [x, y], [x + ROOM_M, y + 0.1], 2.5);
    box("wall", [x, y + 0.1], [x + 0.1, y + ROOM_M], 2.5);
    box("doorway", [x + 1.5, y - 0.1], [x + 2.4, y + 0.2], 2);
  }
  return { type: "FeatureCollection", features };
}

/** @param {number[]} times @param {number} share */
function quantile(times, share) {
  const sorted = [...times].sort((a, b) => a - b);
  return sorted[Math.min(sorted.length - 1, Math.floor(share * sorted.length))] ?? NaN;
}

const browser = await launchBrowser();
try {
  console.log("| walls | plan s | drag ms | p95 | wheel ms | p95 | edit s |");
  console.log("| --- | --- | --- | --- | --- | --- | --- |");
  for (const walls of sizes) {
    const site = `vast-${walls}`;
    await ask("POST", "/sites", { site });
    await ask("POST", `/sites/${site}/levels`, { level: "floor" });
    await ask("PUT", `/sites/${site}/levels/floor/gdb`, floor(walls), { "if-match": "*" });
    await ask("POST", `/sites/${site}/levels/floor/gdb/publications`, null, { "if-match": "*" });
    const page = await (await browser.newContext({ viewport: { width: 1440, height: 900 } })).newPage();
    page.setDefaultTimeout(PATIENCE_MS);
    page.on("pageerror", (error) => {
      throw error;
    });
    const opened = performance.now();
    await page.goto(`${url}/#token=${encodeURIComponent(token)}&site=${site}&level=floor`);
    await page.waitForFunction(() => (document.documentElement.dataset["model"] ?? "") !== "");
    await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(() => requestAnimationFrame(resolve))));
    const planS = (performance.now() - opened) / 1000;
    if (shots !== "") await page.screenshot({ path: `${shots}/${site}.png` });
    /** Times between frames while something is done. @param {(step: number) => Promise<void>} act */
    const framesWhile = async (act) => {
      await page.evaluate(() => {
        const times = /** @type {number[]} */ ([]);
        Object.assign(window, { frameTimes: times, framesGoOn: true });
        let last = performance.now();
        const frame = () => {
          const now = performance.now();
          times.push(now - last);
          last = now;
          if (Reflect.get(window, "framesGoOn") === true) requestAnimationFrame(frame);
        };
        requestAnimationFrame(frame);
      });
      for (let step = 0; step < FRAMES; step += 1) {
        await act(step);
        await page.evaluate(() => new Promise((resolve) => requestAnimationFrame(resolve)));
      }
      const times = await page.evaluate(() => {
        Object.assign(window, { framesGoOn: false });
        const times = /** @type {unknown} */ (Reflect.get(window, "frameTimes"));
        return /** @type {number[]} */ (times);
      });
      return [quantile(times, 0.5), quantile(times, 0.95)].map((ms) => ms.toFixed(1));
    };
    await page.mouse.move(500, 450);
    await page.mouse.down();
    const drag = await framesWhile((step) => page.mouse.move(500 + 4 * (step % 30), 450 + 3 * (step % 20)));
    await page.mouse.up();
    const wheel = await framesWhile(() => page.mouse.wheel(0, -60));
    const pressed = performance.now();
    await page.keyboard.press("f");
    await page.click("#edit-model");
    await page.waitForFunction((least) => Number(document.documentElement.dataset["objects"]) >= least, walls);
    const editS = (performance.now() - pressed) / 1000;
    console.log(`| ${walls} | ${planS.toFixed(2)} | ${drag.join(" | ")} | ${wheel.join(" | ")} | ${editS.toFixed(2)} |`);
    await page.context().close();
  }
} finally {
  await browser.close();
}
