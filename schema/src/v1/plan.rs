//! What a sensor at one height would see of the GDB, and the landmarks there.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use super::gdb::ObjectKind;

/// An edge of an outline or a sheet: from its corner to the next one.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PlanCorner {
    /// Where it is.
    pub at_m: [f64; 2],
    /// Whose surface begins there: an index into `objects`. The last corner of a sheet repeats the one before.
    pub object: u32,
}

/// An object that a plan shows something of.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PlanObject {
    /// Which one.
    pub id: Uuid,
    /// What it is.
    pub kind: ObjectKind,
    /// Standard deviation of where it stands.
    pub tolerance_m: f64,
    /// How far it is to be believed that it is there.
    pub trust: f64,
}

/// Where a doorway opens one face of a wall.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PlanOpeningSide {
    /// The wall.
    pub wall: Uuid,
    /// One jamb; seen from there to the other one, the wall is on the right.
    pub from_m: [f64; 2],
    /// The other jamb.
    pub to_m: [f64; 2],
}

/// A doorway that leads through something at this height.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PlanOpening {
    /// The doorway.
    pub doorway: Uuid,
    /// Its width.
    pub width_m: f64,
    /// The stretches of walls that it opens; two for a doorway through one straight wall.
    pub sides: Vec<PlanOpeningSide>,
}

/// `GET L/gdb/plan`: the GDB cut just above one height.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct GdbPlan {
    /// The height above the level's floor.
    pub height_m: f64,
    /// The draft that is shown.
    pub draft: i64,
    /// The library that instances are taken from.
    pub library: i64,
    /// The objects that edges belong to, by identity.
    pub objects: Vec<PlanObject>,
    /// Closed outlines of what is solid, free space on their left: clockwise about something that stands in a
    /// room, counter-clockwise within a room.
    pub outlines: Vec<Vec<PlanCorner>>,
    /// Surfaces without thickness, seen from both sides.
    pub sheets: Vec<Vec<PlanCorner>>,
    /// Doorways.
    pub openings: Vec<PlanOpening>,
}

/// Kinds of landmarks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum LandmarkKind {
    /// A corner with more than half of the view free.
    ConvexCorner,
    /// A corner with less than half of the view free.
    ConcaveCorner,
    /// The free end of a thin wall.
    WallEnd,
    /// A doorway.
    Doorway,
}

/// A landmark: what robots find themselves by.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Landmark {
    /// Its identity: kind, objects and place.
    pub id: String,
    /// What it is.
    pub kind: LandmarkKind,
    /// Where it is known from.
    pub source: LandmarkSource,
    /// Where it is.
    pub at_m: [f64; 2],
    /// Into free space: the bisector of a corner, outward from an end; of a doorway the normal of its wall, in
    /// (-pi/2, pi/2].
    pub heading_rad: f64,
    /// Covariance of x, y and heading.
    pub covariance: [[f64; 3]; 3],
    /// The angle of free space at a corner, radians; the width of a doorway or an end, metres.
    pub extent: f64,
    /// The objects that make it, or the segments' ids.
    pub objects: Vec<String>,
    /// Of what robots saw: who bears it out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub support: Option<LandmarkSupport>,
}

/// Who bears out a landmark that robots saw.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct LandmarkSupport {
    /// Quality: distinct looks at the least seen of its walls.
    pub looks: u32,
    /// Who saw any of its walls, ascending.
    pub robots: Vec<String>,
}

/// Where a landmark is known from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum LandmarkSource {
    /// The published GDB.
    Gdb,
    /// What robots saw, and what the published GDB does not know.
    Learned,
}

/// `GET L/landmarks`: those that changed, or all of them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LandmarkTable {
    /// The revision of the level for which this holds: the `since` of the next question.
    pub revision: i64,
    /// The publication of the GDB that they are of; 0 if there is none.
    pub publication: i64,
    /// The height that they are seen at.
    pub height_m: f64,
    /// New landmarks, and those that are another than they were.
    pub landmarks: Vec<Landmark>,
    /// Landmarks that are no more, or no longer where they are asked for.
    pub removed: Vec<String>,
}
