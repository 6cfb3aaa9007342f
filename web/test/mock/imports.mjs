// A stand-in for the imports of a level: unpacks what the page sends, and tells of it what the page shows.

import { inflateRawSync } from "node:zlib";

/** The files of a zip, by name, as its directory lists them. @param {Buffer} zip */
export function unzip(zip) {
  const end = zip.lastIndexOf(Buffer.from("PK\x05\x06", "latin1"));
  if (end < 0) throw new Error("no zip");
  /** @type {Map<string, Buffer>} */
  const files = new Map();
  let at = zip.readUInt32LE(end + 16);
  for (let left = zip.readUInt16LE(end + 10); left > 0; left--) {
    const [packed, title] = [zip.readUInt32LE(at + 20), zip.readUInt16LE(at + 28)];
    const local = zip.readUInt32LE(at + 42);
    const name = zip.toString("utf8", at + 46, at + 46 + title);
    const content = local + 30 + zip.readUInt16LE(local + 26) + zip.readUInt16LE(local + 28);
    files.set(name, inflateRawSync(zip.subarray(content, content + packed)));
    at += 46 + title;
  }
  return files;
}

/** @param {{ nowMs: () => number }} options */
export function createMockImports({ nowMs }) {
  /** @type {Import[]} */
  const imports = [];
  let revision = 1000;

  /** @param {ImportReport | null} report @returns {Import} */
  const enter = (report) => {
    revision += 1;
    const made = { id: `import-${revision}`, revision, at: new Date(nowMs()).toISOString(), author: "mock", digest: "", report };
    imports.unshift(made);
    return made;
  };

  return {
    /** Newest first. */
    imports,
    /** What is in a map, or in words why it cannot be taken. @param {Buffer} zip @param {number} trust @returns {ImportReport | string} */
    read(zip, trust) {
      const files = unzip(zip);
      const yaml = [...files].find(([name]) => name.endsWith(".yaml"));
      if (yaml === undefined) return "one file of it should end in .yaml";
      const text = yaml[1].toString("utf8");
      const image = /^image: (.*)$/m.exec(text)?.[1] ?? "";
      const resolution = /^resolution: ([0-9.]+)$/m.exec(text)?.[1];
      if (resolution === undefined) return "line 2, column 13 of the description: `fine` is no number";
      const size = /^P5\n(\d+) (\d+)\n/.exec(files.get(image)?.toString("latin1") ?? "");
      if (size === null) return `the description names the image \`${image}\`, which is not there`;
      const [columns, rows] = [Number(size[1]), Number(size[2])];
      return {
        image, columns, rows, resolution_m: Number(resolution), origin_m: [-1.5, 2.25], yaw_rad: 0, mode: "trinary", trust,
        occupied_thresh: 0.65, free_thresh: 0.196, negate: false, occupied: 1, free: columns * rows - 1, unknown: 0, tiles: 1,
        bounds: null, warnings: ["yaw is 0"],
      };
    },
    /** @param {ImportReport} report */
    make: (report) => enter(report),
    /** Null if there is nothing to take away. */
    remove: () => (imports[0]?.report == null ? null : enter(null)),
  };
}

/** @typedef {import("../../src/wire").Import} Import */
/** @typedef {import("../../src/wire").ImportReport} ImportReport */
