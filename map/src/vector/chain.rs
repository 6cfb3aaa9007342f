//! Polylines and polygons: what walls that meet at their ends add up to.

use super::ChainKind::{Obstacle, Polyline, Room};
use crate::geometry::{Covariance, Point};
use crate::level::{FeatureId, RobotName};

/// Identity of a chain: the piece of wall in it whose founding observation ranks best.
///
/// The rank of an observation never changes, so neither does this while the chain keeps that piece,
/// however much it grows elsewhere; it changes when a better observation joins, or this one is
/// taken out. Like all identities it is a function of the set of contributions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ChainId {
    /// The segment.
    pub segment: FeatureId,
    /// Which of its solid parts: 0 is the one nearest to the middle of the founding observation,
    /// others count up and down from there along the line, so that news at the wall's ends do not
    /// rename what was there before.
    pub piece: i16,
}

/// What a chain encloses.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum ChainKind {
    /// Nothing: it is open.
    Polyline,
    /// Closed, with free space outside: a thing that stands in a room.
    Obstacle,
    /// Closed, with free space inside.
    Room,
}

impl ChainKind {
    /// Whether the last vertex is joined to the first.
    pub fn is_closed(self) -> bool {
        match self {
            Polyline => false,
            Obstacle | Room => true,
        }
    }
}

/// A corner of a chain, or one of its two ends.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vertex {
    /// Where it is.
    pub at: Point,
    /// Covariance of its place, safe for any correlation of what its walls may share.
    pub covariance: Covariance<2>,
}

/// Walls that meet at their ends, with free space on the left of whoever walks along them.
///
/// Consecutive vertices are the ends of one piece of wall. It never meets itself; a closed one
/// has at least three vertices and does not repeat the first.
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    /// What it encloses.
    pub kind: ChainKind,
    /// The vertices in order.
    pub vertices: Vec<Vertex>,
    /// The segments that its edges lie on, edge by edge.
    pub segments: Vec<FeatureId>,
    /// Quality: the least of its segments' numbers of looks.
    pub looks: u32,
    /// Who saw any of it, ascending.
    pub robots: Vec<RobotName>,
    /// Earliest look, microseconds since 1970.
    pub first_seen_us: i64,
    /// Latest look, microseconds since 1970.
    pub last_seen_us: i64,
}
