//! Robots and their sensors.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{SensorKind, SensorProfile, UncertainPose};

/// A robot to be enrolled.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewRobot {
    /// Slug: lower-case letters, digits and hyphens.
    pub robot: String,
    /// Name for people; the slug if absent.
    #[serde(default)]
    pub name: Option<String>,
    /// Its sensors; its competence follows from them.
    pub sensors: Vec<SensorProfile>,
}

/// What may be changed of a robot; what is absent stays.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotUpdate {
    /// Name for people.
    #[serde(default)]
    pub name: Option<String>,
    /// Its sensors.
    #[serde(default)]
    pub sensors: Option<Vec<SensorProfile>>,
    /// Whether what it sends goes into the map.
    #[serde(default)]
    pub state: Option<RobotState>,
    /// The revision of its level that it runs, as it reports.
    #[serde(default)]
    pub revision: Option<i64>,
    /// Contributions that wait in its outbox, as it reports.
    #[serde(default)]
    pub queue_length: Option<i64>,
    /// What it knows of its place, as it reports.
    #[serde(default)]
    pub fix: Option<RobotFix>,
}

/// What a robot knows of its place.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RobotFix {
    /// Slug of the level.
    pub level: String,
    /// When, by the robot's clock, RFC 3339.
    pub observed_at: String,
    /// How well it knows.
    pub kind: FixKind,
    /// Where it is, or where it may be, likeliest first, at most 16: one if `unique` or `tracked`, none if `no_match`.
    pub places: Vec<UncertainPose>,
    /// Ids of the map's segments that its last look was matched with, at most 1024.
    #[serde(default)]
    pub segments: Vec<String>,
    /// The map's landmarks that it was matched with, [x, y], at most 1024.
    #[serde(default)]
    pub landmarks_m: Vec<[f64; 2]>,
}

/// How well a robot knows its place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FixKind {
    /// Found from nothing just now, and there is no other place.
    Unique,
    /// Carried on since it was found, and held against the map.
    Tracked,
    /// One of several, or one that is not among them.
    Ambiguous,
    /// Nothing on the map fits what it sees.
    NoMatch,
}

/// Whether what a robot sends goes into the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RobotState {
    /// It does.
    Active,
    /// It is kept for review.
    Held,
}

/// Where a robot last was.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LastPose {
    /// Slug of the level.
    pub level: String,
    /// Position, x.
    pub x_m: f64,
    /// Position, y.
    pub y_m: f64,
    /// Heading.
    pub heading_rad: f64,
    /// Covariance of (x, y, heading).
    pub covariance: [[f64; 3]; 3],
    /// When, by the robot's clock.
    pub observed_at: String,
}

/// A robot as it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RobotDescription {
    /// Slug.
    pub robot: String,
    /// Name for people.
    pub name: String,
    /// Its sensors.
    pub sensors: Vec<SensorProfile>,
    /// Kinds of its sensors, each once.
    pub competence: Vec<SensorKind>,
    /// Whether what it sends goes into the map.
    pub state: RobotState,
    /// Where it last was, if it ever contributed.
    #[serde(default)]
    pub last_pose: Option<LastPose>,
    /// The revision that it runs, as it last reported.
    #[serde(default)]
    pub revision: Option<i64>,
    /// Contributions that wait in its outbox, as it last reported.
    #[serde(default)]
    pub queue_length: Option<i64>,
    /// What it knew of its place when it last reported.
    #[serde(default)]
    pub fix: Option<RobotFix>,
    /// Contributions of it that the server has.
    pub contributions: i64,
    /// Those of them that are reverted.
    #[serde(default)]
    pub reverted: i64,
}
