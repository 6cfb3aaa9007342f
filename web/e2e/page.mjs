// Opens the page of a running server in Chromium and says what it shows, one JSON object a line:
//
//   PAGE_URL=http://127.0.0.1:7171 TOKEN=... SITE=... LEVEL=... [WATCH_S=30] [SCREENSHOT=out.png] node e2e/page.mjs
//
// First, once the page has caught up with the server:
//   {"event": "shown", "ready_ms", "revision", "segments", "pieces_painted", "clusters", "robots",
//    "tiles", "tiles_loaded", "live", "console_errors": [...], "failed_requests": [...]}
// Then, for WATCH_S seconds, for each revision that the server acknowledged and that the page then
// showed (a later one shows the earlier ones too):
//   {"event": "revision", "revision", "delay_ms"}
// the delay being that from the first answer of the server that named the revision, asked for every
// 50 ms, to the page's painting. Last, the facts again, with what came to pass:
//   {"event": "end", ..., "revisions_seen", "delay_ms_max", "delay_ms_median"}
//
// Ends with status 1 when the page does not catch up within TIMEOUT_S (60) seconds, or when the
// browser complained about anything.

import { launchBrowser } from "./browser.mjs";

const POLL_MS = 50;
const PICTURES_MS = 5_000;

/** @param {string} name @param {string} [otherwise] */
function setting(name, otherwise) {
  const value = process.env[name] ?? otherwise;
  if (value === undefined || value === "") throw new Error(`set ${name}`);
  return value;
}

const url = setting("PAGE_URL").replace(/\/$/, "");
const token = setting("TOKEN");
const site = setting("SITE");
const level = setting("LEVEL");
const watchMs = Number(setting("WATCH_S", "0")) * 1000;
const timeoutMs = Number(setting("TIMEOUT_S", "60")) * 1000;

/** @param {object} line */
function say(line) {
  console.log(JSON.stringify(line));
}

/** The newest revision that the server has acknowledged. @returns {Promise<number>} */
async function acknowledged() {
  const path = `/api/v1/sites/${encodeURIComponent(site)}/levels/${encodeURIComponent(level)}`;
  const response = await fetch(url + path, { headers: { authorization: `Bearer ${token}` } });
  if (!response.ok) throw new Error(`the server answers ${response.status} for ${path}`);
  /** @type {unknown} */
  const body = await response.json();
  if (typeof body !== "object" || body === null || !("revision" in body)) throw new Error(`${path} names no revision`);
  return Number(body.revision);
}

/** @type {string[]} */
const consoleErrors = [];
/** @type {string[]} */
const failedRequests = [];
const browser = await launchBrowser();

try {
  const page = await browser.newPage({ viewport: { width: 1280, height: 800 } });
  page.on("console", (message) => {
    if (message.type() === "error" || message.type() === "warning") consoleErrors.push(message.text());
  });
  page.on("pageerror", (error) => consoleErrors.push(error.message));
  page.on("response", (response) => {
    if (response.status() >= 400) failedRequests.push(`${response.status()} ${response.url()}`);
  });

  const facts = async () => {
    const shown = await page.evaluate(() => Object.fromEntries(Object.entries(document.documentElement.dataset)));
    /** @param {string} name */
    const number = (name) => Number(shown[name] ?? NaN);
    return {
      revision: number("revision"),
      segments: number("segments"),
      pieces_painted: number("piecesPainted"),
      clusters: number("clusters"),
      robots: number("robots"),
      tiles: number("tiles"),
      tiles_loaded: number("tilesLoaded"),
      tiles_pending: number("tilesPending"),
      live: shown["live"] ?? "",
      console_errors: consoleErrors,
      failed_requests: failedRequests,
    };
  };

  // When the page painted which revision: seen from inside, so that no round trip counts.
  /** @type {{ revision: number, atMs: number }[]} */
  const paintings = [];
  await page.exposeFunction("reportPainting", (/** @type {number} */ revision, /** @type {number} */ atMs) => {
    paintings.push({ revision, atMs });
  });
  await page.addInitScript(() => {
    // The root element is not there yet, or will be another: the whole document is watched.
    new MutationObserver(() => {
      const report = /** @type {{ reportPainting?: (revision: number, atMs: number) => void }} */ (
        /** @type {unknown} */ (window)
      ).reportPainting;
      report?.(Number(document.documentElement.dataset["revision"]), Date.now());
    }).observe(document, { subtree: true, attributes: true, attributeFilter: ["data-revision"] });
  });

  const startMs = Date.now();
  const target = await acknowledged();
  const place = `site=${encodeURIComponent(site)}&level=${encodeURIComponent(level)}`;
  await page.goto(`${url}/#token=${encodeURIComponent(token)}&${place}`);
  await page.waitForFunction(
    (revision) => {
      const { live, revision: painted, tiles, tilesLoaded } = document.documentElement.dataset;
      // While robots are on the move, some picture is always on its way.
      return live === "live" && Number(painted ?? -1) >= revision && (tiles === "0" || Number(tilesLoaded) > 0);
    },
    target,
    { timeout: timeoutMs },
  );
  say({ event: "shown", ready_ms: Date.now() - startMs, ...(await facts()) });

  // Acknowledged revisions that the page has not painted yet, and since when.
  /** @type {{ revision: number, atMs: number }[]} */
  let waiting = [];
  /** @type {number[]} */
  const delaysMs = [];
  let newest = target;
  const endMs = Date.now() + watchMs;
  while (Date.now() < endMs || (watchMs > 0 && waiting.length > 0 && Date.now() < endMs + timeoutMs)) {
    const revision = await acknowledged();
    if (revision > newest && Date.now() < endMs) waiting.push({ revision, atMs: Date.now() });
    newest = Math.max(newest, revision);
    waiting = waiting.filter((one) => {
      const painting = paintings.find((painted) => painted.revision >= one.revision);
      if (painting === undefined) return true;
      const delayMs = Math.max(0, painting.atMs - one.atMs);
      delaysMs.push(delayMs);
      say({ event: "revision", revision: one.revision, delay_ms: delayMs });
      return false;
    });
    await new Promise((resolve) => setTimeout(resolve, POLL_MS));
  }

  const screenshot = process.env["SCREENSHOT"];
  if (screenshot !== undefined && screenshot !== "") {
    // All pictures, if they come soon; robots on the move may keep some on their way.
    await page
      .waitForFunction(() => document.documentElement.dataset["tilesPending"] === "0", undefined, { timeout: PICTURES_MS })
      .catch(() => undefined);
    await page.screenshot({ path: screenshot });
  }
  delaysMs.sort((a, b) => a - b);
  say({
    event: "end",
    ...(await facts()),
    revisions_seen: delaysMs.length,
    revisions_missed: waiting.length,
    delay_ms_max: delaysMs.at(-1) ?? null,
    delay_ms_median: delaysMs[Math.floor(delaysMs.length / 2)] ?? null,
  });
  if (consoleErrors.length > 0 || failedRequests.length > 0 || waiting.length > 0) process.exitCode = 1;
} finally {
  await browser.close();
}
