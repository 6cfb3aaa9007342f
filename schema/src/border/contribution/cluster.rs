//! The clusters of a contribution.

use std::f64::consts::{PI, TAU};

use mapfold_map::geometry::{Level, Point, Pose, Robot, distance_to_hull};
use mapfold_map::vector::ObservedCluster;

use crate::border::Limits;
use crate::border::number::{bounded_covariance, coordinate, in_level, some_points};
use crate::border::violations::{Place, Violations};
use crate::v1;

/// Widest cluster, metres: no sensor sees further.
const WIDTH_MAX_M: f64 = 1000.0;
/// Distance from the hull at which the centroid still counts as in it, metres: coordinates may
/// have been rounded to millimetres.
const CENTROID_TOLERANCE_M: f64 = 0.002;
/// Turn to the right at a corner, relative to its two edges, that counts as rounding.
const CONVEXITY_TOLERANCE: f64 = 1e-9;
/// Largest standard deviations of (x, y), metres.
const SD_MAX: [f64; 2] = [100.0, 100.0];
/// Smallest standard deviations of (x, y): 1 mm.
const SD_FLOOR: [f64; 2] = [0.001, 0.001];

pub(super) fn check(
    cluster: &v1::ObservedCluster,
    level_from_robot: Option<&Pose<Level, Robot>>,
    limits: &Limits,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<ObservedCluster> {
    let hull = check_hull(&cluster.hull_m, level_from_robot, limits, &place.field("hull_m"), wrong);
    let centroid_place = place.field("centroid_m");
    let centroid = point(cluster.centroid_m, limits, &centroid_place, wrong);
    let covariance =
        bounded_covariance(&cluster.covariance, &SD_MAX, &place.field("covariance"), wrong);
    let points = some_points(cluster.points, place, wrong);

    let (hull, centroid, points) = (hull?, centroid?, points?);
    if distance_to_hull(&centroid, &hull) > CENTROID_TOLERANCE_M {
        wrong.add(
            &centroid_place,
            "centroid_outside_hull",
            "the mean of points lies in their convex hull",
        );
        return None;
    }
    if (points as usize) < hull.len() {
        wrong.add(
            &place.field("points"),
            "too_few_points",
            format_args!("a hull of {} points is not that of {points} points", hull.len()),
        );
        return None;
    }
    Some(ObservedCluster { hull, centroid, covariance: covariance?.floored(&SD_FLOOR), points })
}

/// How far a hull's corners lie from its first, at most: between half its greatest width and all of it.
pub(super) fn width(hull: &[Point]) -> f64 {
    hull.iter().map(|p| (p - hull[0]).norm()).fold(0.0, f64::max)
}

fn check_hull(
    hull: &[[f64; 2]],
    level_from_robot: Option<&Pose<Level, Robot>>,
    limits: &Limits,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Vec<Point>> {
    if hull.is_empty() {
        wrong.add(place, "empty_hull", "a hull has at least one point");
        return None;
    }
    if hull.len() > limits.hull_points_max {
        let (n, max) = (hull.len(), limits.hull_points_max);
        wrong.add(
            place,
            "too_many_hull_points",
            format_args!("{n} points: a hull has at most {max}; simplify it outwards"),
        );
        return None;
    }
    let mut points = Vec::with_capacity(hull.len());
    for (i, p) in hull.iter().enumerate() {
        let place = place.index(i);
        let Some(p) = point(*p, limits, &place, wrong) else { continue };
        if let Some(level_from_robot) = level_from_robot {
            in_level(&level_from_robot.act(&p), limits, &place, wrong);
        }
        points.push(p);
    }
    if points.len() < hull.len() {
        return None;
    }
    if width(&points) > WIDTH_MAX_M {
        wrong.add(
            place,
            "cluster_too_wide",
            format_args!("no look sees a thing wider than {WIDTH_MAX_M} m"),
        );
        return None;
    }
    if !is_convex(&points) {
        wrong.add(
            place,
            "not_convex",
            "a hull is convex and goes round once, counter-clockwise, no point twice in a row",
        );
        return None;
    }
    Some(points)
}

/// Whether the points go round once, counter-clockwise, without a turn to the right. A single
/// point does, and so do two different ones.
fn is_convex(hull: &[Point]) -> bool {
    let n = hull.len();
    if n == 1 {
        return true;
    }
    let edge = |i: usize| hull[(i + 1) % n] - hull[i % n];
    let mut turned = 0.0;
    for i in 0..n {
        let (before, after) = (edge(i), edge(i + 1));
        let scale = before.norm() * after.norm();
        let (sine, cosine) = (before.perp(&after), before.dot(&after));
        if scale <= 0.0 || sine < -CONVEXITY_TOLERANCE * scale {
            return false;
        }
        turned += sine.max(0.0).atan2(cosine);
    }
    // All turns are to the left, so their sum is a whole number of rounds.
    (turned - TAU).abs() < PI
}

fn point(
    [x, y]: [f64; 2],
    limits: &Limits,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Point> {
    let x = coordinate(x, limits, &place.index(0), wrong);
    let y = coordinate(y, limits, &place.index(1), wrong);
    Some(Point::new(x?, y?))
}
