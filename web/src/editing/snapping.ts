// Where a point lands when it is drawn near something. In this order: ends of walls; the foot of the perpendicular on a
// wall; where a direction of 15 degrees meets a wall; a wall; a direction of 15 degrees; the grid. Pure.

import type { Piece, Point } from "../geometry";
import { angleOf, axisOf, coordinatesOn, isAbout, isSamePlace, lengthOf, placeOn, type Wall } from "./walls";

export type SnapKind = "end" | "perpendicular" | "crossing" | "wall" | "angle" | "grid" | "free";

/** Where a point has landed, and on what. */
export interface Snap {
  at: Point;
  kind: SnapKind;
  /** A line to show: the wall or the direction that was snapped to. */
  guide: Piece | null;
}

export const SNAP_WORDS: Readonly<Record<SnapKind, string>> = {
  end: "end",
  perpendicular: "perpendicular",
  crossing: "15° on wall",
  wall: "on wall",
  angle: "15°",
  grid: "grid",
  free: "",
};

export interface SnapOptions {
  /** Metres per pixel. */
  resolution: number;
  /** How near is near: less for a mouse than for a finger. */
  withinPx: number;
  walls: Iterable<Wall>;
  /** Other places that count as ends. */
  ends?: readonly Point[];
  /** Where the line being drawn comes from. */
  from?: Point | null;
  /** Null for no grid. */
  gridM: number | null;
}

const STEP_RAD = Math.PI / 12;

/** A point that lands nowhere in particular. */
export function free(at: Point): Snap {
  return { at, kind: "free", guide: null };
}

/** The nearest of `candidates` to a place, if it is within reach. */
function nearest(at: Point, candidates: Iterable<Snap>, withinM: number): Snap | null {
  let [best, least] = [null as Snap | null, withinM];
  for (const candidate of candidates) {
    const distance = Math.hypot(candidate.at[0] - at[0], candidate.at[1] - at[1]);
    if (distance > least || (best !== null && distance === least)) continue;
    [best, least] = [candidate, distance];
  }
  return best;
}

export function snap(at: Point, options: SnapOptions): Snap {
  const withinM = options.withinPx * options.resolution;
  const from = options.from ?? null;
  const walls = [...options.walls];
  const near = walls.filter((wall) => isNear(wall, at, withinM));
  const rays = from === null ? [] : raysFrom(from, walls);
  const kinds: (() => Iterable<Snap>)[] = [
    () => [...near.flatMap(({ a, b }) => [a, b]), ...(options.ends ?? [])].map((end): Snap => ({ at: end, kind: "end", guide: null })),
    () => (from === null ? [] : near.flatMap((wall) => footsOn(wall, from))),
    () => near.flatMap((wall) => crossingsOn(wall, from, rays)),
    () => near.flatMap((wall) => onWall(wall, at)),
    () => (from === null ? [] : [alongRay(at, from, rays, options)]),
    () => (options.gridM === null ? [] : [onGrid(at, options.gridM)]),
  ];
  for (const candidates of kinds) {
    const found = nearest(at, candidates(), withinM);
    if (found !== null) return found;
  }
  return free(at);
}

function isNear(wall: Wall, at: Point, withinM: number): boolean {
  if (!isAbout(wall, at, withinM)) return false;
  const { alongM, acrossM } = coordinatesOn(wall, at);
  return Math.abs(acrossM) <= withinM && alongM >= -withinM && alongM <= lengthOf(wall) + withinM;
}

function isWithin(wall: Wall, alongM: number): boolean {
  return alongM >= 0 && alongM <= lengthOf(wall);
}

function footsOn(wall: Wall, from: Point): Snap[] {
  const { alongM, acrossM } = coordinatesOn(wall, from);
  if (!isWithin(wall, alongM) || Math.abs(acrossM) < 1e-9) return [];
  return [{ at: placeOn(wall, alongM), kind: "perpendicular", guide: axisOf(wall) }];
}

function onWall(wall: Wall, at: Point): Snap[] {
  const { alongM } = coordinatesOn(wall, at);
  return isWithin(wall, alongM) ? [{ at: placeOn(wall, alongM), kind: "wall", guide: axisOf(wall) }] : [];
}

/** Directions in steps of 15 degrees from the level's x, and from the walls that end where the line begins. */
function raysFrom(from: Point, walls: readonly Wall[]): number[] {
  const references = [0, ...walls.filter(({ a, b }) => isSamePlace(a, from) || isSamePlace(b, from)).map(angleOf)];
  return references.flatMap((reference) => Array.from({ length: 24 }, (_, n) => reference + n * STEP_RAD));
}

function crossingsOn(wall: Wall, from: Point | null, rays: readonly number[]): Snap[] {
  if (from === null) return [];
  const start = coordinatesOn(wall, from);
  if (Math.abs(start.acrossM) < 1e-9) return [];
  return rays.flatMap((ray): Snap[] => {
    const turn = ray - angleOf(wall);
    const reach = -start.acrossM / Math.sin(turn);
    const alongM = start.alongM + reach * Math.cos(turn);
    if (!(reach > 0) || !isWithin(wall, alongM)) return [];
    const at = placeOn(wall, alongM);
    return [{ at, kind: "crossing", guide: [from[0], from[1], at[0], at[1]] }];
  });
}

/** On the nearest direction; in whole steps of the grid, if one is near. */
function alongRay(at: Point, from: Point, rays: readonly number[], { resolution, withinPx, gridM }: SnapOptions): Snap {
  const [dx, dy] = [at[0] - from[0], at[1] - from[1]];
  let [ray, least] = [0, Infinity];
  for (const angle of rays) {
    const forward = dx * Math.cos(angle) + dy * Math.sin(angle);
    const off = Math.abs(dy * Math.cos(angle) - dx * Math.sin(angle));
    if (forward >= 0 && off < least) [ray, least] = [angle, off];
  }
  const length = dx * Math.cos(ray) + dy * Math.sin(ray);
  const whole = gridM === null ? length : Math.round(length / gridM) * gridM;
  const kept = Math.abs(whole - length) <= withinPx * resolution ? whole : length;
  const there: Point = [from[0] + kept * Math.cos(ray), from[1] + kept * Math.sin(ray)];
  return { at: there, kind: "angle", guide: [from[0], from[1], there[0], there[1]] };
}

function onGrid([x, y]: Point, gridM: number): Snap {
  return { at: [Math.round(x / gridM) * gridM, Math.round(y / gridM) * gridM], kind: "grid", guide: null };
}
