// Gives the map of a robot that came with a frame of its own its place on a level of a running server in Chromium, takes it
// off again, and says what the page showed, one JSON object a line:
//
//   PAGE_URL=http://127.0.0.1:7171 TOKEN=... READER=... SITE=... LEVEL=... [SHOTS=folder] node e2e/alignments.mjs
//
// Contributions of one frame are held.
//
//   {"event": "reader", "answers"}                            buttons that a token without map:edit is shown
//   {"event": "told", "now", "frame", "places"}
//   {"event": "accepted", "done", "log"}
//   {"event": "withdrawn", "done", "log"}
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
const shots = process.env["SHOTS"] ?? "";

/** @param {object} line */
function say(line) {
  console.log(JSON.stringify(line));
}

/** @type {string[]} */
const consoleErrors = [];
const browser = await launchBrowser();

/** @param {string} token */
async function opened(token) {
  const context = await browser.newContext({ viewport: { width: 1440, height: 900 }, timezoneId: "Europe/Berlin" });
  const page = await context.newPage();
  page.setDefaultTimeout(PATIENCE_MS);
  page.on("console", (message) => {
    if (message.type() === "error" || message.type() === "warning") consoleErrors.push(message.text());
  });
  page.on("pageerror", (error) => consoleErrors.push(error.message));
  await page.goto(`${url}/#token=${encodeURIComponent(token)}&${place}`);
  await page.waitForFunction(() => document.documentElement.dataset["live"] === "live");
  await page.locator(".alignments-card summary").click();
  await page.locator(".alignments-card .place").first().waitFor();
  return page;
}

try {
  const reader = await opened(setting("READER"));
  say({ event: "reader", answers: await reader.locator(".alignments-card .accept, .alignments-card .withdraw").count() });
  await reader.context().close();

  const page = await opened(setting("TOKEN"));
  /** @param {string} name */
  const shoot = async (name) => {
    if (shots === "") return;
    await page.waitForTimeout(800);
    await page.screenshot({ path: `${shots}/${name}.png` });
  };
  const frame = page.locator(".alignments-card .frame").first();
  say({ event: "told", now: await page.locator(".alignments-now").innerText(), frame: await frame.innerText(), places: await frame.locator(".place").count() });
  await shoot("told");
  const done = page.locator(".alignments-card .done");
  await frame.locator(".place .accept").first().click();
  await done.filter({ hasText: "lies at" }).waitFor();
  await page.locator(".alignments-card .frame.is-aligned").waitFor();
  say({ event: "accepted", done: await done.innerText(), log: await page.locator(".alignments-card .frame.is-aligned").innerText() });
  await shoot("accepted");
  await page.locator(".alignments-card .frame.is-aligned .withdraw").click();
  await done.filter({ hasText: "off the map" }).waitFor();
  await page.locator(".alignments-card .frame.is-withdrawn").waitFor();
  await page.locator(".alignments-card .place").first().waitFor();
  say({ event: "withdrawn", done: await done.innerText(), log: await page.locator(".alignments-card .frame.is-withdrawn").innerText() });
  await shoot("withdrawn");
  say({ event: "end", console_errors: consoleErrors });
} finally {
  await browser.close();
}
if (consoleErrors.length > 0) process.exit(1);
