// A made-up floor: a ring of corridors with rooms on both sides, a hall with machines, and routes
// for robots. Metres, x right, y up. Rays find the nearest wall.

/** @typedef {{ from: [number, number], to: [number, number], round: boolean }} Wall `round`: part of something that no line explains. */
/** @typedef {{ distanceM: number, wall: number, alongM: number }} Hit */

/** Width of the doorways. */
const DOOR_M = 1.1;

/**
 * A straight wall with doorways at the given places along it.
 * @param {[number, number]} from
 * @param {[number, number]} to
 * @param {readonly number[]} doorsAtM
 * @returns {Wall[]}
 */
function wallWithDoors(from, to, doorsAtM) {
  const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
  /** @type {(alongM: number) => [number, number]} */
  const at = (alongM) => [
    from[0] + ((to[0] - from[0]) * alongM) / length,
    from[1] + ((to[1] - from[1]) * alongM) / length,
  ];
  const ends = [0, ...doorsAtM.flatMap((door) => [door - DOOR_M / 2, door + DOOR_M / 2]), length];
  /** @type {Wall[]} */
  const walls = [];
  for (let i = 0; i + 1 < ends.length; i += 2) {
    walls.push({ from: at(ends[i] ?? 0), to: at(ends[i + 1] ?? 0), round: false });
  }
  return walls;
}

/**
 * @param {[number, number, number, number]} box
 * @returns {Wall[]}
 */
function boxWalls([left, bottom, right, top]) {
  return [
    ...wallWithDoors([left, bottom], [right, bottom], []),
    ...wallWithDoors([right, bottom], [right, top], []),
    ...wallWithDoors([right, top], [left, top], []),
    ...wallWithDoors([left, top], [left, bottom], []),
  ];
}

/**
 * @param {[number, number]} centre
 * @param {number} radiusM
 * @returns {Wall[]}
 */
function pillar([x, y], radiusM) {
  return Array.from({ length: 8 }, (_, i) => {
    /** @type {(k: number) => [number, number]} */
    const at = (k) => [x + radiusM * Math.cos((k * Math.PI) / 4), y + radiusM * Math.sin((k * Math.PI) / 4)];
    return { from: at(i), to: at(i + 1), round: true };
  });
}

/**
 * Rooms of about equal width along one side of a corridor, each with a doorway to it.
 * @param {{ y: number, depthM: number, leftM: number, rightM: number, count: number }} row `depthM` is negative below the corridor
 * @returns {Wall[]}
 */
function roomsAlong({ y, depthM, leftM, rightM, count }) {
  const width = (rightM - leftM) / count;
  const doors = Array.from({ length: count }, (_, i) => width * (i + 0.3));
  const walls = wallWithDoors([leftM, y], [rightM, y], doors);
  for (let i = 1; i < count; i++) {
    walls.push(...wallWithDoors([leftM + i * width, y], [leftM + i * width, y + depthM], []));
  }
  return walls;
}

/** @returns {Wall[]} */
export function buildWalls() {
  return [
    ...boxWalls([-12, -9, 60, 33]),
    // South corridor: y from 0 to 2.4; north corridor: y from 21 to 23.4.
    ...roomsAlong({ y: 0, depthM: -9, leftM: -12, rightM: 60, count: 11 }),
    ...roomsAlong({ y: 23.4, depthM: 9.6, leftM: -12, rightM: 60, count: 9 }),
    ...roomsAlong({ y: 2.4, depthM: 6.3, leftM: 2.4, rightM: 24, count: 4 }),
    ...roomsAlong({ y: 21, depthM: -6.3, leftM: 2.4, rightM: 24, count: 3 }),
    ...wallWithDoors([2.4, 8.7], [24, 8.7], [11]),
    ...wallWithDoors([2.4, 14.7], [24, 14.7], [9]),
    // West corridor, and the hall in the east.
    ...wallWithDoors([2.4, 2.4], [2.4, 21], [9.3]),
    ...wallWithDoors([0, 2.4], [0, 21], [4, 12, 17]),
    ...wallWithDoors([24, 2.4], [24, 21], [9.3]),
    ...wallWithDoors([24, 2.4], [46, 2.4], [4, 17]),
    ...wallWithDoors([24, 21], [46, 21], [6, 18]),
    ...wallWithDoors([46, 2.4], [46, 21], []),
    ...wallWithDoors([48.4, 2.4], [48.4, 21], [5, 13]),
    ...wallWithDoors([48.4, 2.4], [60, 2.4], []),
    ...wallWithDoors([48.4, 21], [60, 21], []),
    ...boxWalls([28, 5.5, 32, 7]),
    ...boxWalls([28, 15.5, 33.5, 17.2]),
    ...boxWalls([38, 5.2, 40, 9.4]),
    ...pillar([36, 11.8], 0.35),
    ...pillar([41, 13.6], 0.35),
    ...pillar([30.5, 11.8], 0.35),
    ...pillar([43.4, 17.8], 0.5),
    ...pillar([15, -5], 0.4),
    ...pillar([54, 9], 0.6),
    ...pillar([-6, 10], 0.5),
  ];
}

/** Routes: closed ways through corridors, rooms and the hall. @type {Record<string, readonly [number, number][]>} */
export const ROUTES = {
  ring: [[-10, 1.2], [47.2, 1.2], [47.2, 22.2], [1.2, 22.2], [1.2, 1.2]],
  hall: [[25.5, 1.2], [28, 1.2], [28, 4], [35, 4], [35, 10], [26, 10], [26, 14], [36, 14], [36, 19], [44, 19], [44, 3.6], [41, 3.6], [41, 1.2], [26, 1.2]],
  west: [[1.2, 3], [1.2, 11.7], [13, 11.7], [13, 12.2], [1.2, 12.2], [1.2, 20], [-11, 22.2], [30, 22.2], [1.2, 22]],
};

/**
 * The nearest wall along a ray.
 * @param {readonly Wall[]} walls
 * @param {{ x: number, y: number, angleRad: number, rangeMaxM: number }} ray
 * @returns {Hit | null}
 */
export function castRay(walls, { x, y, angleRad, rangeMaxM }) {
  const dx = Math.cos(angleRad);
  const dy = Math.sin(angleRad);
  /** @type {Hit | null} */
  let nearest = null;
  walls.forEach(({ from, to }, wall) => {
    const ex = to[0] - from[0];
    const ey = to[1] - from[1];
    const det = ex * dy - ey * dx;
    if (Math.abs(det) < 1e-12) return;
    const px = from[0] - x;
    const py = from[1] - y;
    const distanceM = (ex * py - ey * px) / det;
    const share = (dx * py - dy * px) / det;
    if (distanceM < 0.05 || distanceM > rangeMaxM || share < 0 || share > 1) return;
    if (nearest === null || distanceM < nearest.distanceM) {
      nearest = { distanceM, wall, alongM: share * Math.hypot(ex, ey) };
    }
  });
  return nearest;
}
