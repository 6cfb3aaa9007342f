//! What the map publishes.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The side of a supporting line from which it is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Facing {
    /// From the side on which the frame's origin lies.
    Origin,
    /// From the far side.
    Away,
}

/// What an end of a segment is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum EndKind {
    /// Another wall meets it there.
    Corner,
    /// A physical end of the wall.
    Jump,
    /// The view ended, not the wall.
    Occluded,
}

/// A class of sensors, with layers of its own in the grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum SensorClass {
    /// Scanners: narrow beams.
    Scanner,
    /// Ultrasonic range finders: wide cones.
    Sonar,
}

/// A part of a wall that was seen and not seen through.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SolidInterval {
    /// Lower end along the line, from the foot point of the level's origin: whole millimetres.
    pub from_m: f64,
    /// Upper end, whole millimetres.
    pub to_m: f64,
    /// What the lower and the upper end are.
    pub ends: [EndKind; 2],
    /// Log-odds that it is there, in whole hundredths of a nat: looks that saw it speak for it,
    /// looks that saw through it against it.
    pub existence_nat: f64,
}

/// A straight piece of wall of the map, in the level frame.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Segment {
    /// `<contribution uuid>-<index>` of the observation that founded it.
    pub id: String,
    /// Distance of the supporting line from the level's origin, not negative.
    pub rho_m: f64,
    /// Angle of its normal.
    pub alpha_rad: f64,
    /// Covariance of (rho, alpha): the sum of the two parts, for readers that use it whole.
    pub covariance: [[f64; 2]; 2],
    /// The part of it that is independent from look to look. It travels beside the sum because
    /// the difference would have lost bits, and a mirror equals the server's map bit for bit.
    pub covariance_independent: [[f64; 2]; 2],
    /// The part of it that other segments may share.
    pub covariance_dependent: [[f64; 2]; 2],
    /// The side from which it is seen.
    pub facing: Facing,
    /// The solid parts, ascending.
    pub solid: Vec<SolidInterval>,
    /// The number of distinct looks that support it.
    pub quality: u32,
    /// Who saw it.
    pub robots: Vec<String>,
    /// Earliest look.
    pub first_seen: String,
    /// Latest look.
    pub last_seen: String,
}

/// What a chain encloses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ChainKind {
    /// Nothing: it is open.
    Polyline,
    /// Closed, with free space outside: a thing that stands in a room.
    Obstacle,
    /// Closed, with free space inside.
    Room,
}

/// Walls that meet at their ends, in the level frame, with free space on the left of whoever walks
/// along them. Never meets itself.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Chain {
    /// `<segment id>.<piece>` of the piece of wall that it is called after.
    pub id: String,
    /// What it encloses.
    pub kind: ChainKind,
    /// Whether the last vertex is joined to the first: not for a polyline.
    pub closed: bool,
    /// The vertices in order, [x, y]; of a closed chain at least 3, and the first is not repeated.
    pub vertices_m: Vec<[f64; 2]>,
    /// Covariance of each vertex, safe for any correlation of what its walls may share.
    pub covariances: Vec<[[f64; 2]; 2]>,
    /// The segments that its edges lie on, edge by edge.
    pub segments: Vec<String>,
    /// The least quality of its segments: each part of it was seen in so many distinct looks.
    pub quality: u32,
    /// Who saw any of it.
    pub robots: Vec<String>,
    /// Earliest look.
    pub first_seen: String,
    /// Latest look.
    pub last_seen: String,
}

/// A thing of the map that no line explains.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Cluster {
    /// `<contribution uuid>-<index>` of the observation that founded it.
    pub id: String,
    /// Convex hull in the level frame, counter-clockwise, [x, y].
    pub hull_m: Vec<[f64; 2]>,
    /// Fused centroid.
    pub centroid_m: [f64; 2],
    /// Covariance of the centroid.
    pub covariance: [[f64; 2]; 2],
    /// Number of points in all looks.
    pub points: u64,
    /// The number of distinct looks that support it.
    pub quality: u32,
    /// Who saw it.
    pub robots: Vec<String>,
    /// Earliest look.
    pub first_seen: String,
    /// Latest look.
    pub last_seen: String,
}
