import { describe, expect, it } from "vitest";
import { withPuts } from "../src/editing/history";
import { drawn } from "../src/editing/verbs";
import { wallObject } from "../src/editing/walls";
import { openedSolids, partAt, surfacesOf } from "../src/space/surfaces";
import type { GdbObject, GdbSolid, ObjectKind } from "../src/wire";
import { asWall, corner, counting, doorway, TABLE, wall } from "./editing_samples";

const ALL: ReadonlySet<ObjectKind> = new Set(["wall", "doorway", "corridor", "machine", "furniture", "other"]);

/** Area of all triangles. */
function areaOf(triangles: Float32Array): number {
  let area = 0;
  for (let n = 0; n < triangles.length; n += 9) {
    const at = (k: number): number => triangles[n + k] ?? 0;
    const [ax, ay, az, bx, by, bz] = [at(3) - at(0), at(4) - at(1), at(5) - at(2), at(6) - at(0), at(7) - at(1), at(8) - at(2)];
    area += Math.hypot(ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx) / 2;
  }
  return area;
}

function surfaceOf(solid: GdbSolid, placement: GdbObject["placement"] = null): ReturnType<typeof surfacesOf> {
  return surfacesOf(new Map<string, GdbObject>([["a", { kind: "other", solids: [solid], placement }]]), new Map(), ALL);
}

describe("surfaces", () => {
  it("of short forms have the area that they are to have, however they are turned", () => {
    const box: GdbSolid = { box: { from_m: [0, 0, 0], to_m: [2, 3, 4] } };
    expect(areaOf(surfaceOf(box).triangles)).toBeCloseTo(52, 4);
    expect(areaOf(surfaceOf(box, { position_m: [5, 6, 7], rotation: [0.5, 0.5, 0.5, 0.5] }).triangles)).toBeCloseTo(52, 4);
    expect(surfaceOf(box).edges.length / 6).toBe(12);
    const frame: GdbSolid = { prism: { base_m: [[[0, 0], [4, 0], [4, 4], [0, 4]], [[1, 1], [1, 3], [3, 3], [3, 1]]], lower_m: 0, upper_m: 1 } };
    // Two faces of 16 - 4, sides of 16 and 8.
    expect(areaOf(surfaceOf(frame).triangles)).toBeCloseTo(48, 4);
    const cylinder: GdbSolid = { cylinder: { centre_m: [1, 1], radius_m: 1, lower_m: 0, upper_m: 2 } };
    expect(areaOf(surfaceOf(cylinder).triangles)).toBeCloseTo(6 * Math.PI, 0);
  });

  it("of free polyhedra are those of their faces, in the level", () => {
    const pyramid: GdbSolid = {
      polyhedron: {
        vertices_m: [[0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0], [1, 1, 1]],
        faces: [[[0, 3, 2, 1]], [[0, 1, 4]], [[1, 2, 4]], [[2, 3, 4]], [[3, 0, 4]]],
      },
    };
    const { triangles, edges } = surfaceOf(pyramid, { position_m: [10, 0, 0] });
    expect(areaOf(triangles)).toBeCloseTo(4 + 4 * Math.SQRT2, 5);
    expect(edges.length / 6).toBe(8);
    expect(Math.min(...Array.from(triangles).filter((_, n) => n % 3 === 0))).toBe(10);
    // A cube cut up into triangles, as files have it: its edges are those of the cube.
    const at = [0, 1].flatMap((x) => [0, 1].flatMap((y) => [0, 1].map((z): [number, number, number] => [x, y, z])));
    const sides = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]];
    const halves = sides.flatMap(([a = 0, b = 0, c = 0, d = 0]) => [[[a, b, c]], [[a, c, d]]]);
    const cube = surfaceOf({ polyhedron: { vertices_m: at, faces: halves } });
    expect([areaOf(cube.triangles), cube.edges.length / 6]).toEqual([6, 12]);
    // An arrow head: of its two diagonals only one lies within.
    const arrow: GdbSolid = { polyhedron: { vertices_m: [[0, 0, 0], [2, 1, 0], [0, 2, 0], [1, 1, 0]], faces: [[[0, 1, 2, 3]]] } };
    expect(areaOf(surfaceOf(arrow).triangles)).toBeCloseTo(1, 6);
    const broken: GdbSolid = { polyhedron: { vertices_m: [[0, 0, 0]], faces: [[[0, 1, 2]], []] } };
    expect(surfaceOf(broken).triangles).toHaveLength(0);
  });

  it("of a wall leave its doorways open", () => {
    const host = wallObject(wall([1, 1], [1, 5], { thicknessM: 0.2 }));
    const [solids, two] = [openedSolids(host, asWall(host), [doorway(host, 2)]), openedSolids(host, asWall(host), [doorway(host, 1), doorway(host, 3)])];
    const volumeOf = (some: readonly GdbSolid[]): number =>
      some.reduce((sum, solid) => {
        if (!("prism" in solid)) throw new Error("a piece is a prism");
        const [a, b, c] = solid.prism.base_m[0] ?? [];
        if (a === undefined || b === undefined || c === undefined) throw new Error("a piece has corners");
        return sum + Math.hypot(b[0] - a[0], b[1] - a[1]) * Math.hypot(c[0] - b[0], c[1] - b[1]) * (solid.prism.upper_m - solid.prism.lower_m);
      }, 0);
    expect(volumeOf(solids)).toBeCloseTo(4 * 0.2 * 2.5 - 0.9 * 0.2 * 2.1, 6);
    expect(volumeOf(two)).toBeCloseTo(4 * 0.2 * 2.5 - 2 * 0.9 * 0.2 * 2.1, 6);
    expect(solids).toHaveLength(3);
  });

  it("tell which object a triangle belongs to", () => {
    const objects = corner();
    const { parts, triangles } = surfacesOf(objects, new Map([["table", TABLE]]), ALL);
    expect(parts.map(({ id }) => id)).toEqual(["east", "north", "door", "table"]);
    for (const part of parts) {
      expect(partAt(parts, part.first)?.id).toBe(part.id);
      expect(partAt(parts, part.first + part.count - 1)?.id).toBe(part.id);
    }
    expect(partAt(parts, triangles.length / 3)).toBeNull();
    expect(surfacesOf(objects, new Map(), new Set(["furniture"])).parts.map(({ count }) => count)).toEqual([0]);
  });

  it("of 20 000 walls are there at once", () => {
    const { uuid } = counting();
    let objects: ReadonlyMap<string, GdbObject> = new Map();
    const puts = new Map(Array.from({ length: 20_000 }, (_, n) => [uuid(), wallObject(wall([n % 200, Math.floor(n / 200)], [(n % 200) + 0.8, Math.floor(n / 200)]))]));
    objects = withPuts(objects, puts);
    const { parts } = surfacesOf(objects, new Map(), ALL);
    expect(parts).toHaveLength(20_000);
    expect(drawn(objects, [[0, -1], [5, -1]], { thicknessM: 0.1, heightM: 2 }, uuid).size).toBe(1);
  });
});
