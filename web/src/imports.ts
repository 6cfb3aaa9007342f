// What the prior card knows, and imports in words. Pure.

import type { Import, ImportReport } from "./wire";
import { count, counted, degrees, instant, lengthInWords } from "./words";

export interface ImportsState {
  open: boolean;
  /** Newest first; null until they are known. */
  imports: readonly Import[] | null;
  /** How much the next one is trusted, 0 to 1. */
  trust: number;
  /** What the server read in the files that are chosen. */
  told: ImportReport | null;
  /** What the card waits for, in words. */
  busy: string | null;
  problem: string | null;
  /** What was done last, in words. */
  done: string | null;
}

/** What the server takes if nobody says. */
export const TRUST = 0.5;

/** Before the card is opened. */
export const NO_IMPORTS: ImportsState = {
  open: false,
  imports: null,
  trust: TRUST,
  told: null,
  busy: null,
  problem: null,
  done: null,
};

/** The import that is the prior; null if there is none, or none is known of. */
export function priorOf(imports: readonly Import[] | null): Import | null {
  const newest = imports?.at(0);
  return newest?.report == null ? null : newest;
}

/** What the server read, as names and values. */
export function reportInWords(report: ImportReport): [string, string][] {
  const [x = 0, y = 0] = report.origin_m;
  const [across, up] = [report.columns * report.resolution_m, report.rows * report.resolution_m];
  const turned = report.yaw_rad === 0 ? "" : `, turned by ${degrees(report.yaw_rad)}`;
  return [
    ["Image", `${report.image}, ${count(report.columns)} × ${count(report.rows)} pixels`],
    ["Resolution", `${lengthInWords(report.resolution_m)} a pixel, ${across.toFixed(1)} m × ${up.toFixed(1)} m in all`],
    ["Origin", `x ${x.toFixed(2)} m, y ${y.toFixed(2)} m${turned}`],
    ["Mode", report.mode],
    ["Thresholds", thresholds(report)],
    ["Pixels", `${count(report.occupied)} occupied, ${count(report.free)} free, ${count(report.unknown)} unknown`],
    ["Trust", String(report.trust)],
  ];
}

/** Which greys are what, as the description says. */
function thresholds({ occupied_thresh, free_thresh, negate, mode }: ImportReport): string {
  if (mode === "raw") return "none: the grey is the occupancy in per cent";
  if (occupied_thresh == null || free_thresh == null) return "not told";
  const dark = negate === true ? "brightness" : "darkness";
  return `occupied from a ${dark} of ${occupied_thresh}, free up to ${free_thresh}`;
}

/** An import in one line. */
export function importInWords({ report }: Import): string {
  return report == null
    ? "Prior taken away"
    : `${report.image}: ${counted(report.tiles, "tile")}, trust ${report.trust}`;
}

/** Whose it was, and when. */
export function provenanceInWords({ revision, at, author }: Import): string {
  return `#${count(revision)} · ${instant(at)} · by token ${author}`;
}
