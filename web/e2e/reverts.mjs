// Takes a robot's contributions out of the map of a running server and puts them back, in Chromium
// and with the keyboard, and says what the page showed, one JSON object a line:
//
//   PAGE_URL=http://127.0.0.1:7171 TOKEN=... READER=... SITE=... LEVEL=... ROBOT=... [SHOTS=folder] node e2e/reverts.mjs
//
//   {"event": "reader", "controls": false, "text"}            what a token without map:edit is shown
//   {"event": "preview", "text"}
//   {"event": "out", "revision", "segments", "done", "lines_out"}
//   {"event": "undo_preview", "text"}
//   {"event": "back", "revision", "segments", "done"}
//   {"event": "refused", "text"}                              what the page says when the server refuses
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
const robot = setting("ROBOT");
const shots = process.env["SHOTS"];

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
    // What the server refuses, the browser reports too; the page says it in words.
    const refused = message.text().startsWith("Failed to load resource");
    if ((message.type() === "error" || message.type() === "warning") && !refused) consoleErrors.push(message.text());
  });
  page.on("pageerror", (error) => consoleErrors.push(error.message));
  await page.goto(`${url}/#token=${encodeURIComponent(token)}&${place}`);
  await page.waitForFunction(() => {
    const { live, segments } = document.documentElement.dataset;
    return live === "live" && Number(segments) > 0;
  });
  await page.locator("#open-log").focus();
  await page.keyboard.press("Enter");
  await page.locator(".log-lines li").first().waitFor();
  return page;
}

/** @param {import("playwright-core").Page} page @param {string} name */
async function shoot(page, name) {
  if (shots === undefined || shots === "") return;
  await page
    .waitForFunction(() => document.documentElement.dataset["tilesPending"] === "0", undefined, { timeout: 5_000 })
    .catch(() => undefined);
  await page.screenshot({ path: `${shots}/${name}.png` });
}

/** @param {import("playwright-core").Page} page */
async function facts(page) {
  return page.evaluate(() => {
    const { revision, segments } = document.documentElement.dataset;
    return { revision: Number(revision), segments: Number(segments) };
  });
}

/** @param {import("playwright-core").Page} page @param {number} revision */
async function painted(page, revision) {
  await page.waitForFunction((least) => Number(document.documentElement.dataset["revision"]) >= least, revision);
}

try {
  const reader = await opened(setting("READER"));
  const controls = await reader.locator(".log-form form").isVisible();
  const boxes = await reader.locator(".log-lines input").first().isVisible();
  say({ event: "reader", controls: controls || boxes, text: await reader.locator(".log-form").innerText() });
  await shoot(reader, "reader");
  await reader.context().close();

  const page = await opened(setting("TOKEN"));
  const before = await facts(page);
  // The focus is in the panel, on the choice of a robot: only keys from here on.
  await page.locator("#log-robot:focus").waitFor();
  await page.locator("#log-robot").selectOption(robot);
  await page.locator(".log-lines li.meant").first().waitFor();
  await shoot(page, "chosen");
  await page.locator("#log-preview").focus();
  await page.keyboard.press("Enter");
  await page.locator(".told p").first().waitFor();
  say({ event: "preview", text: await page.locator(".told").innerText() });
  await shoot(page, "preview");
  if (!(await page.locator("#log-confirm").isDisabled())) throw new Error("it may be taken out without a reason");
  await page.locator("#log-reason").focus();
  await page.keyboard.type("its scanner had come loose");
  await page.keyboard.press("Enter");
  await page.locator(".log-form .done").waitFor();
  await page.locator(".reverts li").first().waitFor();
  await painted(page, before.revision + 1);
  await page.locator(".log-lines li.out").first().waitFor();
  say({
    event: "out",
    ...(await facts(page)),
    done: await page.locator(".log-form .done").innerText(),
    lines_out: await page.locator(".log-lines li.out").count(),
  });
  await shoot(page, "out");

  await page.locator(".reverts button").first().focus();
  await page.keyboard.press("Enter");
  await page.locator(".told p").first().waitFor();
  say({ event: "undo_preview", text: await page.locator(".told").innerText() });
  await page.locator("#log-confirm").focus();
  await page.keyboard.press("Enter");
  await page.locator(".log-form .done").waitFor();
  await painted(page, before.revision + 2);
  await page.locator(".reverts li.undone").waitFor();
  say({ event: "back", ...(await facts(page)), done: await page.locator(".log-form .done").innerText() });
  await shoot(page, "back");

  // Somebody else is faster: what the page tried out is out already.
  await page.locator("#log-preview").click();
  await page.locator("#log-reason").fill("once more");
  await page.evaluate(
    async ({ path, body }) => {
      await fetch(path, { method: "POST", headers: { "content-type": "application/json" }, body: JSON.stringify(body) });
    },
    {
      path: `/api/v1/sites/${setting("SITE")}/levels/${setting("LEVEL")}/reverts`,
      body: { robot, reason: "somebody else's" },
    },
  );
  await page.locator("#log-confirm").click();
  await page.locator(".log-form .problem").waitFor();
  say({ event: "refused", text: await page.locator(".log-form .problem").innerText() });
  await shoot(page, "refused");
  await page.keyboard.press("Escape");
  await page.locator("#log").waitFor({ state: "hidden" });
  say({ event: "end", console_errors: consoleErrors });
  if (consoleErrors.length > 0) process.exitCode = 1;
} finally {
  await browser.close();
}
