import { describe, expect, it } from "vitest";
import { instantOf, isMeant, NO_LOG, previewInWords, revertInWords, targetsInWords, targetsOf, type LogState } from "../src/reverts";
import { update } from "../src/state";
import { uuidFrom } from "../src/uuid";
import type { Revert, RevertPreview } from "../src/wire";
import { after, entry, ON_GROUND } from "./samples";

const name = (robot: string): string => robot.toUpperCase();
const NOTHING = { new: 0, changed: 0, removed: 0 };

function told(fields: Partial<RevertPreview>): RevertPreview {
  return {
    revision: 9,
    contributions: 3,
    moved: 3,
    robots: [{ robot: "ada", contributions: 3 }],
    segments: NOTHING,
    clusters: NOTHING,
    tiles: NOTHING,
    bounds: null,
    features: [],
    more_features: false,
    ...fields,
  };
}

describe("what is meant", () => {
  const log: LogState = { ...NO_LOG, robot: "ada", from: "2026-11-22T12:00:00", to: "2026-11-22T12:00:02" };
  const at = (input: string): string => new Date(input).toISOString();

  it("is nothing until something is chosen", () => {
    expect(targetsOf(NO_LOG)).toBeNull();
    expect(targetsInWords(NO_LOG, name)).toBeNull();
    expect(instantOf("")).toBeNull();
    expect(instantOf("tomorrow")).toBeNull();
  });

  it("is a robot's span in the reader's time zone, or what is ticked", () => {
    expect(targetsOf(log)).toEqual({ robot: "ada", from: at(log.from), to: at(log.to) });
    expect(targetsOf({ ...log, from: "", to: "" })).toEqual({ robot: "ada", from: null, to: null });
    expect(targetsOf({ ...log, ticked: new Set(["b", "a"]) })).toEqual({ contributions: ["a", "b"] });
    expect(targetsInWords({ ...log, ticked: new Set(["b"]) }, name)).toBe("1 ticked contribution");
    expect(targetsInWords(log, name)).toBe(
      "all contributions of ADA, seen from 2026-11-22 12:00:00 and before 2026-11-22 12:00:02",
    );
  });

  it("holds the span's first instant and not its end", () => {
    const seen = (observed_at: string): boolean => isMeant(log, entry(1, { id: "e", robot: "ada", observed_at }));
    expect(seen(at("2026-11-22T11:59:59"))).toBe(false);
    expect(seen(at("2026-11-22T12:00:00"))).toBe(true);
    expect(seen(at("2026-11-22T12:00:01"))).toBe(true);
    expect(seen(at("2026-11-22T12:00:02"))).toBe(false);
    expect(isMeant({ ...log, from: "", to: "" }, entry(1, { id: "e", robot: "ada" }))).toBe(true);
    expect(isMeant(log, entry(1, { id: "e", robot: "bob", observed_at: at(log.from) }))).toBe(false);
    expect(isMeant({ ...log, ticked: new Set(["e"]) }, entry(1, { id: "e", robot: "bob" }))).toBe(true);
    expect(isMeant({ ...log, ticked: new Set(["e"]) }, entry(1, { id: "e", robot: "bob", state: "held" }))).toBe(false);
  });

  it("is forgotten with the level", () => {
    const open = update(after(...ON_GROUND), { kind: "log", log: { open: true, robot: "ada" } });
    expect(open.log.robot).toBe("ada");
    expect(update(open, { kind: "place", place: { site: "plant", level: "upper" } }).log).toEqual(NO_LOG);
  });
});

describe("a preview in words", () => {
  it("tells what goes, and what would change", () => {
    const preview = told({
      contributions: 5,
      segments: { new: 1, changed: 1200, removed: 4 },
      tiles: { new: 0, changed: 0, removed: 2 },
    });
    expect(previewInWords({ trial: { kind: "revert" }, told: preview }, name)).toEqual([
      "Takes 3 contributions of ADA out of the map.",
      "2 more are out already.",
      "Segments: 1 new, 1\u202f200 changed, 4 gone.",
      "Tiles: 2 gone.",
    ]);
  });

  it("tells what comes back, and what stays out", () => {
    const trial = { kind: "undo", revert: "r" } as const;
    const preview = told({
      contributions: 4,
      clusters: { new: 2, changed: 0, removed: 0 },
      chains: { new: 1, changed: 0, removed: 0 },
    });
    expect(previewInWords({ trial, told: preview }, name)).toEqual([
      "Puts 3 contributions of ADA back into the map.",
      "1 more stay out, because another revert covers them.",
      "Clusters: 2 new.",
      "Chains: 1 new.",
    ]);
    expect(previewInWords({ trial, told: told({ moved: 0 }) }, name)[0]).toContain("Nothing would come back");
  });

  it("says so when nothing would change", () => {
    const trial = { kind: "revert" } as const;
    expect(previewInWords({ trial, told: told({ moved: 0 }) }, name)).toHaveLength(1);
    expect(previewInWords({ trial, told: told({}) }, name)[1]).toBe("The map would look the same.");
  });
});

it("a revert says whose contributions it took out, and from when", () => {
  const revert: Revert = {
    id: "r",
    revision: 4,
    at: "2026-11-22T12:00:00Z",
    author: "abc",
    reason: "drift",
    contributions: 2,
    taken_out: 2,
    robots: [
      { robot: "ada", contributions: 1 },
      { robot: "bob", contributions: 1 },
    ],
  };
  expect(revertInWords(revert, name)).toBe("2 contributions of ADA and BOB");
  const from = new Date("2026-11-22T12:00:00").toISOString();
  expect(revertInWords({ ...revert, from }, name)).toBe("2 contributions of ADA and BOB, seen from 2026-11-22 12:00:00");
});

it("a UUID bears its version and variant", () => {
  expect(uuidFrom(new Uint8Array(16))).toBe("00000000-0000-4000-8000-000000000000");
  expect(uuidFrom(new Uint8Array(16).fill(255))).toBe("ffffffff-ffff-4fff-bfff-ffffffffffff");
});
