import TileGrid from "ol/tilegrid/TileGrid.js";
import { describe, expect, it } from "vitest";
import {
  pictureBox,
  pictureKey,
  pictureMarks,
  pictureResolution,
  picturesOver,
  picturesTouched,
  zFor,
  type TileMark,
} from "../src/pyramid";
import { createRandom } from "./mock/random.mjs";
import { tile } from "./samples";

const CELL_M = 0.05;
const LEVELS = [0, 1, 2, 3, 4, 5, 6, 7, 8];
/** OpenLayers' own arithmetic for the same pyramid. */
const GRID = new TileGrid({
  origin: [0, 0],
  resolutions: LEVELS.map((z) => pictureResolution(z, CELL_M)),
  tileSize: 256,
});

describe("pictures", () => {
  it("are where OpenLayers says", () => {
    const random = createRandom(1);
    for (let i = 0; i < 500; i++) {
      const z = Math.floor(random() * 9);
      const point = [(random() - 0.5) * 600, (random() - 0.5) * 600];
      const [, col = 0, row = 0] = GRID.getTileCoordForCoordAndZ(point, z);
      const [x = 0, y = 0] = point;
      const around = picturesOver([x - 1e-6, y - 1e-6, x + 1e-6, y + 1e-6], z, CELL_M);
      expect(around).toContainEqual({ z, row, col });
      const expected = GRID.getTileCoordExtent([z, col, row]);
      pictureBox({ z, row, col }, CELL_M).forEach((edge, index) => {
        expect(edge).toBeCloseTo(expected[index] ?? NaN, 9);
      });
    }
  });

  it("cover a box without gaps and without those that only touch it", () => {
    // At z = 6 a picture is 12.8 m wide.
    expect(picturesOver([0, 0, 12.8, 12.8], 6, CELL_M)).toEqual([{ z: 6, row: -1, col: 0 }]);
    expect(picturesOver([-1, -1, 1, 1], 6, CELL_M).map(pictureKey)).toEqual(["6/-1/-1", "6/-1/0", "6/0/-1", "6/0/0"]);
  });

  it("are chosen sharp, and never finer than cells", () => {
    expect(zFor(0.05, CELL_M)).toBe(6);
    expect(zFor(0.001, CELL_M)).toBe(6);
    expect(zFor(0.1, CELL_M)).toBe(5);
    expect(zFor(0.09, CELL_M)).toBe(5);
    expect(zFor(0.07, CELL_M)).toBe(6);
    expect(zFor(100, CELL_M)).toBe(0);
  });
});

describe("a changed tile", () => {
  it("touches one picture at each zoom level up to cells, the one that holds its middle", () => {
    const random = createRandom(2);
    for (let i = 0; i < 300; i++) {
      const address = tile(Math.floor((random() - 0.5) * 400), Math.floor((random() - 0.5) * 400));
      for (const z of [0, 1, 2, 3, 4, 5, 6, 7, 8]) {
        const touched = picturesTouched(address, z, 64);
        const middle = [(address.x + 0.5) * 3.2, (address.y + 0.5) * 3.2];
        const [, col = 0, row = 0] = GRID.getTileCoordForCoordAndZ(middle, z);
        expect(touched).toEqual([{ z, row, col }]);
      }
    }
  });

  it("touches as many as it covers where pictures are smaller than tiles", () => {
    expect(picturesTouched(tile(0, 0), 8, 128).map(pictureKey)).toEqual(["8/-2/0", "8/-2/1", "8/-1/0", "8/-1/1"]);
    expect(picturesTouched(tile(-1, -1), 8, 128).map(pictureKey)).toEqual(["8/0/-2", "8/0/-1", "8/1/-2", "8/1/-1"]);
  });
});

describe("marks of pictures", () => {
  const tiles: TileMark[] = [
    { address: tile(0, 0), revision: 3, present: true },
    { address: tile(1, 0, "sonar"), revision: 9, present: true },
    { address: tile(-1, 0), revision: 5, present: false },
  ];

  it("bear the newest revision of their tiles", () => {
    const marks = pictureMarks(tiles, { z: 6, evidence: "all", tileCells: 64 });
    expect(Object.fromEntries(marks)).toEqual({
      "6/-1/0": { revision: 9, present: true },
      "6/-1/-1": { revision: 5, present: false },
    });
  });

  it("leave out what other sensors saw", () => {
    const marks = pictureMarks(tiles, { z: 6, evidence: "scanner", tileCells: 64 });
    expect(marks.get("6/-1/0")).toEqual({ revision: 3, present: true });
  });

  it("say that nothing is there any more only when all tiles are gone", () => {
    const marks = pictureMarks(tiles, { z: 0, evidence: "all", tileCells: 64 });
    expect(marks.get("0/-1/-1")?.present).toBe(false);
    expect(marks.get("0/-1/0")?.present).toBe(true);
  });
});
