// Objects of the a-priori model as they stand in the level: which ground they cover, and what moving and turning
// them means. Pure; an object is never changed in place.

import { union, type Box, type Point } from "../geometry";
import type { GdbObject, GdbPlacement, GdbPrototype, GdbSolid, ObjectKind, Triple } from "../wire";

/** Objects by identity. */
export type Objects = ReadonlyMap<string, GdbObject>;

/** Prototypes of the site by name. */
export type Library = ReadonlyMap<string, GdbPrototype>;

/** One polygon on the floor, with the heights that a solid has there. */
export interface Ground {
  /** The outer ring first, counter-clockwise, then holes; the first corner is not repeated. */
  rings: readonly (readonly Point[])[];
  lowerM: number;
  upperM: number;
}

const UPRIGHT: [number, number, number, number] = [1, 0, 0, 0];
/** Corners of a drawn circle. */
const CIRCLE_SIDES = 32;
/** What is turned out of the upright by less than this is upright. */
const UPRIGHT_WITHIN = 1e-9;

/** What objects are called. */
export const KIND_WORDS: Readonly<Record<ObjectKind, string>> = {
  wall: "wall",
  doorway: "doorway",
  corridor: "corridor",
  machine: "machine",
  furniture: "furniture",
  other: "object",
};

/** A coordinate rounded to the micrometre, the grid on which plans are cut. */
export function rounded(metres: number): number {
  return Math.round(metres * 1e6) / 1e6;
}

/** The solids of an object, in its own coordinates; none if its prototype is not there. */
export function solidsOf(object: GdbObject, library: Library): readonly GdbSolid[] {
  if (object.solids != null) return object.solids;
  return object.prototype == null ? [] : (library.get(object.prototype)?.solids ?? []);
}

/** Where an object stands; its own coordinates are the level's if it does not say. */
export function placementOf({ placement }: GdbObject): { position: Triple; rotation: [number, number, number, number] } {
  return { position: placement?.position_m ?? [0, 0, 0], rotation: placement?.rotation ?? UPRIGHT };
}

/** A point of the object in the level. */
export function pointInLevel(object: GdbObject, [x, y, z]: Triple): Triple {
  const { position, rotation: [w, i, j, k] } = placementOf(object);
  // p + 2 w (q x p) + 2 q x (q x p), with q the vector part.
  const [cx, cy, cz] = [j * z - k * y, k * x - i * z, i * y - j * x];
  return [
    position[0] + x + 2 * (w * cx + (j * cz - k * cy)),
    position[1] + y + 2 * (w * cy + (k * cx - i * cz)),
    position[2] + z + 2 * (w * cz + (i * cy - j * cx)),
  ];
}

/** Whether an object is turned about the vertical only. */
export function isUpright(object: GdbObject): boolean {
  const [, i, j] = placementOf(object).rotation;
  return Math.hypot(i, j) < UPRIGHT_WITHIN;
}

/** By how much an upright object is turned, counter-clockwise from x. */
export function yawOf(object: GdbObject): number {
  const [w, , , k] = placementOf(object).rotation;
  return 2 * Math.atan2(k, w);
}

/** Upright at a place. */
export function uprightAt([x, y]: Point, yawRad: number, zM = 0): GdbPlacement {
  const position: Triple = [rounded(x), rounded(y), rounded(zM)];
  return yawRad === 0 ? { position_m: position } : { position_m: position, rotation: [Math.cos(yawRad / 2), 0, 0, Math.sin(yawRad / 2)] };
}

/** The object moved. */
export function moved(object: GdbObject, [dx, dy]: Point, dzM = 0): GdbObject {
  const { position: [x, y, z] } = placementOf(object);
  const rotation = object.placement?.rotation;
  const position_m: Triple = [rounded(x + dx), rounded(y + dy), rounded(z + dzM)];
  return { ...object, placement: rotation == null ? { position_m } : { position_m, rotation } };
}

/** The object turned about a vertical axis. */
export function turned(object: GdbObject, about: Point, angleRad: number): GdbObject {
  const { position: [x, y, z], rotation: [w, i, j, k] } = placementOf(object);
  const [tx, ty] = turnedPoint([x, y], about, angleRad);
  const [c, s] = [Math.cos(angleRad / 2), Math.sin(angleRad / 2)];
  // The turn about z from the left: it happens in the level, after the object's own.
  const rotation: [number, number, number, number] = [c * w - s * k, c * i - s * j, c * j + s * i, c * k + s * w];
  return { ...object, placement: { position_m: [rounded(tx), rounded(ty), z], rotation } };
}

/** A point turned about another. */
export function turnedPoint([x, y]: Point, [cx, cy]: Point, angleRad: number): Point {
  const [c, s] = [Math.cos(angleRad), Math.sin(angleRad)];
  return [cx + c * (x - cx) - s * (y - cy), cy + s * (x - cx) + c * (y - cy)];
}

const grounds = new WeakMap<GdbObject, { library: Library; grounds: readonly Ground[] }>();

