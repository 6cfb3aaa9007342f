// A stand-in for the a-priori model of a level: a room with a doorway, and a table of which the legs or the top are
// cut, as the height may be.

/** @typedef {import("../../src/wire").GdbPlan} GdbPlan */
/** @typedef {import("../../src/wire").LandmarkTable} LandmarkTable */
/** @typedef {import("../../src/wire").GdbEntryPage} GdbEntryPage */
/** @typedef {import("../../src/wire").GdbFindings} GdbFindings */
/** @typedef {import("../../src/wire").GdbCollection} GdbCollection */
/** @typedef {import("../../src/wire").GdbEdit} GdbEdit */
/** @typedef {import("../../src/wire").GdbObject} GdbObject */

/** @param {[number, number][]} corners @param {number} object */
const ring = (corners, object) => corners.map((at_m) => ({ at_m, object }));

/** A rectangle, clockwise. @param {number} x @param {number} y @param {number} wide @param {number} high @returns {[number, number][]} */
const box = (x, y, wide, high) => [[x, y], [x, y + high], [x + wide, y + high], [x + wide, y]];

const WALL = "019aa000-0000-7000-8000-000000000001";
const TABLE = "019aa000-0000-7000-8000-000000000002";
const DOOR = "019aa000-0000-7000-8000-000000000003";
/** Height of the top of the table. */
const TOP_M = 0.7;

/** @param {{ nowMs: () => number }} options */
export function createMockModel({ nowMs }) {
  /** @type {GdbEntryPage["entries"]} */
  const entries = [];
  /** What was drawn on the page. @type {Map<string, GdbObject>} */
  const objects = new Map();
  /** The draft: the newest edit. */
  const draft = () => entries.find(({ kind }) => kind === "edit")?.revision ?? 0;

  return {
    /** Somebody edits or publishes. @param {"edit" | "publication"} kind */
    enter(kind) {
      const revision = 2000 + entries.length;
      const made = {
        id: `entry-${revision}`, revision, kind, draft: kind === "edit" ? revision : draft(), library: 0, at: new Date(nowMs()).toISOString(), author: "mock", comment: "", put: 3, removed: 0,
      };
      entries.unshift(made);
      return made;
    },
    /** @returns {GdbCollection} */
    collection: () => ({ type: "FeatureCollection", revision: draft(), library: 0, features: [...objects].map(([id, properties]) => ({ id, properties })) }),
    /** Null if it is another draft by now. @param {string} tag @param {GdbEdit} edit */
    edit(tag, edit) {
      if (tag !== `"${draft()}.0"`) return null;
      for (const { id, properties } of edit.put) objects.set(id, properties);
      for (const id of edit.remove) objects.delete(id);
      const entry = this.enter("edit");
      return { draft: entry.draft, library: 0, entry };
    },
    /** What is wrong with the draft. @type {GdbFindings["findings"]} */
    wrong: [],
    /** @returns {GdbFindings} */
    findings() {
      return { draft: draft(), library: 0, findings: this.wrong };
    },
    /** Null if it is another draft by now. @param {string} tag */
    publish(tag) {
      return tag === `"${draft()}.0"` ? { draft: draft(), library: 0, entry: this.enter("publication") } : null;
    },
    /** @returns {GdbEntryPage} */
    entries: () => ({ entries, next: null }),
    /** Null if nothing is published. @param {number} heightM @param {string} state @returns {GdbPlan | null} */
    plan(heightM, state) {
      const isThere = state === "draft" ? entries.length > 0 : entries.some(({ kind }) => kind === "publication");
      if (!isThere) return null;
      const legs = [box(30, 2, 0.1, 0.1), box(31.9, 2, 0.1, 0.1), box(30, 2.9, 0.1, 0.1), box(31.9, 2.9, 0.1, 0.1)];
      const table = heightM < TOP_M ? legs : [box(30, 2, 2, 1)];
      return {
        height_m: heightM, draft: 2000, library: 0,
        objects: [
          { id: WALL, kind: "wall", tolerance_m: 0.02, trust: 0.9 },
          { id: TABLE, kind: "furniture", tolerance_m: 0.05, trust: 0.5 },
        ],
        outlines: [ring([...box(26, 0, 8, 5)].reverse(), 0), ring(box(25.8, -0.2, 8.4, 5.4), 0), ...table.map((leg) => ring(leg, 1))],
        sheets: [ring([[28, 0], [28, 1.5]], 0)],
        openings: [{ doorway: DOOR, width_m: 0.9, sides: [{ wall: WALL, from_m: [29, 0], to_m: [29.9, 0] }] }],
      };
    },
    /** @param {number} heightM @returns {LandmarkTable} */
    landmarks(heightM) {
      const isThere = entries.some(({ kind }) => kind === "publication");
      /** @type {LandmarkTable["landmarks"]} */
      const landmarks = [
        { id: "corner", kind: "concave_corner", source: "gdb", at_m: [26, 0], heading_rad: Math.PI / 4, covariance: [[4e-4, 0, 0], [0, 4e-4, 0], [0, 0, 1e-4]], extent: Math.PI / 2, objects: [WALL] },
        { id: "end", kind: "wall_end", source: "gdb", at_m: [28, 1.5], heading_rad: Math.PI / 2, covariance: [[4e-4, 0, 0], [0, 4e-4, 0], [0, 0, 1e-4]], extent: 0.1, objects: [WALL] },
        { id: "door", kind: "doorway", source: "gdb", at_m: [29.45, 0], heading_rad: Math.PI / 2, covariance: [[4e-4, 0, 0], [0, 4e-4, 0], [0, 0, 1e-4]], extent: 0.9, objects: [DOOR] },
      ];
      /** @type {LandmarkTable["landmarks"]} */
      const learned = [
        { id: "learned", kind: "wall_end", source: "learned", at_m: [31, 2.5], heading_rad: 0, covariance: [[4e-4, 0, 0], [0, 4e-4, 0], [0, 0, 1e-4]], extent: 0, objects: ["a-0"], support: { looks: 4, robots: ["anna"] } },
      ];
      return { revision: 2000, publication: isThere ? 2001 : 0, height_m: heightM, landmarks: isThere ? [...landmarks, ...learned] : learned, removed: [] };
    },
  };
}
