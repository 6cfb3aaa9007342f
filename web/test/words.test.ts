import { describe, expect, it } from "vitest";
import { gridStep, roundLengthAbove, roundLengthBelow, scaleBar } from "../src/scale";
import { ago, coordinate, count, counted, degrees, fixed, instant, lengthInWords, listed } from "../src/words";

describe("numbers", () => {
  it("have their thousands apart", () => {
    expect([0, 999, 1000, 1234567].map(count)).toEqual(["0", "999", "1\u202f000", "1\u202f234\u202f567"]);
    expect([counted(1, "segment"), counted(2, "segment"), counted(0, "piece")]).toEqual([
      "1 segment",
      "2 segments",
      "0 pieces",
    ]);
  });

  it("have a true minus sign, and no negative zero", () => {
    expect(fixed(-1.25, 1)).toBe("\u22121.3");
    expect(fixed(-0.001, 2)).toBe("0.00");
    expect(coordinate(-12.345)).toBe("\u221212.35 m");
  });

  it("bear the unit that suits them", () => {
    expect([1500, 10, 1, 0.25, 0.0123, 0.002].map(lengthInWords)).toEqual([
      "1.5 km",
      "10 m",
      "1 m",
      "25 cm",
      "1.23 cm",
      "2 mm",
    ]);
    expect(degrees(Math.PI / 2)).toBe("90.0°");
  });
});

describe("times", () => {
  it.each([
    [-5_000, "just now"],
    [4_999, "just now"],
    [5_000, "5 s ago"],
    [59_999, "59 s ago"],
    [60_000, "1 min ago"],
    [3_600_000, "1 h ago"],
    [47 * 3_600_000, "47 h ago"],
    [48 * 3_600_000, "2 days ago"],
  ])("%i ms are %s", (passedMs, words) => {
    expect(ago(0, passedMs)).toBe(words);
  });

  it("are shown in the reader's time zone", () => {
    const local = new Date(2026, 10, 2, 3, 4, 5);
    expect(instant(local.toISOString())).toBe("2026-11-02 03:04:05");
    expect(instant("yesterday")).toBe("yesterday");
  });
});

describe("names", () => {
  it("are listed as people do", () => {
    expect([listed([]), listed(["a"]), listed(["a", "b"]), listed(["a", "b", "c"])]).toEqual([
      "",
      "a",
      "a and b",
      "a, b and c",
    ]);
  });
});

describe("round lengths", () => {
  it("are 1, 2 or 5 times a power of ten", () => {
    expect([0.04, 0.05, 1, 1.99, 2, 4.9, 7, 123].map(roundLengthBelow).map((x) => Number(x.toPrecision(6)))).toEqual([
      0.02, 0.05, 1, 1, 2, 2, 5, 100,
    ]);
    expect([0.04, 0.05, 1, 1.01, 2, 5.1, 7, 123].map(roundLengthAbove).map((x) => Number(x.toPrecision(6)))).toEqual([
      0.05, 0.05, 1, 2, 2, 10, 10, 200,
    ]);
  });

  it("make a scale bar that is as long as it says and not too long", () => {
    for (let resolution = 0.001; resolution < 20; resolution *= 1.13) {
      const bar = scaleBar(resolution, 130);
      expect(bar.lengthPx).toBeLessThanOrEqual(130 + 1e-6);
      expect(bar.lengthPx).toBeGreaterThan(130 / 2.51);
      expect(bar.lengthPx * resolution).toBeCloseTo(bar.lengthM, 9);
    }
  });

  it("keep grid lines apart", () => {
    for (let resolution = 0.001; resolution < 20; resolution *= 1.13) {
      const px = gridStep(resolution, 70) / resolution;
      expect(px).toBeGreaterThanOrEqual(70 - 1e-6);
      expect(px).toBeLessThan(70 * 2.51);
    }
  });
});
