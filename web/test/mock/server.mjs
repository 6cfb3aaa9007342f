// A stand-in for the server: serves the built page and the routes that the page uses, for one site
// with two levels (or none at all), with live events.

import { createServer } from "node:http";
import { readFile } from "node:fs/promises";
import { extname, join, normalize } from "node:path";
import { fileURLToPath } from "node:url";
import { createMockImports } from "./imports.mjs";
import { createMockLevel } from "./level.mjs";
import { createMockModel } from "./model.mjs";
import { drawPicture } from "./picture.mjs";

export const MOCK_TOKEN = "mock-token";
const DIST = fileURLToPath(new URL("../../dist/", import.meta.url));
const TYPES = /** @type {Record<string, string>} */ ({
  ".html": "text/html; charset=utf-8",
  ".js": "text/javascript; charset=utf-8",
  ".css": "text/css; charset=utf-8",
  ".svg": "image/svg+xml",
});
const CSP =
  "default-src 'none'; script-src 'self'; worker-src 'self' blob:; style-src 'self'; img-src 'self' data: blob:; " +
  "font-src 'self'; connect-src 'self'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'";

/** @typedef {import("node:http").IncomingMessage} Request */
/** @typedef {import("node:http").ServerResponse} Response */

/** @typedef {{ status: number, headers: Record<string, string>, body?: string | Buffer }} Answer */

/** @param {unknown} body @param {Record<string, string>} [headers] @returns {Answer} */
function json(body, headers = {}) {
  return { status: 200, headers: { "content-type": "application/json", ...headers }, body: JSON.stringify(body) };
}

/** @param {number} status @param {string} detail @returns {Answer} */
function problem(status, detail) {
  const body = { type: "urn:mapfold:problem:mock", title: "Mock", status, detail, code: "mock", errors: [], retryable: false };
  return { status, headers: { "content-type": "application/problem+json" }, body: JSON.stringify(body) };
}

/** @param {Request} request @returns {Promise<Buffer>} */
async function bytesOf(request) {
  /** @type {Buffer[]} */
  const parts = [];
  for await (const part of /** @type {AsyncIterable<Buffer>} */ (request)) parts.push(part);
  return Buffer.concat(parts);
}

/** @param {Request} request @returns {Promise<string>} */
async function bodyOf(request) {
  return (await bytesOf(request)).toString("utf8");
}

/**
 * @param {{ nowMs?: () => number, noSites?: boolean }} [options]
 */
