import { describe, expect, it } from "vitest";
import { doorwaysIn, followed, hostOf, sizeIn } from "../src/editing/doorways";
import { groundsOf, moved, pointInLevel, same, turned, yawOf } from "../src/editing/objects";
import { rejoined, wallObject, wallOf, wallsAmong } from "../src/editing/walls";
import { ringContains, type Point } from "../src/geometry";
import type { GdbObject } from "../src/wire";
import { asWall, corner, doorway, wall } from "./editing_samples";
import { createRandom } from "./mock/random.mjs";

const NO_LIBRARY = new Map();

describe("an object", () => {
  it("stands where its quaternion turns it", () => {
    const half = Math.SQRT1_2;
    const object: GdbObject = { kind: "other", placement: { position_m: [10, 0, 1], rotation: [half, 0, 0, half] } };
    expect(pointInLevel(object, [2, 0.5, 0.25]).map((v) => Math.round(v * 1e6) / 1e6)).toEqual([9.5, 2, 1.25]);
    const onItsSide: GdbObject = { kind: "other", placement: { position_m: [0, 0, 0], rotation: [half, half, 0, 0] } };
    expect(pointInLevel(onItsSide, [1, 2, 3]).map((v) => Math.round(v * 1e6) / 1e6)).toEqual([1, -3, 2]);
  });

  it("that is turned and turned back is where it was", () => {
    const object: GdbObject = { kind: "other", placement: { position_m: [3, 4, 0] } };
    const there = turned(turned(object, [1, 1], 0.7), [1, 1], -0.7);
    expect(pointInLevel(there, [1, 2, 3])[0]).toBeCloseTo(4, 5);
    expect(yawOf(there)).toBeCloseTo(0, 9);
    expect(same(moved(moved(object, [0.1, 0.2]), [-0.1, -0.2]), object)).toBe(true);
  });

  it("says the same whatever it leaves unsaid", () => {
    expect(same({ kind: "wall", name: "", door: null }, { kind: "wall" })).toBe(true);
    expect(same({ kind: "wall", name: "a" }, { kind: "wall" })).toBe(false);
    expect(same(null, undefined)).toBe(true);
  });
});

describe("a wall", () => {
  it("is read from its object as it was drawn, in any direction", () => {
    const random = createRandom(7);
    for (let n = 0; n < 200; n++) {
      const [x, y, angle, length] = [random() * 20, random() * 20, random() * 7, 0.2 + random() * 8];
      const drawn = wall([x, y], [x + length * Math.cos(angle), y + length * Math.sin(angle)], { thicknessM: 0.05 + random() * 0.1 });
      const read = asWall(wallObject(drawn));
      for (const [got, wanted] of [[read.a, drawn.a], [read.b, drawn.b]] as const) {
        expect(Math.hypot(got[0] - wanted[0], got[1] - wanted[1])).toBeLessThan(3e-6);
      }
      expect(read.thicknessM).toBeCloseTo(drawn.thicknessM, 5);
    }
  });

  it("of another form is none that can be reshaped", () => {
    const pillar: GdbObject = { kind: "wall", solids: [{ cylinder: { centre_m: [0, 0], radius_m: 0.2, lower_m: 0, upper_m: 2 } }] };
    expect(wallOf(pillar)).toBeNull();
    const bent: GdbObject = { kind: "wall", solids: [{ prism: { base_m: [[[0, 0], [4, 0], [4, 3], [3.9, 3], [3.9, 0.1], [0, 0.1]]], lower_m: 0, upper_m: 2 } }] };
    expect(wallOf(bent)).toBeNull();
    const long: GdbObject = { kind: "wall", solids: [{ box: { from_m: [0, 0, 0], to_m: [0.2, 5, 2] } }] };
    expect(asWall(long)).toMatchObject({ a: [0.1, 0], b: [0.1, 5], thicknessM: 0.2 });
  });

  it("and the next one close their corner, at any angle", () => {
    for (const degrees of [30, 60, 90, 120, 150, 210, 300]) {
      const angle = (degrees * Math.PI) / 180;
      const objects = new Map([
        ["a", wallObject(wall([0, 0], [3, 0]))],
        ["b", wallObject(wall([0, 0], [3 * Math.cos(angle), 3 * Math.sin(angle)], { thicknessM: 0.2 }))],
      ]);
      const joined = new Map([...objects, ...rejoined(objects, [[0, 0]])]);
      const covered = (p: Point): boolean => [...joined.values()].some((object) => groundsOf(object, NO_LIBRARY).some(({ rings: [ring] }) => ringContains(ring ?? [], p)));
      // Around the corner, just inside the outer sides.
      const outwards = angle < Math.PI ? angle / 2 + Math.PI : angle / 2;
      for (const off of [0.001, 0.02, 0.045]) expect(covered([off * Math.cos(outwards), off * Math.sin(outwards)]), `${degrees} ${off}`).toBe(true);
      expect(wallsAmong(joined).size).toBe(2);
      expect(asWall(joined.get("a"))).toEqual(wall([0, 0], [3, 0]));
    }
  });

  it("and the next one at a right angle have the outer corner where their outer sides meet", () => {
    const objects = corner();
    const joined = rejoined(objects, [[4, 0]]);
    expect([...joined.keys()]).toEqual(["east"]);
    const corners = groundsOf(joined.get("east") ?? { kind: "other" }, NO_LIBRARY).flatMap(({ rings }) => rings.flat());
    expect(corners.some(([x, y]) => Math.abs(x - 4.05) < 1e-6 && Math.abs(y + 0.05) < 1e-6)).toBe(true);
    // Joining again changes nothing; alone again, it is a box again.
    const now = new Map([...objects, ...joined]);
    expect(rejoined(now, [[4, 0]]).size).toBe(0);
    const alone = new Map([...now].filter(([id]) => id !== "north"));
    expect(rejoined(alone, [[4, 0]]).get("east")?.solids).toHaveLength(1);
  });
});

describe("a doorway", () => {
  it("stands in the wall that its middle is in", () => {
    const objects = corner();
    expect(hostOf(objects.get("door") ?? { kind: "other" }, wallsAmong(objects))).toBe("east");
    expect([...doorwaysIn(objects, wallsAmong(objects))]).toEqual([["east", ["door"]]]);
    expect(hostOf(moved(objects.get("door") ?? { kind: "other" }, [0, 0.3]), wallsAmong(objects))).toBeNull();
  });

  it("keeps within its wall, and goes through it", () => {
    const host = wallObject(wall([0, 0], [4, 0]));
    const [ground] = groundsOf(doorway(host, 0.1), NO_LIBRARY);
    const xs = ground?.rings[0]?.map(([x]) => x) ?? [];
    const ys = ground?.rings[0]?.map(([, y]) => y) ?? [];
    expect([Math.min(...xs), Math.max(...xs)]).toEqual([0, 0.9]);
    expect(Math.max(...ys)).toBeGreaterThan(0.05);
    expect(sizeIn(asWall(host), doorway(host, 2))).toEqual({ widthM: 0.9, heightM: 2.1 });
  });

  it("stays as far from the end of its wall that stays", () => {
    const from = wall([0, 0], [4, 0]);
    const door = doorway(wallObject(from), 1);
    const [x] = pointInLevel(followed(door, from, wall([-2, 0], [4, 0])), [0, 0, 0]);
    expect(x).toBeCloseTo(1, 6);
    const [, y] = pointInLevel(followed(door, from, wall([0, 0], [0, 4])), [0, 0, 0]);
    expect(y).toBeCloseTo(1, 6);
  });
});