/** What ground an object covers, solid by solid; of what is tilted or free in form, its hull. */
export function groundsOf(object: GdbObject, library: Library): readonly Ground[] {
  const known = grounds.get(object);
  if (known?.library === library) return known.grounds;
  const made = solidsOf(object, library).map((solid) => groundOf(object, solid));
  grounds.set(object, { library, grounds: made });
  return made;
}

function groundOf(object: GdbObject, solid: GdbSolid): Ground {
  const { rings, lowerM, upperM, loose } = flattened(solid);
  const upright = isUpright(object);
  if (loose === null && upright) {
    const z = placementOf(object).position[2];
    const placed = rings.map((ring) => ring.map(([x, y]): Point => onFloor(pointInLevel(object, [x, y, 0]))));
    const [outer = [], ...holes] = placed;
    return { rings: [isClockwise(outer) ? outer.reverse() : outer, ...holes], lowerM: lowerM + z, upperM: upperM + z };
  }
  const corners = loose ?? rings.flat().flatMap(([x, y]): Triple[] => [[x, y, lowerM], [x, y, upperM]]);
  const placed = corners.map((corner) => pointInLevel(object, corner));
  const heights = placed.map(([, , z]) => z);
  return { rings: [hullOf(placed.map(onFloor))], lowerM: Math.min(...heights), upperM: Math.max(...heights) };
}

function isClockwise(ring: readonly Point[]): boolean {
  return ring.reduce((sum, [x, y], n) => sum + x * (ring[(n + 1) % ring.length]?.[1] ?? y) - y * (ring[(n + 1) % ring.length]?.[0] ?? x), 0) < 0;
}

function onFloor([x, y]: Triple): Point {
  return [x, y];
}

/** A solid as polygons drawn up; or, of what has another form, its loose corners. */
function flattened(solid: GdbSolid): Ground & { loose: readonly Triple[] | null } {
  if ("box" in solid) {
    const { from_m: [x0, y0, z0], to_m: [x1, y1, z1] } = solid.box;
    return { rings: [[[x0, y0], [x1, y0], [x1, y1], [x0, y1]]], lowerM: z0, upperM: z1, loose: null };
  }
  if ("prism" in solid) {
    const { base_m: rings, lower_m: lowerM, upper_m: upperM } = solid.prism;
    return { rings, lowerM, upperM, loose: null };
  }
  if ("cylinder" in solid) {
    const { centre_m: [x, y], radius_m: radius, lower_m: lowerM, upper_m: upperM } = solid.cylinder;
    const ring = Array.from({ length: CIRCLE_SIDES }, (_, n): Point => {
      const angle = (2 * Math.PI * n) / CIRCLE_SIDES;
      return [x + radius * Math.cos(angle), y + radius * Math.sin(angle)];
    });
    return { rings: [ring], lowerM, upperM, loose: null };
  }
  return { rings: [], lowerM: 0, upperM: 0, loose: solid.polyhedron.vertices_m };
}

/** The convex hull, counter-clockwise (Andrew 1979). */
export function hullOf(points: readonly Point[]): Point[] {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (from: readonly Point[]): Point[] => {
    const chain: Point[] = [];
    for (const p of from) {
      for (;;) {
        const [a, b] = [chain.at(-2), chain.at(-1)];
        if (a === undefined || b === undefined) break;
        if ((b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0]) > 0) break;
        chain.pop();
      }
      chain.push(p);
    }
    return chain.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

const boxes = new WeakMap<readonly Ground[], Box | "none">();

/** The box around an object on the floor; null if it covers nothing. */
export function boxOf(object: GdbObject, library: Library): Box | null {
  const own = groundsOf(object, library);
  let box = boxes.get(own);
  if (box === undefined) {
    box = boxAround(own) ?? "none";
    boxes.set(own, box);
  }
  return box === "none" ? null : box;
}

function boxAround(own: readonly Ground[]): Box | null {
  let box: Box | null = null;
  for (const { rings } of own) {
    for (const [x, y] of rings.flat()) box = union(box, [x, y, x, y]);
  }
  return box;
}

/** The middle of several objects on the floor; null if they cover nothing. */
export function middleOf(objects: Iterable<GdbObject>, library: Library): Point | null {
  let box: Box | null = null;
  for (const object of objects) box = union(box, boxOf(object, library));
  return box === null ? null : [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2];
}

/** Whether two objects say the same, whatever they leave unsaid. */
export function same(a: GdbObject | null | undefined, b: GdbObject | null | undefined): boolean {
  return a === b || canonical(a ?? null) === canonical(b ?? null);
}

function canonical(value: unknown): string {
  return JSON.stringify(value, (key: string, inner: unknown) => {
    if (inner === null || (key === "name" && inner === "")) return undefined;
    if (typeof inner !== "object" || Array.isArray(inner)) return inner;
    return Object.fromEntries(Object.entries(inner).sort(([one], [other]) => (one < other ? -1 : 1)));
  });
}

/** An object for people: its name, or what it is. */
export function nameOf(object: GdbObject | null | undefined): string {
  if (object == null) return "object";
  const kind = KIND_WORDS[object.kind];
  return object.name === undefined || object.name === "" ? (object.prototype ?? kind) : `${kind} “${object.name}”`;
}
