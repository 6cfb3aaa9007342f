import { afterEach, beforeEach, describe, expect, it, vi } from "vitest";
import { Refused, Unreachable, type Api } from "../src/api";
import type { Timers } from "../src/coalesce";
import { followLevel } from "../src/feed";
import { update, type Event, type State } from "../src/state";
import type { Problem } from "../src/wire";
import { after, entry, level, NOON_MS, ON_GROUND, rasterChanges, robot, segment, tile, vectorPatch } from "./samples";

const PLACE = { site: "plant", level: "ground" };

const timers: Timers = {
  setTimeout: (run, delayMs) => setTimeout(run, delayMs) as unknown as number,
  clearTimeout: (timer) => {
    clearTimeout(timer);
  },
};

/** A server of one level that can be told what to answer. */
class World {
  state: State = after(...ON_GROUND.slice(0, 2));
  events: Event[] = [];
  asked: string[] = [];
  streams: (EventTarget & { isClosed: boolean })[] = [];
  revision = 5;
  frame = "frame-1";
  failure: Error | null = null;
  failing = /./;
  quiet: string | null = null;
  stop: () => void = () => undefined;

  readonly api: Pick<Api, "nowMs" | "level" | "robots" | "contributions" | "vector" | "raster"> = {
    nowMs: () => NOON_MS,
    level: () => this.answer("level", level({ revision: this.revision, folded_revision: this.revision, frame: this.frame })),
    robots: () => this.answer("robots", [robot("ada"), robot("quiet")]),
    contributions: (_, { limit, robot: only }) =>
      this.answer(`contributions ${limit} ${only ?? ""}`.trim(), {
        contributions: only === undefined ? [entry(this.revision)] : [entry(2, { robot: only, received_at: "2026-11-21T00:00:00Z" })],
        next: null,
      }),
    vector: (_, since) => this.answer(`vector ${since}`, vectorPatch(since, this.revision, { segments: [segment(`at-${this.revision}`)] })),
    raster: (_, since) => this.answer(`raster ${since}`, rasterChanges(since, this.revision, { tiles: [tile(0, 0)] })),
  };

  private answer<T>(question: string, answer: T): Promise<T> {
    this.asked.push(question);
    return this.failure !== null && this.failing.test(question) ? Promise.reject(this.failure) : Promise.resolve(answer);
  }

  follow(): void {
    this.stop = followLevel({
      place: PLACE,
      api: this.api as Api,
      state: () => this.state,
      dispatch: (event) => {
        this.events.push(event);
        this.state = update(this.state, event);
      },
      openEvents: () => {
        const stream = Object.assign(new EventTarget(), {
          isClosed: false,
          close(): void {
            stream.isClosed = true;
          },
        });
        this.streams.push(stream);
        return stream as unknown as EventSource;
      },
      timers,
    });
  }

  /** The newest stream says something. */
  say(type: string, data?: unknown): void {
    this.streams.at(-1)?.dispatchEvent(new MessageEvent(type, { data: JSON.stringify(data) }));
  }

  revisionEvent(): void {
    this.revision++;
    this.say("revision", { revision: this.revision, robots: ["ada"], features: 1, tiles: 1 });
  }

  questions(word: string): string[] {
    return this.asked.filter((question) => question.startsWith(word));
  }
}

const soon = (): Promise<unknown> => vi.advanceTimersByTimeAsync(1);
let world: World;

beforeEach(() => {
  vi.useFakeTimers();
  world = new World();
});
afterEach(() => {
  world.stop();
  vi.useRealTimers();
});

