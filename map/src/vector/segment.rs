//! Straight pieces of wall: as one look saw them, and as the map knows them.

use crate::geometry::{Covariance, Interval, Level, Line, Robot, UncertainLine};
use crate::level::RobotName;
use crate::raster::LogOdds;

/// The side of a supporting line from which it is seen.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Facing {
    /// From the side on which the frame's origin lies.
    Origin,
    /// From the far side.
    Away,
}

impl Facing {
    /// The other side.
    #[must_use]
    pub fn opposite(self) -> Self {
        match self {
            Self::Origin => Self::Away,
            Self::Away => Self::Origin,
        }
    }
}

/// What an end of a segment is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum EndKind {
    /// Another wall meets it there.
    Corner,
    /// The wall ends and the view goes on: a physical end.
    Jump,
    /// The view ended, not the wall.
    Occluded,
}

/// One end of an observed segment.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ObservedEnd {
    /// What it is.
    pub kind: EndKind,
    /// Standard deviation of its place along the line, metres.
    pub sd: f64,
}

/// A straight piece of wall in one look, in the robot frame.
#[derive(Debug, Clone, PartialEq)]
pub struct ObservedSegment {
    /// Supporting line with the sensor's covariance only.
    pub line: UncertainLine<Robot>,
    /// Coordinate of the lower end along the line, from the foot point of the robot's origin.
    pub from: f64,
    /// Coordinate of the upper end, more than `from`.
    pub to: f64,
    /// From which side it was seen.
    pub facing: Facing,
    /// The lower and the upper end.
    pub ends: [ObservedEnd; 2],
    /// Number of beams that support it.
    pub points: u32,
    /// Stretches of the supporting line that beams of this look crossed before they ended well
    /// behind it: there is no wall. Millimetres along the line as `from` and `to`, ascending,
    /// disjoint. What is in none of them may have been hidden as well as solid.
    pub seen_through: Vec<Interval>,
}

/// A piece of a wall that was seen and not seen through.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SolidInterval {
    /// Millimetres along the line, from the foot point of the level's origin.
    pub span: Interval,
    /// What the lower and the upper end are.
    pub ends: [EndKind; 2],
    /// Log-odds that it is there, from the looks that saw it and those that say they saw through
    /// it, averaged along it.
    pub existence: LogOdds,
}

/// A straight piece of wall of the map: one supporting line and the parts of it that are solid.
#[derive(Debug, Clone, PartialEq)]
pub struct Segment {
    /// Supporting line, in normal form.
    pub line: Line<Level>,
    /// Covariance of (rho, alpha) that is independent from look to look: it averages out.
    pub independent: Covariance<2>,
    /// Covariance of (rho, alpha) that other segments may share: it does not.
    pub dependent: Covariance<2>,
    /// The side from which it is seen.
    pub facing: Facing,
    /// The solid parts, ascending, at least one.
    pub solid: Vec<SolidInterval>,
    /// Quality: the number of distinct looks that support it.
    pub looks: u32,
    /// Who saw it, ascending.
    pub robots: Vec<RobotName>,
    /// Earliest look, microseconds since 1970.
    pub first_seen_us: i64,
    /// Latest look, microseconds since 1970.
    pub last_seen_us: i64,
}
