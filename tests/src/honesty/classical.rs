//! The classical rule (equations 5 to 7 of the method's first publication): every new line is
//! fused into the wall's line by their sensor covariances, as if the robot's pose were exact.

use mapfold_map::geometry::{Level, Pose, Robot, difference, tangent, unit_normal, wrap};
use mapfold_map::vector::{Facing, ObservedSegment};
use nalgebra::{Matrix2, Vector2};

use super::fix::{MapLine, inverse};
use super::room::{Room, Truth, Wall};

/// Error (offset about the wall's middle, angle) of a wall's line, and its covariance.
type State = (Vector2<f64>, Matrix2<f64>);

/// A map of the room by the classical rule. Which wall a segment is of is told to it.
#[derive(Debug, Default)]
pub(super) struct Classical {
    walls: Vec<Option<State>>,
}

impl Classical {
    /// Fuses what a robot saw from where it believes to be.
    pub(super) fn fuse(
        &mut self,
        room: &Room,
        truth: Truth,
        believed: &Pose<Level, Robot>,
        segments: &[ObservedSegment],
    ) {
        self.walls.resize(room.walls.len(), None);
        for segment in segments {
            let Some(index) = room.seen(truth, segment) else { continue };
            let (z, c) = about_middle(&room.walls[index], believed, segment);
            let state = &mut self.walls[index];
            *state = Some(match *state {
                None => (z, c),
                Some((x, p)) => {
                    let Some(innovation) = inverse(&(p + c)) else { continue };
                    let k = p * innovation;
                    let kept = Matrix2::identity() - k;
                    (x + k * (z - x), kept * p * kept.transpose() + k * c * k.transpose())
                }
            });
        }
    }

    /// Its lines as a robot uses them.
    pub(super) fn lines<'a>(&'a self, room: &'a Room) -> impl Iterator<Item = MapLine> + 'a {
        room.walls.iter().zip(&self.walls).filter_map(|(wall, state)| {
            let (error, covariance) = (*state)?;
            let middle = wall.middle();
            let angle = wrap(wall.angle + error.y);
            let offset = error.x + unit_normal(angle).dot(&middle);
            let lever = tangent(angle).dot(&middle);
            let j = Matrix2::new(1.0, lever, 0.0, 1.0);
            let covariance = j * covariance * j.transpose();
            let turned = offset < 0.0;
            let flip = Matrix2::new(if turned { -1.0 } else { 1.0 }, 0.0, 0.0, 1.0);
            let alpha = if turned { wrap(angle + std::f64::consts::PI) } else { angle };
            let along = |p: crate::plane::Point| {
                tangent(alpha).dot(&mapfold_map::geometry::Point::new(p.x, p.y))
            };
            let (a, b) = (along(wall.piece.a), along(wall.piece.b));
            Some(MapLine {
                rho: offset.abs(),
                alpha,
                facing: if turned { Facing::Origin } else { Facing::Away },
                independent: flip * covariance * flip,
                dependent: Matrix2::zeros(),
                span: (a.min(b), a.max(b)),
            })
        })
    }

    /// The normalised errors squared of its lines.
    pub(super) fn errors(&self) -> impl Iterator<Item = f64> + '_ {
        self.walls.iter().filter_map(|state| {
            let (error, covariance) = (*state)?;
            Some((error.transpose() * inverse(&covariance)? * error)[(0, 0)])
        })
    }
}

/// A segment's (offset, angle) about a wall's middle, less the wall's own, and its covariance.
fn about_middle(
    wall: &Wall,
    believed: &Pose<Level, Robot>,
    segment: &ObservedSegment,
) -> (Vector2<f64>, Matrix2<f64>) {
    let line = &segment.line.line;
    let middle = wall.middle();
    // In the robot frame normals point away from the robot, walls' normals into free space.
    let angle = wrap(line.alpha() + believed.heading() + std::f64::consts::PI);
    let local = believed.inverse().act(&middle);
    let offset = unit_normal(line.alpha()).dot(&local) - line.rho();
    let j = Matrix2::new(-1.0, tangent(line.alpha()).dot(&local), 0.0, 1.0);
    let z = Vector2::new(offset, difference(angle, wall.angle));
    (z, j * segment.line.covariance.matrix() * j.transpose())
}
