//! Whether a landmark that robots taught is one that is known anyway: the model's, so that nobody is told of one
//! thing twice and cannot tell both apart.

use super::grid::Grid;
use super::{Landmark, LandmarkKind};
use crate::geometry::{Point, mahalanobis_sq, tangent};

/// How far two landmarks that are one thing may be apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SameConfig {
    /// In deviations of both places, and of both directions: beyond that in one of a thousand.
    pub deviations: f64,
    /// However sure both are, metres: what plaster and skirting boards make.
    pub place_min: f64,
    /// However unsure they are, metres.
    pub place_max: f64,
    /// However sure both are, radians.
    pub turn_min: f64,
    /// How far the face of a wall may be from the middle of a doorway in it, metres.
    pub half_wall_max: f64,
}

impl SameConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        deviations: 3.7,
        place_min: 0.10,
        place_max: 0.50,
        turn_min: 0.26,
        half_wall_max: 0.25,
    };

    /// The farthest that anything the same can be, metres, from something so wide.
    fn reach(&self, width: f64) -> f64 {
        self.place_max + self.half_wall_max + 0.5 * width
    }
}

/// Of each of `learned`, in their order, whether it is one of `known`, which come with their extents (the width of a
/// doorway or of an end, metres).
///
/// Besides landmarks of one kind: a wall that the model draws with corners at its end may look like an end, and the other
/// way round; and ends and corners at the jambs of a doorway belong to it.
pub fn told_by<'a>(
    learned: impl IntoIterator<Item = &'a Landmark>,
    known: &[(Landmark, f64)],
    config: &SameConfig,
) -> Vec<bool> {
    let places: Vec<Point> = known.iter().map(|(landmark, _)| landmark.at).collect();
    let grid = Grid::new(&places, 1.0);
    let widest = known.iter().filter(|(known, _)| known.kind == LandmarkKind::Doorway);
    let widest = widest.map(|(_, width)| *width).fold(1.0, f64::max);
    let told = |learned: &Landmark| {
        let mut near = grid.near(&learned.at, config.reach(widest));
        near.any(|number| {
            let (known, extent) = &known[number as usize];
            is_same(learned, known, *extent, config)
        })
    };
    learned.into_iter().map(told).collect()
}

