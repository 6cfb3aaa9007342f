// The faces of objects as triangles in the level, for drawing them in space, and their edges. Walls of the simple form are
// drawn with their doorways open. Knows nothing of screens; part of what is loaded only for the view in space.

import { ShapeUtils, Vector2 } from "three";
import { doorwaysIn, middleOfDoorway, sizeIn } from "../editing/doorways";
import { pointInLevel, solidsOf, type Library, type Objects } from "../editing/objects";
import { coordinatesOn, lengthOf, wallsAmong, type Wall } from "../editing/walls";
import type { GdbObject, GdbSolid, ObjectKind, Triple } from "../wire";

/** Triangles and edges of some objects, three numbers a vertex, in level metres; the objects one after the other. */
export interface Surfaces {
  triangles: Float32Array;
  edges: Float32Array;
  parts: readonly Part[];
}

/** Where the vertices of one object are. */
export interface Part {
  id: string;
  kind: ObjectKind;
  /** First vertex among those of the triangles, and how many there are. */
  first: number;
  count: number;
  firstEdge: number;
  edgeCount: number;
}

/** A polyhedron: corners, and faces as rings of them, the outer one first. */
interface Hull {
  corners: Triple[];
  faces: number[][][];
  edges: [number, number][];
}

const CYLINDER_SIDES = 32;

/** The surfaces of the objects of some kinds. */
export function surfacesOf(objects: Objects, library: Library, kinds: ReadonlySet<ObjectKind>): Surfaces {
  const triangles: number[] = [];
  const edges: number[] = [];
  const parts: Part[] = [];
  const walls = wallsAmong(objects);
  const doorways = doorwaysIn(objects, walls);
  for (const [id, object] of objects) {
    if (!kinds.has(object.kind)) continue;
    const [first, firstEdge] = [triangles.length / 3, edges.length / 3];
    const wall = walls.get(id);
    const within = (doorways.get(id) ?? []).flatMap((doorway) => objects.get(doorway) ?? []);
    const solids = wall !== undefined && within.length > 0 ? openedSolids(object, wall, within) : solidsOf(object, library);
    for (const solid of solids) {
      const hull = hullOf(solid);
      const corners = hull.corners.map((corner) => pointInLevel(object, corner));
      for (const rings of hull.faces) {
        for (const index of facesOf(corners, rings)) triangles.push(...(corners[index] ?? [0, 0, 0]));
      }
      for (const [from, to] of hull.edges) {
        const [p, q] = [corners[from], corners[to]];
        if (p !== undefined && q !== undefined) edges.push(...p, ...q);
      }
    }
    parts.push({ id, kind: object.kind, first, count: triangles.length / 3 - first, firstEdge, edgeCount: edges.length / 3 - firstEdge });
  }
  return { triangles: Float32Array.from(triangles), edges: Float32Array.from(edges), parts };
}

/** The part that a vertex belongs to. */
export function partAt(parts: readonly Part[], vertex: number): Part | null {
  let [low, high] = [0, parts.length];
  while (low < high) {
    const middle = (low + high) >> 1;
    const part = parts[middle];
    if (part !== undefined && part.first + part.count <= vertex) low = middle + 1;
    else high = middle;
  }
  return parts[low] ?? null;
}

/** How much the normals of two faces may differ for them to be one plane: 0.6 degrees, as a cosine. */
const ONE_PLANE = 0.99995;

