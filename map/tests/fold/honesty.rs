//! The published covariances against truth: normalised estimation errors over many seeded worlds.

use std::sync::Arc;

use mapfold_map::geometry::{Covariance, Point, Pose, UncertainPose, difference, mahalanobis_sq};
use mapfold_map::level::{Contribution, Level, LevelConfig, Provenance};
use nalgebra::Vector2;

use crate::world::{Chance, NOISE, id, observe};

/// The wall through (60, 25), far from the origin, where naive fusion of (rho, alpha) bends walls.
const WALL: [Point; 2] = [Point::new(58.0, 24.0), Point::new(62.0, 26.0)];

/// Mean squared Mahalanobis distance of the published line from the true one over `runs` worlds,
/// and the mean ratio of claimed to actual standard deviation of the offset.
fn nees(looks: u64, shared: f64, runs: u64) -> (f64, f64) {
    let (mut sum, mut claimed, mut actual) = (0.0, 0.0, 0.0);
    for run in 0..runs {
        let mut chance = Chance(run * 7919 + looks);
        // An error that all looks share, as when all robots localize on one map.
        let common = [
            chance.normal(NOISE.position * shared),
            chance.normal(NOISE.position * shared),
            chance.normal(NOISE.heading * shared),
        ];
        let own = (1.0 - shared * shared).sqrt();
        let contributions: Vec<Contribution> = (0..looks)
            .map(|number| {
                let truth = Pose::new(
                    chance.uniform(59.0, 63.0),
                    chance.uniform(20.0, 22.0),
                    chance.uniform(-3.0, 3.0),
                );
                let segment = observe(WALL[0], WALL[1], &truth, NOISE, &mut chance);
                Contribution {
                    id: id(run, number),
                    robot: Arc::from("ada"),
                    observed_at_us: 0,
                    level_from_robot: UncertainPose {
                        pose: Pose::new(
                            truth.x + common[0] + chance.normal(NOISE.position * own),
                            truth.y + common[1] + chance.normal(NOISE.position * own),
                            truth.heading() + common[2] + chance.normal(NOISE.heading * own),
                        ),
                        covariance: Covariance::from_variances([
                            NOISE.position.powi(2),
                            NOISE.position.powi(2),
                            NOISE.heading.powi(2),
                        ]),
                    },
                    provenance: Provenance::SharedMap,
                    segments: vec![segment],
                    clusters: Vec::new(),
                    evidence: Vec::new(),
                }
            })
            .collect();
        let mut level = Level::new(LevelConfig::standard(0.05));
        level.fold(&contributions);
        let segment = level.map().segments.values().max_by_key(|s| s.looks).unwrap();
        let direction = (WALL[1] - WALL[0]).normalize();
        let normal = Point::new(direction.y, -direction.x);
        let (mut rho, mut alpha) = (normal.dot(&WALL[0]), normal.y.atan2(normal.x));
        if rho < 0.0 {
            (rho, alpha) = (-rho, (-normal.y).atan2(-normal.x));
        }
        let delta = Vector2::new(segment.line.rho() - rho, difference(segment.line.alpha(), alpha));
        let total = segment.independent + segment.dependent;
        sum += mahalanobis_sq(&delta, &total);
        let middle = (WALL[0] + WALL[1]) * 0.5;
        let lever = -segment.line.along(&middle);
        let c = total.transformed(&nalgebra::Matrix2::new(1.0, lever, 0.0, 1.0));
        claimed += c.matrix()[(0, 0)];
        actual += segment.line.across(&middle).powi(2);
    }
    (sum / runs as f64, (claimed / actual).sqrt())
}

#[test]
fn one_look_is_honest_to_the_chi_square_band() {
    // 1000 runs, 2 degrees of freedom: the mean lies in [1.878, 2.126] with 95 %; 99.9 % is wider.
    let (mean, _) = nees(1, 0.0, 1000);
    assert!((1.79..2.22).contains(&mean), "{mean}");
}

#[test]
fn many_looks_are_never_optimistic_whatever_they_share() {
    for looks in [2, 10, 40] {
        for shared in [0.0, 0.7, 1.0] {
            let (mean, ratio) = nees(looks, shared, 250);
            assert!(mean < 2.27, "{looks} looks sharing {shared}: NEES {mean}");
            if shared > 0.99 {
                // All error shared: the claim must be honest and not wasteful.
                assert!((0.9..1.6).contains(&ratio), "{looks} looks: claimed/actual {ratio}");
            }
        }
    }
}
