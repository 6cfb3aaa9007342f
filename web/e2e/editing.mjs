// Edits the model of a level of a running server in Chromium, as two operators, and says what the page showed, one JSON
// object a line:
//
//   PAGE_URL=http://127.0.0.1:7171 TOKEN=... SECOND=... READER=... SITE=... LEVEL=... [SHOTS=folder] node e2e/editing.mjs
//
// The level has no model yet, and the site a prototype; SECOND is a token of another operator, READER one that may not edit.
//
//   {"event": "reader", "editor": false}                      what a token without map:edit is shown
//   {"event": "drawn", "objects", "unsent"}                   a room with a door, a prototype and a copy of it
//   {"event": "space", "chosen_before", "chosen", "on_the_map", "x_m"}  the same in space: what is chosen before and after a click there
//   {"event": "undone", "objects"}  {"event": "redone", "objects"}
//   {"event": "kept", "objects", "unsent", "text"}            after the page was loaded again
//   {"event": "sent", "text", "findings"}
//   {"event": "published", "text"}
//   {"event": "refused", "text", "news", "clashes", "unsent"} a second operator's stale edit
//   {"event": "still_there", "clashes", "unsent"}             after the page was loaded again
//   {"event": "settled", "text", "clashes", "unsent"}         with that edit made after all
//   {"event": "tablet", "length_m", "angle_deg", "scroll_width", "unsent"}  a wall drawn and dragged with a finger
//   {"event": "end", "console_errors": [...]}
//
// Ends with status 1 when something does not show in time, or the browser complained.

import { launchBrowser } from "./browser.mjs";

const PATIENCE_MS = 30_000;
/** Metres per pixel, and the middle of what is shown. */
const RESOLUTION = 0.01;
const MIDDLE = /** @type {const} */ ([2, 1.5]);

/** @param {string} name */
function setting(name) {
  const value = process.env[name] ?? "";
  if (value === "") throw new Error(`set ${name}`);
  return value;
}

/** Where the view in space first shows the table that was placed last, as shares of its width and height. */
const SPACE_TABLE = /** @type {const} */ ([0.6, 0.5]);

const url = setting("PAGE_URL").replace(/\/$/, "");
const place = `site=${encodeURIComponent(setting("SITE"))}&level=${encodeURIComponent(setting("LEVEL"))}`;
const shots = process.env["SHOTS"];

/** @typedef {import("playwright-core").Page} Page */

/** @param {object} line */
function say(line) {
  console.log(JSON.stringify(line));
}

/** @type {string[]} */
const consoleErrors = [];
const browser = await launchBrowser();

/** @param {string} token @param {import("playwright-core").BrowserContextOptions} [options] */
async function opened(token, options = { viewport: { width: 1440, height: 900 } }) {
  const context = await browser.newContext({ ...options, timezoneId: "Europe/Berlin" });
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE_MS);
  page.on("console", (message) => {
    // What the server refuses, the browser reports too; the page says it in words.
    const refused = message.text().startsWith("Failed to load resource");
    // Pictures of what software draws in space take a while: so says the driver.
    const slow = message.text().includes("GPU stall due to ReadPixels");
    if ((message.type() === "error" || message.type() === "warning") && !refused && !slow) consoleErrors.push(message.text());
  });
  page.on("pageerror", (error) => consoleErrors.push(error.message));
  await page.goto(`${url}/#token=${encodeURIComponent(token)}&${place}&x=${MIDDLE[0]}&y=${MIDDLE[1]}&resolution=${RESOLUTION}&layers=raster,grid,model,segments,landmarks`);
  await page.waitForFunction(() => document.documentElement.dataset["live"] === "live");
  return page;
}

/** @param {Page} page */
async function editing(page) {
  await page.locator("#edit-model").click();
  await page.waitForFunction(() => (document.documentElement.dataset["objects"] ?? "") !== "");
}

/** Where a place of the level is on the screen. @param {Page} page @param {readonly [number, number]} at @returns {Promise<[number, number]>} */
async function onScreen(page, [x, y]) {
  const box = await page.locator("#map").boundingBox();
  if (box === null) throw new Error("there is no map");
  return [box.x + box.width / 2 + (x - MIDDLE[0]) / RESOLUTION, box.y + box.height / 2 - (y - MIDDLE[1]) / RESOLUTION];
}

/** @param {Page} page @param {readonly [number, number]} at */
async function clickAt(page, at) {
  const [x, y] = await onScreen(page, at);
  await page.mouse.move(x - 30, y - 12);
  await page.mouse.move(x, y, { steps: 3 });
  await page.mouse.click(x, y);
  // Two clicks in one place would be a double click.
  await page.waitForTimeout(300);
}

