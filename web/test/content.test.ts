import { describe, expect, it } from "vitest";
import { pictureMarks } from "../src/pyramid";
import { boundsOf, NO_CONTENT, tileCount, withRaster, withVector } from "../src/content";
import { chain, cluster, rasterChanges, segment, tile, vectorPatch } from "./samples";

const FIRST = withVector(NO_CONTENT, vectorPatch(0, 4, { segments: [segment("a"), segment("b")], clusters: [cluster("c")] }));

describe("a vector patch", () => {
  it("adds, changes and removes", () => {
    const next = withVector(
      FIRST,
      vectorPatch(4, 6, {
        segments: [segment("a", { quality: 9 }), segment("d")],
        removed: { segments: ["b"], clusters: ["c"], tiles: [] },
      }),
    );
    expect([...next.segments.keys()].sort()).toEqual(["a", "d"]);
    expect(next.segments.get("a")?.quality).toBe(9);
    expect(next.clusters.size).toBe(0);
    expect(next.vectorRevision).toBe(6);
  });

  it("brings chains and takes them away", () => {
    const joined = withVector(FIRST, vectorPatch(4, 5, { chains: [chain("a.0"), chain("b.0")] }));
    expect([...joined.chains.keys()]).toEqual(["a.0", "b.0"]);
    const parted = withVector(joined, vectorPatch(5, 6, { removed: { chains: ["a.0"] } }));
    expect([...parted.chains.keys()]).toEqual(["b.0"]);
    expect(parted.segments).toBe(FIRST.segments);
  });

  it("leaves the content before it as it was", () => {
    withVector(FIRST, vectorPatch(4, 5, { removed: { segments: ["a"], clusters: [], tiles: [] } }));
    expect(FIRST.segments.has("a")).toBe(true);
  });

  it("keeps the maps that it does not touch, so that they need no drawing", () => {
    const next = withVector(FIRST, vectorPatch(4, 5, { segments: [segment("e")] }));
    expect(next.clusters).toBe(FIRST.clusters);
    const same = withVector(FIRST, vectorPatch(4, 5));
    expect(same.segments).toBe(FIRST.segments);
    expect(same.vectorRevision).toBe(5);
  });

  it("that starts somewhere else is not applied", () => {
    expect(withVector(FIRST, vectorPatch(3, 9, { segments: [segment("x")] }))).toBe(FIRST);
  });

  it("from 0 is the whole, also when it leads back", () => {
    const whole = withVector(FIRST, vectorPatch(0, 2, { segments: [segment("z")] }));
    expect([...whole.segments.keys()]).toEqual(["z"]);
    expect(whole.clusters.size).toBe(0);
    expect(whole.vectorRevision).toBe(2);
  });

  it("one by one or all at once leads to the same", () => {
    const one = vectorPatch(4, 5, { segments: [segment("d")], removed: { segments: ["a"], clusters: [], tiles: [] } });
    const two = vectorPatch(5, 6, { segments: [segment("a", { quality: 1 })] });
    const both = vectorPatch(4, 6, { segments: [segment("d"), segment("a", { quality: 1 })] });
    const stepwise = withVector(withVector(FIRST, one), two);
    expect(new Map([...stepwise.segments].sort())).toEqual(new Map([...withVector(FIRST, both).segments].sort()));
  });
});

