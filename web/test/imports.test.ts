import { describe, expect, it } from "vitest";
import { importInWords, priorOf, reportInWords } from "../src/imports";
import type { Import, ImportReport } from "../src/wire";

const REPORT: ImportReport = {
  image: "floor.pgm", columns: 1200, rows: 800, resolution_m: 0.05, origin_m: [-1.5, 2.25], yaw_rad: 0, mode: "trinary", trust: 0.5,
  occupied_thresh: 0.65, free_thresh: 0.196, negate: false, occupied: 10, free: 20, unknown: 30, tiles: 7, bounds: null, warnings: [],
};
const made = (report: ImportReport | null): Import => ({ id: "a", revision: 9, at: "2026-01-01T00:00:00Z", author: "t", digest: "", report });
const words = (report: ImportReport): string => reportInWords(report).map((line) => line.join(": ")).join("\n");

describe("an import", () => {
  it("is the prior if it is the newest and no removal", () => {
    expect(priorOf(null)).toBeNull();
    expect(priorOf([])).toBeNull();
    expect(priorOf([made(null), made(REPORT)])).toBeNull();
    expect(priorOf([made(REPORT), made(null)])?.report).toBe(REPORT);
  });

  it("is told in words", () => {
    expect(words(REPORT)).toContain("60.0 m × 40.0 m in all");
    expect(words(REPORT)).toContain("x -1.50 m, y 2.25 m\n");
    expect(words(REPORT)).toContain("occupied from a darkness of 0.65, free up to 0.196");
    expect(words({ ...REPORT, yaw_rad: Math.PI / 6 })).toContain("turned by 30.0°");
    expect(words({ ...REPORT, negate: true })).toContain("brightness");
    expect(words({ ...REPORT, mode: "raw" })).toContain("occupancy in per cent");
    expect(words({ ...REPORT, occupied_thresh: null, free_thresh: null, negate: null })).toContain("not told");
    expect(importInWords(made(REPORT))).toBe("floor.pgm: 7 tiles, trust 0.5");
    expect(importInWords(made(null))).toBe("Prior taken away");
  });
});
