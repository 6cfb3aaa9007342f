// A level that robots fill: the server's answers for it, from looks of made-up robots at a made-up
// floor. Not the fold of the product, only something whose answers have the same shape and grow the
// same way.

import { buildWalls, castRay, ROUTES } from "./world.mjs";
import { createRandom, normal } from "./random.mjs";

/** @typedef {import("../../src/wire").Segment} Segment */
/** @typedef {import("../../src/wire").Chain} Chain */
/** @typedef {import("../../src/wire").Cluster} Cluster */
/** @typedef {import("../../src/wire").TileAddress} TileAddress */
/** @typedef {import("../../src/wire").SensorClass} SensorClass */
/** @typedef {import("../../src/wire").RobotDescription} RobotDescription */
/** @typedef {import("../../src/wire").ContributionEntry} ContributionEntry */
/** @typedef {import("../../src/wire").LevelEvent} LevelEvent */

export const RESOLUTION_M = 0.05;
export const TILE_CELLS = 64;
const STEP_M = 0.7;

/** @typedef {{ address: TileAddress, revision: number, cells: Float32Array }} Tile */
/** @typedef {{ kind: SensorClass, route: string, startM: number, emulated: boolean, name: string, model: string, beams: number, fieldRad: number, rangeMaxM: number }} Plan */

/** @type {Record<string, Plan>} */
const FLEET = {
  ada: { kind: "scanner", route: "ring", startM: 12, emulated: false, name: "Ada", model: "SICK LMS200", beams: 181, fieldRad: Math.PI, rangeMaxM: 15 },
  bruno: { kind: "scanner", route: "hall", startM: 0, emulated: false, name: "Bruno", model: "SICK LMS200", beams: 181, fieldRad: Math.PI, rangeMaxM: 15 },
  sina: { kind: "sonar", route: "west", startM: 0, emulated: true, name: "Sina", model: "ring of 12", beams: 12, fieldRad: 2 * Math.PI, rangeMaxM: 4 },
};

/**
 * @param {string} route
 * @param {number} atM
 * @returns {{ x: number, y: number, heading: number }}
 */
function poseOn(route, atM) {
  const points = ROUTES[route] ?? [];
  const legs = points.map((from, i) => {
    const to = points[(i + 1) % points.length] ?? from;
    return { from, to, length: Math.hypot(to[0] - from[0], to[1] - from[1]) };
  });
  let left = atM % legs.reduce((sum, leg) => sum + leg.length, 0);
  for (const { from, to, length } of legs) {
    if (left <= length) {
      const share = length === 0 ? 0 : left / length;
      return {
        x: from[0] + (to[0] - from[0]) * share,
        y: from[1] + (to[1] - from[1]) * share,
        heading: Math.atan2(to[1] - from[1], to[0] - from[0]),
      };
    }
    left -= length;
  }
  return { x: 0, y: 0, heading: 0 };
}

/**
 * @param {{ nowMs: () => number, seed?: number }} options
 */
