//! Whether what a tracker claims is true: normalised errors over many runs.

use mapfold_map::geometry::mahalanobis_sq;
use nalgebra::Vector3;

use super::*;
use crate::emulation::Chance;
use crate::odometry::OdometryNoise;

/// A step with the wheels' errors: what they count is exact, where the robot goes is not.
fn slipped(
    step: &Pose<Robot, Robot>,
    noise: &OdometryNoise,
    chance: &mut Chance,
) -> Pose<Robot, Robot> {
    let d = step.position().norm();
    let turn_sd = noise.turn_per_metre * d.sqrt();
    let turn_sd = turn_sd.hypot(noise.turn_per_turn * step.heading().abs().sqrt());
    let turn = chance.normal(turn_sd);
    let (along, across) =
        (chance.normal(noise.along * d.sqrt()), chance.normal(noise.across * d.sqrt()));
    let ahead = step.position() / d;
    let aside = Point::new(-ahead.y, ahead.x);
    let wander = 0.5 * d * turn + chance.normal(turn_sd * d / 12_f64.sqrt());
    let at = step.position() + ahead * along + aside * (across + wander);
    Pose::new(at.x, at.y, step.heading() + turn)
}

/// Errors of (x, y, heading) at the end of a drive of 40 looks round a room whose walls are mapped with errors of
/// their own and one that they share, normalised.
fn run(chance: &mut Chance) -> f64 {
    let (own, shared): ([f64; 2], [f64; 2]) = ([4e-4, 9e-6], [2.25e-4, 4e-6]);
    // No wall is straighter than the tracker believes either.
    let straight = [25e-6, 0.2_f64.to_radians().powi(2)];
    let common = Point::new(chance.normal(shared[0].sqrt()), chance.normal(shared[0].sqrt()));
    let turned = chance.normal(shared[1].sqrt());
    let walls = room();
    let mut segments = Vec::new();
    for wall in &walls {
        let off = chance.normal((own[0] + straight[0]).sqrt());
        let turn = chance.normal((own[1] + straight[1]).sqrt());
        let both = (off + wall.normal().dot(&common), turn + turned);
        segments.push(wall.mapped(both, own, shared));
    }
    let reference = ReferenceWalls::of_segments((0..).map(id).zip(&segments));
    let mut truth: Pose<Level, Robot> = Pose::new(0.0, -1.0, 0.0);
    let start = Pose::new(
        truth.x + chance.normal(0.05),
        truth.y + chance.normal(0.05),
        truth.heading() + chance.normal(0.02),
    );
    let mut tracker = Tracker::new(fix(start, [0.05, 0.05, 0.02]), TrackerConfig::STANDARD);
    let noise = TrackerConfig::STANDARD.odometry;
    for _ in 0..40 {
        let step = Pose::new(0.2, 0.0, 0.2);
        truth = truth.compose(&slipped(&step, &noise, chance));
        tracker.moved(&step);
        let seen: Vec<_> = walls
            .iter()
            .map(|w| {
                let off = (chance.normal(0.01), chance.normal(0.003));
                w.seen(&truth, off, [1e-4, 9e-6])
            })
            .collect();
        tracker.seen(&seen, &reference, None);
    }
    let found = tracked(&tracker);
    let mut error: Vector3<f64> = found.pose.vector() - truth.vector();
    error.z = mapfold_map::geometry::wrap(error.z);
    mahalanobis_sq(&error, &found.covariance)
}

#[test]
fn what_is_claimed_after_forty_looks_is_true() {
    let runs = 200;
    let mut chance = Chance::new(11);
    let nees = (0..runs).map(|_| run(&mut chance)).sum::<f64>() / f64::from(runs);
    // 95 % of the means of 200 chi-squares with three degrees of freedom.
    assert!((2.670..3.349).contains(&nees), "{nees}");
}
