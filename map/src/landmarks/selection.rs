//! Which landmarks to find oneself by, if not all: those that are good enough, and of these, one by one, the one that
//! makes the place most certain (the A-optimal choice, greedily); then single ones are exchanged as long as that helps.
//!
//! It never beats using all that were matched rightly: it is for who has no time, and for who must not rely on poor ones.

use nalgebra::{Cholesky, Matrix3};

use super::Correspondence;
use super::goodness::{Goodness, GoodnessConfig, Traits, ramp};
use crate::geometry::{Level, Point, Robot, UncertainPose, difference};

/// Exchanges after the greedy choice; one to three are usual.
const EXCHANGES_MAX: usize = 16;

/// A landmark that may be chosen.
#[derive(Debug, Clone, Copy)]
pub struct Selectable<'a> {
    /// As seen and as known.
    pub pair: Correspondence<'a>,
    /// What it is judged by.
    pub traits: Traits,
}

/// A landmark that was chosen.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Selected {
    /// Its place in the list.
    pub index: usize,
    /// How it was judged.
    pub goodness: Goodness,
    /// Root of the trace of the covariance of the robot's place with it and all chosen before, metres.
    pub place_sd: f64,
}

/// Chooses at most `count` landmarks for a robot at about this pose, the most useful first. What the fuzzy judgement
/// refuses is not chosen.
pub fn select(
    landmarks: &[Selectable<'_>],
    prior: &UncertainPose<Level, Robot>,
    count: usize,
    config: &GoodnessConfig,
) -> Vec<Selected> {
    let Some(own) = prior.covariance.information() else { return Vec::new() };
    let fit: Vec<(usize, Goodness, Matrix3<f64>)> = landmarks
        .iter()
        .enumerate()
        .filter_map(|(index, of)| {
            let goodness = Goodness::of(&of.traits, config);
            let tells = information_of(&of.pair, prior)?;
            (goodness.value >= config.gate).then_some((index, goodness, tells))
        })
        .collect();
    let mut chosen: Vec<usize> = Vec::new();
    let mut information = own;
    while chosen.len() < count.min(fit.len()) {
        let Some((_, best)) = best_of(&fit, &chosen, &information) else { break };
        information += fit[best].2;
        chosen.push(best);
    }
    for _ in 0..EXCHANGES_MAX {
        let Some(now) = place_sd(&information) else { break };
        let swaps = (0..chosen.len()).filter_map(|at| {
            let (sd, best) = best_of(&fit, &chosen, &(information - fit[chosen[at]].2))?;
            Some((sd, at, best))
        });
        let swap = swaps.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let Some((_, at, best)) = swap.filter(|swap| swap.0 < (1.0 - 1e-9) * now) else { break };
        information += fit[best].2 - fit[chosen[at]].2;
        chosen[at] = best;
    }
    let mut information = own;
    let told = chosen.into_iter().filter_map(|at| {
        let (index, goodness, tells) = fit[at];
        information += tells;
        Some(Selected { index, goodness, place_sd: place_sd(&information)? })
    });
    told.collect()
}

/// The one that is not chosen yet and makes the place most certain, and how certain; of equals the first.
fn best_of(
    fit: &[(usize, Goodness, Matrix3<f64>)],
    chosen: &[usize],
    information: &Matrix3<f64>,
) -> Option<(f64, usize)> {
    let left = (0..fit.len()).filter(|at| !chosen.contains(at));
    let sds = left.filter_map(|at| Some((place_sd(&(information + fit[at].2))?, at)));
    sds.min_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)))
}

