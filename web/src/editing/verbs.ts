// What can be done to objects: drawing, moving, turning, copying, removing. Each answers what is to become of which
// objects; walls that meet are joined anew, and doorways go where their walls go. Pure.

import type { Point } from "../geometry";
import type { GdbObject } from "../wire";
import { doorwayIn, doorwaysIn, followed, type DoorwaySize } from "./doorways";
import { withPuts, type Puts } from "./history";
import { moved, rounded, turned, uprightAt, type Library, type Objects } from "./objects";
import { endsOf, isSamePlace, lengthOf, rejoined, wallObject, wallOf, wallsAmong, type Wall } from "./walls";

/** Shorter walls are not drawn: one would not tell how they lie. */
export const WALL_LEAST_M = 0.05;

/** How walls are drawn. */
export interface WallSize {
  thicknessM: number;
  heightM: number;
}

/** With the doorways that stand in the walls among them. */
export function withDoorways(objects: Objects, chosen: Iterable<string>): Set<string> {
  const all = new Set(chosen);
  const walls = chosenWalls(objects, all);
  if (walls.size === 0) return all;
  for (const [, doorways] of doorwaysIn(objects, walls)) for (const id of doorways) all.add(id);
  return all;
}

function chosenWalls(objects: Objects, chosen: Iterable<string>): Map<string, Wall> {
  const [all, walls] = [wallsAmong(objects), new Map<string, Wall>()];
  for (const id of chosen) {
    const wall = all.get(id);
    if (wall !== undefined) walls.set(id, wall);
  }
  return walls;
}

/** With the walls joined anew that end where walls changed. */
function joined(objects: Objects, puts: Puts): Map<string, GdbObject | null> {
  const next = new Map(puts);
  const places: Point[] = [];
  for (const [id, after] of puts) {
    for (const object of [objects.get(id), after]) {
      const wall = object == null ? null : wallOf(object);
      if (wall !== null) places.push(...endsOf(wall));
    }
  }
  if (places.length === 0) return next;
  for (const [id, object] of rejoined(withPuts(objects, puts), places)) next.set(id, object);
  return next;
}

/** Walls from place to place; what is too short to be one is left out. */
export function drawn(objects: Objects, points: readonly Point[], { thicknessM, heightM }: WallSize, uuid: () => string): Puts {
  const puts = new Map<string, GdbObject>();
  for (const [index, to] of points.entries()) {
    const from = points[index - 1];
    if (from === undefined) continue;
    const wall: Wall = { a: from, b: to, thicknessM, lowerM: 0, upperM: heightM };
    if (lengthOf(wall) >= WALL_LEAST_M) puts.set(uuid(), wallObject(wall));
  }
  return joined(objects, puts);
}

export function shifted(objects: Objects, chosen: Iterable<string>, by: Point): Puts {
  const puts = new Map<string, GdbObject>();
  for (const id of withDoorways(objects, chosen)) {
    const object = objects.get(id);
    if (object !== undefined) puts.set(id, moved(object, by));
  }
  return joined(objects, puts);
}

export function rotated(objects: Objects, chosen: Iterable<string>, about: Point, angleRad: number): Puts {
  const puts = new Map<string, GdbObject>();
  for (const id of withDoorways(objects, chosen)) {
    const object = objects.get(id);
    if (object !== undefined) puts.set(id, turned(object, about, angleRad));
  }
  return joined(objects, puts);
}

/** Copies beside the originals, and which they are. */
export function copied(objects: Objects, chosen: Iterable<string>, by: Point, uuid: () => string): { puts: Puts; copies: string[] } {
  const puts = new Map<string, GdbObject>();
  for (const id of withDoorways(objects, chosen)) {
    const object = objects.get(id);
    if (object !== undefined) puts.set(uuid(), moved(object, by));
  }
  const copies = [...puts.keys()];
  return { puts: joined(objects, puts), copies };
}

export function removed(objects: Objects, chosen: Iterable<string>): Puts {
  const puts = new Map<string, null>();
  for (const id of withDoorways(objects, chosen)) puts.set(id, null);
  return joined(objects, puts);
}

/** Walls as they are to be; their doorways follow. */
export function reshaped(objects: Objects, walls: ReadonlyMap<string, Wall>): Puts {
  const puts = new Map<string, GdbObject>();
  const before = chosenWalls(objects, walls.keys());
  const doorways = doorwaysIn(objects, before);
  for (const [id, wall] of walls) {
    const [object, from] = [objects.get(id), before.get(id)];
    if (object === undefined || from === undefined) continue;
    puts.set(id, wallObject(wall, object));
    for (const doorway of doorways.get(id) ?? []) {
      const there = objects.get(doorway);
      if (there !== undefined) puts.set(doorway, followed(there, from, wall));
    }
  }
  return joined(objects, puts);
}

/** All ends of walls at one place moved to another; null if a wall would be too short. */
export function pulled(objects: Objects, place: Point, to: Point): Puts | null {
  const walls = new Map<string, Wall>();
  for (const [id, wall] of wallsAmong(objects)) {
    const [atA, atB] = [isSamePlace(wall.a, place), isSamePlace(wall.b, place)];
    if (!atA && !atB) continue;
    const next: Wall = { ...wall, a: atA ? roundedPoint(to) : wall.a, b: atB ? roundedPoint(to) : wall.b };
    if (lengthOf(next) < Math.max(WALL_LEAST_M, next.thicknessM)) return null;
    walls.set(id, next);
  }
  return reshaped(objects, walls);
}

function roundedPoint([x, y]: Point): Point {
  return [rounded(x), rounded(y)];
}

/** A doorway put into a wall. */
export function opened(wall: Wall, alongM: number, size: DoorwaySize, uuid: () => string): Puts {
  return new Map([[uuid(), { ...doorwayIn(wall, alongM, size), door: { type: "hinged" as const } }]]);
}

/** An instance of a prototype, placed. */
export function instanceAt(prototype: string, library: Library, at: Point, yawRad: number): GdbObject {
  return { kind: library.get(prototype)?.kind ?? "other", prototype, placement: uprightAt(at, yawRad) };
}
