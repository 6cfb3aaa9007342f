// What the log panel knows, which contributions it means, and reverts in words. Pure.

import type { ChangeCounts, ContributionEntry, NewRevert, Revert, RevertPreview, RobotShare } from "./wire";
import { count, counted, instant, listed } from "./words";

/** What was asked to be tried out: a revert of what is meant, or the undoing of a revert. */
export type Trial = { kind: "revert" } | { kind: "undo"; revert: string };

export interface LogState {
  open: boolean;
  /** The robot whose contributions are listed; empty for all. */
  robot: string;
  /** A span of the robot's time as the browser's inputs write it, in the reader's time zone; empty for none. */
  from: string;
  to: string;
  /** Newest first; null until they are known. */
  entries: readonly ContributionEntry[] | null;
  /** Where the next page begins; null on the last. */
  next: string | null;
  /** Contributions that are ticked. */
  ticked: ReadonlySet<string>;
  reason: string;
  preview: { trial: Trial; told: RevertPreview } | null;
  /** What the panel waits for, in words. */
  busy: string | null;
  problem: string | null;
  /** What was done last, in words. */
  done: string | null;
  /** Newest first; null until they are known. */
  reverts: readonly Revert[] | null;
}

const NO_CHANGES: ChangeCounts = { new: 0, changed: 0, removed: 0 };

/** Before the panel is opened. */
export const NO_LOG: LogState = {
  open: false,
  robot: "",
  from: "",
  to: "",
  entries: null,
  next: null,
  ticked: new Set(),
  reason: "",
  preview: null,
  busy: null,
  problem: null,
  done: null,
  reverts: null,
};

/** An instant of an input in the reader's time zone as the server takes it; null if it is none. */
export function instantOf(input: string): string | null {
  const time = new Date(input);
  return input === "" || Number.isNaN(time.getTime()) ? null : time.toISOString();
}

/** Which contributions are meant: those that are ticked, else the robot's within the span; null if none are. */
export function targetsOf(log: LogState): Omit<NewRevert, "reason"> | null {
  if (log.ticked.size > 0) return { contributions: [...log.ticked].sort() };
  if (log.robot === "") return null;
  return { robot: log.robot, from: instantOf(log.from), to: instantOf(log.to) };
}

/** Whether a line is among what is meant, as far as the page can tell. */
export function isMeant(log: LogState, entry: ContributionEntry): boolean {
  if (entry.state === "held") return false;
  if (log.ticked.size > 0) return log.ticked.has(entry.id);
  if (log.robot !== entry.robot) return false;
  const atMs = Date.parse(entry.observed_at);
  const fromMs = Date.parse(instantOf(log.from) ?? "");
  const toMs = Date.parse(instantOf(log.to) ?? "");
  return !(atMs < fromMs) && !(atMs >= toMs);
}

/** What is meant, in words; null if nothing is. */
export function targetsInWords(log: LogState, name: (robot: string) => string): string | null {
  if (log.ticked.size > 0) return counted(log.ticked.size, "ticked contribution");
  if (log.robot === "") return null;
  const [from, to] = [instantOf(log.from), instantOf(log.to)];
  const bounds = [
    from === null ? "" : `from ${instant(from)}`,
    to === null ? "" : `before ${instant(to)}`,
  ].filter((bound) => bound !== "");
  const seen = bounds.length === 0 ? "" : `, seen ${bounds.join(" and ")}`;
  return `all contributions of ${name(log.robot)}${seen}`;
}

/** What a trial told, as sentences. */
export function previewInWords(
  { trial, told }: { trial: Trial; told: RevertPreview },
  name: (robot: string) => string,
): string[] {
  const whose = whoseInWords(told.robots, name);
  if (told.moved === 0) {
    return [
      trial.kind === "undo"
        ? "Nothing would come back: other reverts keep out all that this one took out, or it is undone already."
        : "Nothing would change: none of these contributions is in the map.",
    ];
  }
  const what =
    trial.kind === "undo"
      ? `Puts ${counted(told.moved, "contribution")}${whose} back into the map.`
      : `Takes ${counted(told.moved, "contribution")}${whose} out of the map.`;
  const rest = told.contributions - told.moved;
  const others =
    rest === 0
      ? []
      : [
          trial.kind === "undo"
            ? `${count(rest)} more stay out, because another revert covers them.`
            : `${count(rest)} more are out already.`,
        ];
  const changes = [
    changesInWords(told.segments, "segment"),
    changesInWords(told.clusters, "cluster"),
    changesInWords(told.chains ?? NO_CHANGES, "chain"),
    changesInWords(told.tiles, "tile"),
  ].filter((change) => change !== "");
  return [what, ...others, ...(changes.length === 0 ? ["The map would look the same."] : changes)];
}

/** "Segments: 3 new, 40 changed, 12 gone."; empty if none. */
function changesInWords({ new: fresh, changed, removed }: ChangeCounts, one: string): string {
  const parts = [
    fresh > 0 ? `${count(fresh)} new` : "",
    changed > 0 ? `${count(changed)} changed` : "",
    removed > 0 ? `${count(removed)} gone` : "",
  ].filter((part) => part !== "");
  const kind = `${one[0]?.toUpperCase() ?? ""}${one.slice(1)}s`;
  return parts.length === 0 ? "" : `${kind}: ${parts.join(", ")}.`;
}

function whoseInWords(shares: readonly RobotShare[], name: (robot: string) => string): string {
  return shares.length === 0 ? "" : ` of ${listed(shares.map(({ robot }) => name(robot)))}`;
}

/** What a revert took out, in words. */
export function revertInWords(revert: Revert, name: (robot: string) => string): string {
  const all = `${counted(revert.contributions, "contribution")}${whoseInWords(revert.robots, name)}`;
  const bounds = [
    revert.from == null ? "" : `from ${instant(revert.from)}`,
    revert.to == null ? "" : `before ${instant(revert.to)}`,
  ].filter((bound) => bound !== "");
  return bounds.length === 0 ? all : `${all}, seen ${bounds.join(" and ")}`;
}
