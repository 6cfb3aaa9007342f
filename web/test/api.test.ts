import { describe, expect, it } from "vitest";
import openapi from "../../schema/openapi.json";
import { createApi, eventsPath, inWords, picturePath, Refused, Unreachable, type Api } from "../src/api";
import { NOON_MS } from "./samples";

/** A path of the description, as far as it matters here. */
interface Described {
  get?: { operationId?: string; parameters?: readonly { name: string; in: string }[] };
  post?: object;
}
const PATHS: Record<string, Described> = openapi.paths;
const PLACE = { site: "plant", level: "ground floor" };

/** An API whose server answers so, and what it was asked. */
function against(answer: (path: string) => Response | Error): { api: Api; asked: string[] } {
  const asked: string[] = [];
  const api = createApi({
    nowMs: () => NOON_MS,
    fetch: (input, init) => {
      const path = input instanceof Request ? input.url : input.toString();
      asked.push(`${init?.method ?? "GET"} ${path}`);
      const made = answer(path);
      return made instanceof Error ? Promise.reject(made) : Promise.resolve(made);
    },
  });
  return { api, asked };
}

const json = (body: unknown, status = 200, headers: Record<string, string> = {}): Response =>
  new Response(JSON.stringify(body), { status, headers: { "content-type": "application/problem+json", ...headers } });
const signal = new AbortController().signal;

describe("requests", () => {
  it("go to the paths of schema/src/route.rs, with names made safe", async () => {
    const { api, asked } = against(() => json({}));
    await api.vector(PLACE, 7, signal);
    await api.raster(PLACE, 0, signal);
    await api.contributions(PLACE, { limit: 1, robot: "a&b" }, signal);
    await api.robots(PLACE, signal);
    await api.picture(PLACE, { z: 6, row: -1, col: 3 }, "sonar");
    expect(asked).toEqual([
      "GET /api/v1/sites/plant/levels/ground%20floor/vector?since=7",
      "GET /api/v1/sites/plant/levels/ground%20floor/raster?since=0",
      "GET /api/v1/sites/plant/levels/ground%20floor/contributions?limit=1&robot=a%26b",
      "GET /api/v1/sites/plant/robots",
      "GET /api/v1/sites/plant/levels/ground%20floor/tiles/6/-1/3.png?layer=sonar",
    ]);
  });
});

describe("the server's description", () => {
  it("has all the paths that the page asks for, with the parameters that it gives", () => {
    const described = Object.entries(PATHS).map(([template, { get }]) => {
      const path = new RegExp(`^${template.replace(/[.]/g, "\\$&").replace(/\{\w+\}/g, "[^/]+")}$`);
      const query = (get?.parameters ?? []).filter((parameter) => parameter.in === "query").map(({ name }) => name);
      return { path, query };
    });
    const asked = [
      "/api/v1/session",
      "/api/v1/sites",
      "/api/v1/sites/a/robots",
      "/api/v1/sites/a/levels/b",
      "/api/v1/sites/a/levels/b/vector?since=1",
      "/api/v1/sites/a/levels/b/raster?since=1",
      "/api/v1/sites/a/levels/b/contributions?limit=20&robot=c",
      eventsPath({ site: "a", level: "b" }),
      picturePath({ site: "a", level: "b" }, { z: 6, row: -1, col: 3 }, "all"),
    ];
    for (const question of asked) {
      const url = new URL(question, "http://server");
      const route = described.find(({ path }) => path.test(url.pathname));
      expect(route, question).toBeDefined();
      for (const name of url.searchParams.keys()) expect(route?.query, question).toContain(name);
    }
  });
});

describe("failures", () => {
  it("that are refusals tell the problem's own words", async () => {
    const { api } = against(() => json({ detail: "Ask again tomorrow.", code: "later" }, 503));
    const error: unknown = await api.sites().catch((reason: unknown) => reason);
    expect(error).toBeInstanceOf(Refused);
    expect(inWords(error)).toBe("Ask again tomorrow.");
  });

  it("without a problem tell the status", async () => {
    const { api } = against(() => new Response("<h1>Bad gateway</h1>", { status: 502, headers: { "content-type": "text/html" } }));
    await expect(api.sites()).rejects.toThrow("status 502");
  });

  it("to connect, and answers that are none, mean that the server cannot be reached", async () => {
    await expect(against(() => new TypeError("refused")).api.sites()).rejects.toBeInstanceOf(Unreachable);
    await expect(against(() => new Response("{")).api.sites()).rejects.toBeInstanceOf(Unreachable);
  });

  it("to be signed in are an answer when the question is who is", async () => {
    expect(await against(() => json({ detail: "no" }, 401)).api.session()).toBeNull();
    await expect(against(() => json({ detail: "no" }, 500)).api.session()).rejects.toBeInstanceOf(Refused);
  });

  it("to find a picture mean that there is nothing to see", async () => {
    expect(await against(() => json({ detail: "no" }, 404)).api.picture(PLACE, { z: 0, row: 0, col: 0 }, "all")).toBeNull();
  });
});

describe("the server's time", () => {
  it("is what its answers say, not what this machine thinks", async () => {
    const { api } = against(() => json([], 200, { date: "Sun, 22 Nov 2026 12:10:00 GMT" }));
    expect(api.nowMs()).toBe(NOON_MS);
    await api.sites();
    expect(api.nowMs()).toBe(NOON_MS + 10 * 60_000 + 500);
  });
});
