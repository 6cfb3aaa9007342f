//! What a robot hands in at once: one look, immutable.

use std::sync::Arc;

use crate::geometry::{Level, Robot, UncertainPose};
use crate::raster::EvidencePatch;
use crate::vector::{ObservedCluster, ObservedSegment};

/// Identity of a contribution: the bytes of a UUIDv7. Their order is the canonical order of the
/// fold; it follows the robots' clocks only roughly and nothing depends on that.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ContributionId(pub [u8; 16]);

/// A robot's slug.
pub type RobotName = Arc<str>;

/// Identity of a segment or cluster of the map: the contribution and the place in it of the
/// observation that founded it. A function of the set of contributions, not of their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct FeatureId {
    /// The founding contribution.
    pub contribution: ContributionId,
    /// Position of the founding observation among its kind in that contribution.
    pub index: u16,
}

/// Where a pose comes from, and so which part of its error it shares with other looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Provenance {
    /// Found on surveyed or a-priori landmarks only.
    Datum,
    /// Found on the shared map: its whole error may already be in that map.
    SharedMap,
    /// Carried on by odometry since the last fix.
    Odometry,
}

/// All that one robot saw under one fix.
#[derive(Debug, Clone, PartialEq)]
pub struct Contribution {
    /// Who it is.
    pub id: ContributionId,
    /// Who saw it.
    pub robot: RobotName,
    /// When, by the robot's clock, in microseconds since 1970.
    pub observed_at_us: i64,
    /// From where.
    pub level_from_robot: UncertainPose<Level, Robot>,
    /// Where that pose comes from.
    pub provenance: Provenance,
    /// Straight pieces of wall, in the robot frame, with sensor-only covariance.
    pub segments: Vec<ObservedSegment>,
    /// What no line explains, in the robot frame.
    pub clusters: Vec<ObservedCluster>,
    /// Evidence for the grid, in the level frame.
    pub evidence: Vec<EvidencePatch>,
}