/** @param {Page} page @param {readonly [number, number]} from @param {readonly [number, number]} to */
async function drag(page, from, to) {
  const [x0, y0] = await onScreen(page, from);
  const [x1, y1] = await onScreen(page, to);
  await page.mouse.move(x0, y0);
  await page.mouse.down();
  await page.mouse.move((x0 + x1) / 2, (y0 + y1) / 2, { steps: 4 });
  await page.mouse.move(x1, y1, { steps: 4 });
  await page.mouse.up();
}

/** With a finger. @param {Page} page @param {readonly [number, number]} at */
async function tapAt(page, at) {
  await page.touchscreen.tap(...(await onScreen(page, at)));
  await page.waitForTimeout(350);
}

/** With a finger. @param {Page} page @param {readonly [number, number]} from @param {readonly [number, number]} to */
async function slide(page, from, to) {
  const browserSide = await page.context().newCDPSession(page);
  const [[x0, y0], [x1, y1]] = [await onScreen(page, from), await onScreen(page, to)];
  for (let step = 0; step <= 5; step++) {
    const point = { x: x0 + ((x1 - x0) * step) / 5, y: y0 + ((y1 - y0) * step) / 5 };
    await browserSide.send("Input.dispatchTouchEvent", { type: step === 0 ? "touchStart" : "touchMove", touchPoints: [point] });
  }
  await browserSide.send("Input.dispatchTouchEvent", { type: "touchEnd", touchPoints: [] });
}

/** @param {Page} page @param {string} name */
async function shoot(page, name) {
  if (shots === undefined || shots === "") return;
  await page.waitForTimeout(300);
  await page.screenshot({ path: `${shots}/${name}.png` });
}

/** @param {Page} page @param {string} name @param {string | number} value */
async function until(page, name, value) {
  await page.waitForFunction(([key, wanted]) => document.documentElement.dataset[key] === wanted, /** @type {const} */ ([name, String(value)]));
}

/** @param {Page} page */
async function facts(page) {
  return page.evaluate(() => {
    const { objects, unsent, clashes, chosen } = document.documentElement.dataset;
    return { objects: Number(objects), unsent: Number(unsent), clashes: Number(clashes), chosen: Number(chosen) };
  });
}

