// Walls as people draw them: straight, of one thickness, from one place to another. The first solid of such a wall is
// the box about its axis; where walls meet at an angle, the gap at the outer side is filled by a small prism that
// belongs to one of them. Pure.

import { distanceToPiece, type Piece, type Point } from "../geometry";
import type { GdbObject, GdbSolid } from "../wire";
import { groundsOf, isUpright, placementOf, pointInLevel, rounded, uprightAt, type Objects } from "./objects";

/** A straight wall. */
export interface Wall {
  a: Point;
  b: Point;
  thicknessM: number;
  lowerM: number;
  upperM: number;
}

/** Ends of walls nearer to each other than this are one place. */
export const JOINED_WITHIN_M = 1e-3;
/** Sine of the angle up to which a wall goes on straight. */
const STRAIGHT = 0.02;
/** An outer corner this many times half a thickness away is cut off: the angle is too sharp for it. */
const MITRE_MOST = 4;
/** How far what fills a corner reaches into its walls, so that rounding leaves no slit. */
const OVERLAP_M = 1e-3;
const NO_LIBRARY = new Map();

/** Length and direction of a wall. */
export function lengthOf({ a, b }: Wall): number {
  return Math.hypot(b[0] - a[0], b[1] - a[1]);
}

export function angleOf({ a, b }: Wall): number {
  return Math.atan2(b[1] - a[1], b[0] - a[0]);
}

export function axisOf({ a, b }: Wall): Piece {
  return [a[0], a[1], b[0], b[1]];
}

/** Whether a place is in the box around a wall's axis, widened by so much: most walls are told apart by that alone. */
export function isAbout({ a, b }: Wall, [x, y]: Point, withinM: number): boolean {
  if (x < Math.min(a[0], b[0]) - withinM || x > Math.max(a[0], b[0]) + withinM) return false;
  return y >= Math.min(a[1], b[1]) - withinM && y <= Math.max(a[1], b[1]) + withinM;
}

/** The place on a wall's axis at a distance from its first end. */
export function placeOn(wall: Wall, alongM: number): Point {
  const [cos, sin] = [Math.cos(angleOf(wall)), Math.sin(angleOf(wall))];
  return [wall.a[0] + alongM * cos, wall.a[1] + alongM * sin];
}

/** Where on a wall's axis a place is: how far along, and how far to its left. */
export function coordinatesOn(wall: Wall, [x, y]: Point): { alongM: number; acrossM: number } {
  const [cos, sin] = [Math.cos(angleOf(wall)), Math.sin(angleOf(wall))];
  const [dx, dy] = [x - wall.a[0], y - wall.a[1]];
  return { alongM: dx * cos + dy * sin, acrossM: dy * cos - dx * sin };
}

const known = new WeakMap<GdbObject, Wall | "none">();

/** The wall that an object is; null if it is none, or none of this simple form. */
export function wallOf(object: GdbObject): Wall | null {
  let wall = known.get(object);
  if (wall === undefined) {
    wall = readWall(object) ?? "none";
    known.set(object, wall);
  }
  return wall === "none" ? null : wall;
}

const knownAmong = new WeakMap<Objects, ReadonlyMap<string, Wall>>();

/** The simple walls among objects. */
export function wallsAmong(objects: Objects): ReadonlyMap<string, Wall> {
  const before = knownAmong.get(objects);
  if (before !== undefined) return before;
  const walls = new Map<string, Wall>();
  for (const [id, object] of objects) {
    const wall = object.kind === "wall" ? wallOf(object) : null;
    if (wall !== null) walls.set(id, wall);
  }
  knownAmong.set(objects, walls);
  return walls;
}

function readWall(object: GdbObject): Wall | null {
  const [first, ...fillers] = object.solids ?? [];
  if (object.kind !== "wall" || first === undefined || !isUpright(object)) return null;
  const [ground] = groundsOf({ ...object, solids: [first] }, NO_LIBRARY);
  const ring = ground?.rings[0];
  if (ground?.rings.length !== 1 || ring?.length !== 4 || "cylinder" in first) return null;
  const wall = middleLine(ring, ground.lowerM, ground.upperM);
  if (wall === null) return null;
  return fillers.every((filler) => isFiller(object, filler, wall)) ? wall : null;
}

