// What becomes of unsent edits when others have changed the draft meanwhile: those of other objects stay; those of
// objects that others changed too are set aside with both versions, for the operator to decide. A doorway and the
// wall that it stands in count as one. Pure.

import type { GdbObject } from "../wire";
import { hostOf } from "./doorways";
import { difference, unsent, withPuts, type Edit, type Puts, type Version, type WorkingCopy } from "./history";
import { same, type Objects } from "./objects";
import { wallOf, wallsAmong, type Wall } from "./walls";

/** An unsent edit of one object that no longer fits. */
export interface Clash {
  id: string;
  /** As the operator wants it; null to be gone. */
  mine: GdbObject | null;
  /** As the draft has it now; null if it is gone. */
  theirs: GdbObject | null;
  why: "both" | "wall" | "doorway";
}

export const CLASH_WORDS: Readonly<Record<Clash["why"], string>> = {
  both: "others have changed it too",
  wall: "others have changed the wall that it stands in",
  doorway: "others have changed a doorway in it",
};

/** What others have changed, in numbers of objects. */
export interface News {
  added: number;
  changed: number;
  removed: number;
}

export interface Rebased {
  copy: WorkingCopy;
  clashes: readonly Clash[];
  news: News;
}

/** The working copy on a newer draft. */
export function rebased(copy: WorkingCopy, theirs: Objects, version: Version): Rebased {
  const theirPuts = difference(copy.base, theirs);
  const mine = unsent(copy);
  const why = clashing(copy, mine, theirPuts, theirs);
  const clashes = [...why].map(([id, reason]): Clash => ({ id, mine: mine.get(id) ?? null, theirs: theirs.get(id) ?? null, why: reason }));
  const kept = new Map([...mine].filter(([id]) => !why.has(id)));
  const isForeign = (id: string): boolean => why.has(id) || theirPuts.has(id);
  return {
    copy: {
      version,
      base: theirs,
      now: withPuts(theirs, kept),
      done: without(copy.done, isForeign),
      undone: without(copy.undone, isForeign),
    },
    clashes,
    news: newsOf(copy.base, theirPuts),
  };
}

function newsOf(base: Objects, puts: Puts): News {
  const news = { added: 0, changed: 0, removed: 0 };
  for (const [id, object] of puts) {
    if (object === null) news.removed++;
    else if (base.has(id)) news.changed++;
    else news.added++;
  }
  return news;
}

/** Edits without what they say of some objects; what nothing is left of is no edit. */
function without(edits: readonly Edit[], isForeign: (id: string) => boolean): Edit[] {
  return edits
    .map(({ label, objects }) => ({ label, objects: new Map([...objects].filter(([id]) => !isForeign(id))) }))
    .filter(({ objects }) => objects.size > 0);
}

function clashing(copy: WorkingCopy, mine: Puts, theirPuts: Puts, theirs: Objects): Map<string, Clash["why"]> {
  const why = new Map<string, Clash["why"]>();
  if (theirPuts.size === 0) return why;
  for (const [id, object] of mine) {
    if (theirPuts.has(id) && !same(object, theirPuts.get(id))) why.set(id, "both");
  }
  const walls = wallsAmong(copy.now);
  const isWall = (id: string, puts: Puts): boolean => (puts.get(id) ?? copy.base.get(id))?.kind === "wall";
  // A wall that I change, with a doorway that they have put, moved or taken away.
  const mineWalls = [...mine.keys()].filter((id) => isWall(id, mine) && !why.has(id));
  for (const id of theirPuts.keys()) {
    for (const doorway of [theirs.get(id), copy.base.get(id)]) {
      if (doorway?.kind !== "doorway" || mine.has(id)) continue;
      const host = hostOf(doorway, among(mineWalls, [copy.base, copy.now]));
      if (host !== null) why.set(host, "doorway");
    }
  }
  // A doorway that I put, in a wall that they have changed, or that I may not change.
  for (const [id, object] of mine) {
    if (object?.kind !== "doorway" || why.has(id)) continue;
    const host = hostOf(object, walls);
    if (host !== null && (why.has(host) || (theirPuts.has(host) && !mine.has(host)))) why.set(id, "wall");
  }
  return why;
}

function among(ids: readonly string[], models: readonly Objects[]): [string, Wall][] {
  return ids.flatMap((id) =>
    models.flatMap((objects): [string, Wall][] => {
      const object = objects.get(id);
      const wall = object === undefined ? null : wallOf(object);
      return wall === null ? [] : [[id, wall]];
    }),
  );
}