/** The edges between the corners of faces, each once; not those between two faces of one plane, which only cut it up. */
function edgesOf(corners: readonly Triple[], faces: readonly (readonly (readonly number[])[])[]): [number, number][] {
  const met = new Map<string, { ends: [number, number]; normals: Triple[] }>();
  for (const rings of faces) {
    const normal = areaNormalOf(rings[0]?.map((index) => corners[index] ?? [0, 0, 0]) ?? []);
    for (const ring of rings) {
      for (const [n, from] of ring.entries()) {
        const to = ring[(n + 1) % ring.length] ?? from;
        const name = from < to ? `${from} ${to}` : `${to} ${from}`;
        const edge = met.get(name) ?? { ends: [from, to], normals: [] };
        edge.normals.push(normal);
        met.set(name, edge);
      }
    }
  }
  const isSeen = ({ normals: [a, b, ...others] }: { normals: Triple[] }): boolean =>
    a === undefined || b === undefined || others.length > 0 || a[0] * b[0] + a[1] * b[1] + a[2] * b[2] < ONE_PLANE * Math.hypot(...a) * Math.hypot(...b);
  return [...met.values()].filter(isSeen).map(({ ends }) => ends);
}

/** A ring's normal, twice its area long (Newell). */
function areaNormalOf(ring: readonly Triple[]): Triple {
  const normal: Triple = [0, 0, 0];
  for (const [n, p] of ring.entries()) {
    const q = ring[(n + 1) % ring.length] ?? p;
    normal[0] += (p[1] - q[1]) * (p[2] + q[2]);
    normal[1] += (p[2] - q[2]) * (p[0] + q[0]);
    normal[2] += (p[0] - q[0]) * (p[1] + q[1]);
  }
  return normal;
}

/** A wall as the boxes that its doorways leave of it, and what closes its corners. */
export function openedSolids(object: GdbObject, wall: Wall, doorways: readonly GdbObject[]): GdbSolid[] {
  const length = lengthOf(wall);
  const gaps = doorways.flatMap((doorway) => {
    const middle = middleOfDoorway(doorway);
    if (middle === null) return [];
    const { widthM, heightM } = sizeIn(wall, doorway);
    const { alongM } = coordinatesOn(wall, middle);
    return [{ from: alongM - widthM / 2, to: alongM + widthM / 2, upper: wall.lowerM + heightM }];
  });
  const cuts = [0, length, ...gaps.flatMap(({ from, to }) => [from, to])].filter((at) => at >= 0 && at <= length).sort((a, b) => a - b);
  const half = wall.thicknessM / 2;
  const pieces: GdbSolid[] = [];
  const [, ...fillers] = object.solids ?? [];
  // A wall's own coordinates need not be those of its axis: pieces are made in the level, and brought back.
  const own = ownOf(object);
  for (const [n, to] of cuts.entries()) {
    const from = cuts[n - 1];
    if (from === undefined || to - from < 1e-6) continue;
    const open = gaps.filter((gap) => gap.from < (from + to) / 2 && gap.to > (from + to) / 2);
    const lower = Math.max(wall.lowerM, ...open.map(({ upper }) => upper));
    if (lower >= wall.upperM) continue;
    const angle = Math.atan2(wall.b[1] - wall.a[1], wall.b[0] - wall.a[0]);
    const at = (along: number, across: number): [number, number] =>
      own([wall.a[0] + along * Math.cos(angle) - across * Math.sin(angle), wall.a[1] + along * Math.sin(angle) + across * Math.cos(angle)]);
    const z = pointInLevel(object, [0, 0, 0])[2];
    pieces.push({ prism: { base_m: [[at(from, -half), at(to, -half), at(to, half), at(from, half)]], lower_m: lower - z, upper_m: wall.upperM - z } });
  }
  return [...pieces, ...fillers];
}

/** From the level into an upright object's own coordinates. */
function ownOf(object: GdbObject): (p: readonly [number, number]) => [number, number] {
  const [ox, oy] = pointInLevel(object, [0, 0, 0]);
  const [ux, uy] = pointInLevel(object, [1, 0, 0]);
  const [cos, sin] = [ux - ox, uy - oy];
  return ([x, y]) => [(x - ox) * cos + (y - oy) * sin, (y - oy) * cos - (x - ox) * sin];
}

