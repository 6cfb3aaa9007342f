// What the model card knows: who edited and published the a-priori model, and what is wrong with its draft. Pure.

import type { GdbEntry, GdbFinding } from "./wire";
import { count, counted, instant } from "./words";

export interface DraftState {
  open: boolean;
  /** Newest first; null until they are known. */
  entries: readonly GdbEntry[] | null;
  /** What is wrong with the draft of this version; null until it is known. */
  findings: { draft: number; library: number; list: readonly GdbFinding[] } | null;
  /** What the card waits for, in words. */
  busy: string | null;
  problem: string | null;
  /** What was done last, in words. */
  done: string | null;
}

/** Before the card is opened. */
export const NO_DRAFT: DraftState = { open: false, entries: null, findings: null, busy: null, problem: null, done: null };

/** How far publishing the draft has come. */
export type Readiness = "unknown" | "no-model" | "published" | "has-errors" | "ready";

/** Whether there is something to publish. */
export function readiness({ entries, findings }: DraftState): Readiness {
  if (entries === null || findings === null) return "unknown";
  const newest = entries.at(0);
  if (newest === undefined) return "no-model";
  const { draft, library } = findings;
  if (newest.kind === "publication" && newest.draft === draft && newest.library === library) return "published";
  return findings.list.some(({ severity }) => severity === "error") ? "has-errors" : "ready";
}

/** The same for people. */
export const READINESS_WORDS: Readonly<Record<Readiness, string>> = {
  unknown: "Asking for the model …",
  "no-model": "This level has no model yet.",
  published: "Robots have the draft as it is.",
  "has-errors": "The draft has errors, so it cannot be published.",
  ready: "The draft is another than what robots have.",
};

/** An entry in one line. */
export function entryInWords({ kind, draft, put, removed, comment }: GdbEntry): string {
  const what = kind === "publication" ? `Published draft #${count(draft)}` : `${counted(put, "object")} put, ${count(removed)} removed`;
  return comment === "" ? what : `${what}: ${comment}`;
}

/** Whose it was, and when. */
export function entryProvenance({ revision, at, author }: GdbEntry): string {
  return `#${count(revision)} · ${instant(at)} · by token ${author}`;
}

/** Whether a finding tells a place of the level, and not of an object's own. */
export function placeOf({ at_m: at, other }: GdbFinding): readonly [number, number] | null {
  return at == null || other == null ? null : [at[0], at[1]];
}
