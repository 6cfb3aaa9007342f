// What the server says: the types generated from schema/openapi.json under shorter names. Metres,
// radians; instants are RFC 3339 in UTC. JSON Schema as the server writes it does not tell the
// lengths of arrays that always have the same; these are told here.

import type { components } from "./api.gen";

type Wire = components["schemas"];
/** `T` with some of its fields told more exactly. */
type Exactly<T, U extends Partial<T>> = Omit<T, keyof U> & U;

export type Matrix2 = [[number, number], [number, number]];
export type Matrix3 = [[number, number, number], [number, number, number], [number, number, number]];

export type SensorClass = Wire["SensorClass"];
export type EndKind = Wire["EndKind"];
export type SessionDescription = Wire["SessionDescription"];
export type SiteDescription = Wire["SiteDescription"];
export type LevelDescription = Wire["LevelDescription"];
export type LevelEvent = Wire["LevelEvent"];
export type TileAddress = Wire["TileAddress"];
export type TilePlace = Wire["TilePlace"];
export type RasterChanges = Wire["RasterChanges"];
export type Problem = Wire["Problem"];

export type SolidInterval = Exactly<Wire["SolidInterval"], { ends: [EndKind, EndKind] }>;
export type Segment = Exactly<
  Wire["Segment"],
  {
    covariance: Matrix2;
    covariance_independent: Matrix2;
    covariance_dependent: Matrix2;
    solid: SolidInterval[];
  }
>;
export type Cluster = Exactly<
  Wire["Cluster"],
  { hull_m: [number, number][]; centroid_m: [number, number]; covariance: Matrix2 }
>;
export type Chain = Exactly<Wire["Chain"], { vertices_m: [number, number][]; covariances: Matrix2[] }>;
export type VectorPatch = Exactly<
  Wire["VectorPatch"],
  { segments: Segment[]; clusters: Cluster[]; chains?: Chain[] }
>;

export type LastPose = Exactly<Wire["LastPose"], { covariance: Matrix3 }>;
export type UncertainPose = Exactly<Wire["UncertainPose"], { covariance: Matrix3 }>;
export type RobotFix = Exactly<
  Wire["RobotFix"],
  { places: UncertainPose[]; landmarks_m?: [number, number][] }
>;
export type RobotDescription = Exactly<
  Wire["RobotDescription"],
  { last_pose?: LastPose | null; fix?: RobotFix | null }
>;

export type ContributionEntry = Exactly<Wire["ContributionEntry"], { pose: [number, number, number] }>;
export type ContributionPage = Exactly<Wire["ContributionPage"], { contributions: ContributionEntry[] }>;

export type PlanCorner = Exactly<Wire["PlanCorner"], { at_m: [number, number] }>;
export type PlanOpening = Exactly<
  Wire["PlanOpening"],
  { sides: Exactly<Wire["PlanOpeningSide"], { from_m: [number, number]; to_m: [number, number] }>[] }
>;
export type GdbPlan = Exactly<
  Wire["GdbPlan"],
  { outlines: PlanCorner[][]; sheets: PlanCorner[][]; openings: PlanOpening[] }
>;
export type ObjectKind = Wire["ObjectKind"];
export type DoorKind = Wire["DoorKind"];
export type Triple = [number, number, number];
export type GdbPlacement = Exactly<Wire["GdbPlacement"], { position_m: Triple; rotation?: [number, number, number, number] | null }>;
export type GdbBox = Exactly<Wire["GdbBox"], { from_m: Triple; to_m: Triple }>;
export type GdbPrism = Exactly<Wire["GdbPrism"], { base_m: [number, number][][] }>;
export type GdbCylinder = Exactly<Wire["GdbCylinder"], { centre_m: [number, number] }>;
export type GdbPolyhedron = Exactly<Wire["GdbPolyhedron"], { vertices_m: Triple[] }>;
export type GdbSolid = { box: GdbBox } | { prism: GdbPrism } | { cylinder: GdbCylinder } | { polyhedron: GdbPolyhedron };
export type GdbObject = Exactly<Wire["GdbObject"], { solids?: GdbSolid[] | null; placement?: GdbPlacement | null }>;
export type GdbPrototype = Exactly<Wire["GdbPrototype"], { solids: GdbSolid[] }>;
export type GdbCollection = Omit<Wire["GdbCollection"], "features"> & { features: { id: string; properties: GdbObject }[] };
export type PrototypeCollection = Omit<Wire["PrototypeCollection"], "features"> & { features: { id: string; properties: GdbPrototype }[] };
/** `PATCH L/gdb`: objects put as they are to be, and others removed. */
export interface GdbEdit {
  put: { type: "Feature"; id: string; properties: GdbObject }[];
  remove: string[];
}
export type GdbPreview = Exactly<Wire["GdbPreview"], { findings: GdbFinding[] }>;
export type GdbEntry = Wire["GdbEntry"];
export type GdbEntryPage = Wire["GdbEntryPage"];
export type GdbFinding = Exactly<Wire["GdbFinding"], { at_m?: [number, number, number] | null }>;
export type GdbFindings = Exactly<Wire["GdbFindings"], { findings: GdbFinding[] }>;
export type GdbAnswer = Wire["GdbAnswer"];
export type ModelChangeKind = Wire["ModelChangeKind"];
export type ModelChangeState = Wire["ModelChangeState"];
export type ModelChangeAnswer = Wire["ModelChangeAnswer"];
export type ModelChange = Exactly<
  Wire["ModelChange"],
  { hull_m: [number, number][]; stretches?: Exactly<Wire["OpenStretch"], { from_m: [number, number]; to_m: [number, number] }>[] }
>;
export type ModelChanges = Exactly<Wire["ModelChanges"], { changes: ModelChange[] }>;
export type ModelChangeAnswered = Exactly<Wire["ModelChangeAnswered"], { change: ModelChange }>;
export type Alignment = Exactly<Wire["Alignment"], { pose: UncertainPose }>;
export type AlignmentCandidate = Exactly<Wire["AlignmentCandidate"], { pose: UncertainPose }>;
export type AlignmentDoubt = Wire["AlignmentDoubt"];
export type UnalignedFrame = Exactly<Wire["UnalignedFrame"], { candidates: AlignmentCandidate[] }>;
export type Alignments = Exactly<Wire["Alignments"], { unaligned: UnalignedFrame[]; alignments: Alignment[] }>;
export type LandmarkKind = Wire["LandmarkKind"];
export type Landmark = Exactly<Wire["Landmark"], { at_m: [number, number]; covariance: Matrix3 }>;
export type LandmarkTable = Exactly<Wire["LandmarkTable"], { landmarks: Landmark[] }>;

export type BuildingImport = Exactly<Wire["BuildingImport"], { preview?: GdbPreview | null }>;
export type ModelImport = Exactly<Wire["ModelImport"], { preview?: GdbPreview | null }>;

export type NewRevert = Wire["NewRevert"];
export type Revert = Wire["Revert"];
export type RevertPage = Wire["RevertPage"];
export type RevertPreview = Wire["RevertPreview"];
export type Import = Wire["Import"];
export type ImportPage = Wire["ImportPage"];
export type ImportReport = Wire["ImportReport"];
export type RobotShare = Wire["RobotShare"];
export type ChangeCounts = Wire["ChangeCounts"];
