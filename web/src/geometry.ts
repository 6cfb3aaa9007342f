// Lines, ellipses and boxes of the level frame: metres, x right, y up. Free functions over plain
// arrays; knows nothing of pixels.

import type { Chain, Cluster, Matrix2, Matrix3, Segment } from "./wire";

/** A place in the level frame, [x, y] in metres. */
export type Point = readonly [number, number];

/** A rectangle of the level frame: [min x, min y, max x, max y] in metres. */
export type Box = readonly [number, number, number, number];

/** A straight piece in the level frame: [x, y, x, y] of its ends, in metres. */
export type Piece = readonly [number, number, number, number];

/** 95 % quantile of the chi-square distribution with two degrees of freedom, -2 ln(0.05). */
export const CHI_SQUARE_95_2 = 5.991464547107979;

/** 95 % quantile of |z| for a standard normal z. */
export const Z_95 = 1.959963984540054;

/** The point of the line x cos(alpha) + y sin(alpha) = rho at coordinate `alongM` from its foot point. */
export function pointOnLine(line: { rho_m: number; alpha_rad: number }, alongM: number): Point {
  const cos = Math.cos(line.alpha_rad);
  const sin = Math.sin(line.alpha_rad);
  return [line.rho_m * cos - alongM * sin, line.rho_m * sin + alongM * cos];
}

/** The solid pieces of a segment. */
export function piecesOf(segment: Segment): Piece[] {
  return segment.solid.map((interval) => {
    const from = pointOnLine(segment, interval.from_m);
    const to = pointOnLine(segment, interval.to_m);
    return [from[0], from[1], to[0], to[1]];
  });
}

/** Log-odds that the least certain of the solid pieces is there, nats. */
export function leastExistence(segment: Segment): number {
  return Math.min(...segment.solid.map((interval) => interval.existence_nat));
}

/** Total length of the solid pieces. */
export function lengthOf(segment: Segment): number {
  return segment.solid.reduce((sum, interval) => sum + interval.to_m - interval.from_m, 0);
}

/** Coordinate along the line of the middle between a segment's outermost ends. */
export function middleOf(segment: Segment): number {
  const first = segment.solid.at(0);
  const last = segment.solid.at(-1);
  return first === undefined || last === undefined ? 0 : (first.from_m + last.to_m) / 2;
}

/**
 * Standard deviation of a line's place across itself at coordinate t along it. Turning the line by
 * d(alpha) and moving it by d(rho) moves that point by d(rho) - t d(alpha) along the normal, so
 * var = S_rr - 2 t S_ra + t^2 S_aa. At the foot point (t = 0), which may be far from the wall, the
 * bare S_rr says little about the wall itself.
 */
export function offsetSd(covariance: Matrix2, alongM: number): number {
  const [[rr, ra], [, aa]] = covariance;
  return Math.sqrt(Math.max(0, rr - 2 * alongM * ra + alongM * alongM * aa));
}

/** Standard deviation of a line's angle. */
export function angleSd(covariance: Matrix2): number {
  return Math.sqrt(Math.max(0, covariance[1][1]));
}

/** An ellipse by its half axes and the direction of the greater one. */
export interface Ellipse {
  majorM: number;
  minorM: number;
  angleRad: number;
}

/** The ellipse that holds 95 % of a plane normal distribution with covariance [[xx, xy], [xy, yy]]. */
export function ellipse95(xx: number, xy: number, yy: number): Ellipse {
  const mean = (xx + yy) / 2;
  const spread = Math.hypot((xx - yy) / 2, xy);
  return {
    majorM: Math.sqrt(CHI_SQUARE_95_2 * Math.max(0, mean + spread)),
    minorM: Math.sqrt(CHI_SQUARE_95_2 * Math.max(0, mean - spread)),
    angleRad: 0.5 * Math.atan2(2 * xy, xx - yy),
  };
}

/** The position's part of a pose covariance as an ellipse. */
export function poseEllipse95(covariance: Matrix3): Ellipse {
  return ellipse95(covariance[0][0], covariance[0][1], covariance[1][1]);
}

