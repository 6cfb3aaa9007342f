// Takes a model's file into the draft of a level of a running server in Chromium, publishes it, shows its landmarks on the map
// and the model in space, and says what the page showed, one JSON object a line:
//
//   PAGE_URL=http://127.0.0.1:7171 TOKEN=... SITE=... LEVEL=... FILES=a.building.yaml[,b] [BAD=file] [BUILDING_LEVEL=name] [UNIT=metres] [SHOTS=folder] node e2e/files.mjs
//
//   {"event": "refused", "text"}             what is said of a file that is none
//   {"event": "told", "text", "doubts"}      what is in the file, before anything is taken
//   {"event": "taken", "text"}
//   {"event": "published", "landmarks"}      landmarks that the map shows
//   {"event": "space"}
//   {"event": "end", "console_errors": [...]}
//
// Ends with status 1 when something does not show in time, or the browser complained.

import { launchBrowser } from "./browser.mjs";

const PATIENCE_MS = 60_000;

/** @param {string} name */
function setting(name) {
  const value = process.env[name] ?? "";
  if (value === "") throw new Error(`set ${name}`);
  return value;
}

const url = setting("PAGE_URL").replace(/\/$/, "");
const place = `site=${encodeURIComponent(setting("SITE"))}&level=${encodeURIComponent(setting("LEVEL"))}`;
const files = setting("FILES").split(",");
const bad = process.env["BAD"] ?? "";
const buildingLevel = process.env["BUILDING_LEVEL"] ?? "";
const unit = process.env["UNIT"] ?? "";
const shots = process.env["SHOTS"] ?? "";

/** @param {object} line */
function say(line) {
  console.log(JSON.stringify(line));
}

/** @type {string[]} */
const consoleErrors = [];
const browser = await launchBrowser();
try {
  const context = await browser.newContext({ viewport: { width: 1280, height: 720 }, timezoneId: "Europe/Berlin" });
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE_MS);
  page.on("console", (message) => {
    const text = message.text();
    // A refused file is answered 422, which the browser notes; what software draws in space it notes too.
    const isExpected = text.includes("422") || text.includes("GPU stall") || text.includes("GL Driver");
    if ((message.type() === "error" || message.type() === "warning") && !isExpected) consoleErrors.push(text);
  });
  page.on("pageerror", (error) => consoleErrors.push(error.message));
  /** @param {string} name */
  const shoot = async (name) => {
    if (shots === "") return;
    await page.waitForTimeout(1_500);
    await page.screenshot({ path: `${shots}/${name}.png` });
  };
  await page.goto(`${url}/#token=${encodeURIComponent(setting("TOKEN"))}&${place}`);
  await page.waitForFunction(() => document.documentElement.dataset["live"] === "live");
  await page.locator(".files-card summary").click();
  if (bad !== "") {
    await page.setInputFiles("#model-files", bad);
    await page.click("#model-file-preview");
    await page.locator(".files-card .problem").filter({ hasText: /./ }).waitFor();
    say({ event: "refused", text: await page.locator(".files-card .problem").innerText() });
  }
  await page.setInputFiles("#model-files", files);
  if (buildingLevel !== "") await page.fill("#model-file-level", buildingLevel);
  if (unit !== "") await page.fill("#model-file-unit", unit);
  await page.click("#model-file-preview");
  await page.locator("#model-file-confirm").waitFor();
  const doubts = page.locator(".files-card .prior-warnings");
  say({ event: "told", text: await page.locator(".files-card .prior-told").innerText(), doubts: (await doubts.isVisible()) ? await doubts.innerText() : "" });
  await shoot("told");
  await page.click("#model-file-confirm");
  await page.locator(".files-card .done").filter({ hasText: /./ }).waitFor();
  say({ event: "taken", text: await page.locator(".files-card .done").innerText() });
  await page.locator(".files-card summary").click();
  await page.locator(".model-card summary").click();
  await page.locator("#model-publish:not([disabled])").click();
  await page.locator(".model-card .done").filter({ hasText: "Published" }).waitFor();
  await page.check("#layer-landmarks");
  await page.waitForFunction(() => Number(document.documentElement.dataset["landmarks"]) > 0);
  say({ event: "published", landmarks: await page.evaluate(() => Number(document.documentElement.dataset["landmarks"])) });
  await page.locator(".model-card summary").click();
  await page.keyboard.press("f");
  await shoot("plan");
  await page.click("#show-3d");
  await page.locator(".space canvas").waitFor();
  await page.waitForFunction(() => (document.documentElement.dataset["space"] ?? "") !== "");
  await shoot("space");
  say({ event: "space" });
  say({ event: "end", console_errors: consoleErrors });
} finally {
  await browser.close();
}
if (consoleErrors.length > 0) process.exit(1);
