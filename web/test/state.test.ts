import { describe, expect, it } from "vitest";
import { fixInWords } from "../src/panels/selection_card";
import { fixHere, isSilent, robotsHere, SILENT_AFTER_MS, update, type State } from "../src/state";
import type { RobotFix } from "../src/wire";
import { after, entry, lastPose, level, NOON_MS, ON_GROUND, robot, segment, vectorPatch } from "./samples";

const ground = after(...ON_GROUND);

describe("choosing a level", () => {
  it("starts with the first level there is", () => {
    expect(ground.place).toEqual({ site: "plant", level: "ground" });
    expect(ground.missing).toBeNull();
  });

  it("follows the link, if what it names is there", () => {
    const sites = [
      { site: "a", name: "A", levels: ["x"] },
      { site: "b", name: "B", levels: ["y", "z"] },
    ];
    const link = (place: State["place"]): State =>
      update({ ...after(), place }, { kind: "sites", sites });
    expect(link({ site: "b", level: "z" }).place).toEqual({ site: "b", level: "z" });
    const gone = link({ site: "b", level: "gone" });
    expect(gone.place).toEqual({ site: "b", level: "y" });
    expect(gone.missing).toEqual({ site: "b", level: "gone" });
    expect(link({ site: "gone", level: "gone" }).place).toEqual({ site: "a", level: "x" });
  });

  it("has no place where there is no level", () => {
    expect(after({ kind: "sites", sites: [] }).place).toBeNull();
    expect(after({ kind: "sites", sites: [{ site: "a", name: "A", levels: [] }] }).place).toBeNull();
  });

  it("forgets all of the level before, and shows the new one whole", () => {
    const filled = [
      { kind: "vector", patch: vectorPatch(0, 3, { segments: [segment("a")] }) },
      { kind: "select", selection: { kind: "segment", id: "a" } },
      { kind: "view", view: { kind: "at", xLevelM: 1, yLevelM: 1, resolution: 1 } },
    ] as const;
    const moved = update(filled.reduce(update, ground), { kind: "place", place: { site: "plant", level: "upper" } });
    expect(moved.content.segments.size).toBe(0);
    expect(moved.level).toBeNull();
    expect(moved.selection).toBeNull();
    expect(moved.robots).toEqual([]);
    expect(moved.view).toEqual({ kind: "fit" });
    expect(moved.sites).toBe(ground.sites);
  });

  it("changes nothing when the level is the one already chosen", () => {
    expect(update(ground, { kind: "place", place: { site: "plant", level: "ground" } })).toBe(ground);
  });
});

describe("the session", () => {
  it("takes the map along when it ends, but not the place, so that signing in leads back", () => {
    const out = update(ground, { kind: "session", session: { kind: "out", problem: "ended" } });
    expect(out.level).toBeNull();
    expect(out.sites).toBeNull();
    expect(out.place).toEqual({ site: "plant", level: "ground" });
  });
});

describe("robots", () => {
  it("are silent when the server had nothing of them for a minute", () => {
    const heard = update(ground, { kind: "heard", robots: ["ada"], atMs: NOON_MS });
    expect(isSilent(heard, "ada")).toBe(false);
    const later = update(heard, { kind: "tick", nowMs: NOON_MS + SILENT_AFTER_MS });
    expect(isSilent(later, "ada")).toBe(false);
    expect(isSilent(update(later, { kind: "tick", nowMs: NOON_MS + SILENT_AFTER_MS + 1 }), "ada")).toBe(true);
    expect(isSilent(heard, "nobody")).toBe(true);
  });

  it("are heard by when the server took their contributions, not by their own clocks", () => {
    const state = update(ground, { kind: "contributions", contributions: [entry(7), entry(6, { robot: "bo" })] });
    expect(state.heardAtMs.get("ada")).toBe(NOON_MS - 30_000);
    expect(isSilent(state, "bo")).toBe(false);
  });

  it("are never heard earlier than they were", () => {
    const events = [
      { kind: "heard", robots: ["ada"], atMs: NOON_MS },
      { kind: "contributions", contributions: [entry(7)] },
    ] as const;
    expect(events.reduce(update, ground).heardAtMs.get("ada")).toBe(NOON_MS);
    const nonsense = update(ground, { kind: "heard", robots: ["ada"], atMs: NaN });
    expect(nonsense.heardAtMs.has("ada")).toBe(false);
  });

  it("are here only with a last pose on this level", () => {
    const state = update(ground, {
      kind: "robots",
      robots: [robot("a"), robot("b", { last_pose: null }), robot("c", { last_pose: lastPose("upper") })],
    });
    expect(robotsHere(state).map((one) => one.robot)).toEqual(["a"]);
  });

  it("keep their colours when others come", () => {
    const two = update(ground, { kind: "robots", robots: [robot("ada"), robot("aaa")] });
    expect(two.slots.get("ada")).toBe(ground.slots.get("ada"));
    expect(two.slots.get("aaa")).not.toBe(two.slots.get("ada"));
  });
});

