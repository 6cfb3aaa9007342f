// Answers what robots found against the model of a level of a running server in Chromium, and says what the page
// showed, one JSON object a line:
//
//   PAGE_URL=http://127.0.0.1:7171 TOKEN=... READER=... SITE=... LEVEL=... [SHOTS=folder] node e2e/changes.mjs
//
// The level's model is drawn and not published yet, lacks a thing, and has one too many and one in the wrong place.
//
//   {"event": "unpublished", "text"}
//   {"event": "told", "open", "list"}
//   {"event": "reader", "answers"}                            buttons that a token without map:edit is shown
//   {"event": "accepted", "done"}                             what is missing, and what has moved
//   {"event": "dismissed", "open"}                            what is new
//   {"event": "published", "left"}                            what is still listed then
//   {"event": "end", "console_errors": [...]}
//
// Ends with status 1 when something does not show in time, or the browser complained.

import { launchBrowser } from "./browser.mjs";

const PATIENCE_MS = 30_000;

/** @param {string} name */
function setting(name) {
  const value = process.env[name] ?? "";
  if (value === "") throw new Error(`set ${name}`);
  return value;
}

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
  await page.locator(".changes-card summary").click();
  return page;
}

/** @param {Page} page @param {string} name */
async function shoot(page, name) {
  if (shots === undefined || shots === "") return;
  await page.waitForTimeout(800);
  await page.screenshot({ path: `${shots}/${name}.png` });
}

/** @param {Page} page @param {string} kind */
const row = (page, kind) => page.locator(`.model-change.change-${kind}`).first();

try {
  const page = await opened(setting("TOKEN"));
  await page.getByText("Nothing is published to hold the map against.").waitFor();
  say({ event: "unpublished", text: await page.locator(".changes-now").innerText() });
  await page.locator(".model-card summary").click();
  await page.locator("#model-publish").click();
  await page.locator(".model-card .done").getByText("Published").waitFor();
  await page.locator(".model-card summary").click();
  await page.locator(".model-change").nth(2).waitFor();
  say({ event: "told", open: await page.locator(".model-change.is-open").count(), list: await page.locator(".model-changes").innerText() });
  await shoot(page, "told");

  const reader = await opened(setting("READER"));
  await reader.locator(".model-change").nth(2).waitFor();
  say({ event: "reader", answers: await reader.locator(".model-change .accept, .model-change .dismiss").count() });
  await reader.context().close();

  for (const kind of ["missing", "moved"]) {
    await row(page, kind).locator(".show").click();
    await shoot(page, kind);
    await row(page, kind).locator(".accept").click();
    await page.locator(`.model-change.change-${kind}.is-accepted`).waitFor();
  }
  say({ event: "accepted", done: await page.locator(".changes-card .done").innerText() });
  await row(page, "new").locator(".dismiss").click();
  await page.locator(".model-change.change-new.is-dismissed").waitFor();
  say({ event: "dismissed", open: await page.locator(".model-change.is-open").count() });
  await shoot(page, "answered");

  await page.locator(".model-card summary").click();
  await page.locator("#model-publish:not([disabled])").click();
  await page.locator(".model-card .done").getByText("Published").waitFor();
  await page.waitForFunction(() => document.querySelectorAll(".model-change").length === 1);
  say({ event: "published", left: await page.locator(".model-change").count() });
  await shoot(page, "published");
  say({ event: "end", console_errors: consoleErrors });
} finally {
  await browser.close();
}
if (consoleErrors.length > 0) process.exit(1);
