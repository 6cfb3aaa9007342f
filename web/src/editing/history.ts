// A working copy of the draft: what the server has, what the operator has made of it, and the edits between, each of
// which can be taken back. Pure.

import type { GdbObject } from "../wire";
import { same, type Objects } from "./objects";

/** What becomes of objects: as they are to be, or null for those that are to go. */
export type Puts = ReadonlyMap<string, GdbObject | null>;

/** One edit: each object before it and after it, null where it is not there. */
export interface Edit {
  label: string;
  objects: ReadonlyMap<string, { before: GdbObject | null; after: GdbObject | null }>;
}

/** Which draft, with which library. */
export interface Version {
  draft: number;
  library: number;
}

export interface WorkingCopy {
  version: Version;
  /** The draft as the server has it. */
  base: Objects;
  /** As the operator sees it. */
  now: Objects;
  /** Edits made, oldest first; sent ones too, as they can still be taken back. */
  done: readonly Edit[];
  /** Edits taken back, the last one at the end. */
  undone: readonly Edit[];
}

/** Edits that can be taken back. */
const DONE_MOST = 200;

/** A working copy of a draft that nobody has touched. */
export function workingCopy(base: Objects, version: Version): WorkingCopy {
  return { version, base, now: base, done: [], undone: [] };
}

/** Objects with some of them as they are to be. */
export function withPuts(objects: Objects, puts: Puts): Objects {
  if (puts.size === 0) return objects;
  const next = new Map(objects);
  for (const [id, object] of puts) {
    if (object === null) next.delete(id);
    else next.set(id, object);
  }
  return next;
}

/** The edit that makes `puts` so; null if all of it is so already. */
export function editOf(label: string, objects: Objects, puts: Puts): Edit | null {
  const changed = new Map<string, { before: GdbObject | null; after: GdbObject | null }>();
  for (const [id, after] of puts) {
    const before = objects.get(id) ?? null;
    if (!same(before, after)) changed.set(id, { before, after });
  }
  return changed.size === 0 ? null : { label, objects: changed };
}

/** The same edit the other way round. */
export function inverse({ label, objects }: Edit): Edit {
  return { label, objects: new Map([...objects].map(([id, { before, after }]) => [id, { before: after, after: before }])) };
}

function putsOf({ objects }: Edit): Puts {
  return new Map([...objects].map(([id, { after }]) => [id, after]));
}

/** With an edit made; what was taken back before can no longer be made again. */
export function withEdit(copy: WorkingCopy, edit: Edit): WorkingCopy {
  return { ...copy, now: withPuts(copy.now, putsOf(edit)), done: [...copy.done, edit].slice(-DONE_MOST), undone: [] };
}

/** With the last edit taken back. */
export function undo(copy: WorkingCopy): WorkingCopy {
  const last = copy.done.at(-1);
  if (last === undefined) return copy;
  return { ...copy, now: withPuts(copy.now, putsOf(inverse(last))), done: copy.done.slice(0, -1), undone: [...copy.undone, last] };
}

/** With the edit made again that was taken back last. */
export function redo(copy: WorkingCopy): WorkingCopy {
  const last = copy.undone.at(-1);
  if (last === undefined) return copy;
  return { ...copy, now: withPuts(copy.now, putsOf(last)), done: [...copy.done, last], undone: copy.undone.slice(0, -1) };
}

/** What of `to` is another than in `from`. */
export function difference(from: Objects, to: Objects): Map<string, GdbObject | null> {
  const puts = new Map<string, GdbObject | null>();
  if (from === to) return puts;
  for (const [id, object] of to) if (from.get(id) !== object && !same(from.get(id), object)) puts.set(id, object);
  for (const id of from.keys()) if (!to.has(id)) puts.set(id, null);
  return puts;
}

/** What the server has not been told yet. */
export function unsent({ base, now }: WorkingCopy): Map<string, GdbObject | null> {
  return difference(base, now);
}

/** With the server having taken `puts`, as the draft of a version. */
export function withSent(copy: WorkingCopy, puts: Puts, version: Version): WorkingCopy {
  return { ...copy, base: withPuts(copy.base, puts), version };
}
