//! Reverts: contributions taken out of the map by operators, and put back.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use super::Bounds;

/// Which contributions are to be taken out: either `contributions`, or a `robot` and a time span.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewRevert {
    /// A UUID made by whoever asks, so that asking twice is asking once; made by the server if
    /// absent.
    #[serde(default)]
    pub id: Option<Uuid>,
    /// These contributions, at most 1000.
    #[serde(default)]
    pub contributions: Option<Vec<Uuid>>,
    /// All contributions of this robot, within the span if there is one.
    #[serde(default)]
    pub robot: Option<String>,
    /// What was seen at this instant or later, by the robot's clock, RFC 3339.
    #[serde(default)]
    pub from: Option<String>,
    /// What was seen before this instant, by the robot's clock, RFC 3339.
    #[serde(default)]
    pub to: Option<String>,
    /// Why, for those who read the log; may be absent from a preview.
    #[serde(default)]
    pub reason: String,
}

/// Contributions of one robot.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct RobotShare {
    /// The robot.
    pub robot: String,
    /// How many of them are its.
    pub contributions: u32,
}

/// A revert as the log has it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Revert {
    /// Its identity.
    pub id: Uuid,
    /// Its place in the level's log.
    pub revision: i64,
    /// When the server took it.
    pub at: String,
    /// Public id of the token that asked for it.
    pub author: String,
    /// Why.
    pub reason: String,
    /// The robot, if a robot and a span were asked for.
    #[serde(default)]
    pub robot: Option<String>,
    /// The beginning of that span, if it has one.
    #[serde(default)]
    pub from: Option<String>,
    /// The end of that span, if it has one.
    #[serde(default)]
    pub to: Option<String>,
    /// Contributions that it covers: they stay out for as long as it stands.
    pub contributions: u32,
    /// Those of them that were in the map until then; another revert had taken out the others.
    pub taken_out: u32,
    /// Whose the covered ones are, by robot.
    pub robots: Vec<RobotShare>,
    /// How it was undone, if it was.
    #[serde(default)]
    pub undone: Option<Undone>,
}

/// How a revert was undone.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Undone {
    /// The undoing's place in the level's log.
    pub revision: i64,
    /// When the server took it.
    pub at: String,
    /// Public id of the token that asked for it.
    pub author: String,
    /// Contributions that it put back into the map; another revert keeps the others out.
    pub put_back: u32,
}

/// A revert and all that it covers.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct RevertRecord {
    /// The revert.
    pub revert: Revert,
    /// The contributions that it covers, in the order of the log.
    pub contributions: Vec<Uuid>,
}

/// A page of the reverts of a level.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct RevertPage {
    /// Reverts, newest first.
    pub reverts: Vec<Revert>,
    /// Pass as `cursor` for the next page; absent on the last.
    #[serde(default)]
    pub next: Option<String>,
}

/// What a revert, or undoing one, would change.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RevertPreview {
    /// The revision of the map for which this holds.
    pub revision: i64,
    /// Contributions that it covers.
    pub contributions: u32,
    /// Those of them that it would take out of the map, or put back into it.
    pub moved: u32,
    /// Whose the covered ones are, by robot.
    pub robots: Vec<RobotShare>,
    /// Segments.
    pub segments: ChangeCounts,
    /// Clusters.
    pub clusters: ChangeCounts,
    /// Chains.
    #[serde(default)]
    pub chains: ChangeCounts,
    /// Tiles of all layers.
    pub tiles: ChangeCounts,
    /// What covers all that would change, before and after; absent if nothing would.
    #[serde(default)]
    pub bounds: Option<Bounds>,
    /// The segments, clusters and chains that would change, at most 200.
    pub features: Vec<ChangedFeature>,
    /// Whether there are more of them.
    pub more_features: bool,
}

/// How many things of a kind would change.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
pub struct ChangeCounts {
    /// Things that the map does not have now.
    pub new: u32,
    /// Things that would look different.
    pub changed: u32,
    /// Things that would be no more.
    pub removed: u32,
}

/// A segment, cluster or chain that would change.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ChangedFeature {
    /// Its identity.
    pub id: String,
    /// What it is.
    pub kind: FeatureKind,
    /// What would become of it.
    pub change: ChangeKind,
}

/// Kinds of features.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FeatureKind {
    /// A segment.
    Segment,
    /// A cluster.
    Cluster,
    /// A chain.
    Chain,
}

/// What becomes of a thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ChangeKind {
    /// It is not there now.
    New,
    /// It would look different.
    Changed,
    /// It would be no more.
    Removed,
}
