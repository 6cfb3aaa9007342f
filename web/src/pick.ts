// What lies under a point of the map: the nearest of what is shown, robots before landmarks before the corners of
// chains before walls before clusters before the rest of chains.

import { distanceToPiece, edgesOf, hullContains, piecesOf, ringContains, type Point } from "./geometry";
import { robotsHere, type Selection, type State } from "./state";

/** How far from a thing still counts as on it. */
const ROBOT_PX = 16;
const LINE_PX = 8;

/** What is at `at`, as shown at `resolution` metres per pixel; null if nothing is. */
export function pick(state: State, at: Point, resolution: number): Selection | null {
  return (
    (state.layers.robots.on ? pickRobot(state, at, ROBOT_PX * resolution) : null) ??
    (state.layers.landmarks.on ? pickLandmark(state, at, LINE_PX * resolution) : null) ??
    (state.layers.chains.on ? pickCorner(state, at, LINE_PX * resolution) : null) ??
    (state.layers.segments.on ? pickSegment(state, at, LINE_PX * resolution) : null) ??
    (state.layers.clusters.on ? pickCluster(state, at, LINE_PX * resolution) : null) ??
    (state.layers.chains.on ? pickChain(state, at, LINE_PX * resolution) : null)
  );
}

function pickRobot(state: State, at: Point, withinM: number): Selection | null {
  return nearest(
    robotsHere(state).map(({ robot, last_pose: pose }) => ({
      id: robot,
      distanceM: Math.hypot(pose.x_m - at[0], pose.y_m - at[1]),
    })),
    { kind: "robot", withinM },
  );
}

function pickLandmark(state: State, at: Point, withinM: number): Selection | null {
  return nearest(
    [...state.model.landmarks.values()].map(({ id, at_m: [x, y] }) => ({ id, distanceM: Math.hypot(x - at[0], y - at[1]) })),
    { kind: "landmark", withinM },
  );
}

function pickSegment(state: State, at: Point, withinM: number): Selection | null {
  const found: Found[] = [];
  for (const segment of state.content.segments.values()) {
    // Far from the supporting line is far from every piece of it.
    const across = at[0] * Math.cos(segment.alpha_rad) + at[1] * Math.sin(segment.alpha_rad) - segment.rho_m;
    if (Math.abs(across) > withinM) continue;
    const distanceM = Math.min(...piecesOf(segment).map((piece) => distanceToPiece(at, piece)));
    found.push({ id: segment.id, distanceM });
  }
  return nearest(found, { kind: "segment", withinM });
}

function pickCluster(state: State, at: Point, withinM: number): Selection | null {
  const found: Found[] = [];
  for (const { id, hull_m: hull } of state.content.clusters.values()) {
    const edges = hull.map((from, index) => {
      const to = hull[(index + 1) % hull.length] ?? from;
      return distanceToPiece(at, [from[0], from[1], to[0], to[1]]);
    });
    found.push({ id, distanceM: hullContains(hull, at) ? 0 : Math.min(...edges) });
  }
  return nearest(found, { kind: "cluster", withinM });
}

function pickCorner(state: State, at: Point, withinM: number): Selection | null {
  const found: Found[] = [];
  for (const { id, vertices_m: vertices } of state.content.chains.values()) {
    for (const [x, y] of vertices) found.push({ id, distanceM: Math.hypot(x - at[0], y - at[1]) });
  }
  return nearest(found, { kind: "chain", withinM });
}

/** By its edges; an obstacle, in which nothing else can be, also from inside. */
function pickChain(state: State, at: Point, withinM: number): Selection | null {
  const found: Found[] = [];
  for (const chain of state.content.chains.values()) {
    const isInside = chain.kind === "obstacle" && ringContains(chain.vertices_m, at);
    const distances = edgesOf(chain).map((edge) => distanceToPiece(at, edge));
    found.push({ id: chain.id, distanceM: isInside ? 0 : Math.min(...distances) });
  }
  return nearest(found, { kind: "chain", withinM });
}

interface Found {
  id: string;
  distanceM: number;
}

function nearest(
  found: readonly Found[],
  { kind, withinM }: { kind: Selection["kind"]; withinM: number },
): Selection | null {
  let best: Found | null = null;
  for (const one of found) {
    if (one.distanceM <= withinM && (best === null || one.distanceM < best.distanceM)) best = one;
  }
  return best === null ? null : { kind, id: best.id };
}