export function createMockServer({ nowMs = Date.now, noSites = false } = {}) {
  const ground = createMockLevel({ nowMs });
  const prior = createMockImports({ nowMs });
  const model = createMockModel({ nowMs });
  /** @type {Set<Response>} */
  const streams = new Set();
  /** Paths asked for, in order. @type {string[]} */
  const requests = [];
  let signedIn = true;
  let upperRevision = 0;

  /** @param {string} event @param {unknown} data */
  const tell = (event, data) => {
    for (const stream of streams) stream.write(`event: ${event}\ndata: ${JSON.stringify(data)}\n\n`);
  };

  /** Null when the answer goes on. @param {Request} request @param {Response} response @param {URL} url @returns {Promise<Answer | null>} */
  const answerApi = async (request, response, url) => {
    const path = url.pathname.replace("/api/v1", "");
    if (path === "/session" && request.method === "POST") {
      if ((await bodyOf(request)) !== JSON.stringify({ token: MOCK_TOKEN })) return problem(401, "This token is not known.");
      signedIn = true;
      const cookie = `mapfold_session=${MOCK_TOKEN}; HttpOnly; SameSite=Strict; Path=/`;
      return json({ id: "mock", scopes: ["admin"], site: null, robot: null, expires_at: null }, { "set-cookie": cookie });
    }
    const bySession = signedIn && (request.headers.cookie ?? "").includes(`mapfold_session=${MOCK_TOKEN}`);
    if (!bySession && request.headers.authorization !== `Bearer ${MOCK_TOKEN}`) {
      return problem(401, "Sign in first.");
    }
    if (path === "/session" && request.method === "DELETE") {
      return { status: 204, headers: { "set-cookie": "mapfold_session=; Max-Age=0; Path=/" } };
    }
    if (path === "/session") return json({ id: "mock", scopes: ["admin"], site: null, robot: null, expires_at: null });
    if (path === "/sites") {
      return json(noSites ? [] : [{ site: "plant", name: "Demonstration plant", levels: ["ground", "upper"] }]);
    }
    if (path === "/sites/plant/robots") return json(ground.robots());
    if (path === "/sites/plant/prototypes") return json({ type: "FeatureCollection", revision: 0, features: [] });

    const match = /^\/sites\/plant\/levels\/(ground|upper)(\/.*)?$/.exec(path);
    if (match === null) return problem(404, `There is no ${path}.`);
    const isGround = match[1] === "ground";
    const rest = match[2] ?? "";
    const since = Number(url.searchParams.get("since") ?? 0);
    if (rest === "") {
      const empty = { revision: upperRevision, folded_revision: upperRevision, counts: { contributions: 0, segments: 0, clusters: 0, tiles: 0 } };
      return json(isGround ? ground.describe() : { ...ground.describe(), level: "upper", name: "Upper floor", ...empty });
    }
    if (rest === "/vector") {
      const none = { since, revision: upperRevision, segments: [], clusters: [], removed: { segments: [], clusters: [], tiles: [] } };
      return json(isGround ? ground.vector(since) : none);
    }
    if (rest === "/raster") {
      return json(isGround ? ground.raster(since) : { since, revision: upperRevision, resolution_m: 0.05, tiles: [], removed: [] });
    }
    if (rest === "/contributions") {
      const page = ground.contributions(Number(url.searchParams.get("limit") ?? 50), url.searchParams.get("robot"));
      return json({ contributions: isGround ? page : [], next: null });
    }
    if (rest === "/imports" && request.method === "POST") {
      const report = prior.read(await bytesOf(request), Number(url.searchParams.get("trust") ?? 0.5));
      if (typeof report === "string") return problem(422, report);
      return json(url.searchParams.get("preview") === "true" ? report : prior.make(report));
    }
    if (rest === "/imports" && request.method === "DELETE") {
      const removed = prior.remove();
      return removed === null ? problem(404, "There is no prior.") : json(removed);
    }
    if (rest === "/imports") return json({ imports: isGround ? prior.imports : [], next: null });
    if (rest === "/gdb" && request.method === "PATCH") {
      /** @type {unknown} */
      const body = JSON.parse(await bodyOf(request));
      const edit = /** @type {import("../../src/wire").GdbEdit} */ (body);
      if (url.searchParams.get("preview") === "true") return json({ draft: 0, new: edit.put.length, changed: 0, removed: 0, findings: [], more_findings: false });
      const answer = model.edit(request.headers["if-match"] ?? "", edit);
      return answer === null ? problem(412, "The draft has moved on: ada changed 3 objects since.") : json(answer);
    }
    if (rest === "/gdb") return json(model.collection());
    if (rest === "/gdb/entries") return json(isGround ? model.entries() : { entries: [], next: null });
    if (rest === "/gdb/findings") return json(model.findings());
    if (rest === "/gdb/publications") {
      const answer = model.publish(request.headers["if-match"] ?? "");
      return answer === null ? problem(412, "The draft has moved on: ada changed 3 objects since.") : json(answer);
    }
    if (rest === "/gdb/plan") {
      const plan = model.plan(Number(url.searchParams.get("height_m")), url.searchParams.get("state") ?? "draft");
      return plan === null ? problem(404, "Nothing is published yet.") : json(plan);
    }
    if (rest === "/landmarks") return json(model.landmarks(Number(url.searchParams.get("height_m"))));
    if (rest === "/events") {
      response.writeHead(200, { "content-type": "text/event-stream", "cache-control": "no-store" });
      response.write("retry: 3000\n\n");
      streams.add(response);
      response.on("close", () => streams.delete(response));
      return null;
    }
    const picture = /^\/tiles\/(\d+)\/(-?\d+)\/(-?\d+)\.png$/.exec(rest);
    if (picture !== null) {
      const address = { z: Number(picture[1]), row: Number(picture[2]), col: Number(picture[3]), layer: url.searchParams.get("layer") ?? "all" };
      const drawn = isGround ? drawPicture(ground.tiles(), address) : null;
      if (drawn === null) return problem(404, "There is nothing here.");
      const etag = `"${drawn.revision}"`;
      if (request.headers["if-none-match"] === etag) {
        return { status: 304, headers: { etag } };
      }
      return { status: 200, headers: { "content-type": "image/png", "cache-control": "no-cache", etag }, body: drawn.png };
    }
    return problem(404, `There is no ${path}.`);
  };

  /** @param {URL} url @returns {Promise<Answer>} */
  const answerFile = async (url) => {
    const name = normalize(url.pathname === "/" ? "/index.html" : url.pathname);
    try {
      const headers = { "content-type": TYPES[extname(name)] ?? "application/octet-stream", "content-security-policy": CSP };
      return { status: 200, headers, body: await readFile(join(DIST, name)) };
    } catch {
      return problem(404, `There is no ${name}.`);
    }
  };

  const server = createServer((request, response) => {
    const url = new URL(request.url ?? "/", "http://mock");
    requests.push(`${request.method} ${url.pathname}${url.search}`);
    const answered = url.pathname.startsWith("/api/") ? answerApi(request, response, url) : answerFile(url);
    answered
      .catch((/** @type {unknown} */ error) => problem(500, String(error)))
      .then((answer) => {
        if (answer !== null) response.writeHead(answer.status, answer.headers).end(answer.body);
      })
      .catch(() => response.destroy());
  });

  return {
    ground,
    prior,
    model,
    requests,
    /** @param {number} [port] @returns {Promise<string>} where the page is */
    listen: (port = 0) =>
      new Promise((resolve, reject) => {
        server.on("error", reject);
        server.listen(port, "127.0.0.1", () => {
          const address = server.address();
          resolve(`http://127.0.0.1:${typeof address === "object" && address !== null ? address.port : port}`);
        });
      }),
    /** Every robot looks `times` times; one event for all of it. @param {number} [times] */
    step(times = 1) {
      /** @type {LevelEvent[]} */
      const events = [];
      for (let i = 0; i < times; i++) for (const robot of ground.fleet) events.push(ground.look(robot));
      tell("revision", {
        revision: ground.revision(),
        robots: [...new Set(events.flatMap((event) => event.robots))],
        features: events.reduce((sum, event) => sum + event.features, 0),
        tiles: events.reduce((sum, event) => sum + event.tiles, 0),
      });
    },
    tell,
    /** Ends the live streams, as a restarting server does. */
    dropStreams() {
      for (const stream of streams) stream.destroy();
    },
    /** Forgets who is signed in. */
    endSessions() {
      signedIn = false;
    },
    streamCount: () => streams.size,
    close: () =>
      new Promise((resolve) => {
        server.close(() => {
          resolve(undefined);
        });
        server.closeAllConnections();
      }),
  };
}

/** @typedef {import("../../src/wire").LevelEvent} LevelEvent */
