//! A solid part of a published segment as something that can be joined: it has a direction, with
//! free space on its left, and two uncertain ends.

use std::sync::Arc;

use super::slots::Slot;
use super::{EndKind, Facing, Segment, VectorConfig};
use crate::geometry::{Covariance, Point, offset_variance, unit_normal};
use crate::level::FeatureId;

/// Name of a piece: a segment and the place among its solid parts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PieceKey {
    pub(super) segment: FeatureId,
    pub(super) part: u16,
}

/// The same, by the place of the segment's wall: found without a search, but not a function of the
/// set of contributions.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct PieceAt {
    pub(super) slot: Slot,
    pub(super) part: u16,
}

/// One end of a piece.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct End {
    pub(super) at: Point,
    pub(super) kind: EndKind,
    /// Variance of its place along the piece, square metres.
    pub(super) along_variance: f64,
}

/// A solid part with a direction.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub(super) segment: Arc<Segment>,
    /// Unit vector from tail to head; free space lies a quarter turn to its left.
    pub(super) direction: Point,
    pub(super) tail: End,
    pub(super) head: End,
    /// Metres.
    pub(super) length: f64,
}

impl Piece {
    /// The solid parts of a segment, in the order in which they stand in it.
    pub(super) fn of<'a>(
        segment: &'a Arc<Segment>,
        config: &'a VectorConfig,
    ) -> impl Iterator<Item = Self> + 'a {
        let n = unit_normal(segment.line.alpha());
        let u = Point::new(-n.y, n.x);
        segment.solid.iter().map(move |solid| {
            let end = |along: f64, kind| {
                let at = segment.line.at(along);
                let variance = |c: &Covariance<2>| offset_variance(c, along);
                End {
                    at,
                    kind,
                    along_variance: variance(&segment.independent)
                        + variance(&segment.dependent)
                        + config.end_sd * config.end_sd,
                }
            };
            let low = end(solid.span.from_m(), solid.ends[0]);
            let high = end(solid.span.to_m(), solid.ends[1]);
            let (direction, tail, head) = match segment.facing {
                Facing::Origin => (u, low, high),
                Facing::Away => (-u, high, low),
            };
            let length = (head.at - tail.at).norm();
            Self { segment: Arc::clone(segment), direction, tail, head, length }
        })
    }

    /// The normal that points to free space.
    pub(super) fn left(&self) -> Point {
        Point::new(-self.direction.y, self.direction.x)
    }

    /// Variances of the line's offset at `p` from independent and from shared errors.
    pub(super) fn offset_variances(&self, p: &Point) -> [f64; 2] {
        let along = self.segment.line.along(p);
        [&self.segment.independent, &self.segment.dependent].map(|c| offset_variance(c, along))
    }
}
