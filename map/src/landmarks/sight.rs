//! Which landmarks a robot at some place should see.

use super::Landmark;
use super::grid::Grid;
use crate::geometry::{Level, Point, Pose, Robot, difference};

/// How far short of a landmark its line of sight ends, metres: its own walls are no obstacle.
const SHORT_OF: f64 = 0.10;
/// Edge of the squares that obstacles are found by, metres; longer ones are cut.
const SQUARE: f64 = 2.0;

/// What a robot's sensor covers.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sight {
    /// Landmarks farther away are not seen, metres.
    pub range: f64,
    /// Half of its field of view, radians: pi for all around.
    pub half_field: f64,
}

impl Sight {
    /// Whether a landmark lies within it.
    pub(super) fn covers(&self, pose: &Pose<Level, Robot>, landmark: &Landmark) -> bool {
        let arm = landmark.at - pose.position();
        if arm.norm_squared() > self.range * self.range {
            return false;
        }
        let bearing = arm.y.atan2(arm.x);
        difference(bearing, pose.heading()).abs() <= self.half_field && faces(landmark, bearing)
    }
}

/// Whether what makes a landmark can be seen along this bearing: both walls of a corner from their free
/// sides, a doorway not too much from the side.
fn faces(landmark: &Landmark, bearing: f64) -> bool {
    use super::LandmarkKind::{ConcaveCorner, ConvexCorner, Doorway, WallEnd};
    let backwards = difference(bearing, std::f64::consts::PI);
    let off = landmark.kind.turn(backwards, landmark.direction).abs();
    match landmark.kind {
        ConvexCorner | ConcaveCorner => off < 40f64.to_radians(),
        Doorway => off < 60f64.to_radians(),
        WallEnd => off < 120f64.to_radians(),
    }
}

/// Straight obstacles to sight, found by place.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Obstacles {
    pieces: Vec<(Point, Point)>,
    grid: Grid,
}

impl Obstacles {
    /// From the ends of straight walls.
    pub fn new(walls: impl IntoIterator<Item = (Point, Point)>) -> Self {
        let mut pieces = Vec::new();
        for (a, b) in walls {
            let count = ((b - a).norm() / SQUARE).ceil().clamp(1.0, 1e4);
            let at = |i: f64| a + (b - a) * (i / count);
            pieces.extend((0..count as u32).map(|i| (at(f64::from(i)), at(f64::from(i) + 1.0))));
        }
        let middles: Vec<Point> = pieces.iter().map(|(a, b)| (a + b) * 0.5).collect();
        Self { grid: Grid::new(&middles, SQUARE), pieces }
    }

    /// Whether the way from a robot to just short of a landmark is free.
    pub(super) fn leave_free(&self, from: &Point, landmark: &Landmark) -> bool {
        let way = landmark.at - from;
        let length = way.norm();
        if length <= SHORT_OF {
            return true;
        }
        let to = from + way * ((length - SHORT_OF) / length);
        // Squares along the way, each looked up once or twice.
        let steps = (length / SQUARE).ceil().max(1.0);
        let mut at = (0..=steps as u32).map(|i| from + (to - from) * (f64::from(i) / steps));
        !at.any(|p| {
            let near = self.grid.near(&p, 1.5 * SQUARE);
            near.map(|i| &self.pieces[i as usize]).any(|(a, b)| cross(from, &to, a, b))
        })
    }
}

/// Whether two pieces cross; merely touching is no obstacle.
fn cross(a: &Point, b: &Point, c: &Point, d: &Point) -> bool {
    let side = |p: &Point, q: &Point, r: &Point| (q - p).perp(&(r - p));
    side(a, b, c) * side(a, b, d) < 0.0 && side(c, d, a) * side(c, d, b) < 0.0
}

#[cfg(test)]
mod tests {
    use super::super::LandmarkKind;
    use super::*;
    use crate::geometry::Covariance;

    fn corner(x: f64, y: f64, direction: f64) -> Landmark {
        Landmark {
            kind: LandmarkKind::ConcaveCorner,
            at: Point::new(x, y),
            direction,
            covariance: Covariance::from_variances([1e-4; 2]),
            direction_sd: 0.05,
        }
    }

    #[test]
    fn range_field_facing_and_walls_limit_sight() {
        let sight = Sight { range: 6.0, half_field: 1.6 };
        let pose = Pose::new(0.0, 0.0, 0.0);
        let back = std::f64::consts::PI;
        assert!(sight.covers(&pose, &corner(5.0, 0.0, back)));
        assert!(!sight.covers(&pose, &corner(7.0, 0.0, back)), "too far");
        assert!(!sight.covers(&pose, &corner(-5.0, 0.0, 0.0)), "behind");
        assert!(!sight.covers(&pose, &corner(5.0, 0.0, 0.0)), "seen from its back");
        let walls = Obstacles::new([(Point::new(2.0, -9.0), Point::new(2.0, 1.0))]);
        assert!(!walls.leave_free(&pose.position(), &corner(5.0, 0.0, back)));
        assert!(walls.leave_free(&pose.position(), &corner(2.0, 0.0, back)), "on the wall itself");
        assert!(walls.leave_free(&pose.position(), &corner(2.0, 4.0, back)));
    }
}
