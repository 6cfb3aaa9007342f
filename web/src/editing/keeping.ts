// Unsent edits as text that the browser keeps, so that a reload loses nothing; and back again, on whatever draft is
// there by then. Pure.

import type { GdbObject } from "../wire";
import type { Place } from "../permalink";
import { doorwaysIn, hostOf } from "./doorways";
import { unsent, withPuts, type Edit, type Puts, type Version, type WorkingCopy } from "./history";
import type { Objects } from "./objects";
import { rebased, type Clash, type Rebased } from "./rebasing";
import { wallsAmong } from "./walls";

type Pairs = [string, GdbObject | null][];

interface Kept {
  format: 1;
  version: Version;
  /** The draft that the edits were made on, as far as they depend on it. */
  base: Pairs;
  mine: Pairs;
  done: { label: string; objects: [string, { before: GdbObject | null; after: GdbObject | null }][] }[];
  undone: Kept["done"];
  clashes: readonly Clash[];
}

/** Under which name the browser keeps the edits of a level. */
export function keyOf({ site, level }: Place): string {
  return `mapfold.edits.${encodeURIComponent(site)}.${encodeURIComponent(level)}`;
}

/** What to keep; null if everything is sent. */
export function kept(copy: WorkingCopy, clashes: readonly Clash[]): string | null {
  const mine = unsent(copy);
  if (mine.size === 0 && clashes.length === 0) return null;
  const base = [...new Set([...mine.keys(), ...companions(copy, mine)])].map((id): [string, GdbObject | null] => [id, copy.base.get(id) ?? null]);
  const listed = (edits: readonly Edit[]): Kept["done"] => edits.map(({ label, objects }) => ({ label, objects: [...objects] }));
  const value: Kept = { format: 1, version: copy.version, base, mine: [...mine], done: listed(copy.done), undone: listed(copy.undone), clashes };
  return JSON.stringify(value);
}

/** Walls that my doorways stand in, and doorways in walls of mine: what others do to them concerns my edits. */
function companions(copy: WorkingCopy, mine: Puts): string[] {
  const walls = wallsAmong(copy.now);
  const hosts = [...mine.values()].flatMap((object) => (object?.kind === "doorway" ? [hostOf(object, walls)] : []));
  const changed = new Map([...wallsAmong(copy.base)].filter(([id]) => mine.has(id)));
  const doorways = [...doorwaysIn(copy.base, changed).values()].flat();
  return [...hosts.filter((host) => host !== null), ...doorways];
}

/** What was kept, on the draft of now; null if the text is none of ours. */
export function restored(text: string, theirs: Objects, version: Version): Rebased | null {
  let value: Partial<Kept>;
  try {
    value = JSON.parse(text) as Partial<Kept>;
  } catch {
    return null;
  }
  const { format, base, mine, done, undone, clashes } = value;
  if (format !== 1 || !base || !mine || !done || !undone || !clashes || !value.version) return null;
  const old = withPuts(theirs, new Map(base));
  const edits = (list: Kept["done"]): Edit[] => list.map(({ label, objects }) => ({ label, objects: new Map(objects) }));
  const copy = { version: value.version, base: old, now: withPuts(old, new Map(mine)), done: edits(done), undone: edits(undone) };
  const again = rebased(copy, theirs, version);
  return { ...again, clashes: together(clashes, again.clashes, theirs) };
}

/** Clashes old and new, each object once, with what the draft has by now. */
export function together(old: readonly Clash[], more: readonly Clash[], theirs: Objects): Clash[] {
  const all = new Map([...old, ...more].map((clash) => [clash.id, clash]));
  return [...all.values()].map((clash) => ({ ...clash, theirs: theirs.get(clash.id) ?? null }));
}
