//! What two maps say of each other at a pose.

use nalgebra::{Matrix3, Vector3};

use super::{AlignmentConfig, Candidate, Chart};
use crate::geometry::{Covariance, Level, Odom, Point, Pose, UncertainPose};
use crate::landmarks::Landmark;
use crate::places::{Known, STEPS};

/// A square agrees if its end fits better than this share of what the unknown costs.
const AGREES: f64 = 0.75;
/// What nothing tells of: metres, radians.
const UNTOLD: (f64, f64) = (10.0, 1.0);

/// What the occupied squares of one map come to on another.
#[derive(Debug, Clone, Copy, Default)]
struct Tally {
    agreed: u32,
    conflicting: u32,
    /// Neither, but known to the other map.
    doubtful: u32,
    /// Of the squared distances of those that agree, square metres.
    squares: f64,
    sum: Point,
}

fn cost(chart: &Chart, p: &Point) -> f64 {
    f64::from(chart.field.best - chart.field.fit(p).min(chart.field.best)) / STEPS
}

fn agrees(chart: &Chart, p: &Point, config: &AlignmentConfig) -> bool {
    cost(chart, p) < AGREES * config.places.unknown_cost
}

fn tally(onto: &Chart, points: impl Iterator<Item = Point>, config: &AlignmentConfig) -> Tally {
    let mut tally = Tally::default();
    for p in points {
        let cost = cost(onto, &p);
        if cost < AGREES * config.places.unknown_cost {
            tally.agreed += 1;
            tally.squares += 2.0 * cost * config.places.spread * config.places.spread;
            tally.sum += p;
        } else {
            match onto.field.known(&p) {
                // Close to a wall is neither here nor there.
                Known::Free if onto.field.fit(&p) == 0 => tally.conflicting += 1,
                Known::Free | Known::Occupied => tally.doubtful += 1,
                Known::Nothing | Known::Presumed | Known::Built | Known::Unvisited => {}
            }
        }
    }
    tally
}

/// The candidate that a pose is.
pub(super) fn weighed(
    level: &Chart,
    own: &Chart,
    pose: &Pose<Level, Odom>,
    config: &AlignmentConfig,
) -> Candidate {
    let odom_from_level = pose.inverse();
    let of_own = tally(level, own.occupied.iter().map(|p| pose.act(p)), config);
    let of_level = tally(own, level.occupied.iter().map(|p| odom_from_level.act(p)), config);
    let metres = |squares: u32| f64::from(squares) * config.grain;
    let agreed = of_own.agreed + of_level.agreed;
    let known = of_own.agreed + of_own.conflicting + of_own.doubtful;
    let middle =
        if of_own.agreed > 0 { of_own.sum / f64::from(of_own.agreed) } else { pose.position() };
    let squares = of_own.squares + of_level.squares;
    Candidate {
        level_from_odom: UncertainPose {
            pose: *pose,
            covariance: covariance(level, own, pose, &middle, config),
        },
        middle,
        overlap: f64::from(known) / (own.occupied.len() as f64).max(1.0),
        agreed: metres(agreed),
        conflicting: metres(of_own.conflicting + of_level.conflicting),
        residual: (squares / f64::from(agreed).max(1.0)).sqrt(),
        landmarks: shared_landmarks(level, own, pose, config),
    }
}

/// Landmarks of the robot's map that have one of their kind on the level.
fn shared_landmarks(
    level: &Chart,
    own: &Chart,
    pose: &Pose<Level, Odom>,
    config: &AlignmentConfig,
) -> usize {
    let (apart, turned) = config.landmark_apart;
    let is_shared = |landmark: &&Landmark| {
        let (at, direction) = (pose.act(&landmark.at), pose.heading() + landmark.direction);
        level.landmarks.iter().any(|other| {
            other.kind == landmark.kind
                && (other.at - at).norm() < apart
                && other.kind.turn(other.direction, direction).abs() < turned
        })
    };
    own.landmarks.iter().filter(is_shared).count()
}

/// Covariance of the pose, from the walls that agree: each says where it is across itself, and all of them err by what
/// they have in common. It is worked out about the middle of them, and moved to the origin of the robot's frame.
fn covariance(
    level: &Chart,
    own: &Chart,
    pose: &Pose<Level, Odom>,
    middle: &Point,
    config: &AlignmentConfig,
) -> Covariance<3> {
    let information = information(level, own, pose, middle, config);
    let inverse = information.cholesky().map(|c| c.inverse());
    let diagonal = [UNTOLD.0, UNTOLD.0, UNTOLD.1].map(|sd| sd * sd);
    let common = Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0)) * config.common.powi(2);
    let about_middle = inverse
        .and_then(|inverse| Covariance::new((inverse + inverse.transpose()) * 0.5 + common).ok())
        .unwrap_or_else(|| Covariance::from_variances(diagonal));
    let arm = pose.position() - middle;
    // The origin moves with the middle, and turns about it.
    let jacobian = Matrix3::new(1.0, 0.0, -arm.y, 0.0, 1.0, arm.x, 0.0, 0.0, 1.0);
    about_middle.transformed(&jacobian)
}

fn information(
    level: &Chart,
    own: &Chart,
    pose: &Pose<Level, Odom>,
    middle: &Point,
    config: &AlignmentConfig,
) -> Matrix3<f64> {
    let untold = [UNTOLD.0, UNTOLD.0, UNTOLD.1].map(|sd| 1.0 / (sd * sd));
    let mut information = Matrix3::from_diagonal(&Vector3::from(untold));
    let (sin, cos) = pose.heading().sin_cos();
    // Neighbours along a wall err together.
    let weight = config.grain / (config.correlation * config.spread * config.spread);
    for (p, normal) in &own.faces {
        let at = pose.act(p);
        if agrees(level, &at, config) {
            let normal =
                Point::new(cos * normal.x - sin * normal.y, sin * normal.x + cos * normal.y);
            let row = Vector3::new(normal.x, normal.y, (at - middle).perp(&normal));
            information += row * row.transpose() * weight;
        }
    }
    information
}

/// Deviations of a candidate where the maps overlap: of its worst direction, metres, and its heading, radians.
pub(super) fn deviations(candidate: &Candidate) -> (f64, f64) {
    let UncertainPose { pose, covariance } = &candidate.level_from_odom;
    let arm = candidate.middle - pose.position();
    let jacobian = Matrix3::new(1.0, 0.0, -arm.y, 0.0, 1.0, arm.x, 0.0, 0.0, 1.0);
    let m = *covariance.transformed(&jacobian).matrix();
    let (a, b, c) = (m[(0, 0)], m[(0, 1)], m[(1, 1)]);
    let largest = 0.5 * (a + c) + (0.25 * (a - c) * (a - c) + b * b).sqrt();
    (largest.max(0.0).sqrt(), m[(2, 2)].max(0.0).sqrt())
}
