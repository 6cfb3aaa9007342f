//! What no line explains: points in a convex hull.

use crate::geometry::{Covariance, Point};
use crate::level::RobotName;

/// Points that no line explains, in one look, in the robot frame.
#[derive(Debug, Clone, PartialEq)]
pub struct ObservedCluster {
    /// Convex hull, counter-clockwise, at least one point.
    pub hull: Vec<Point>,
    /// Mean of the points.
    pub centroid: Point,
    /// Covariance of the centroid, from the sensor only.
    pub covariance: Covariance<2>,
    /// Number of points.
    pub points: u32,
}

/// A thing of the map that no line explains.
#[derive(Debug, Clone, PartialEq)]
pub struct Cluster {
    /// Convex hull in the level frame, counter-clockwise.
    pub hull: Vec<Point>,
    /// Fused centroid.
    pub centroid: Point,
    /// Covariance of the centroid.
    pub covariance: Covariance<2>,
    /// Number of points in all looks.
    pub points: u64,
    /// Quality: the number of distinct looks that support it.
    pub looks: u32,
    /// Who saw it, ascending.
    pub robots: Vec<RobotName>,
    /// Earliest look, microseconds since 1970.
    pub first_seen_us: i64,
    /// Latest look, microseconds since 1970.
    pub last_seen_us: i64,
}
