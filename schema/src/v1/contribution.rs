//! What a robot uploads: one look.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use super::{EndKind, Facing, SensorClass};

/// All that one robot saw under one fix. Immutable; the id is the idempotency key.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Contribution {
    /// A UUIDv7 made on the robot and kept there before the first send.
    pub id: Uuid,
    /// The robot's slug.
    pub robot: String,
    /// UUID of the frame that the pose and the evidence are in: the level's; or, of a robot that does not know
    /// where it is, one of its own (see `own_map`).
    pub frame: Uuid,
    /// When it was seen, by the robot's clock, RFC 3339.
    pub observed_at: String,
    /// Whether these readings were derived from those of another sensor (demonstrations).
    #[serde(default)]
    pub emulated: bool,
    /// From where.
    pub pose: PoseEstimate,
    /// Straight pieces of wall, in the robot frame.
    #[serde(default)]
    pub segments: Vec<ObservedSegment>,
    /// What no line explains, in the robot frame.
    #[serde(default)]
    pub clusters: Vec<ObservedCluster>,
    /// Evidence for the grid, in the level frame, at most one entry a sensor class.
    #[serde(default)]
    pub evidence: Vec<EvidencePatch>,
}

/// `level_from_robot` with its covariance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PoseEstimate {
    /// Position, x.
    pub x_m: f64,
    /// Position, y.
    pub y_m: f64,
    /// Heading, counter-clockwise from x.
    pub heading_rad: f64,
    /// Covariance of (x, y, heading), row by row.
    pub covariance: [[f64; 3]; 3],
    /// Where the pose comes from.
    pub provenance: Provenance,
    /// What of the map told it, if the robot found itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub basis: Option<FixBasis>,
}

/// What a robot was localized by, that has found itself: so that it can be told later which poses owe what to which
/// walls.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FixBasis {
    /// The revision of the map that the robot went by.
    pub revision: i64,
    /// Metres driven since it last found its place from nothing.
    pub way_m: f64,
    /// Ids of the map's segments that this look was matched with, at most 1024.
    #[serde(default)]
    pub segments: Vec<String>,
    /// The map's landmarks that it was matched with, [x, y], at most 1024.
    #[serde(default)]
    pub landmarks_m: Vec<[f64; 2]>,
}

/// Where a pose comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Provenance {
    /// Surveyed or a-priori landmarks only.
    Datum,
    /// The shared map.
    SharedMap,
    /// Odometry since the last fix.
    Odometry,
    /// The robot's own map: pose and evidence are in `frame`, a frame of the robot's own, and are held until
    /// it is known where on the level that lies.
    OwnMap,
}

/// A straight piece of wall as one look saw it, in the robot frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ObservedSegment {
    /// Distance of the supporting line from the robot's origin, not negative.
    pub rho_m: f64,
    /// Angle of its normal.
    pub alpha_rad: f64,
    /// Covariance of (rho, alpha) from the sensor only.
    pub covariance: [[f64; 2]; 2],
    /// Lower end along the line, from the foot point of the origin.
    pub from_m: f64,
    /// Upper end, more than `from_m`.
    pub to_m: f64,
    /// The side from which it was seen.
    pub facing: Facing,
    /// The lower and the upper end.
    pub ends: [ObservedEnd; 2],
    /// Number of beams that support it.
    pub points: u32,
    /// Stretches of the supporting line, [from, to] along it, that beams of this look crossed before
    /// they ended well behind it, such as open doors beside this piece of wall: ascending, apart
    /// from each other, at most 64, to the nearest millimetre.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub seen_through_m: Vec<[f64; 2]>,
}

/// An end of an observed segment.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ObservedEnd {
    /// What it is.
    pub kind: EndKind,
    /// Standard deviation of its place along the line.
    pub sd_m: f64,
}

/// Points that no line explains, in the robot frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ObservedCluster {
    /// Convex hull, counter-clockwise, [x, y] in metres.
    pub hull_m: Vec<[f64; 2]>,
    /// Mean of the points.
    pub centroid_m: [f64; 2],
    /// Covariance of the mean from the sensor only.
    pub covariance: [[f64; 2]; 2],
    /// Number of points.
    pub points: u32,
}

/// What one look adds to the grid, for one class of sensor.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct EvidencePatch {
    /// The layer.
    pub sensor: SensorClass,
    /// The touched tiles, ascending by (x, y), each once.
    pub tiles: Vec<TilePatch>,
}

/// What one look adds to one tile.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TilePatch {
    /// Tiles to the right of the level's origin.
    pub x: i32,
    /// Tiles up from the level's origin.
    pub y: i32,
    /// Runs of equal evidence, flat: start, length, value, start, length, value, ... with start
    /// the cell's offset in the tile (64 x 64, row by row from below) and value in 0.01 nat.
    pub runs: Vec<i32>,
}

/// What has become of a contribution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ContributionState {
    /// In the map.
    Folded,
    /// Kept out until reviewed.
    Held,
    /// Taken out again.
    Reverted,
}

/// A line of the log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ContributionEntry {
    /// The contribution.
    pub id: Uuid,
    /// Its place in the level's log.
    pub revision: i64,
    /// Who sent it.
    pub robot: String,
    /// When it was seen, by the robot's clock.
    pub observed_at: String,
    /// When the server took it.
    pub received_at: String,
    /// Whether its readings were emulated.
    pub emulated: bool,
    /// Number of segments in it.
    pub segments: u32,
    /// Number of clusters in it.
    pub clusters: u32,
    /// Number of tiles in it.
    pub tiles: u32,
    /// Where the robot was: [x, y, heading].
    pub pose: [f64; 3],
    /// The robot's own frame that the pose is in; absent if it is the level's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frame: Option<Uuid>,
    /// What has become of it.
    pub state: ContributionState,
}

/// A line of the log with all that was uploaded.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ContributionRecord {
    /// The line.
    pub entry: ContributionEntry,
    /// SHA-256 of its canonical CBOR, lower-case hexadecimal.
    pub digest: String,
    /// What was uploaded.
    pub contribution: Contribution,
}

/// A page of the log.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ContributionPage {
    /// Entries, newest first.
    pub contributions: Vec<ContributionEntry>,
    /// Pass as `cursor` for the next page; absent on the last.
    #[serde(default)]
    pub next: Option<String>,
}
