// What the page knows of the a-priori model (GDB): its plan at one height, and its landmarks. Pure.

import { union, type Box } from "./geometry";
import type { GdbPlan, Landmark, LandmarkKind, LandmarkTable, PlanCorner } from "./wire";

/** Which model is shown: what robots have, or what is being edited. */
export const MODEL_STATES = ["published", "draft"] as const;

export type ModelStateName = (typeof MODEL_STATES)[number];

/** What is asked for. */
export interface ModelView {
  /** Height of the sensor above the floor, metres. */
  heightM: number;
  state: ModelStateName;
}

export interface ModelState {
  view: ModelView;
  /** The newest entry about the model that was read; 0 if there is none, null before anything was asked for. */
  revision: number | null;
  /** What the view was when it was read. */
  readAs: ModelView | null;
  /** Null if there is none. */
  plan: GdbPlan | null;
  /** Of what is published, and those that robots taught. */
  landmarks: ReadonlyMap<string, Landmark>;
  /** The revision of the level that they were told at; null before. */
  told: number | null;
  problem: string | null;
}

/** Before anything was asked for: the height of a table's legs. */
export const NO_MODEL: ModelState = {
  view: { heightM: 0.3, state: "published" },
  revision: null,
  readAs: null,
  plan: null,
  landmarks: new Map(),
  told: null,
  problem: null,
};

/** Heights that can be asked for, metres. */
export const HEIGHTS_M = { min: 0, max: 20, step: 0.05 } as const;

/** Whether what was read is what is asked for, the newest entry being `revision`. */
export function isRead(model: ModelState, revision: number): boolean {
  return model.revision === revision && model.readAs === model.view;
}

/** Landmarks after a table of what changed since they were told; whole, if nothing was. */
export function withTable(known: ReadonlyMap<string, Landmark>, table: LandmarkTable): Pick<ModelState, "landmarks" | "told"> {
  const landmarks = new Map(known);
  for (const id of table.removed) landmarks.delete(id);
  for (const landmark of table.landmarks) landmarks.set(landmark.id, landmark);
  return { landmarks, told: table.revision };
}

/** All corners of a plan. */
export function cornersOf({ outlines, sheets }: GdbPlan): PlanCorner[] {
  return [...outlines, ...sheets].flat();
}

/** The least box that holds a plan; null if nothing of the model is at its height. */
export function boundsOfPlan(plan: GdbPlan | null): Box | null {
  let box: Box | null = null;
  for (const { at_m: [x, y] } of plan === null ? [] : cornersOf(plan)) {
    box = union(box, [x, y, x, y]);
  }
  return box;
}

/** Kinds of landmarks for people. */
export const LANDMARK_WORDS: Readonly<Record<LandmarkKind, string>> = {
  convex_corner: "corner that juts out",
  concave_corner: "corner of a room",
  wall_end: "free end of a wall",
  doorway: "doorway",
};