function hullOf(solid: GdbSolid): Hull {
  if ("box" in solid) {
    const { from_m: [x0, y0, z0], to_m: [x1, y1, z1] } = solid.box;
    return drawnUp([[[x0, y0], [x1, y0], [x1, y1], [x0, y1]]], z0, z1);
  }
  if ("prism" in solid) return drawnUp(solid.prism.base_m, solid.prism.lower_m, solid.prism.upper_m);
  if ("cylinder" in solid) {
    const { centre_m: [x, y], radius_m: radius, lower_m: lower, upper_m: upper } = solid.cylinder;
    const ring = Array.from({ length: CYLINDER_SIDES }, (_, n): [number, number] => {
      const angle = (2 * Math.PI * n) / CYLINDER_SIDES;
      return [x + radius * Math.cos(angle), y + radius * Math.sin(angle)];
    });
    return drawnUp([ring], lower, upper);
  }
  const { vertices_m: corners, faces } = solid.polyhedron;
  return { corners, faces, edges: edgesOf(corners, faces) };
}

function drawnUp(rings: readonly (readonly [number, number][])[], lower: number, upper: number): Hull {
  const corners: Triple[] = [];
  const faces: number[][][] = [];
  const edges: [number, number][] = [];
  const [floor, ceiling]: [number[][], number[][]] = [[], []];
  for (const ring of rings) {
    const first = corners.length;
    for (const [x, y] of ring) corners.push([x, y, lower], [x, y, upper]);
    const at = (n: number): number => first + 2 * (n % ring.length);
    for (const n of ring.keys()) {
      faces.push([[at(n), at(n + 1), at(n + 1) + 1, at(n) + 1]]);
      edges.push([at(n), at(n + 1)], [at(n) + 1, at(n + 1) + 1], [at(n), at(n) + 1]);
    }
    floor.push([...ring.keys()].map(at).reverse());
    ceiling.push([...ring.keys()].map((n) => at(n) + 1));
  }
  return { corners, faces: [...faces, floor, ceiling], edges };
}

/** The triangles of a plane quadrangle: along the diagonal that has both on the same side of the plane. */
function halves(corners: readonly Triple[], [a = 0, b = 0, c = 0, d = 0]: readonly number[]): number[] {
  const normal = (i: number, j: number, k: number): Triple => {
    const at = (index: number): Triple => corners[index] ?? [0, 0, 0];
    const [p, q, r] = [at(i), at(j), at(k)];
    const [ux, uy, uz, vx, vy, vz] = [q[0] - p[0], q[1] - p[1], q[2] - p[2], r[0] - p[0], r[1] - p[1], r[2] - p[2]];
    return [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
  };
  const [one, other] = [normal(a, b, c), normal(a, c, d)];
  const isWithin = one[0] * other[0] + one[1] * other[1] + one[2] * other[2] > 0;
  return isWithin ? [a, b, c, a, c, d] : [b, c, d, b, d, a];
}

/** The triangles of a plane face, as indices of its corners; none if it names corners that are not there. */
function facesOf(corners: readonly Triple[], rings: readonly (readonly number[])[]): number[] {
  const [outer = [], ...holes] = rings;
  const all = [...outer, ...holes.flat()];
  if (outer.length < 3 || all.some((index) => corners[index] === undefined)) return [];
  if (all.length === 3) return all;
  if (all.length === 4 && holes.length === 0) return halves(corners, outer);
  // Seen along the axis to which the face is most nearly square.
  const normal = areaNormalOf(outer.map((index) => corners[index] ?? [0, 0, 0]));
  const size = normal.map(Math.abs);
  const axis = size.indexOf(Math.max(...size));
  const flat = (ring: readonly number[]): Vector2[] =>
    ring.map((index) => {
      const corner = corners[index] ?? [0, 0, 0];
      return new Vector2(corner[(axis + 1) % 3], corner[(axis + 2) % 3]);
    });
  return ShapeUtils.triangulateShape(flat(outer), holes.map(flat)).flat().map((n) => all[n] ?? 0);
}
