// Which objects lie at a place or in a box, and what a click makes of what is chosen. Pure.

import { areaOf, distanceToPiece, holds, ringContains, type Box, type Point } from "../geometry";
import type { GdbObject } from "../wire";
import { boxOf, groundsOf, type Library, type Objects } from "./objects";

/** The object at a place: the smallest of those that cover it or nearly do; floors last. */
export function objectAt(objects: Objects, library: Library, at: Point, withinM: number): string | null {
  let [best, least] = [null as string | null, Infinity];
  for (const [id, object] of objects) {
    const box = boxOf(object, library);
    if (box === null || at[0] < box[0] - withinM || at[0] > box[2] + withinM || at[1] < box[1] - withinM || at[1] > box[3] + withinM) continue;
    if (!covers(object, library, at, withinM)) continue;
    const size = (object.kind === "corridor" ? 1e9 : object.kind === "doorway" ? 0 : 1) + groundArea(object, library) * 1e-6;
    if (size < least) [best, least] = [id, size];
  }
  return best;
}

function groundArea(object: GdbObject, library: Library): number {
  return groundsOf(object, library).reduce((sum, { rings: [outer] }) => sum + areaOf(outer ?? []), 0);
}

function covers(object: GdbObject, library: Library, at: Point, withinM: number): boolean {
  return groundsOf(object, library).some(({ rings }) => {
    const [outer, ...holes] = rings;
    if (outer !== undefined && ringContains(outer, at) && !holes.some((hole) => ringContains(hole, at))) return true;
    return rings.some((ring) =>
      ring.some((p, index) => {
        const q = ring[(index + 1) % ring.length] ?? p;
        return distanceToPiece(at, [p[0], p[1], q[0], q[1]]) <= withinM;
      }),
    );
  });
}

/** The objects that lie wholly in a box. */
export function objectsIn(objects: Objects, library: Library, box: Box): string[] {
  const inside: string[] = [];
  for (const [id, object] of objects) {
    const own = boxOf(object, library);
    if (own !== null && holds(box, own)) inside.push(id);
  }
  return inside;
}

/** What is chosen after a click: that one; together with others, it joins them or leaves them. */
export function chosenAfter(chosen: ReadonlySet<string>, id: string | null, several: boolean): ReadonlySet<string> {
  if (id === null) return several ? chosen : new Set();
  if (!several) return new Set([id]);
  const next = new Set(chosen);
  if (!next.delete(id)) next.add(id);
  return next;
}

/** What of a choice is still there. */
export function stillThere(chosen: ReadonlySet<string>, objects: Objects): ReadonlySet<string> {
  return [...chosen].every((id) => objects.has(id)) ? chosen : new Set([...chosen].filter((id) => objects.has(id)));
}

/** The box between two corners. */
export function boxBetween(a: Point, b: Point): Box {
  return [Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.max(a[0], b[0]), Math.max(a[1], b[1])];
}
