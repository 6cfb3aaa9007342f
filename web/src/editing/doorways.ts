// Doorways in walls: the space that is free in them. A doorway knows of no wall; which one it stands in follows from
// where it is. Pure.

import type { Point } from "../geometry";
import type { GdbObject } from "../wire";
import { groundsOf, middleOf, rounded, uprightAt, type Objects } from "./objects";
import { angleOf, coordinatesOn, isAbout, lengthOf, placeOn, type Wall } from "./walls";

/** How far a doorway reaches beyond its wall on either side. */
const DEEPER_M = 0.05;
/** A doorway stands in a wall if its middle is as near to the axis as half the wall is thick, and this. */
const IN_WALL_WITHIN_M = 0.02;
const NO_LIBRARY = new Map();

/** The size of a doorway. */
export interface DoorwaySize {
  widthM: number;
  heightM: number;
}

/** A doorway in a wall, with its middle at a distance from the wall's first end; kept within the wall. */
export function doorwayIn(wall: Wall, alongM: number, { widthM, heightM }: DoorwaySize, previous: Partial<GdbObject> = {}): GdbObject {
  const length = lengthOf(wall);
  const half = widthM / 2;
  const kept = length > widthM ? Math.min(length - half, Math.max(half, alongM)) : length / 2;
  const deep = rounded(wall.thicknessM / 2 + DEEPER_M);
  return {
    ...previous,
    kind: "doorway",
    placement: uprightAt(placeOn(wall, kept), angleOf(wall)),
    solids: [{ box: { from_m: [rounded(-half), -deep, rounded(wall.lowerM)], to_m: [rounded(half), deep, rounded(wall.lowerM + heightM)] } }],
  };
}

/** The middle of a doorway. */
export function middleOfDoorway(doorway: GdbObject): Point | null {
  return middleOf([doorway], NO_LIBRARY);
}

/** How wide a doorway is along a wall, and how high. */
export function sizeIn(wall: Wall, doorway: GdbObject): DoorwaySize {
  const grounds = groundsOf(doorway, NO_LIBRARY);
  const along = grounds.flatMap(({ rings }) => rings.flat().map((p) => coordinatesOn(wall, p).alongM));
  const upperM = Math.max(...grounds.map((ground) => ground.upperM));
  return { widthM: rounded(Math.max(...along) - Math.min(...along)), heightM: rounded(upperM - wall.lowerM) };
}

/** The wall that a doorway stands in, of those given; null if in none. */
export function hostOf(doorway: GdbObject, walls: Iterable<readonly [string, Wall]>): string | null {
  const middle = middleOfDoorway(doorway);
  if (middle === null) return null;
  let [best, least] = [null as string | null, Infinity];
  for (const [id, wall] of walls) {
    if (!isAbout(wall, middle, wall.thicknessM / 2 + IN_WALL_WITHIN_M)) continue;
    const { alongM, acrossM } = coordinatesOn(wall, middle);
    const off = Math.abs(acrossM);
    if (alongM < 0 || alongM > lengthOf(wall) || off > wall.thicknessM / 2 + IN_WALL_WITHIN_M || off >= least) continue;
    [best, least] = [id, off];
  }
  return best;
}

/** The doorways that stand in walls: which are in which. */
export function doorwaysIn(objects: Objects, walls: ReadonlyMap<string, Wall>): Map<string, string[]> {
  const of = new Map<string, string[]>();
  for (const [id, object] of objects) {
    const host = object.kind === "doorway" ? hostOf(object, walls) : null;
    if (host === null) continue;
    const beside = of.get(host);
    if (beside === undefined) of.set(host, [id]);
    else beside.push(id);
  }
  return of;
}

/** A doorway that follows its wall from where it was to where it is: as far from the end that stayed. */
export function followed(doorway: GdbObject, from: Wall, to: Wall): GdbObject {
  const middle = middleOfDoorway(doorway);
  if (middle === null) return doorway;
  const { alongM } = coordinatesOn(from, middle);
  const stayed = Math.hypot(from.b[0] - to.b[0], from.b[1] - to.b[1]) < Math.hypot(from.a[0] - to.a[0], from.a[1] - to.a[1]);
  return doorwayIn(to, stayed ? lengthOf(to) - (lengthOf(from) - alongM) : alongM, sizeIn(from, doorway), doorway);
}
