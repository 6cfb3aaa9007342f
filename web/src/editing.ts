// What the page knows while an operator edits the draft of the model: the working copy, what is chosen, which tool is at
// hand and what it is doing. Pure.

import type { Point } from "./geometry";
import { redo, undo, unsent, withEdit, withPuts, editOf, type Puts, type WorkingCopy } from "./editing/history";
import { nameOf, type Library, type Objects } from "./editing/objects";
import { CLASH_WORDS, type Clash, type News } from "./editing/rebasing";
import type { Snap } from "./editing/snapping";
import { stillThere } from "./editing/choosing";
import type { GdbEntry, GdbFinding } from "./wire";
import { count, counted, instant, listed } from "./words";

export const TOOLS = ["select", "wall", "doorway", "prototype"] as const;

export type Tool = (typeof TOOLS)[number];

/** What a tool is in the middle of. */
export type Sketch =
  | { kind: "none" }
  /** Over the map, before anything is clicked: where a point would land and what would come to be there. */
  | { kind: "hover"; snap: Snap | null; puts: Puts }
  /** Walls from place to place; the pointer is where the next one would end. */
  | { kind: "walls"; points: readonly Point[]; snap: Snap | null }
  /** Objects, or an end of walls, are being dragged. */
  | { kind: "drag"; from: Point; end: Point | null; snap: Snap | null; puts: Puts }
  | { kind: "box"; from: Point; to: Point };

/** How new things are made. */
export interface Making {
  thicknessM: number;
  wallHeightM: number;
  doorWidthM: number;
  doorHeightM: number;
  /** Null for none. */
  gridM: number | null;
  prototype: string | null;
  yawRad: number;
}

export interface EditingState {
  /** Whether the draft is being edited. */
  on: boolean;
  /** Null until the draft is there. */
  copy: WorkingCopy | null;
  library: Library;
  chosen: ReadonlySet<string>;
  tool: Tool;
  /** Whether each click adds to what is chosen, for those without a shift key. */
  several: boolean;
  sketch: Sketch;
  making: Making;
  /** Unsent edits that no longer fit. */
  clashes: readonly Clash[];
  /** What others did to the draft meanwhile, in words. */
  news: readonly string[];
  /** What would be wrong with the model as it is now; null until it is known. */
  findings: readonly GdbFinding[] | null;
  comment: string;
  /** Whether the browser keeps what is not sent. */
  isKept: boolean;
  busy: string | null;
  problem: string | null;
  done: string | null;
  /** Whether the third dimension is shown. */
  is3d: boolean;
}

export const NO_EDITING: EditingState = {
  on: false,
  copy: null,
  library: new Map(),
  chosen: new Set(),
  tool: "select",
  several: false,
  sketch: { kind: "none" },
  making: { thicknessM: 0.1, wallHeightM: 2.5, doorWidthM: 0.9, doorHeightM: 2.1, gridM: 0.1, prototype: null, yawRad: 0 },
  clashes: [],
  news: [],
  findings: null,
  comment: "",
  isKept: true,
  busy: null,
  problem: null,
  done: null,
  is3d: false,
};

const NOTHING: Sketch = { kind: "none" };

/** The objects as the operator sees them at this moment, with what is being dragged where it would be. */
export function shownObjects({ copy, sketch }: EditingState): Objects {
  if (copy === null) return new Map();
  return sketch.kind === "drag" || sketch.kind === "hover" ? withPuts(copy.now, sketch.puts) : copy.now;
}

/** With an edit made, and what is chosen after it. */
export function edited(editing: EditingState, label: string, puts: Puts, chosen?: Iterable<string>): Partial<EditingState> {
  const { copy } = editing;
  const edit = copy === null ? null : editOf(label, copy.now, puts);
  const rest = { sketch: NOTHING, done: null, problem: null };
  if (copy === null || edit === null) return rest;
  return withCopy(editing, withEdit(copy, edit), { ...rest, ...(chosen === undefined ? {} : { chosen: new Set(chosen) }) });
}

/** With the last edit taken back, or the last that was taken back made again. */
export function stepped(editing: EditingState, step: "undo" | "redo"): Partial<EditingState> {
  const { copy } = editing;
  if (copy === null) return {};
  return withCopy(editing, step === "undo" ? undo(copy) : redo(copy), { sketch: NOTHING, done: null, problem: null });
}

function withCopy(editing: EditingState, copy: WorkingCopy, rest: Partial<EditingState>): Partial<EditingState> {
  const chosen = stillThere(rest.chosen ?? editing.chosen, copy.now);
  return { ...rest, copy, chosen, findings: null };
}

/** How many objects the server has not been told of. */
export function unsentCount({ copy }: EditingState): number {
  return copy === null ? 0 : unsent(copy).size;
}

/** How the working copy stands to the draft. */
export function standInWords(editing: EditingState): string {
  const { copy, clashes } = editing;
  if (copy === null) return "Asking for the draft …";
  const objects = unsentCount(editing);
  if (objects === 0 && clashes.length === 0) return "All is in the draft.";
  const kept = editing.isKept ? "kept in this browser" : "not kept by this browser: send them before you leave";
  return `${counted(objects + clashes.length, "object")} not in the draft yet, ${kept}.`;
}

/** What others did since, entry by entry. */
export function newsInWords(news: News, entries: readonly GdbEntry[]): string[] {
  const parts = [
    ...(news.added > 0 ? [`${count(news.added)} new`] : []),
    ...(news.changed > 0 ? [`${count(news.changed)} changed`] : []),
    ...(news.removed > 0 ? [`${count(news.removed)} removed`] : []),
  ];
  const told = entries.map(({ author, at, comment, put, removed }) => {
    const what = comment === "" ? `${counted(put, "object")} put, ${count(removed)} removed` : `“${comment}”`;
    return `Token ${author}, ${instant(at)}: ${what}`;
  });
  return parts.length === 0 && told.length === 0 ? [] : [`Others have changed the draft: ${parts.length === 0 ? "prototypes only" : listed(parts)}.`, ...told];
}

/** One clash in one line. */
export function clashInWords({ mine, theirs, why }: Clash): string {
  const name = nameOf(mine ?? theirs);
  const wish = mine === null ? "you removed it" : theirs === null && why === "both" ? "you changed it, and it is gone" : CLASH_WORDS[why];
  return `${name}: ${mine === null ? `${wish}; ${CLASH_WORDS[why]}` : wish}`;
}
