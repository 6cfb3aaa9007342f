//! Choosing four of twelve landmarks: how certain the place is with those.

use mapfold_map::geometry::{Covariance, Level, Point, Pose, Robot, UncertainPose};
use mapfold_map::landmarks::{
    Correspondence, Goodness, GoodnessConfig, Landmark, LandmarkKind, Selectable, Traits, fit_pose,
    select, select_by_goodness,
};

use crate::simulation::Noise;

/// Scenes of the table.
pub(super) const SCENES: u32 = 400;
/// Landmarks of a scene, and how many are chosen.
const LANDMARKS: usize = 12;
const CHOSEN: usize = 4;

/// Ways of choosing.
pub(super) const WAYS: [&str; 5] =
    ["at random", "by goodness", "by goodness and bearing", "greedily for the place", "all twelve"];

/// Deviations of the place with what each of [`WAYS`] chose, scene by scene, metres. In every other scene, all
/// landmarks lie in about one direction.
pub(super) fn place_sds(scenes: u32, noise: &mut Noise) -> [Vec<f64>; 5] {
    let mut sds: [Vec<f64>; 5] = Default::default();
    for scene in 0..scenes {
        let seen: Vec<Landmark> = (0..LANDMARKS).map(|_| landmark(scene % 2 == 1, noise)).collect();
        let known: Vec<Landmark> = seen
            .iter()
            .map(|l| Landmark { covariance: Covariance::from_variances([1e-4; 2]), ..*l })
            .collect();
        let pairs = || seen.iter().zip(&known).map(|(seen, known)| Correspondence { seen, known });
        let all: Vec<Selectable<'_>> =
            pairs().map(|pair| Selectable { pair, traits: traits(&pair) }).collect();
        let config = GoodnessConfig::STANDARD;
        let mut random: Vec<usize> = (0..LANDMARKS).collect();
        for i in 0..CHOSEN {
            let other = i + (noise.share() * (LANDMARKS - i) as f64) as usize;
            random.swap(i, other.min(LANDMARKS - 1));
        }
        random.truncate(CHOSEN);
        let value = |i: &usize| Goodness::of(&all[*i].traits, &config).value;
        let mut best: Vec<usize> = (0..LANDMARKS).collect();
        best.sort_by(|a, b| value(b).total_cmp(&value(a)));
        best.truncate(CHOSEN);
        // What odometry leaves of a pose: half a metre, ten degrees.
        let prior: UncertainPose<Level, Robot> = UncertainPose {
            pose: Pose::identity(),
            covariance: Covariance::from_variances([0.25, 0.25, 0.03]),
        };
        // All of them are fit to be used here: what is compared is the choice.
        let open = GoodnessConfig { gate: 0.0, ..config };
        let greedy = select(&all, &prior, CHOSEN, &open).into_iter().map(|s| s.index).collect();
        let apart = select_by_goodness(&all, CHOSEN, &config);
        let chosen = [random, best, apart, greedy, (0..LANDMARKS).collect()];
        for (sds, chosen) in sds.iter_mut().zip(chosen) {
            let pairs: Vec<Correspondence<'_>> = chosen.iter().map(|i| all[*i].pair).collect();
            if let Ok(fit) = fit_pose(&pairs) {
                let c = fit.level_from_robot.covariance;
                sds.push(c.sd(0).hypot(c.sd(1)));
            }
        }
    }
    sds
}

fn landmark(clustered: bool, noise: &mut Noise) -> Landmark {
    let away = 1.0 + 5.0 * noise.share();
    let bearing = if clustered {
        noise.normal(0.5)
    } else {
        (2.0 * noise.share() - 1.0) * std::f64::consts::PI
    };
    let (along, across) = (0.02 * (0.5 + 2.5 * noise.share()), 0.01 * away);
    let (sin, cos) = bearing.sin_cos();
    let (a, b) = (along * along, across * across);
    let rows = [
        [a * cos * cos + b * sin * sin, (a - b) * sin * cos],
        [(a - b) * sin * cos, a * sin * sin + b * cos * cos],
    ];
    Landmark {
        kind: LandmarkKind::ConcaveCorner,
        at: Point::new(away * cos, away * sin),
        direction: 0.0,
        covariance: Covariance::from_rows(rows)
            .unwrap_or_else(|_| Covariance::from_variances([a, b])),
        direction_sd: 0.05,
    }
}

fn traits(pair: &Correspondence<'_>) -> Traits {
    let variance = (pair.seen.covariance + pair.known.covariance).matrix().trace();
    Traits { sd: variance.sqrt(), uniqueness: 1.0, wall: 1.0, existence: 0.95 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::mean;

    #[test]
    fn the_greedy_choice_is_better_than_judgement_and_that_than_chance() {
        let sds = place_sds(SCENES, &mut Noise::of_seed(4));
        let [random, fuzzy, apart, greedy, all] = sds.map(|of| {
            assert_eq!(of.len(), SCENES as usize);
            1e3 * mean(&of)
        });
        println!("{random} {fuzzy} {apart} {greedy} {all}");
        assert!(all < greedy && greedy < apart && apart < fuzzy && fuzzy < random);
        assert!(greedy < 21.0, "{greedy} mm");
    }
}
