import { describe, expect, it } from "vitest";
import { noticeOf, warningOf } from "../src/notice";
import { describe as describeSelection } from "../src/panels/selection_card";
import { update, type Event, type State } from "../src/state";
import { after, chain, cluster, level, NOON_MS, ON_GROUND, robot, segment, vectorPatch } from "./samples";

const ORIGIN = "http://127.0.0.1:7171";
const ground = after(...ON_GROUND);
const then = (state: State, ...events: readonly Event[]): State => events.reduce(update, state);

describe("in place of a map", () => {
  it("tells how to make a site where there is none", () => {
    const none = then(after(ON_GROUND[0] ?? { kind: "tick", nowMs: 0 }), { kind: "sites", sites: [] });
    const notice = noticeOf(none, ORIGIN);
    expect(notice?.title).toBe("No site yet");
    expect(notice?.command).toContain("mapfold-robot replay LOG --server http://127.0.0.1:7171 --token TOKEN");
    expect(notice?.command).toContain("--create");
  });

  it("tells how to fill a level that is empty", () => {
    const empty = then(ground, { kind: "level", level: level({ revision: 0, folded_revision: 0 }) });
    const notice = noticeOf(empty, ORIGIN);
    expect(notice?.title).toBe("Nothing here yet");
    expect(notice?.command).toContain("--site plant --level ground");
  });

  it("says what is wrong with a level", () => {
    expect(noticeOf(then(ground, { kind: "trouble", trouble: "It is gone." }), ORIGIN)?.text).toBe("It is gone.");
  });

  it("is nothing once there is a map, nor before signing in", () => {
    expect(noticeOf(then(ground, { kind: "vector", patch: vectorPatch(0, 3, { segments: [segment("a")] }) }), ORIGIN)).toBeNull();
    expect(noticeOf(after(), ORIGIN)).toBeNull();
  });
});

describe("above a map", () => {
  it("is a warning while the server is away, with the age of the map", () => {
    const lost = then(ground, { kind: "link", link: { kind: "lost", sinceMs: NOON_MS - 90_000, problem: "The server cannot be reached." } });
    expect(warningOf(lost)).toBe("The server cannot be reached. The map is as it was 1 min ago. Trying again …");
    expect(warningOf(ground)).toBeNull();
  });

  it("is a warning when the link led somewhere else", () => {
    const state = { ...ground, missing: { site: "a", level: "b" } };
    expect(warningOf(state)).toContain("level “b” of site “a”");
    expect(warningOf(then(state, { kind: "place", place: { site: "plant", level: "upper" } }))).toBeNull();
  });
});

describe("what is chosen", () => {
  const filled = then(ground, { kind: "vector", patch: vectorPatch(0, 3, { segments: [segment("w")], clusters: [cluster("c")], chains: [chain("w.0")] }) });
  const lines = (kind: "segment" | "cluster" | "chain" | "robot", id: string, state = filled): Record<string, string> =>
    Object.fromEntries(describeSelection(then(state, { kind: "select", selection: { kind, id } }))?.lines ?? []);

  it("is told of a segment: quality, robots, sds, times", () => {
    expect(lines("segment", "w")).toMatchObject({
      Quality: "3 looks",
      // 1 / (1 + exp(-8.67)) = 0.99983.
      "Is there": "99.9 % or more",
      "Seen by": "ada",
      Length: "3 m in 1 piece",
      // sqrt(0.0004 + 2.5^2 * 0.0001) across the wall's middle.
      "Offset sd": "3.2 cm, of it 1 cm shared",
      "Angle sd": "0.57°",
      Ends: "corner, free end",
    });
    expect(lines("segment", "w")["Last seen"]).toMatch(/^2026-11-2\d \d\d:\d\d:00$/);
  });

  it("is told of a chain, and of a wall's part in it", () => {
    expect(lines("chain", "w.0")).toMatchObject({
      What: "obstacle of 4 walls, free outside",
      Quality: "at least 2 looks each",
      Length: "8 m",
      Area: "4.0 m²",
      // 2 cm times the root of 5.99.
      Vertices: "4, 95 % within 4.9 cm",
    });
    expect(lines("segment", "w")["Part of"]).toBe("obstacle of 4 walls");
  });

  it("is told of a cluster", () => {
    expect(lines("cluster", "c")).toMatchObject({ Points: "12", "Centre sd": "x 10 cm, y 20 cm" });
  });

  it("is told of a robot, with what is emulated", () => {
    const sonar = robot("sina", {
      name: "Sina",
      competence: ["sonar"],
      sensors: [{ kind: "sonar", model: "ring", range_max_m: 4, range_sd_m: 0.05, beam_rad: 0.4, emulated: true }],
      queue_length: 3,
    });
    const state = then(filled, { kind: "robots", robots: [sonar] });
    expect(lines("robot", "sina", state)).toMatchObject({
      Competence: "sonar (emulated)",
      Sensor: "ring, up to 4 m, emulated",
      State: "active, offline",
      "Waiting to send": "3",
    });
  });

  it("is nothing if it is gone", () => {
    expect(describeSelection({ ...filled, selection: { kind: "segment", id: "gone" } })).toBeNull();
  });
});