describe("following a level", () => {
  it("asks for the whole first, and for what changed after that", async () => {
    world.follow();
    await soon();
    expect(world.state.content.vectorRevision).toBe(5);
    world.say("open");
    expect(world.state.link).toEqual({ kind: "live" });
    await vi.advanceTimersByTimeAsync(300);
    world.revisionEvent();
    await vi.advanceTimersByTimeAsync(300);
    expect(world.questions("vector")).toEqual(["vector 0", "vector 5", "vector 5"]);
    expect(world.questions("raster").at(-1)).toBe("raster 5");
    expect(world.state.content.vectorRevision).toBe(6);
    expect(world.state.content.segments.size).toBe(2);
  });

  it("asks a few times a second, however many events come", async () => {
    world.follow();
    world.say("open");
    await vi.advanceTimersByTimeAsync(2_000);
    world.asked = [];
    for (let i = 0; i < 200; i++) {
      world.revisionEvent();
      await vi.advanceTimersByTimeAsync(10);
    }
    await vi.advanceTimersByTimeAsync(300);
    expect(world.questions("vector").length).toBeGreaterThanOrEqual(8);
    expect(world.questions("vector").length).toBeLessThanOrEqual(10);
    expect(world.questions("contributions 20").length).toBeLessThanOrEqual(4);
    expect(world.state.content.vectorRevision).toBe(205);
  });

  it("asks the log once when each robot was heard, and then hears them by events", async () => {
    world.follow();
    await vi.advanceTimersByTimeAsync(5_000);
    world.say("open");
    await vi.advanceTimersByTimeAsync(5_000);
    expect(world.questions("contributions 1 ")).toEqual(["contributions 1 ada", "contributions 1 quiet"]);
    expect(world.state.heardAtMs.get("quiet")).toBe(Date.UTC(2026, 10, 21));
    world.revisionEvent();
    expect(world.state.heardAtMs.get("ada")).toBe(NOON_MS);
  });

  it("reads the whole again when events were lost", async () => {
    world.follow();
    world.say("open");
    await vi.advanceTimersByTimeAsync(2_000);
    world.say("resync", { revision: 5, robots: [], features: 0, tiles: 0 });
    await vi.advanceTimersByTimeAsync(300);
    expect(world.questions("vector").at(-1)).toBe("vector 0");
    expect(world.state.content.epoch).toBe(2);
  });

  it("reads the whole again when the level was replaced", async () => {
    world.follow();
    world.say("open");
    await vi.advanceTimersByTimeAsync(2_000);
    world.frame = "frame-2";
    world.revision = 2;
    world.say("revision", { revision: 2, robots: [], features: 1, tiles: 1 });
    await vi.advanceTimersByTimeAsync(2_000);
    expect(world.state.content.vectorRevision).toBe(2);
    expect([...world.state.content.segments.keys()]).toEqual(["at-2"]);
  });

  it("reads the whole again when its revision is ahead of the log", async () => {
    world.follow();
    world.say("open");
    await vi.advanceTimersByTimeAsync(2_000);
    world.failure = new Refused(410, null);
    world.failing = /^vector [^0]/;
    world.revisionEvent();
    await vi.advanceTimersByTimeAsync(2_000);
    expect(world.questions("vector").at(-1)).toBe("vector 0");
    expect(world.state.link).toEqual({ kind: "live" });
  });

  it("notices by itself when events are held up", async () => {
    world.follow();
    world.say("open");
    await vi.advanceTimersByTimeAsync(2_000);
    world.revision = 9;
    await vi.advanceTimersByTimeAsync(20_000);
    expect(world.state.content.vectorRevision).toBe(9);
  });
});

describe("when the server is gone", () => {
  beforeEach(async () => {
    world.follow();
    world.say("open");
    await vi.advanceTimersByTimeAsync(2_000);
    world.failure = new Unreachable("The server cannot be reached.");
    world.streams.at(-1)?.dispatchEvent(new globalThis.Event("error"));
    await soon();
  });

  it("says so, and keeps the map", async () => {
    await vi.advanceTimersByTimeAsync(3_000);
    expect(world.state.link).toEqual({ kind: "lost", sinceMs: NOON_MS, problem: "The server cannot be reached." });
    expect(world.state.content.segments.size).toBe(1);
  });

  it("tries again, ever less often, and is live once it is back", async () => {
    const streams = world.streams.length;
    for (let second = 0; second < 60; second++) {
      await vi.advanceTimersByTimeAsync(1_000);
      world.streams.at(-1)?.dispatchEvent(new globalThis.Event("error"));
    }
    const tries = world.streams.length - streams;
    expect(tries).toBeGreaterThan(6);
    expect(tries).toBeLessThan(14);
    world.failure = null;
    world.revision = 8;
    await vi.advanceTimersByTimeAsync(10_000);
    world.say("open");
    await soon();
    expect(world.state.link).toEqual({ kind: "live" });
    expect(world.state.content.vectorRevision).toBe(8);
  });

  it("has one stream open at a time", async () => {
    await vi.advanceTimersByTimeAsync(30_000);
    expect(world.streams.slice(0, -1).every((stream) => stream.isClosed)).toBe(true);
  });
});

describe("when the server refuses", () => {
  const problem: Problem = { type: "urn:x", title: "x", status: 404, detail: "There is no level “ground”.", code: "level_not_found", retryable: false };

  it("says what it said", async () => {
    world.failure = new Refused(404, problem);
    world.follow();
    await soon();
    expect(world.state.trouble).toBe("There is no level “ground”.");
    world.failure = null;
    await vi.advanceTimersByTimeAsync(1_500);
    world.say("open");
    await vi.advanceTimersByTimeAsync(1_500);
    expect(world.state.trouble).toBeNull();
  });

  it("asks to sign in again when the session has ended", async () => {
    world.failure = new Refused(401, null);
    world.follow();
    await soon();
    expect(world.state.session).toEqual({ kind: "out", problem: "Your session has ended. Sign in again." });
  });
});

describe("leaving a level", () => {
  it("ends all of it, and what comes late changes nothing", async () => {
    world.follow();
    world.say("open");
    world.stop();
    const { state } = world;
    world.revisionEvent();
    await vi.advanceTimersByTimeAsync(60_000);
    expect(world.state).toBe(state);
    expect(world.streams).toHaveLength(1);
    expect(world.streams[0]?.isClosed).toBe(true);
  });
});
