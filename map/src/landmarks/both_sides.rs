//! Landmarks that are one thing seen from two sides.
//!
//! A thin wall has two faces, and nobody sees both from one place: its end and its doorways are found once for each face, a wall's
//! thickness apart. Each is one thing, and lies in the middle of the wall, where the a-priori model has it too. What
//! is at the jambs of a doorway belongs to the doorway.

use super::faces::Found;
use super::grid::Grid;
use super::{Landmark, LandmarkKind, SameConfig, told_by};
use crate::geometry::{Covariance, Point, difference, tangent, wrap};

/// When two faces are those of one wall.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BothSidesConfig {
    /// Thickness of walls whose end is one landmark, metres: the face of a thicker one's end makes two corners.
    pub end_width_max: f64,
    /// Thickness of walls with doorways, metres.
    pub doorway_depth_max: f64,
    /// How far the wall's back may lie before its front, metres: sheets have no thickness, but errors.
    pub overlap_max: f64,
    /// How far the two faces may end from each other, along the wall, metres.
    pub along_max: f64,
    /// The most that the faces may be turned against each other, radians.
    pub turn_max: f64,
    /// What belongs to a doorway.
    pub jambs: SameConfig,
}

impl BothSidesConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        end_width_max: 0.25,
        doorway_depth_max: 0.5,
        overlap_max: 0.05,
        along_max: 0.2,
        turn_max: 0.09,
        jambs: SameConfig::STANDARD,
    };
}

/// A thing, and the one or two findings that show it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Thing {
    pub(super) landmark: Landmark,
    /// As of a single finding; the width of an end whose two sides are known, metres.
    pub(super) extent: f64,
    /// What shows it. Of an end of which both sides are known: the face that goes up to it.
    pub(super) front: Found,
    /// What shows it from the other side.
    pub(super) back: Option<Found>,
}

/// The things that findings show; corners as they are.
pub(super) fn things(found: Vec<Found>, config: &BothSidesConfig) -> Vec<Thing> {
    let (doorways, others): (Vec<Found>, Vec<Found>) =
        found.into_iter().partition(|found| found.landmark.kind == LandmarkKind::Doorway);
    let mut things = paired(doorways, config);
    let known: Vec<(Landmark, f64)> = things.iter().map(|t| (t.landmark, t.extent)).collect();
    let at_jambs = told_by(others.iter().map(|found| &found.landmark), &known, &config.jambs);
    let others = others.into_iter().zip(at_jambs).filter(|(_, at_jamb)| !at_jamb);
    let (ends, corners): (Vec<Found>, Vec<Found>) =
        others.map(|(found, _)| found).partition(|f| f.landmark.kind == LandmarkKind::WallEnd);
    things.extend(paired(ends, config));
    things.extend(corners.into_iter().map(Thing::one));
    things
}

/// Of findings of one kind the closest that are two sides of one thing together, and the others alone.
fn paired(found: Vec<Found>, config: &BothSidesConfig) -> Vec<Thing> {
    let places: Vec<Point> = found.iter().map(|found| found.landmark.at).collect();
    let grid = Grid::new(&places, 1.0);
    let reach = config.along_max.hypot(config.end_width_max.max(config.doorway_depth_max));
    let mut pairs: Vec<(f64, usize, usize)> = Vec::new();
    for (a, first) in found.iter().enumerate() {
        for b in grid.near(&first.landmark.at, reach) {
            let b = b as usize;
            pairs.extend(apart(first, &found[b], config).map(|apart| (apart, a, b)));
        }
    }
    pairs.sort_by(|x, y| x.0.total_cmp(&y.0).then((x.1, x.2).cmp(&(y.1, y.2))));
    let mut taken = vec![false; found.len()];
    let mut things = Vec::new();
    for (_, a, b) in pairs {
        if !taken[a] && !taken[b] {
            (taken[a], taken[b]) = (true, true);
            things.push(Thing::two(found[a], found[b]));
        }
    }
    let alone = found.into_iter().zip(taken).filter(|(_, taken)| !taken);
    things.extend(alone.map(|(found, _)| Thing::one(found)));
    things
}

/// How far two findings are apart if `b` is the back of `a`: of ends `a` is where a face ends, and `b` where the other begins.
fn apart(a: &Found, b: &Found, config: &BothSidesConfig) -> Option<f64> {
    let (from, to) = (&a.landmark, &b.landmark);
    let off = to.at - from.at;
    // Along the wall, and into it from `a`.
    let (along, inwards, turn, depth_max) = match (from.kind, to.kind) {
        (LandmarkKind::WallEnd, LandmarkKind::WallEnd) if !a.is_tail && b.is_tail => {
            // A face that ends in this direction has free space on the left of it.
            let along = Point::new(from.direction.cos(), from.direction.sin());
            let inwards = Point::new(along.y, -along.x);
            (along, inwards, difference(from.direction, to.direction), config.end_width_max)
        }
        (LandmarkKind::Doorway, LandmarkKind::Doorway) => {
            // Doorways face free space, each its own.
            let inwards = -Point::new(from.direction.cos(), from.direction.sin());
            let turn = difference(from.direction + std::f64::consts::PI, to.direction);
            (tangent(from.direction), inwards, turn, config.doorway_depth_max)
        }
        _ => return None,
    };
    let depth = off.dot(&inwards);
    let fits = turn.abs() <= config.turn_max
        && (-config.overlap_max..=depth_max).contains(&depth)
        && off.dot(&along).abs() <= config.along_max;
    fits.then(|| off.norm())
}

impl Thing {
    fn one(found: Found) -> Self {
        Self { landmark: found.landmark, extent: found.extent, front: found, back: None }
    }

    fn two(a: Found, b: Found) -> Self {
        let (first, second) = (&a.landmark, &b.landmark);
        // Of the mean of two places, whatever errors they share: C((x + y) / 2) <= (C(x) + C(y)) / 2, for C(x - y) >= 0.
        let sum = first.covariance + second.covariance;
        let covariance = Covariance::symmetrised(sum.matrix() * 0.5);
        let off = second.at - first.at;
        let turn = first.kind.turn(second.direction, first.direction);
        let landmark = Landmark {
            kind: first.kind,
            at: first.at + off * 0.5,
            direction: wrap(first.direction + 0.5 * turn),
            covariance,
            direction_sd: 0.5 * (first.direction_sd + second.direction_sd),
        };
        let extent = match first.kind {
            LandmarkKind::WallEnd => off.dot(&tangent(landmark.direction)).abs(),
            _ => f64::midpoint(a.extent, b.extent),
        };
        Self { landmark, extent, front: a, back: Some(b) }
    }
}