describe("changes of tiles", () => {
  const first = withRaster(NO_CONTENT, rasterChanges(0, 4, { tiles: [tile(0, 0), tile(1, 0), tile(0, 0, "sonar")] }));

  it("mark each tile with the revision of its last change", () => {
    const next = withRaster(first, rasterChanges(4, 8, { tiles: [tile(1, 0)] }));
    expect([...next.tiles.values()].map((mark) => mark.revision)).toEqual([4, 8, 4]);
    expect(next.rasterRevision).toBe(8);
    expect(next.epoch).toBe(first.epoch);
  });

  it("keep a mark of tiles that are gone, as their pictures must be fetched once more", () => {
    const next = withRaster(first, rasterChanges(4, 5, { removed: [tile(0, 0)] }));
    expect(next.tiles.get("scanner/0/0")).toEqual({ address: tile(0, 0), revision: 5, present: false });
    expect(tileCount(next)).toBe(2);
  });

  it("from 0 begin a new epoch in which all else is gone", () => {
    const whole = withRaster(first, rasterChanges(0, 2, { tiles: [tile(5, 5)] }));
    expect(whole.epoch).toBe(first.epoch + 1);
    expect(tileCount(whole)).toBe(1);
    expect(whole.tiles.get("scanner/0/0")?.present).toBe(false);
  });

  it("tell the prior apart from what robots saw, and from nothing", () => {
    const before = rasterChanges(4, 5, { prior: [{ x: 0, y: 0 }, { x: 7, y: 7 }] });
    const known = withRaster(first, before);
    expect(known.tiles.get("prior/7/7")).toEqual({ address: { sensor: "prior", x: 7, y: 7 }, revision: 5, present: true });
    expect(tileCount(known)).toBe(3);
    expect(boundsOf(known, 3.2)?.[2]).toBeCloseTo(8 * 3.2);
    const gone = withRaster(known, rasterChanges(5, 6, { removed_prior: [{ x: 7, y: 7 }] }));
    expect(gone.tiles.get("prior/7/7")?.present).toBe(false);
    expect(gone.tiles.get("scanner/0/0")?.revision).toBe(4);
  });

  it("keep what walls say apart from evidence, so that its pictures change and its tiles do not count", () => {
    const known = withRaster(first, rasterChanges(4, 5, { walls: [{ x: 0, y: 0 }] }));
    expect(known.tiles.get("walls/0/0")).toEqual({ address: { sensor: "walls", x: 0, y: 0 }, revision: 5, present: true });
    expect(tileCount(known)).toBe(tileCount(first));
    const marks = pictureMarks(known.tiles.values(), { z: 6, evidence: "all", tileCells: 64 });
    expect(marks.get("6/-1/0")?.revision).toBe(5);
    const alone = pictureMarks(known.tiles.values(), { z: 6, evidence: "sonar", tileCells: 64 });
    expect(alone.get("6/-1/0")?.revision).not.toBe(5);
    const gone = withRaster(known, rasterChanges(5, 6, { removed_walls: [{ x: 0, y: 0 }] }));
    expect(gone.tiles.get("walls/0/0")).toMatchObject({ revision: 6, present: false });
  });

  it("that start somewhere else are not applied", () => {
    expect(withRaster(first, rasterChanges(1, 9, { tiles: [tile(9, 9)] }))).toBe(first);
  });

  it("of nothing leave the tiles alone", () => {
    expect(withRaster(first, rasterChanges(4, 6)).tiles).toBe(first.tiles);
  });
});

describe("bounds", () => {
  it("hold the features and the tiles", () => {
    expect(boundsOf(FIRST, 3.2)).toEqual([2, 1, 6, 6]);
    const both = withRaster(FIRST, rasterChanges(0, 4, { tiles: [tile(-10, -10)] }));
    expect(boundsOf(both, 3.2)).toEqual([-32, -32, 6, 6]);
  });

  it("hold whole tiles", () => {
    const only = withRaster(NO_CONTENT, rasterChanges(0, 4, { tiles: [tile(-1, 0), tile(2, 1)] }));
    const [left, bottom, right, top] = boundsOf(only, 3.2) ?? [];
    expect([left, bottom]).toEqual([-3.2, 0]);
    expect(right).toBeCloseTo(9.6, 12);
    expect(top).toBeCloseTo(6.4, 12);
  });

  it("are none of nothing", () => {
    expect(boundsOf(NO_CONTENT, 3.2)).toBeNull();
  });
});
