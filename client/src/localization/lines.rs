//! A wall that was seen against one that is known.
//!
//! Both are compared about a point of the known wall that both cover, for far from it the two components of a
//! line go together so closely that a pose's error of a degree is no longer small. In the robot frame, with
//! the point `c` there, the offset of a line is `r - n.c`; seen less expected of that and of the angle is the
//! innovation.

use mapfold_map::geometry::{Level, Pose, Robot, difference, unit_normal, wrap};
use mapfold_map::vector::{Facing, ObservedSegment};
use nalgebra::{Matrix2, Matrix2x3, Vector2};

use super::filter::Measurement;
use super::reference_walls::ReferenceWall;

/// Where both must be to be compared at all.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Reach {
    /// Metres that both must cover, or all of what was seen if that is less.
    pub(super) overlap_min: f64,
    /// Radians between them at most.
    pub(super) turn_max: f64,
    /// Metres between them at most.
    pub(super) offset_max: f64,
}

/// What a segment says of the pose if it is this wall; `None` if it cannot be.
pub(super) fn measure(
    wall: &ReferenceWall,
    seen: &ObservedSegment,
    pose: &Pose<Level, Robot>,
    reach: &Reach,
) -> Option<Measurement<2>> {
    let line = &seen.line.line;
    // Towards where it was seen from, which is free.
    let (sign, turn) = match seen.facing {
        Facing::Origin => (-1.0, std::f64::consts::PI),
        Facing::Away => (1.0, 0.0),
    };
    let angle = wrap(line.alpha() + turn);
    let off = difference(angle + pose.heading(), wall.angle);
    if off.abs() > reach.turn_max {
        return None;
    }
    let ends = [seen.from, seen.to].map(|t| wall.along(&pose.act(&line.at(t))));
    let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
    let shared = wall.parts.iter().map(|(from, to)| (from.max(low), to.min(high)));
    let (from, to) = shared.max_by(|a, b| (a.1 - a.0).total_cmp(&(b.1 - b.0)))?;
    if to - from < reach.overlap_min.min(0.5 * (high - low)) {
        return None;
    }
    let about = wall.middle + wall.tangent * f64::midpoint(from, to);
    let at = pose.inverse().act(&about);
    let (normal, along) = (unit_normal(angle), mapfold_map::geometry::tangent(angle));
    let offset = sign * line.rho() - normal.dot(&at);
    if offset.abs() > reach.offset_max {
        return None;
    }
    let j_line = Matrix2::new(sign, -along.dot(&at), 0.0, 1.0);
    let expected_along = mapfold_map::geometry::tangent(wall.angle - pose.heading());
    Some(Measurement {
        innovation: Vector2::new(offset, off),
        j_pose: Matrix2x3::new(
            -wall.normal.x,
            -wall.normal.y,
            expected_along.dot(&at),
            0.0,
            0.0,
            -1.0,
        ),
        j_errors: wall.errors_at(&about).collect(),
        noise: *seen.line.covariance.transformed(&j_line).matrix(),
    })
}
