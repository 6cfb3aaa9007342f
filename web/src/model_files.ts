// Files of models: how each is sent, and what the server read in one, in words. Pure.

import type { BuildingImport, ModelImport } from "./wire";
import { count, counted } from "./words";

/** What the server answers about a file. */
export type FileTold = BuildingImport | ModelImport;

export interface FilesState {
  open: boolean;
  /** Whether all that the draft has and the file has not goes. */
  replace: boolean;
  /** Of a building with several levels, which one. */
  level: string;
  /** Metres of one unit of a drawing; empty for what it says itself. */
  unit: string;
  /** What the server read in what is chosen. */
  told: FileTold | null;
  busy: string | null;
  problem: string | null;
  done: string | null;
}

/** Before the card is opened. */
export const NO_FILES: FilesState = { open: false, replace: false, level: "", unit: "", told: null, busy: null, problem: null, done: null };

/** How files are sent: by themselves, or a map of several in a zip. */
export interface Sending {
  mediaType: string;
  zipped: boolean;
  query: Readonly<Record<string, string>>;
}

const MAP = { mediaType: "application/zip", query: { into: "gdb" } };
const IMAGE = /\.(pgm|png)$/i;

/** How the chosen files are sent, by the ends of their names; null if they are no model. */
export function sendingOf(names: readonly string[], { level, unit }: Pick<FilesState, "level" | "unit">): Sending | null {
  const [name, second] = names;
  if (name === undefined) return null;
  const ends = (end: RegExp): boolean => end.test(name);
  if (second !== undefined) {
    const isMap = names.length === 2 && names.some((one) => IMAGE.test(one)) && names.some((one) => /\.ya?ml$/i.test(one));
    return isMap ? { ...MAP, zipped: true } : null;
  }
  if (ends(/\.zip$/i)) return { ...MAP, zipped: false };
  if (ends(/\.ya?ml$/i)) return { mediaType: "application/yaml", zipped: false, query: level === "" ? {} : { building_level: level } };
  if (ends(/\.dxf$/i)) return { mediaType: "image/vnd.dxf", zipped: false, query: unit === "" ? {} : { unit_m: unit } };
  if (ends(/\.glb$/i)) return { mediaType: "model/gltf-binary", zipped: false, query: {} };
  if (ends(/\.(json|jsonfg)$/i)) return { mediaType: "application/fg+json", zipped: false, query: {} };
  if (ends(/\.geojson$/i)) return { mediaType: "application/geo+json", zipped: false, query: {} };
  return null;
}

/** What is in a file, as names and values. */
export function toldInWords(told: FileTold): [string, string][] {
  const { report, preview } = told;
  const what: [string, string][] =
    "kinds" in report
      ? [
          ["Objects", report.kinds.map(({ kind, count: many }) => `${count(many)} ${kind}`).join(", ") || "none"],
          ["Instances", `${count(report.instances)} of them, ${counted(report.prototypes.length, "new prototype")}`],
        ]
      : [
          ["Building", `${report.building}, level ${report.building_level} of ${report.building_levels.join(", ")}`],
          ["Objects", `${counted(report.walls, "wall")}, ${counted(report.doorways, "doorway")}, ${counted(report.floors, "floor")}, ${counted(report.instances, "instance")}`],
        ];
  const { bounds } = report;
  if (bounds != null) what.push(["Size", `${(bounds.max_x_m - bounds.min_x_m).toFixed(1)} m × ${(bounds.max_y_m - bounds.min_y_m).toFixed(1)} m`]);
  if (preview != null) {
    what.push(["Draft", `${count(preview.new)} new, ${count(preview.changed)} changed, ${count(preview.removed)} removed`]);
    const errors = preview.findings.filter(({ severity }) => severity === "error").length;
    what.push(["Findings", `${counted(errors, "error")}, ${counted(preview.findings.length - errors, "warning")}`]);
  }
  return what;
}

/** What was left out, and what is doubtful. */
export function doubtsInWords({ report }: FileTold): string[] {
  const left = "left_out" in report ? report.left_out.map(({ count: many, what, why }) => `left out: ${count(many)} ${what}: ${why}`) : [];
  return [...left, ...report.warnings];
}