/** Distance of a point from a piece. */
export function distanceToPiece(point: Point, piece: Piece): number {
  const [x0, y0, x1, y1] = piece;
  const dx = x1 - x0;
  const dy = y1 - y0;
  const lengthSq = dx * dx + dy * dy;
  const t = lengthSq === 0 ? 0 : ((point[0] - x0) * dx + (point[1] - y0) * dy) / lengthSq;
  const clamped = Math.min(1, Math.max(0, t));
  return Math.hypot(point[0] - x0 - clamped * dx, point[1] - y0 - clamped * dy);
}

/** Whether a convex, counter-clockwise ring holds a point. */
export function hullContains(hull: readonly Point[], point: Point): boolean {
  if (hull.length < 3) return false;
  return hull.every((from, index) => {
    const to = hull[(index + 1) % hull.length] ?? from;
    return (to[0] - from[0]) * (point[1] - from[1]) - (to[1] - from[1]) * (point[0] - from[0]) >= 0;
  });
}

/** The edges of a chain. */
export function edgesOf(chain: Chain): Piece[] {
  const { vertices_m: vertices, closed } = chain;
  const edges: Piece[] = [];
  for (const [index, from] of vertices.entries()) {
    const to = vertices[index + 1] ?? (closed ? vertices[0] : undefined);
    if (to !== undefined) edges.push([from[0], from[1], to[0], to[1]]);
  }
  return edges;
}

/** Area of a ring, whichever way it runs. */
export function areaOf(ring: readonly Point[]): number {
  let doubled = 0;
  for (const [index, from] of ring.entries()) {
    const to = ring[(index + 1) % ring.length] ?? from;
    doubled += from[0] * to[1] - from[1] * to[0];
  }
  return Math.abs(doubled) / 2;
}

/** Whether a ring of any shape holds a point: a ray from it crosses the ring an odd number of times. */
export function ringContains(ring: readonly Point[], point: Point): boolean {
  let inside = false;
  for (const [index, from] of ring.entries()) {
    const to = ring[(index + 1) % ring.length] ?? from;
    if (from[1] > point[1] === to[1] > point[1]) continue;
    const x = from[0] + ((point[1] - from[1]) * (to[0] - from[0])) / (to[1] - from[1]);
    if (point[0] < x) inside = !inside;
  }
  return inside;
}

/** The smallest box around two boxes; a missing one counts for nothing. */
export function union(a: Box | null, b: Box | null): Box | null {
  if (a === null) return b;
  if (b === null) return a;
  return [Math.min(a[0], b[0]), Math.min(a[1], b[1]), Math.max(a[2], b[2]), Math.max(a[3], b[3])];
}

/** Whether `outer` holds all of `inner`. */
export function holds(outer: Box, inner: Box): boolean {
  return outer[0] <= inner[0] && outer[1] <= inner[1] && outer[2] >= inner[2] && outer[3] >= inner[3];
}

/** A box widened about its middle: by `share` of itself, and to at least `leastM` each way. */
export function widened(box: Box, { leastM, share }: { leastM: number; share: number }): Box {
  const [x, y] = [(box[0] + box[2]) / 2, (box[1] + box[3]) / 2];
  const halfWidth = Math.max((box[2] - box[0]) * (1 + share), leastM) / 2;
  const halfHeight = Math.max((box[3] - box[1]) * (1 + share), leastM) / 2;
  return [x - halfWidth, y - halfHeight, x + halfWidth, y + halfHeight];
}

/** The share of `outer` that `inner` fills in the direction in which it fills more. */
export function shareOf(outer: Box, inner: Box): number {
  return Math.max((inner[2] - inner[0]) / (outer[2] - outer[0]), (inner[3] - inner[1]) / (outer[3] - outer[1]));
}

/** The box around segments and clusters; null if there are none. */
export function boxAround(segments: Iterable<Segment>, clusters: Iterable<Cluster>): Box | null {
  let box: Box | null = null;
  for (const segment of segments) {
    for (const [x0, y0, x1, y1] of piecesOf(segment)) {
      box = union(box, [Math.min(x0, x1), Math.min(y0, y1), Math.max(x0, x1), Math.max(y0, y1)]);
    }
  }
  for (const cluster of clusters) {
    for (const [x, y] of cluster.hull_m) box = union(box, [x, y, x, y]);
  }
  return box;
}