/** The middle line of a quadrangle between its longest side and the one opposite, which must be parallel. */
function middleLine(ring: readonly Point[], lowerM: number, upperM: number): Wall | null {
  const corner = (n: number): Point => ring[n % 4] ?? [0, 0];
  const side = (n: number): number => Math.hypot(corner(n + 1)[0] - corner(n)[0], corner(n + 1)[1] - corner(n)[1]);
  const longest = [0, 1, 2, 3].reduce((best, n) => (side(n) > side(best) + 1e-9 ? n : best), 0);
  const [p, q, r, s] = [corner(longest), corner(longest + 1), corner(longest + 2), corner(longest + 3)];
  const length = side(longest);
  if (length === 0) return null;
  const [ux, uy] = [(q[0] - p[0]) / length, (q[1] - p[1]) / length];
  const across = (to: Point): number => ux * (to[1] - p[1]) - uy * (to[0] - p[0]);
  const thicknessM = (Math.abs(across(r)) + Math.abs(across(s))) / 2;
  if (Math.abs(across(r) - across(s)) > 1e-4 || thicknessM < 1e-6) return null;
  const a: Point = [rounded((p[0] + s[0]) / 2), rounded((p[1] + s[1]) / 2)];
  const b: Point = [rounded((q[0] + r[0]) / 2), rounded((q[1] + r[1]) / 2)];
  return { a, b, thicknessM: rounded(thicknessM), lowerM, upperM };
}

/** Whether a solid of a wall only fills the corner at one of its ends. */
function isFiller(object: GdbObject, solid: GdbSolid, wall: Wall): boolean {
  if (!("prism" in solid)) return false;
  const [ring, ...holes] = solid.prism.base_m;
  if (ring === undefined || holes.length > 0 || ring.length > 5) return false;
  const reachM = (MITRE_MOST + 1) * wall.thicknessM;
  const near = (end: Point): boolean =>
    ring.every(([x, y]) => {
      const [px, py] = pointInLevel(object, [x, y, 0]);
      return Math.hypot(px - end[0], py - end[1]) <= reachM;
    });
  return near(wall.a) || near(wall.b);
}

/** A wall as an object; what `previous` says of name, tolerance and trust stays. */
export function wallObject(wall: Wall, previous: Partial<GdbObject> = {}, corners: readonly (readonly Point[])[] = []): GdbObject {
  const [length, half] = [rounded(lengthOf(wall)), rounded(wall.thicknessM / 2)];
  const [lower_m, upper_m] = [rounded(wall.lowerM), rounded(wall.upperM)];
  const placement = uprightAt(wall.a, angleOf(wall));
  const own = (p: Point): [number, number] => {
    const { alongM, acrossM } = coordinatesOn(wall, p);
    return [rounded(alongM), rounded(acrossM)];
  };
  const solids: GdbSolid[] = [
    { box: { from_m: [0, -half, lower_m], to_m: [length, half, upper_m] } },
    ...corners.map((ring): GdbSolid => ({ prism: { base_m: [ring.map(own)], lower_m, upper_m } })),
  ];
  return { ...previous, kind: "wall", placement, solids };
}

/** Places where a wall ends. */
export function endsOf({ a, b }: Wall): [Point, Point] {
  return [a, b];
}

export function isSamePlace(p: Point, q: Point): boolean {
  return Math.hypot(p[0] - q[0], p[1] - q[1]) <= JOINED_WITHIN_M;
}

/**
 * The walls that end at some places, with the gaps at the outer sides of their corners filled anew; only those
 * that change.
 */