export function createMockLevel({ nowMs, seed = 1 }) {
  const walls = buildWalls();
  const random = createRandom(seed);
  let revision = 0;
  let frame = "0190aaaa-0000-7000-8000-000000000001";
  /** @type {Map<string, { segment: Segment, revision: number }>} */
  let segments = new Map();
  /** @type {Map<string, { cluster: Cluster, revision: number }>} */
  let clusters = new Map();
  /** @type {Map<string, { chain: Chain, revision: number }>} */
  let chains = new Map();
  /** @type {Map<string, Tile>} */
  let tiles = new Map();
  /** @type {{ id: string, revision: number }[]} */
  let removed = [];
  /** @type {ContributionEntry[]} */
  let contributions = [];
  /** @type {Map<string, { robot: RobotDescription, atM: number }>} */
  const robots = new Map();
  for (const [robot, plan] of Object.entries(FLEET)) {
    robots.set(robot, {
      atM: plan.startM,
      robot: {
        robot,
        name: plan.name,
        sensors: [{ kind: plan.kind, model: plan.model, range_max_m: plan.rangeMaxM, range_sd_m: 0.02, beam_rad: 0.01, emulated: plan.emulated }],
        competence: [plan.kind],
        state: "active",
        last_pose: null,
        revision: null,
        queue_length: null,
        contributions: 0,
      },
    });
  }

  /**
   * @param {SensorClass} sensor
   * @param {number} xM
   * @param {number} yM
   * @param {number} nats
   * @param {Set<string>} touched
   */
  const addEvidence = (sensor, xM, yM, nats, touched) => {
    const column = Math.floor(xM / RESOLUTION_M);
    const row = Math.floor(yM / RESOLUTION_M);
    const address = { sensor, x: Math.floor(column / TILE_CELLS), y: Math.floor(row / TILE_CELLS) };
    const key = `${sensor}/${address.x}/${address.y}`;
    let tile = tiles.get(key);
    if (tile === undefined) {
      tile = { address, revision, cells: new Float32Array(TILE_CELLS * TILE_CELLS) };
      tiles.set(key, tile);
    }
    const index = (row - address.y * TILE_CELLS) * TILE_CELLS + (column - address.x * TILE_CELLS);
    tile.cells[index] = (tile.cells[index] ?? 0) + nats;
    tile.revision = revision;
    touched.add(key);
  };

  /**
   * Makes one wall, or one thing that no line explains, better known.
   * @param {{ wall: number, fromM: number, toM: number, robot: string, at: string }} sighting
   */
  const addSighting = ({ wall, fromM, toM, robot, at }) => {
    const place = walls[wall];
    if (place === undefined || toM - fromM < 0.15) return;
    const length = Math.hypot(place.to[0] - place.from[0], place.to[1] - place.from[1]);
    const ux = (place.to[0] - place.from[0]) / length;
    const uy = (place.to[1] - place.from[1]) / length;
    // The line's normal must point away from the origin; its direction is the normal turned left.
    let alpha = Math.atan2(-ux, uy);
    let rho = place.from[0] * Math.cos(alpha) + place.from[1] * Math.sin(alpha);
    if (rho < 0) {
      rho = -rho;
      alpha = alpha > 0 ? alpha - Math.PI : alpha + Math.PI;
    }
    const along = (/** @type {number} */ s) =>
      -(place.from[0] + ux * s) * Math.sin(alpha) + (place.from[1] + uy * s) * Math.cos(alpha);
    const [from, to] = [along(fromM), along(toM)].sort((a, b) => a - b);
    const id = `mock-${wall}`;
    const before = segments.get(id)?.segment;
    const old = before?.solid[0];
    const ends = { from_m: Math.min(from ?? 0, old?.from_m ?? Infinity), to_m: Math.max(to ?? 0, old?.to_m ?? -Infinity) };
    const quality = (before?.quality ?? 0) + 1;
    const t = (ends.from_m + ends.to_m) / 2;
    const angleVar = (0.6 * Math.PI / 180) ** 2 / quality;
    const sharedVar = 0.012 ** 2;
    const ownVar = 0.02 ** 2 / quality;
    /** @type {(offsetVar: number, turnVar: number) => import("../../src/wire").Matrix2} */
    const about = (offsetVar, turnVar) => [[offsetVar + t * t * turnVar, t * turnVar], [t * turnVar, turnVar]];
    segments.set(id, {
      revision,
      segment: {
        id,
        rho_m: rho,
        alpha_rad: alpha,
        covariance: about(ownVar + sharedVar, angleVar),
        covariance_independent: about(ownVar, angleVar),
        covariance_dependent: about(sharedVar, 0),
        facing: "origin",
        solid: [{ ...ends, ends: ["corner", quality > 3 ? "jump" : "occluded"], existence_nat: Math.round(289 * quality) / 100 }],
        quality,
        robots: [...new Set([...(before?.robots ?? []), robot])].sort(),
        first_seen: before?.first_seen ?? at,
        last_seen: at,
      },
    });
  };

  /**
   * @param {{ wall: number, robot: string, at: string }} sighting
   */
  const addCluster = ({ wall, robot, at }) => {
    // The eight sides of a pillar follow one another.
    let first = wall;
    while (walls[first - 1]?.round && walls[first - 1]?.to[0] === walls[first]?.from[0]) first--;
    const hull = walls.slice(first, first + 8).map(({ from }) => /** @type {[number, number]} */ ([from[0], from[1]]));
    const id = `mock-cluster-${first}`;
    const before = clusters.get(id)?.cluster;
    /** @type {Cluster} */
    const cluster = {
      id,
      hull_m: hull,
      centroid_m: [hull.reduce((s, p) => s + p[0], 0) / 8, hull.reduce((s, p) => s + p[1], 0) / 8],
      covariance: [[0.0004, 0], [0, 0.0004]],
      points: (before?.points ?? 0) + 9,
      quality: (before?.quality ?? 0) + 1,
      robots: [...new Set([...(before?.robots ?? []), robot])].sort(),
      first_seen: before?.first_seen ?? at,
      last_seen: at,
    };
    clusters.set(id, { revision, cluster });
    addChain(cluster);
  };

  /**
   * A chain around a pillar: real ones come of walls, but to the page one outline is as good.
   * @param {Cluster} cluster
   */
  const addChain = ({ id, hull_m: hull, quality, robots: seenBy, first_seen, last_seen }) => {
    chains.set(`${id}.0`, {
      revision,
      chain: {
        id: `${id}.0`,
        kind: "obstacle",
        closed: true,
        vertices_m: [...hull].reverse(),
        covariances: hull.map(() => [[0.0004, 0], [0, 0.0004]]),
        segments: hull.map(() => id),
        quality,
        robots: seenBy,
        first_seen,
        last_seen,
      },
    });
  };

  /**
   * One robot goes on by a step and looks around.
   * @param {string} name
   * @returns {LevelEvent}
   */
  const look = (name) => {
    const plan = FLEET[name];
    const entry = robots.get(name);
    if (plan === undefined || entry === undefined) throw new Error(`no robot ${name}`);
    revision++;
    entry.atM += STEP_M;
    const pose = poseOn(plan.route, entry.atM);
    const at = new Date(nowMs()).toISOString();
    /** @type {Set<string>} */
    const touched = new Set();
    /** @type {Map<number, [number, number]>} */
    const seen = new Map();
    for (let i = 0; i < plan.beams; i++) {
      const angleRad = pose.heading + (i / (plan.beams - 1) - 0.5) * plan.fieldRad;
      const hit = castRay(walls, { ...pose, angleRad, rangeMaxM: plan.rangeMaxM });
      const spread = plan.kind === "sonar" ? 0.1 : 0;
      const range = (hit?.distanceM ?? plan.rangeMaxM) + normal(random) * 0.015;
      for (let side = -spread; side <= spread + 1e-9; side += 0.05) {
        for (let d = 0.1; d < range - 0.08; d += RESOLUTION_M * 0.8) {
          addEvidence(plan.kind, pose.x + d * Math.cos(angleRad + side), pose.y + d * Math.sin(angleRad + side), -0.35, touched);
        }
        if (hit !== null) {
          addEvidence(plan.kind, pose.x + range * Math.cos(angleRad + side), pose.y + range * Math.sin(angleRad + side), 1.1, touched);
        }
      }
      if (hit !== null) {
        const [from, to] = seen.get(hit.wall) ?? [Infinity, -Infinity];
        seen.set(hit.wall, [Math.min(from, hit.alongM), Math.max(to, hit.alongM)]);
      }
    }
    for (const [wall, [fromM, toM]] of seen) {
      if (walls[wall]?.round) addCluster({ wall, robot: name, at });
      else addSighting({ wall, fromM, toM, robot: name, at });
    }
    const sd = plan.kind === "sonar" ? 0.14 : 0.04;
    entry.robot = {
      ...entry.robot,
      contributions: entry.robot.contributions + 1,
      last_pose: {
        level: "ground",
        x_m: pose.x,
        y_m: pose.y,
        heading_rad: pose.heading,
        covariance: [[sd * sd, 0.3 * sd * sd, 0], [0.3 * sd * sd, sd * sd * 0.7, 0], [0, 0, (sd / 2) ** 2]],
        observed_at: at,
      },
    };
    contributions.unshift({
      id: `0190bbbb-0000-7000-8000-${String(revision).padStart(12, "0")}`,
      revision,
      robot: name,
      observed_at: at,
      received_at: at,
      emulated: plan.emulated,
      segments: seen.size,
      clusters: 0,
      tiles: touched.size,
      pose: [pose.x, pose.y, pose.heading],
      state: "folded",
    });
    return { revision, robots: [name], features: seen.size, tiles: touched.size };
  };

  return {
    look,
    fleet: Object.keys(FLEET),
    revision: () => revision,
    tiles: () => tiles,
    /** Takes a feature out of the map. @param {string} id */
    remove(id) {
      revision++;
      segments.delete(id);
      removed.push({ id, revision });
      return { revision, robots: [], features: 1, tiles: 0 };
    },
    /** The level begins anew in another frame, as after a restored backup. */
    replace() {
      frame = "0190aaaa-0000-7000-8000-000000000002";
      revision = 0;
      segments = new Map();
      clusters = new Map();
      chains = new Map();
      tiles = new Map();
      removed = [];
      contributions = [];
    },
    /** @returns {import("../../src/wire").LevelDescription} */
    describe: () => ({
      site: "plant",
      level: "ground",
      name: "Ground floor",
      frame,
      resolution_m: RESOLUTION_M,
      tile_cells: TILE_CELLS,
      elevation_m: 0,
      evidence_slice_s: 86400,
      revision,
      folded_revision: revision,
      bounds: null,
      counts: { contributions: contributions.length, segments: segments.size, clusters: clusters.size, chains: chains.size, tiles: tiles.size },
      published: null,
    }),
    robots: () => [...robots.values()].map(({ robot }) => robot),
    /** @param {number} limit @param {string | null} robot */
    contributions: (limit, robot) => contributions.filter((entry) => robot === null || entry.robot === robot).slice(0, limit),
    /** @param {number} since @returns {import("../../src/wire").VectorPatch} */
    vector: (since) => ({
      since,
      revision,
      segments: [...segments.values()].filter((one) => one.revision > since).map((one) => one.segment),
      clusters: [...clusters.values()].filter((one) => one.revision > since).map((one) => one.cluster),
      chains: [...chains.values()].filter((one) => one.revision > since).map((one) => one.chain),
      removed: { segments: removed.filter((one) => one.revision > since).map((one) => one.id), clusters: [], tiles: [] },
    }),
    /** @param {number} since @returns {import("../../src/wire").RasterChanges} */
    raster: (since) => ({
      since,
      revision,
      resolution_m: RESOLUTION_M,
      tiles: [...tiles.values()].filter((tile) => tile.revision > since).map((tile) => tile.address),
      removed: [],
    }),
  };
}