describe("the selection", () => {
  it("is forgotten when what is chosen is no more", () => {
    const chosen = [
      { kind: "vector", patch: vectorPatch(0, 3, { segments: [segment("a"), segment("b")] }) },
      { kind: "select", selection: { kind: "segment", id: "a" } },
    ] as const;
    const state = chosen.reduce(update, ground);
    const without = (id: string): State =>
      update(state, {
        kind: "vector",
        patch: vectorPatch(3, 4, { removed: { segments: [id], clusters: [], tiles: [] } }),
      });
    expect(without("b").selection).toEqual({ kind: "segment", id: "a" });
    expect(without("a").selection).toBeNull();
  });
});

describe("events", () => {
  it("change one layer and leave the others", () => {
    const state = update(ground, { kind: "layer", name: "raster", setting: { opacity: 0.5 } });
    expect(state.layers.raster).toEqual({ on: true, opacity: 0.5 });
    expect(state.layers.segments).toBe(ground.layers.segments);
  });

  it("clear trouble once the level answers", () => {
    const troubled = update(ground, { kind: "trouble", trouble: "gone" });
    expect(update(troubled, { kind: "level", level: level() }).trouble).toBeNull();
  });

  it("of a link change the place, the view and the layers together", () => {
    const state = update(ground, {
      kind: "permalink",
      link: {
        place: { site: "plant", level: "upper" },
        view: { kind: "at", xLevelM: 1, yLevelM: 2, resolution: 0.1 },
        layers: { ...ground.layers, grid: { on: true, opacity: 1 } },
        evidence: "sonar",
      },
    });
    expect(state.place?.level).toBe("upper");
    expect(state.view).toEqual({ kind: "at", xLevelM: 1, yLevelM: 2, resolution: 0.1 });
    expect(state.layers.grid.on).toBe(true);
    expect(state.evidence).toBe("sonar");
  });
});

describe("what robots know of their places", () => {
  const place = { x_m: 3, y_m: 4, heading_rad: 0.5, covariance: lastPose("ground").covariance };
  const fix = (fields: Partial<RobotFix> = {}): RobotFix => ({
    level: "ground", observed_at: "2026-11-22T12:00:00Z", kind: "tracked", places: [place], segments: [], ...fields,
  });
  const told = (report: RobotFix): State => update(ground, { kind: "robots", robots: [robot("ada", { fix: report })] });

  it("shows a robot where it reports to be, before it contributes from there", () => {
    expect(robotsHere(told(fix())).map((r) => r.last_pose.x_m)).toEqual([3]);
    const old = fix({ observed_at: "2026-11-22T11:00:00Z" });
    expect(robotsHere(told(old)).map((r) => r.last_pose.x_m)).toEqual([0]);
  });

  it("does not move a robot that is not sure, and tells where it may be", () => {
    const state = told(fix({ kind: "ambiguous", places: [place, place] }));
    expect(robotsHere(state).map((r) => r.last_pose.x_m)).toEqual([0]);
    expect(state.robots.map((r) => fixHere(state, r)?.places.length)).toEqual([2]);
    expect(told(fix({ level: "upper" })).robots.map((r) => fixHere(ground, r))).toEqual([null]);
  });

  it("is said in words", () => {
    expect(fixInWords(fix({ segments: ["a", "b"], landmarks_m: [[1, 2]] })))
      .toBe("tracked, last look matched with 2 walls and 1 landmark");
    expect(fixInWords(fix({ kind: "ambiguous", places: [place, place] }))).toBe("not sure: 2 places may be it");
    expect(fixInWords(fix({ kind: "no_match", places: [] }))).toContain("lost");
  });
});
