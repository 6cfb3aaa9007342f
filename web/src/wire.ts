// What the server says, as in `schema/src/v1`. Metres, radians; instants are RFC 3339 in UTC.

export type SensorClass = "scanner" | "sonar";
export type EndKind = "corner" | "jump" | "occluded";
export type Matrix2 = [[number, number], [number, number]];
export type Matrix3 = [[number, number, number], [number, number, number], [number, number, number]];

export interface SiteDescription {
  site: string;
  name: string;
  levels: string[];
}

export interface Bounds {
  min_x_m: number;
  min_y_m: number;
  max_x_m: number;
  max_y_m: number;
}

export interface LevelDescription {
  site: string;
  level: string;
  name: string;
  frame: string;
  resolution_m: number;
  tile_cells: number;
  elevation_m: number;
  revision: number;
  folded_revision: number;
  bounds?: Bounds | null;
  counts: { contributions: number; segments: number; clusters: number; tiles: number };
  published?: string | null;
}

export interface SolidInterval {
  from_m: number;
  to_m: number;
  ends: [EndKind, EndKind];
}

export interface Segment {
  id: string;
  rho_m: number;
  alpha_rad: number;
  covariance: Matrix2;
  covariance_dependent: Matrix2;
  facing: "origin" | "away";
  solid: SolidInterval[];
  quality: number;
  robots: string[];
  first_seen: string;
  last_seen: string;
}

export interface Cluster {
  id: string;
  hull_m: [number, number][];
  centroid_m: [number, number];
  covariance: Matrix2;
  points: number;
  quality: number;
  robots: string[];
  first_seen: string;
  last_seen: string;
}

export interface TileAddress {
  sensor: SensorClass;
  x: number;
  y: number;
}

export interface VectorPatch {
  since: number;
  revision: number;
  segments: Segment[];
  clusters: Cluster[];
  removed: { segments: string[]; clusters: string[]; tiles: TileAddress[] };
}

export interface RasterChanges {
  since: number;
  revision: number;
  resolution_m: number;
  tiles: TileAddress[];
  removed: TileAddress[];
}

export interface SensorProfile {
  kind: SensorClass;
  model: string;
  range_max_m: number;
  range_sd_m: number;
  beam_rad: number;
  emulated: boolean;
}

export interface LastPose {
  level: string;
  x_m: number;
  y_m: number;
  heading_rad: number;
  covariance: Matrix3;
  observed_at: string;
}

export interface RobotDescription {
  robot: string;
  name: string;
  sensors: SensorProfile[];
  competence: SensorClass[];
  state: "active" | "held";
  last_pose?: LastPose | null;
  revision?: number | null;
  queue_length?: number | null;
  contributions: number;
}

export interface ContributionEntry {
  id: string;
  revision: number;
  robot: string;
  observed_at: string;
  received_at: string;
  emulated: boolean;
  segments: number;
  clusters: number;
  tiles: number;
  pose: [number, number, number];
  state: "folded" | "held" | "reverted";
}

export interface ContributionPage {
  contributions: ContributionEntry[];
  next?: string | null;
}

export interface LevelEvent {
  revision: number;
  robots: string[];
  features: number;
  tiles: number;
}

export interface Problem {
  type: string;
  title: string;
  status: number;
  detail: string;
  code: string;
  retryable: boolean;
}

export interface SessionDescription {
  id: string;
  scopes: string[];
  site?: string | null;
  robot?: string | null;
  expires_at?: string | null;
}
