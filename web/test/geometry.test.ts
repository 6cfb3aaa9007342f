import { describe, expect, it } from "vitest";
import {
  angleSd,
  areaOf,
  boxAround,
  distanceToPiece,
  edgesOf,
  ellipse95,
  hullContains,
  middleOf,
  offsetSd,
  piecesOf,
  pointOnLine,
  ringContains,
  shareOf,
  widened,
} from "../src/geometry";
import { createRandom, normal } from "./mock/random.mjs";
import { chain, cluster, segment } from "./samples";

describe("lines", () => {
  it("run along the normal turned left, as in map/src/geometry/line.rs", () => {
    const [x, y] = pointOnLine({ rho_m: 2, alpha_rad: Math.PI / 2 }, 3);
    expect(x).toBeCloseTo(-3, 12);
    expect(y).toBeCloseTo(2, 12);
  });

  it("have a piece for each solid interval", () => {
    const wall = segment("w", {
      solid: [
        { from_m: -4, to_m: -1, ends: ["corner", "jump"], existence_nat: 8.67 },
        { from_m: 1, to_m: 5, ends: ["jump", "corner"], existence_nat: 8.67 },
      ],
    });
    expect(piecesOf(wall)).toEqual([
      [2, -4, 2, -1],
      [2, 1, 2, 5],
    ]);
    expect(middleOf(wall)).toBe(0.5);
  });

  it("are as sure across themselves as a thousand lines drawn from their covariance are", () => {
    // Far from the foot point rho and alpha are correlated so that the wall itself is well known.
    const t = 40;
    const angleVar = 0.0004;
    const covariance = [
      [0.0009 + t * t * angleVar, t * angleVar],
      [t * angleVar, angleVar],
    ] as [[number, number], [number, number]];
    expect(offsetSd(covariance, t)).toBeCloseTo(0.03, 9);

    const random = createRandom(3);
    const rho = 10;
    let sumSq = 0;
    const draws = 4000;
    for (let i = 0; i < draws; i++) {
      const dAlpha = Math.sqrt(angleVar) * normal(random);
      const dRho = 0.03 * normal(random) + t * dAlpha;
      // Where the drawn line crosses the normal of the true one at coordinate t (alpha = 0: x = rho, y = t).
      const x = (rho + dRho - t * Math.sin(dAlpha)) / Math.cos(dAlpha);
      sumSq += (x - rho) ** 2;
    }
    const measured = Math.sqrt(sumSq / draws);
    expect(measured / offsetSd(covariance, t)).toBeGreaterThan(0.9);
    expect(measured / offsetSd(covariance, t)).toBeLessThan(1.15);
  });

  it("know the sd of their angle", () => {
    expect(angleSd([[1, 0], [0, 0.0004]])).toBeCloseTo(0.02, 12);
  });
});

describe("the 95 % ellipse", () => {
  it("has its axes along x and y where these are not correlated", () => {
    const ellipse = ellipse95(4, 0, 1);
    expect(ellipse.majorM).toBeCloseTo(2 * Math.sqrt(5.991464547), 6);
    expect(ellipse.minorM).toBeCloseTo(Math.sqrt(5.991464547), 6);
    expect(ellipse.angleRad).toBeCloseTo(0, 12);
  });

  it("turns with the distribution", () => {
    const [cos, sin] = [Math.cos(0.7), Math.sin(0.7)];
    const ellipse = ellipse95(4 * cos * cos + sin * sin, 3 * cos * sin, 4 * sin * sin + cos * cos);
    expect(ellipse.angleRad).toBeCloseTo(0.7, 9);
    expect(ellipse.majorM / ellipse.minorM).toBeCloseTo(2, 9);
  });

  it("holds 95 % of what is drawn from the distribution", () => {
    const [xx, xy, yy] = [0.09, 0.04, 0.04];
    const { majorM, minorM, angleRad } = ellipse95(xx, xy, yy);
    const random = createRandom(5);
    const draws = 20_000;
    let inside = 0;
    for (let i = 0; i < draws; i++) {
      const x = Math.sqrt(xx) * normal(random);
      const y = (xy / xx) * x + Math.sqrt(yy - (xy * xy) / xx) * normal(random);
      const along = x * Math.cos(angleRad) + y * Math.sin(angleRad);
      const across = -x * Math.sin(angleRad) + y * Math.cos(angleRad);
      if ((along / majorM) ** 2 + (across / minorM) ** 2 <= 1) inside++;
    }
    // Four standard deviations of a share of 0.95 in 20 000 draws are 0.006.
    expect(Math.abs(inside / draws - 0.95)).toBeLessThan(0.006);
  });

  it("is a point where nothing is uncertain", () => {
    expect(ellipse95(0, 0, 0)).toEqual({ majorM: 0, minorM: 0, angleRad: 0 });
  });
});

describe("distances and boxes", () => {
  it("measures to the piece, not to its line", () => {
    expect(distanceToPiece([1, 1], [0, 0, 2, 0])).toBe(1);
    expect(distanceToPiece([5, 4], [0, 0, 2, 0])).toBe(5);
    expect(distanceToPiece([3, 4], [0, 0, 0, 0])).toBe(5);
  });

  it("knows what lies in a hull", () => {
    const hull = cluster("c").hull_m;
    expect(hullContains(hull, [5.5, 5.9])).toBe(true);
    expect(hullContains(hull, [6.1, 5.5])).toBe(false);
    expect(hullContains([[0, 0], [1, 1]], [0.5, 0.5])).toBe(false);
  });

  it("knows the edges, the area and the inside of a ring", () => {
    const box = chain("c");
    expect(edgesOf(box)).toHaveLength(4);
    expect(edgesOf(box).at(-1)).toEqual([7, 5, 5, 5]);
    expect(edgesOf({ ...box, closed: false })).toHaveLength(3);
    expect(areaOf(box.vertices_m)).toBe(4);
    const hook: [number, number][] = [[0, 0], [4, 0], [4, 4], [3, 4], [3, 1], [0, 1]];
    expect(areaOf(hook)).toBe(7);
    expect(ringContains(hook, [3.5, 3])).toBe(true);
    expect(ringContains(hook, [1, 3])).toBe(false);
  });

  it("bounds segments and clusters together", () => {
    expect(boxAround([segment("w")], [cluster("c")])).toEqual([2, 1, 6, 6]);
    expect(boxAround([], [])).toBeNull();
  });

  it("widens a box about its middle", () => {
    expect(widened([0, 0, 10, 2], { leastM: 6, share: 0.2 })).toEqual([-1, -2, 11, 4]);
    expect(shareOf([0, 0, 20, 10], [0, 0, 10, 8])).toBe(0.8);
  });
});
