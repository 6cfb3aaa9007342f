import { describe, expect, it } from "vitest";
import { doubtsInWords, NO_FILES, sendingOf, toldInWords, type FileTold } from "../src/model_files";

describe("a model's file", () => {
  it("is sent as what its name says, and a map in a zip", () => {
    const types = ["a.building.yaml", "a.DXF", "a.glb", "a.json", "a.jsonfg", "a.zip"].map((name) => sendingOf([name], NO_FILES)?.mediaType);
    expect(types).toEqual(["application/yaml", "image/vnd.dxf", "model/gltf-binary", "application/fg+json", "application/fg+json", "application/zip"]);
    const map = sendingOf(["map.yaml", "map.pgm"], NO_FILES);
    expect(map).toEqual({ mediaType: "application/zip", zipped: true, query: { into: "gdb" } });
    expect(sendingOf(["map.zip"], NO_FILES)?.zipped).toBe(false);
    for (const names of [[], ["a.txt"], ["a.dxf", "b.dxf"], ["map.yaml", "a.pgm", "b.pgm"]]) expect(sendingOf(names, NO_FILES)).toBeNull();
  });

  it("is read as it is asked for", () => {
    expect(sendingOf(["hotel.building.yaml"], { level: "L2", unit: "0.01" })?.query).toEqual({ building_level: "L2" });
    expect(sendingOf(["a.dxf"], { level: "L2", unit: "0.01" })?.query).toEqual({ unit_m: "0.01" });
    expect(sendingOf(["a.dxf"], { level: "", unit: "" })?.query).toEqual({});
  });

  it("is told in words before it is taken in", () => {
    const preview = { draft: 1, library: 0, new: 3, changed: 0, removed: 1, findings: [] };
    const model = {
      report: {
        format: "dxf", kinds: [{ kind: "wall", count: 2 }, { kind: "furniture", count: 1 }], instances: 1, prototypes: ["chair"], scale_m: 0.01,
        left_out: [{ what: "TEXT", count: 1, why: "no solid" }], warnings: ["one is doubtful"], bounds: { min_x_m: 0, min_y_m: 0, max_x_m: 4, max_y_m: 2.5 },
      },
      preview,
    } as unknown as FileTold;
    const words = toldInWords(model).map((line) => line.join(": "));
    expect(words).toContain("Objects: 2 wall, 1 furniture");
    expect(words).toContain("Size: 4.0 m × 2.5 m");
    expect(words).toContain("Draft: 3 new, 0 changed, 1 removed");
    expect(doubtsInWords(model)).toEqual(["left out: 1 TEXT: no solid", "one is doubtful"]);
    const building = {
      report: { building: "office", building_level: "L1", building_levels: ["L1"], walls: 33, doorways: 3, floors: 4, instances: 0, scale_m: 1, warnings: [] },
    } as unknown as FileTold;
    expect(toldInWords(building)[1]).toEqual(["Objects", "33 walls, 3 doorways, 4 floors, 0 instances"]);
    expect(doubtsInWords(building)).toEqual([]);
  });
});
