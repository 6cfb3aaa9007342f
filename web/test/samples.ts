// Small made-up things of a level, for tests.

import type { Permalink } from "../src/permalink";
import { DEFAULT_LAYERS } from "../src/layers";
import { initialState, update, type Event, type State } from "../src/state";
import type {
  Chain,
  Cluster,
  ContributionEntry,
  LastPose,
  LevelDescription,
  RasterChanges,
  RobotDescription,
  Segment,
  SensorClass,
  TileAddress,
  VectorPatch,
} from "../src/wire";

/** Noon of some day, by the server's clock. */
export const NOON_MS = Date.UTC(2026, 10, 22, 12, 0, 0);

export const NO_LINK: Permalink = { place: null, view: { kind: "fit" }, layers: DEFAULT_LAYERS, evidence: "all" };

/** The wall x = 2 from y = 1 to y = 4, unless told otherwise. */
export function segment(id: string, fields: Partial<Segment> = {}): Segment {
  return {
    id,
    rho_m: 2,
    alpha_rad: 0,
    covariance: [
      [0.0004, 0],
      [0, 0.0001],
    ],
    covariance_independent: [
      [0.0003, 0],
      [0, 0.0001],
    ],
    covariance_dependent: [
      [0.0001, 0],
      [0, 0],
    ],
    facing: "origin",
    solid: [{ from_m: 1, to_m: 4, ends: ["corner", "jump"], existence_nat: 8.67 }],
    quality: 3,
    robots: ["ada"],
    first_seen: "2026-11-22T11:00:00Z",
    last_seen: "2026-11-22T11:30:00Z",
    ...fields,
  };
}

/** A square metre whose lower left corner is at (5, 5). */
export function cluster(id: string, fields: Partial<Cluster> = {}): Cluster {
  return {
    id,
    hull_m: [
      [5, 5],
      [6, 5],
      [6, 6],
      [5, 6],
    ],
    centroid_m: [5.5, 5.5],
    covariance: [
      [0.01, 0],
      [0, 0.04],
    ],
    points: 12,
    quality: 2,
    robots: ["ada"],
    first_seen: "2026-11-22T11:00:00Z",
    last_seen: "2026-11-22T11:30:00Z",
    ...fields,
  };
}

/** The square from (5, 5) to (7, 7), of walls of which the one below is `w`. */
export function chain(id: string, fields: Partial<Chain> = {}): Chain {
  return {
    id,
    kind: "obstacle",
    closed: true,
    vertices_m: [
      [5, 5],
      [5, 7],
      [7, 7],
      [7, 5],
    ],
    covariances: Array.from({ length: 4 }, () => [
      [0.0001, 0],
      [0, 0.0004],
    ]),
    segments: ["x", "y", "z", "w"],
    quality: 2,
    robots: ["ada"],
    first_seen: "2026-11-22T11:00:00Z",
    last_seen: "2026-11-22T11:30:00Z",
    ...fields,
  };
}

export function tile(x: number, y: number, sensor: SensorClass = "scanner"): TileAddress {
  return { sensor, x, y };
}

export function vectorPatch(since: number, revision: number, fields: Partial<VectorPatch> = {}): VectorPatch {
  return {
    since,
    revision,
    segments: [],
    clusters: [],
    removed: { segments: [], clusters: [], tiles: [] },
    ...fields,
  };
}

export function rasterChanges(since: number, revision: number, fields: Partial<RasterChanges> = {}): RasterChanges {
  return { since, revision, resolution_m: 0.05, tiles: [], removed: [], ...fields };
}

/** At the origin, looking along x. */
export function lastPose(onLevel: string): LastPose {
  return {
    level: onLevel,
    x_m: 0,
    y_m: 0,
    heading_rad: 0,
    covariance: [
      [0.01, 0, 0],
      [0, 0.01, 0],
      [0, 0, 0.0001],
    ],
    observed_at: "2026-11-22T11:59:00Z",
  };
}

export function robot(slug: string, fields: Partial<RobotDescription> = {}): RobotDescription {
  return {
    robot: slug,
    name: slug,
    sensors: [{ kind: "scanner", model: "", range_max_m: 10, range_sd_m: 0.02, beam_rad: 0.01, emulated: false }],
    competence: ["scanner"],
    state: "active",
    last_pose: lastPose("ground"),
    revision: null,
    queue_length: null,
    contributions: 4,
    ...fields,
  };
}

export function level(fields: Partial<LevelDescription> = {}): LevelDescription {
  return {
    site: "plant",
    level: "ground",
    name: "Ground floor",
    frame: "frame-1",
    resolution_m: 0.05,
    tile_cells: 64,
    elevation_m: 0,
    evidence_slice_s: 86400,
    revision: 7,
    folded_revision: 7,
    bounds: null,
    counts: { contributions: 7, segments: 1, clusters: 1, chains: 1, tiles: 2 },
    published: null,
    ...fields,
  };
}

export function entry(revision: number, fields: Partial<ContributionEntry> = {}): ContributionEntry {
  return {
    id: `id-${revision}`,
    revision,
    robot: "ada",
    observed_at: "2003-05-01T08:00:00Z",
    received_at: "2026-11-22T11:59:30Z",
    emulated: false,
    segments: 3,
    clusters: 0,
    tiles: 5,
    pose: [1, 2, 0],
    state: "folded",
    ...fields,
  };
}

/** The state after events, from a page just opened. */
export function after(...events: readonly Event[]): State {
  return events.reduce(update, initialState(NO_LINK, NOON_MS));
}

/** Events that bring a page to a level with one robot. */
export const ON_GROUND: readonly Event[] = [
  { kind: "session", session: { kind: "in", who: { id: "t", scopes: ["admin"] } } },
  { kind: "sites", sites: [{ site: "plant", name: "Plant", levels: ["ground", "upper"] }] },
  { kind: "level", level: level() },
  { kind: "robots", robots: [robot("ada")] },
];