/// Chooses by judgement alone: the best first, then those that are good and lie apart from what is chosen, seen from
/// the robot. What a robot without covariances would do; [`select`] is better.
pub fn select_by_goodness(
    landmarks: &[Selectable<'_>],
    count: usize,
    config: &GoodnessConfig,
) -> Vec<usize> {
    let bearing = |at: &Point| at.y.atan2(at.x);
    let value: Vec<f64> =
        landmarks.iter().map(|of| Goodness::of(&of.traits, config).value).collect();
    let mut chosen: Vec<usize> = Vec::new();
    while chosen.len() < count.min(landmarks.len()) {
        let score = |index: usize| {
            let own = bearing(&landmarks[index].pair.seen.at);
            let apart =
                |other: &usize| difference(own, bearing(&landmarks[*other].pair.seen.at)).abs();
            let least = chosen.iter().map(apart).fold(f64::INFINITY, f64::min);
            value[index].min(ramp(least, config.apart))
        };
        let left = (0..landmarks.len()).filter(|index| !chosen.contains(index));
        // Of equals the better one, then the first.
        let best = left.max_by(|a, b| {
            score(*a).total_cmp(&score(*b)).then(value[*a].total_cmp(&value[*b])).then(b.cmp(a))
        });
        let Some(best) = best else { break };
        chosen.push(best);
    }
    chosen
}

/// What a landmark tells of the pose: `J^T W J`.
fn information_of(
    pair: &Correspondence<'_>,
    at: &UncertainPose<Level, Robot>,
) -> Option<Matrix3<f64>> {
    let (_, covariance) = pair.residual(&at.pose);
    let j = at.pose.j_point_pose(&pair.seen.at);
    Some(j.transpose() * covariance.information()? * j)
}

fn place_sd(information: &Matrix3<f64>) -> Option<f64> {
    let covariance = Cholesky::new(*information)?.inverse();
    Some((covariance[(0, 0)] + covariance[(1, 1)]).sqrt())
}

#[cfg(test)]
mod tests {
    use super::super::{Landmark, LandmarkKind};
    use super::*;
    use crate::chance::Chance;
    use crate::geometry::{Covariance, Pose};

    fn prior() -> UncertainPose<Level, Robot> {
        UncertainPose {
            pose: Pose::new(3.0, -2.0, 0.7),
            covariance: Covariance::from_variances([0.25, 0.25, 0.03]),
        }
    }

    fn scene(chance: &mut Chance, count: usize) -> Vec<(Landmark, Landmark)> {
        let pose = prior().pose;
        (0..count)
            .map(|_| {
                let at = Point::new(8.0 * chance.share() - 4.0, 8.0 * chance.share() - 4.0);
                let sds = [0.01 + 0.04 * chance.share(), 0.01 + 0.04 * chance.share()];
                let seen = Landmark {
                    kind: LandmarkKind::ConcaveCorner,
                    at,
                    direction: 0.0,
                    covariance: Covariance::from_variances(sds.map(|sd| sd * sd)),
                    direction_sd: 0.05,
                };
                (seen, Landmark { at: pose.act(&at), ..seen })
            })
            .collect()
    }

    const GOOD: Traits = Traits { sd: 0.02, uniqueness: 1.0, wall: 1.0, existence: 0.95 };

    fn selectable(pairs: &[(Landmark, Landmark)]) -> Vec<Selectable<'_>> {
        let pair =
            |(seen, known)| Selectable { pair: Correspondence { seen, known }, traits: GOOD };
        pairs.iter().map(|(seen, known)| pair((seen, known))).collect()
    }

    #[test]
    fn three_chosen_one_by_one_are_all_but_as_good_as_the_best_three() {
        let mut chance = Chance(21);
        let (mut greedy, mut best) = (0.0, 0.0);
        for _ in 0..100 {
            let pairs = scene(&mut chance, 9);
            let all = selectable(&pairs);
            let chosen = select(&all, &prior(), 3, &GoodnessConfig::STANDARD);
            assert_eq!(chosen.len(), 3);
            assert!(chosen.windows(2).all(|pair| pair[1].place_sd <= pair[0].place_sd));
            let mut least = f64::INFINITY;
            let own = prior().covariance.information().unwrap();
            let tells: Vec<_> =
                all.iter().map(|s| information_of(&s.pair, &prior()).unwrap()).collect();
            for (a, b, c) in (0..9)
                .flat_map(|a| (a + 1..9).flat_map(move |b| (b + 1..9).map(move |c| (a, b, c))))
            {
                least = least.min(place_sd(&(own + tells[a] + tells[b] + tells[c])).unwrap());
            }
            assert!(chosen[2].place_sd >= least - 1e-12);
            greedy += chosen[2].place_sd;
            best += least;
        }
        assert!(greedy < 1.03 * best, "{}", greedy / best);
    }

    #[test]
    fn what_is_judged_poor_is_not_chosen_however_much_it_tells() {
        let mut chance = Chance(22);
        let pairs = scene(&mut chance, 6);
        let mut all = selectable(&pairs);
        for of in &mut all[..4] {
            of.traits.existence = 0.0;
        }
        let chosen = select(&all, &prior(), 4, &GoodnessConfig::STANDARD);
        let mut indices: Vec<usize> = chosen.iter().map(|s| s.index).collect();
        indices.sort_unstable();
        assert_eq!(indices, [4, 5]);
        assert!(select(&[], &prior(), 4, &GoodnessConfig::STANDARD).is_empty());
        let by_judgement = select_by_goodness(&all, 9, &GoodnessConfig::STANDARD);
        assert_eq!(by_judgement.len(), 6);
        assert!(by_judgement[..2].iter().all(|index| *index >= 4));
    }
}
