// What robots found against the published model, as the card of changes knows it. Pure.

import type { ModelChange, ModelChangeKind, ModelChangeState } from "./wire";
import { ago, counted, lengthInWords, listed } from "./words";

export interface ChangesState {
  open: boolean;
  /** Null until they are known. */
  list: readonly ModelChange[] | null;
  /** The publication that they were held against; 0 if there is none. */
  publication: number;
  /** The change that an answer is on its way for. */
  answering: string | null;
  problem: string | null;
  /** What was done last, in words. */
  done: string | null;
}

/** Before the card is opened. */
export const NO_CHANGES: ChangesState = { open: false, list: null, publication: 0, answering: null, problem: null, done: null };

/** Kinds for people. */
export const KIND_WORDS: Readonly<Record<ModelChangeKind, string>> = { missing: "Missing", opened: "Opened", moved: "Moved", new: "New" };

const ORDER: readonly ModelChangeState[] = ["open", "accepted", "dismissed"];

/** Those that wait for an answer first, then what is in the draft, then what was dismissed. */
export function sorted(list: readonly ModelChange[]): ModelChange[] {
  return [...list].sort((a, b) => ORDER.indexOf(a.state) - ORDER.indexOf(b.state) || a.id.localeCompare(b.id));
}

/** What a change is about. */
export function nameOf({ name, object_kind: kind }: ModelChange): string {
  return name === undefined || name === "" ? (kind ?? "thing") : name;
}

/** A change in one line, without its kind. */
export function changeInWords(change: ModelChange): string {
  const name = nameOf(change);
  switch (change.kind) {
    case "missing":
      return `${name} is not there`;
    case "opened": {
      const width = (change.stretches ?? []).map(({ from_m: a, to_m: b }) => Math.hypot(b[0] - a[0], b[1] - a[1]));
      return `${name} is open over ${lengthInWords(width.reduce((sum, length) => sum + length, 0))}`;
    }
    case "moved": {
      const { distance_m: far, heading_rad: turn } = change.motion ?? { distance_m: 0, heading_rad: 0 };
      const degrees = Math.round((turn * 180) / Math.PI);
      return `${name} stands ${lengthInWords(far)} away${degrees === 0 ? "" : `, turned by ${degrees}°`}`;
    }
    case "new":
      return `a thing of ${lengthInWords(extent(change.hull_m))} that the model does not know`;
  }
}

/** The greatest distance between two corners. */
function extent(hull: readonly (readonly [number, number])[]): number {
  let most = 0;
  for (const a of hull) for (const b of hull) most = Math.max(most, Math.hypot(a[0] - b[0], a[1] - b[1]));
  return most;
}

/** What speaks for a change. */
export function evidenceInWords(change: ModelChange, nowMs: number): string {
  const parts: string[] = [];
  if (change.through_m > 0) parts.push(`seen through over ${lengthInWords(change.through_m)} of ${lengthInWords(change.probed_m)}`);
  if (change.looks > 0) parts.push(`${counted(change.looks, "look")} by ${listed(change.robots)}`);
  if (change.last_seen != null) parts.push(`last ${ago(Date.parse(change.last_seen), nowMs)}`);
  if (change.state === "accepted") parts.push("in the draft, to be published");
  if (change.dismissal != null) parts.push(`dismissed by token ${change.dismissal.author}${change.dismissal.comment === "" ? "" : `: ${change.dismissal.comment}`}`);
  return parts.join(" · ");
}

/** Middle of where a change is; null without a place. */
export function middleOf({ hull_m: hull }: ModelChange): readonly [number, number] | null {
  if (hull.length === 0) return null;
  const [x, y] = hull.reduce<readonly [number, number]>((sum, p) => [sum[0] + p[0], sum[1] + p[1]], [0, 0]);
  return [x / hull.length, y / hull.length];
}

/** How many wait for an answer, in words. */
export function waiting({ list, publication }: ChangesState): string {
  if (list === null) return "Asking what robots found …";
  if (publication === 0) return "Nothing is published to hold the map against.";
  const open = list.filter(({ state }) => state === "open").length;
  return open === 0 ? "Robots found nothing that waits for an answer." : `${counted(open, "change")} ${open === 1 ? "waits" : "wait"} for an answer.`;
}
