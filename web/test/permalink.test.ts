import { describe, expect, it } from "vitest";
import { DEFAULT_LAYERS } from "../src/layers";
import { formatPermalink, parsePermalink, takeToken, type Permalink } from "../src/permalink";
import { EVIDENCE } from "../src/pyramid";
import { NO_LINK } from "./samples";

describe("a permalink", () => {
  it("says again what was put in", () => {
    const link: Permalink = {
      place: { site: "plant-7", level: "ground" },
      view: { kind: "at", xLevelM: -12.34, yLevelM: 5.6, resolution: 0.05 },
      layers: { ...DEFAULT_LAYERS, raster: { on: true, opacity: 0.6 }, clusters: { on: false, opacity: 1 } },
      evidence: "sonar",
    };
    expect(parsePermalink(formatPermalink(link))).toEqual(link);
    expect(formatPermalink(link)).toBe(
      "#site=plant-7&level=ground&x=-12.34&y=5.60&resolution=0.05&layers=raster:60,model,chains,segments,robots&evidence=sonar",
    );
  });

  it("names no part of a level that is shown whole", () => {
    expect(formatPermalink({ ...NO_LINK, place: { site: "a", level: "b" } })).toBe(
      "#site=a&level=b&layers=raster,model,clusters,chains,segments,robots",
    );
  });

  it("of nothing is what the page shows by itself", () => {
    expect(parsePermalink("")).toEqual(NO_LINK);
    expect(parsePermalink("#")).toEqual(NO_LINK);
  });

  it.each([
    ["#site=a", "a level is missing"],
    ["#x=1&y=2", "a resolution is missing"],
    ["#x=1&y=two&resolution=1", "y is no number"],
    ["#x=1&y=2&resolution=-1", "the resolution is negative"],
    ["#x=1&y=2&resolution=Infinity", "the resolution is infinite"],
    ["#x=&y=2&resolution=1", "x is empty"],
    ["#evidence=smell", "there is no such layer"],
    ["#%E0%A4%A", "it is no text"],
  ])("takes %s as if that were not there: %s", (hash) => {
    expect(parsePermalink(hash)).toEqual(NO_LINK);
  });

  it("knows no layers but its own, and keeps opacity within bounds", () => {
    const { layers } = parsePermalink("#layers=segments:250,raster:x,nonsense,grid:-5");
    expect(layers.segments).toEqual({ on: true, opacity: 1 });
    expect(layers.raster).toEqual({ on: true, opacity: 1 });
    expect(layers.grid).toEqual({ on: true, opacity: 0 });
    expect(layers.robots.on).toBe(false);
    expect(Object.keys(layers).sort()).toEqual(Object.keys(DEFAULT_LAYERS).sort());
  });

  it.each(EVIDENCE)("remembers that %s is shown", (evidence) => {
    const link: Permalink = { ...NO_LINK, evidence };
    expect(parsePermalink(formatPermalink(link))).toEqual(link);
  });

  it("can show no layer at all", () => {
    const none = parsePermalink("#layers=").layers;
    expect(Object.values(none).some((layer) => layer.on)).toBe(false);
  });
});

describe("a token in the address", () => {
  it("is taken out, and the rest stays", () => {
    expect(takeToken("#site=a&token=mf_1.x%2By&level=b")).toEqual({ token: "mf_1.x+y", rest: "#site=a&level=b" });
    expect(takeToken("#token=abc")).toEqual({ token: "abc", rest: "" });
  });

  it("may be missing", () => {
    expect(takeToken("#site=a")).toEqual({ token: null, rest: "#site=a" });
    expect(takeToken("#token=")).toEqual({ token: null, rest: "" });
    expect(takeToken("")).toEqual({ token: null, rest: "" });
  });
});
