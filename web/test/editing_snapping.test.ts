import { describe, expect, it } from "vitest";
import { snap, type SnapOptions } from "../src/editing/snapping";
import type { Point } from "../src/geometry";
import { wall } from "./editing_samples";
import { createRandom } from "./mock/random.mjs";

/** A centimetre per pixel: near is within 10 cm. */
function near(fields: Partial<SnapOptions> = {}): SnapOptions {
  return { resolution: 0.01, withinPx: 10, walls: [wall([0, 0], [4, 0]), wall([4, 0], [4, 3])], from: null, gridM: 0.5, ...fields };
}

function expectAt([x, y]: Point, [wantedX, wantedY]: Point): void {
  expect(x).toBeCloseTo(wantedX, 9);
  expect(y).toBeCloseTo(wantedY, 9);
}

describe("snapping", () => {
  it("takes the end of a wall before all else", () => {
    const { at, kind } = snap([3.95, 0.06], near({ from: [1, 3] }));
    expect(kind).toBe("end");
    expectAt(at, [4, 0]);
  });

  it("takes the foot of the perpendicular from where the line comes", () => {
    const { at, kind } = snap([1.27, 0.05], near({ from: [1.234, 2] }));
    expect(kind).toBe("perpendicular");
    expectAt(at, [1.234, 0]);
  });

  it("takes where a direction of 15 degrees meets a wall", () => {
    // 60 degrees down from (1, 1): the foot lies 1 / tan 60 further.
    const { at, kind } = snap([1.6, 0.03], near({ from: [1, 1] }));
    expect(kind).toBe("crossing");
    expectAt(at, [1 + 1 / Math.tan(Math.PI / 3), 0]);
  });

  it("takes the nearest place on a wall", () => {
    const { at, kind, guide } = snap([2.345, -0.07], near());
    expect(kind).toBe("wall");
    expectAt(at, [2.345, 0]);
    expect(guide).toEqual([0, 0, 4, 0]);
  });

  it("takes directions of 15 degrees, in whole steps of the grid where one is near", () => {
    const from: Point = [10, 10];
    const along = (degrees: number, length: number): Point => [10 + length * Math.cos((degrees * Math.PI) / 180), 10 + length * Math.sin((degrees * Math.PI) / 180)];
    const exact = snap(along(46, 2.03), near({ from }));
    expect(exact.kind).toBe("angle");
    expectAt(exact.at, along(45, 2));
    const between = snap(along(45, 2.25), near({ from }));
    expectAt(between.at, along(45, 2.25));
    // Far from every direction and from the grid, it is free.
    expect(snap(along(52.5, 3.3), near({ from, gridM: null })).kind).toBe("free");
  });

  it("takes directions from the wall that ends where the line begins", () => {
    const slanted = wall([0, 0], [3, 1]);
    const square = Math.atan2(1, 3) + Math.PI / 2;
    const { at, kind } = snap([3 + 2.02 * Math.cos(square), 1 + 2.02 * Math.sin(square)], near({ walls: [slanted], from: [3, 1], gridM: 0.5 }));
    expect(kind).toBe("angle");
    expectAt(at, [3 + 2 * Math.cos(square), 1 + 2 * Math.sin(square)]);
  });

  it("takes the grid, and leaves what is near nothing", () => {
    const { at, kind } = snap([6.06, 7.45], near());
    expect(kind).toBe("grid");
    expectAt(at, [6, 7.5]);
    expect(snap([6.25, 7.25], near()).kind).toBe("free");
  });

  it("never moves a point by more than its reach, and leaves a point at an end where it is", () => {
    const random = createRandom(3);
    for (let n = 0; n < 500; n++) {
      const at: Point = [random() * 6 - 1, random() * 5 - 1];
      const options = near({ from: n % 2 === 0 ? null : [random() * 4, random() * 4] });
      const first = snap(at, options);
      expect(Math.hypot(first.at[0] - at[0], first.at[1] - at[1])).toBeLessThanOrEqual(0.1 + 1e-9);
      const again = snap(first.at, options);
      if (first.kind === "end") expectAt(again.at, first.at);
    }
  });

  it("reaches further for a finger", () => {
    expect(snap([0.15, 0.15], near({ gridM: null })).kind).toBe("free");
    expect(snap([0.15, 0.15], near({ gridM: null, withinPx: 22 })).kind).toBe("end");
  });
});