export function rejoined(objects: Objects, places: readonly Point[]): Map<string, GdbObject> {
  const walls = wallsAmong(objects);
  const endsAt = (wall: Wall): boolean => places.some((place) => isSamePlace(wall.a, place) || isSamePlace(wall.b, place));
  const next = new Map<string, GdbObject>();
  const near = [...walls].filter(([, wall]) => endsAt(wall));
  for (const [id, wall] of near) {
    const corners = endsOf(wall).flatMap((end) => fillersAt(id, end, walls));
    const object = objects.get(id);
    if (object === undefined) continue;
    const made = wallObject(wall, object, corners);
    if (JSON.stringify(made.solids) !== JSON.stringify(object.solids)) next.set(id, made);
  }
  return next;
}

/** A wall as it leaves a place: its direction, its half thickness. */
interface Leaving {
  id: string;
  angle: number;
  half: number;
}

function fillersAt(id: string, end: Point, walls: ReadonlyMap<string, Wall>): Point[][] {
  const leaving: Leaving[] = [];
  for (const [other, one] of walls) {
    if (!isAbout(one, end, JOINED_WITHIN_M)) continue;
    const { a, b, thicknessM } = one;
    const [atA, atB] = [isSamePlace(a, end), isSamePlace(b, end)];
    if (atA === atB) continue;
    leaving.push({ id: other, angle: angleOf(atA ? one : { ...one, a: b, b: a }), half: thicknessM / 2 });
  }
  leaving.sort((one, other) => one.angle - other.angle);
  const rings: Point[][] = [];
  for (const [n, one] of leaving.entries()) {
    const next = leaving[(n + 1) % leaving.length];
    if (next === undefined || next === one) continue;
    let turn = next.angle - one.angle;
    if (turn <= 0) turn += 2 * Math.PI;
    // Only beyond a straight angle do two walls leave a gap; the one with the smaller id fills it.
    if (turn <= Math.PI || Math.abs(Math.sin(turn)) < STRAIGHT || (one.id < next.id ? one.id : next.id) !== id) continue;
    rings.push(cornerRing(end, one, next));
  }
  return rings;
}

/** What fills the gap from the left side of `one` counter-clockwise to the right side of `next`. */
function cornerRing(end: Point, one: Leaving, next: Leaving): Point[] {
  const [d, e]: [Point, Point] = [
    [Math.cos(one.angle), Math.sin(one.angle)],
    [Math.cos(next.angle), Math.sin(next.angle)],
  ];
  const at = (from: Point, along: Point, by: number): Point => [from[0] + by * along[0], from[1] + by * along[1]];
  const left = at(end, [-d[1], d[0]], one.half);
  const right = at(end, [e[1], -e[0]], next.half);
  const inner = at(at(end, d, OVERLAP_M), e, OVERLAP_M);
  const [into, out] = [at(left, d, OVERLAP_M), at(right, e, OVERLAP_M)];
  // left + s d = right + t e
  const cross = d[0] * e[1] - d[1] * e[0];
  const s = ((right[0] - left[0]) * e[1] - (right[1] - left[1]) * e[0]) / cross;
  const outer = at(left, d, s);
  const isSharp = Math.hypot(outer[0] - end[0], outer[1] - end[1]) > MITRE_MOST * Math.max(one.half, next.half);
  // Counter-clockwise, as seen from above.
  return isSharp ? [into, left, right, out, inner] : [into, outer, out, inner];
}

/** The wall nearest to a place, and how far its axis is; null if none is within reach. */
export function nearestWall(walls: Iterable<readonly [string, Wall]>, at: Point, withinM: number): { id: string; wall: Wall } | null {
  let best: { id: string; wall: Wall } | null = null;
  let least = Infinity;
  for (const [id, wall] of walls) {
    const reachM = Math.max(withinM, wall.thicknessM / 2);
    if (!isAbout(wall, at, reachM)) continue;
    const distance = distanceToPiece(at, axisOf(wall));
    if (distance > reachM || distance >= least) continue;
    [best, least] = [{ id, wall }, distance];
  }
  return best;
}

/** The height of the place where an object stands. */
export function heightOf(object: GdbObject): number {
  return placementOf(object).position[2];
}
