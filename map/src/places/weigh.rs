//! How well a look fits one place.

use nalgebra::{Matrix3, Vector3};

use super::field::{Known, LikelihoodField, STEPS};
use super::sides::Compared;
use super::{Beam, Place};
use crate::geometry::{Covariance, Level, Point, Pose, Robot, UncertainPose};

/// A place is moved and turned in steps from these down to the last, metres and radians.
const STEP: (f64, f64) = (0.06, 0.012);
const STEP_MIN: f64 = 0.008;
/// Beams are followed in steps of this, metres, from a little way off their sensor to a little way off their ends.
const STRIDE: f64 = 0.05;
const OFF_SENSOR: f64 = 0.15;
const OFF_END: f64 = 0.35;

/// What the ends of beams come to at a pose, in steps.
fn ends(field: &LikelihoodField, beams: &[Beam], pose: &Pose<Level, Robot>) -> u32 {
    let (sin, cos) = pose.heading().sin_cos();
    let moved =
        |p: &Point| Point::new(pose.x + cos * p.x - sin * p.y, pose.y + sin * p.x + cos * p.y);
    beams.iter().map(|beam| u32::from(field.fit(&moved(&beam.to)))).sum()
}

/// The pose near `pose` at which the ends of beams fit best, and what they come to there, in steps: downhill, coordinate by
/// coordinate.
pub(super) fn refined(
    field: &LikelihoodField,
    beams: &[Beam],
    mut pose: Pose<Level, Robot>,
) -> (Pose<Level, Robot>, u32) {
    let mut best = ends(field, beams, &pose);
    let mut step = STEP;
    while step.0 > STEP_MIN {
        let mut has_moved = false;
        for (x, y, turn) in [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)] {
            let [x, y, turn] = [x, y, turn].map(f64::from);
            let heading = pose.heading() + turn * step.1;
            let tried = Pose::new(pose.x + x * step.0, pose.y + y * step.0, heading);
            let fit = ends(field, beams, &tried);
            if fit > best {
                (best, pose, has_moved) = (fit, tried, true);
            }
        }
        if !has_moved {
            step = (0.5 * step.0, 0.5 * step.1);
        }
    }
    (pose, best)
}

/// Steps to either side in which the posterior around a place is taken.
const SPREAD_STEPS: i32 = 6;

/// Mean and covariance of what the ends of beams make of all poses that count as one place with `pose`, every one as
/// likely before as any other (Olson 2009). Unlike the covariance of [`Place`], it counts what is no wall, and that walls
/// which were hit may be others nearby. Along what the look does not tell, it is that of a uniform distribution.
pub(super) fn posterior(
    field: &LikelihoodField,
    beams: &[Beam],
    pose: &Pose<Level, Robot>,
) -> UncertainPose<Level, Robot> {
    let config = &field.config;
    let (apart, turned) = config.apart;
    let step = (0.5 * apart / f64::from(SPREAD_STEPS), 0.5 * turned / f64::from(SPREAD_STEPS));
    let best = f64::from(ends(field, beams, pose));
    let steps = -SPREAD_STEPS..=SPREAD_STEPS;
    let (mut all, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
    for turn in steps.clone() {
        for x in steps.clone() {
            for y in steps.clone() {
                let off = [f64::from(x) * step.0, f64::from(y) * step.0, f64::from(turn) * step.1];
                let at = Pose::new(pose.x + off[0], pose.y + off[1], pose.heading() + off[2]);
                let ahead = f64::from(ends(field, beams, &at)) - best;
                let weight = (config.temper * ahead / STEPS).exp();
                let off = Vector3::from(off);
                all += weight;
                first += off * weight;
                second += off * off.transpose() * weight;
            }
        }
    }
    let mean = first / all;
    let within = Vector3::new(step.0, step.0, step.1).map(|step| step * step / 12.0);
    let covariance = second / all - mean * mean.transpose() + Matrix3::from_diagonal(&within);
    UncertainPose {
        pose: Pose::new(pose.x + mean.x, pose.y + mean.y, pose.heading() + mean.z),
        covariance: Covariance::new(covariance).unwrap_or_else(|_| untold(field)),
    }
}

/// The place at a pose, with how well it fits.
pub(super) fn weighed(field: &LikelihoodField, beams: &[Beam], pose: &Pose<Level, Robot>) -> Place {
    let config = &field.config;
    let (mut cost, mut hits, mut throughs) = (0.0, 0.0, 0.0);
    let mut information = prior_information(field);
    for beam in beams {
        let (from, to) = (pose.act(&beam.from), pose.act(&beam.to));
        let of_end = f64::from(field.best - field.fit(&to).min(field.best)) / STEPS;
        cost += of_end;
        let is_hit = of_end < 0.75 * config.unknown_cost;
        if is_hit {
            hits += 1.0;
            if let Some(normal) = beam.normal {
                let normal = pose.act(&normal) - pose.position();
                // The side that was seen faces the sensor.
                let facing = if normal.dot(&(from - to)) < 0.0 { -normal } else { normal };
                cost += match field.compared(&to, &facing) {
                    Compared::Agrees => 0.0,
                    Compared::Behind => config.behind_cost,
                    Compared::Across => config.across_cost,
                };
                let arm = to - pose.position();
                let row = Vector3::new(normal.x, normal.y, arm.perp(&normal));
                information +=
                    row * row.transpose() * (config.temper / (config.spread * config.spread));
            }
        }
        if passes_through(field, &from, &to) {
            throughs += 1.0;
            let is_unknown = matches!(field.known(&to), Known::Nothing | Known::Unvisited);
            cost += if is_unknown && !is_hit {
                config.through_unknown_cost
            } else {
                config.through_cost
            };
        }
    }
    let count = beams.len() as f64;
    let covariance = information.cholesky().and_then(|c| {
        let inverse = c.inverse();
        Covariance::new((inverse + inverse.transpose()) * 0.5).ok()
    });
    let covariance = covariance.unwrap_or_else(|| untold(field));
    Place {
        level_from_robot: UncertainPose { pose: *pose, covariance },
        fit: config.fit(beams.len(), cost),
        hits: hits / count.max(1.0),
        throughs: throughs / count.max(1.0),
        beams: beams.len(),
    }
}

/// Deviations where a look tells nothing: half of what makes two places of one.
fn untold(field: &LikelihoodField) -> Covariance<3> {
    let (apart, turned) = field.config.apart;
    let variances = [0.5 * apart, 0.5 * apart, 0.5 * turned].map(|sd| sd * sd);
    Covariance::from_variances(variances)
}

fn prior_information(field: &LikelihoodField) -> Matrix3<f64> {
    let variances = untold(field).matrix().diagonal();
    Matrix3::from_diagonal(&variances.map(|variance| 1.0 / variance))
}

/// Whether a beam comes out of something occupied well before its end. Behind most walls nothing is known: that makes
/// them no thinner.
fn passes_through(field: &LikelihoodField, from: &Point, to: &Point) -> bool {
    let way = to - from;
    let length = way.norm();
    let steps = ((length - OFF_END - OFF_SENSOR) / STRIDE).ceil().max(0.0) as u32;
    let mut is_inside = false;
    for step in 0..steps {
        let along = (OFF_SENSOR + f64::from(step) * STRIDE) / length;
        match field.known(&(from + way * along)) {
            Known::Occupied | Known::Built => is_inside = true,
            _ if is_inside => return true,
            _ => {}
        }
    }
    false
}