try {
  const reader = await opened(setting("READER"));
  await reader.locator(".tools").waitFor();
  say({ event: "reader", editor: await reader.locator("#edit-model").isVisible() });
  await reader.context().close();

  // A room with a door, by mouse; the corners are not hit exactly, but snapped to.
  const page = await opened(setting("TOKEN"));
  await editing(page);
  await page.keyboard.press("w");
  for (const at of /** @type {const} */ ([[0.02, -0.03], [4.03, 0.02], [3.98, 3.03]])) await clickAt(page, at);
  await page.mouse.move(...(await onScreen(page, [0.03, 2.97])), { steps: 5 });
  await shoot(page, "drawing");
  for (const at of /** @type {const} */ ([[0.03, 2.97], [0.04, 0.02]])) await clickAt(page, at);
  await until(page, "objects", 4);
  await page.keyboard.press("d");
  await page.mouse.move(...(await onScreen(page, [2.05, 0.06])), { steps: 5 });
  await shoot(page, "doorway");
  await clickAt(page, [2.05, 0.06]);
  await until(page, "objects", 5);
  await page.keyboard.press("p");
  await clickAt(page, [1.22, 1.81]);
  await until(page, "objects", 6);
  await page.keyboard.press("v");
  await page.keyboard.press("Control+d");
  await until(page, "objects", 7);
  await drag(page, [1.7, 1.3], [3.02, 1.78]);
  await page.keyboard.press("r");
  await page.locator("#edit-figure-yaw").waitFor();
  say({ event: "drawn", ...(await facts(page)) });
  await shoot(page, "drawn");

  // In space: the same is chosen, and what is chosen there is chosen on the map.
  await page.keyboard.press("3");
  await until(page, "space", 7);
  await page.locator(".space canvas").waitFor();
  const before = await facts(page);
  await shoot(page, "space");
  const inSpace = await page.locator(".space canvas").boundingBox();
  if (inSpace === null) throw new Error("there is no view in space");
  // Between the walls and the front of the view there is nothing: that chooses nothing.
  await page.mouse.click(inSpace.x + inSpace.width / 2, inSpace.y + inSpace.height - 40);
  await until(page, "chosen", 0);
  // The middle of the room is hidden by no wall; the table on the right stands a little beside it.
  await page.mouse.click(inSpace.x + inSpace.width * SPACE_TABLE[0], inSpace.y + inSpace.height * SPACE_TABLE[1]);
  await until(page, "chosen", 1);
  const chosenInSpace = await page.locator(".space-chosen").innerText();
  await page.keyboard.press("3");
  await until(page, "space", "");
  say({ event: "space", chosen_before: before.chosen, chosen: chosenInSpace, on_the_map: await page.locator(".edit-row .hint").innerText(), x_m: Number(await page.locator("#edit-figure-x").inputValue()) });
  await page.mouse.click(...(await onScreen(page, [3, 1.8])));
  await until(page, "chosen", 1);

  // The turn, the move and the copy are taken back, and made again.
  for (let step = 0; step < 4; step++) await page.keyboard.press("Control+z");
  await until(page, "objects", 5);
  say({ event: "undone", ...(await facts(page)) });
  for (let step = 0; step < 4; step++) await page.keyboard.press("Control+Shift+z");
  await until(page, "objects", 7);
  say({ event: "redone", ...(await facts(page)) });

  await page.reload();
  await until(page, "objects", 7);
  await until(page, "unsent", 7);
  say({ event: "kept", ...(await facts(page)), text: await page.locator(".edit-now").innerText() });
  await page.locator(".edit-found", { hasText: "No faults" }).waitFor();
  await page.locator("#edit-comment").fill("the tool room");
  await page.locator("#edit-send").click();
  await page.locator(".edit-card .done").waitFor();
  await until(page, "unsent", 0);
  say({ event: "sent", text: await page.locator(".edit-card .done").innerText(), findings: await page.locator(".edit-found").innerText() });
  await page.locator(".model-card summary").click();
  await page.locator("#model-publish:enabled").click();
  await page.locator(".model-card .done").waitFor();
  say({ event: "published", text: await page.locator(".model-card .done").innerText() });
  await page.waitForFunction(() => Number(document.documentElement.dataset["landmarks"]) > 0);
  await shoot(page, "published");

  // A second operator moves a table and draws a wall, and does not hear that the first one moves the table too.
  const second = await opened(setting("SECOND"));
  await editing(second);
  await second.route("**/gdb/entries*", (route) => route.abort());
  await drag(second, [1.2, 1.8], [1.2, 2.3]);
  await second.keyboard.press("w");
  await clickAt(second, [-2, 0]);
  await clickAt(second, [-2, 2]);
  await second.keyboard.press("Enter");
  await until(second, "unsent", 2);

  await drag(page, [1.2, 1.8], [0.8, 1.2]);
  await until(page, "unsent", 1);
  await page.locator("#edit-comment").fill("table to the window");
  await page.keyboard.press("Control+s");
  await until(page, "unsent", 0);

  await second.unroute("**/gdb/entries*");
  await second.locator("#edit-send").click();
  await second.locator(".edit-card .problem").waitFor();
  await until(second, "clashes", 1);
  say({ event: "refused", text: await second.locator(".edit-card .problem").innerText(), news: await second.locator(".edit-news").innerText(), ...(await facts(second)) });
  await shoot(second, "refused");
  await second.reload();
  await until(second, "clashes", 1);
  say({ event: "still_there", ...(await facts(second)) });
  await second.locator(".edit-clashes button", { hasText: "Take mine" }).click();
  await until(second, "clashes", 0);
  await until(second, "unsent", 2);
  await second.locator("#edit-send").click();
  await second.locator(".edit-card .done").waitFor();
  say({ event: "settled", text: await second.locator(".edit-card .done").innerText(), ...(await facts(second)) });
  // The first one hears of it, and has it without being asked.
  await until(page, "objects", 8);
  await page.locator(".edit-news li").first().waitFor();
  await shoot(page, "news");

  // On a tablet, with a finger: a wall by taps, chosen and dragged; what is not chosen leaves the map to be moved.
  const tablet = await opened(setting("SECOND"), { viewport: { width: 834, height: 1112 }, hasTouch: true });
  await editing(tablet);
  await tablet.locator("#tool-wall").tap();
  await tapAt(tablet, [0.98, -2.1]);
  await tapAt(tablet, [3.03, -2.02]);
  await tablet.locator("#edit-finish").tap();
  await until(tablet, "unsent", 1);
  await tablet.locator("#tool-select").tap();
  await slide(tablet, [2, -2.05], [2.5, -1.55]);
  await shoot(tablet, "tablet");
  await tablet.locator("#edit-figure-length").waitFor();
  const [length, angle] = [await tablet.locator("#edit-figure-length").inputValue(), await tablet.locator("#edit-figure-angle").inputValue()];
  const wide = await tablet.evaluate(() => document.documentElement.scrollWidth);
  say({ event: "tablet", length_m: Number(length), angle_deg: Number(angle), scroll_width: wide, ...(await facts(tablet)) });
  say({ event: "end", console_errors: consoleErrors });
  if (consoleErrors.length > 0) process.exitCode = 1;
} finally {
  await browser.close();
}