fn is_same(learned: &Landmark, known: &Landmark, extent: f64, config: &SameConfig) -> bool {
    use LandmarkKind::{ConcaveCorner, ConvexCorner, Doorway, WallEnd};
    let off = learned.at - known.at;
    let both = learned.covariance + known.covariance;
    // Within so many deviations of both, but at least and at most so far.
    let within = |off: &Point| {
        let distance = off.norm();
        distance <= config.place_min
            || (distance <= config.place_max
                && mahalanobis_sq(off, &both) <= config.deviations.powi(2))
    };
    // Nearer by up to `slack` along `u`.
    let nearer = |off: &Point, u: &Point, slack: f64| {
        let along = off.dot(u);
        off - u * along.clamp(-slack, slack)
    };
    let turned = || {
        let sd = learned.direction_sd.hypot(known.direction_sd);
        known.kind.turn(learned.direction, known.direction).abs()
            <= (config.deviations * sd).max(config.turn_min)
    };
    let out = Point::new(known.direction.cos(), known.direction.sin());
    let across = tangent(known.direction);
    match (known.kind, learned.kind) {
        (ConcaveCorner, ConcaveCorner) | (ConvexCorner, ConvexCorner) => within(&off) && turned(),
        (WallEnd, WallEnd) => within(&nearer(&off, &across, 0.5 * extent)) && turned(),
        (WallEnd, ConvexCorner) => within(&nearer(&off, &across, 0.5 * extent)),
        (ConvexCorner, WallEnd) => within(&off),
        (Doorway, Doorway) => within(&nearer(&off, &out, config.half_wall_max)) && turned(),
        (Doorway, WallEnd | ConvexCorner) => [-0.5, 0.5].into_iter().any(|side| {
            within(&nearer(&(off - across * (side * extent)), &out, config.half_wall_max))
        }),
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Covariance;
    use LandmarkKind::{ConcaveCorner, ConvexCorner, Doorway, WallEnd};
    use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

    fn landmark(kind: LandmarkKind, [x, y]: [f64; 2], direction: f64, sd: f64) -> Landmark {
        Landmark {
            kind,
            at: Point::new(x, y),
            direction,
            covariance: Covariance::from_variances([sd * sd, sd * sd]),
            direction_sd: 0.02,
        }
    }

    fn told(learned: Landmark, known: (Landmark, f64)) -> bool {
        let far = (landmark(WallEnd, [40.0, 3.0], 0.0, 0.03), 0.1);
        told_by([&learned], &[far, known], &SameConfig::STANDARD)[0]
    }

    #[test]
    fn a_corner_is_the_same_within_both_errors_and_if_it_opens_the_same_way() {
        let known = (landmark(ConcaveCorner, [5.0, 2.0], FRAC_PI_4, 0.03), FRAC_PI_2);
        let seen = |x, direction, sd| landmark(ConcaveCorner, [x, 2.0], direction, sd);
        assert!(told(seen(5.08, FRAC_PI_4 + 0.1, 0.005), known));
        assert!(!told(seen(5.2, FRAC_PI_4, 0.005), known), "six deviations");
        assert!(told(seen(5.2, FRAC_PI_4, 0.06), known), "three of them");
        assert!(!told(seen(5.7, FRAC_PI_4, 1.0), known), "nobody knows where it is");
        assert!(
            !told(seen(5.0, FRAC_PI_4 + FRAC_PI_2, 0.005), known),
            "the next corner of a cross"
        );
        assert!(!told(landmark(ConvexCorner, [5.0, 2.0], FRAC_PI_4, 0.01), known));
    }

    #[test]
    fn an_end_is_as_wide_as_its_wall() {
        // A wall of 20 cm that ends at (3, 0): its faces end 10 cm to either side.
        let known = (landmark(WallEnd, [3.0, 0.0], 0.0, 0.01), 0.2);
        assert!(told(landmark(WallEnd, [3.02, 0.12], 0.0, 0.01), known));
        assert!(told(landmark(ConvexCorner, [3.0, -0.1], -FRAC_PI_4, 0.01), known));
        assert!(!told(landmark(WallEnd, [3.3, 0.1], 0.0, 0.01), known));
        assert!(
            !told(landmark(WallEnd, [3.0, 0.1], PI, 0.01), known),
            "a wall that comes towards it"
        );
        let corner = (landmark(ConvexCorner, [3.0, 0.2], FRAC_PI_4, 0.01), 1.5 * PI);
        assert!(told(landmark(WallEnd, [3.0, 0.2], 0.0, 0.01), corner));
    }

    #[test]
    fn what_is_at_the_jambs_of_a_doorway_belongs_to_it() {
        // A doorway of 1 m in a wall along x, 20 cm thick.
        let known = (landmark(Doorway, [4.0, 0.0], FRAC_PI_2, 0.02), 1.0);
        assert!(told(landmark(Doorway, [4.03, 0.1], -FRAC_PI_2, 0.02), known), "from behind");
        assert!(!told(landmark(Doorway, [4.03, 0.1], 0.0, 0.02), known), "in another wall");
        assert!(told(landmark(WallEnd, [3.52, 0.1], 0.0, 0.02), known));
        assert!(told(landmark(ConvexCorner, [4.5, -0.1], 2.0, 0.02), known));
        assert!(!told(landmark(WallEnd, [4.0, 0.1], 0.0, 0.02), known), "a leaf, or a thing in it");
        assert!(!told(landmark(ConcaveCorner, [4.5, -0.1], 2.0, 0.02), known));
    }
}
