//! Where a robot is, from the landmarks that it sees, with nothing else known or with a guess.
//!
//! Pairs of what is seen, rare ones first, are looked up in the table; each pair of the table that could be
//! the same gives a pose; a pose is grown to all that it explains and refined. Poses are then weighed
//! against each other and against "none of them": what was seen where the table says, what was seen and is
//! not there (clutter), and what should have been seen and was not. To first order in the pose's
//! covariance (Laplace), the weight of a pose is
//!
//! `sum_matched ln(P_D N(e; C)) + sum_unmatched ln c + sum_missed ln(1 - P_D) + ln(prior sqrt(|2 pi C_pose|))`
//!
//! with `c` the density of clutter over place, direction and kind. Counting matches alone would call two
//! equal rooms different for one chance match.

use std::f64::consts::{PI, TAU};

use nalgebra::Vector3;

use super::hypothesis::{Hypothesis, Match, Search, Seed, is_near};
use super::pairs::Shape;
use super::sight::{Obstacles, Sight};
use super::table::{PAIR_LENGTHS, PAIR_SD_MAX};
use super::{LandmarkKind, LandmarkTable, ObservedLandmark};
use crate::geometry::{Covariance, Level, Pose, Robot, UncertainPose, difference, mahalanobis_sq};

/// When poses count as found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocateConfig {
    /// Most pairs of what is seen that are looked up.
    pub seeds_max: usize,
    /// Most poses that are tried; with more of them nothing can be told.
    pub tries_max: usize,
    /// Fewest landmarks that a pose explains.
    pub matches_min: usize,
    /// Squared deviations within which a landmark is where it should be: the 99 % quantile of chi-square
    /// with two degrees of freedom.
    pub gate: f64,
    /// Directions are not known better than this, radians.
    pub direction_sd_min: f64,
    /// Least density of landmarks seen that are none, a square metre.
    pub clutter: f64,
    /// Probability that a landmark in full sight is seen: corners and free ends.
    pub detection: f64,
    /// The same of doorways, whose doors may be closed.
    pub detection_of_doorways: f64,
    /// The same of all where nobody says what stands in the way.
    pub detection_in_the_dark: f64,
    /// Logarithm of how much likelier one pose must be than all others together.
    pub odds: f64,
    /// Poses closer than this are one: metres, radians.
    pub apart: (f64, f64),
    /// Headings less certain than this are none, radians.
    pub heading_sd_max: f64,
    /// Most candidates that are told.
    pub candidates_max: usize,
}

impl LocateConfig {
    /// The defaults: a thousand to one.
    pub const STANDARD: Self = Self {
        seeds_max: 24,
        tries_max: 200_000,
        matches_min: 3,
        gate: 9.21,
        direction_sd_min: 3.0 * PI / 180.0,
        clutter: 0.02,
        detection: 0.9,
        detection_of_doorways: 0.5,
        detection_in_the_dark: 0.5,
        odds: 6.9,
        apart: (0.5, 0.3),
        heading_sd_max: 3.0 * PI / 180.0,
        candidates_max: 16,
    };
}

const KINDS: usize = LandmarkKind::ALL.len();

/// A pose that may be the robot's.
#[derive(Debug, Clone, PartialEq)]
pub struct Candidate {
    /// The pose.
    pub level_from_robot: UncertainPose<Level, Robot>,
    /// What was seen (by place in the list) and the landmark that it is (by number in the table), ascending.
    pub matches: Vec<(usize, u32)>,
    /// Chi-square of the matches, with `2 n - 3` degrees of freedom.
    pub chi_sq: f64,
    /// Its share of all poses' probability.
    pub weight: f64,
}

/// Where a robot is, as far as can be told.
#[derive(Debug, Clone, PartialEq)]
pub enum Fix {
    /// There; all other places together are less likely by the odds asked for.
    Unique(Candidate),
    /// One of these, likeliest first, or elsewhere.
    Ambiguous(Vec<Candidate>),
    /// Nothing that is seen fits well enough.
    NoMatch,
}

/// Finds where a robot is that sees these landmarks. `sight` is what its sensor covers, `obstacles` what may stand
/// in the way of it, if that is known, `prior` a guess of the pose.
pub fn locate(
    table: &LandmarkTable,
    seen: &[ObservedLandmark],
    sight: &Sight,
    obstacles: Option<&Obstacles>,
    prior: Option<&UncertainPose<Level, Robot>>,
    config: &LocateConfig,
) -> Fix {
    let search = Search { table, seen, config };
    let weigh = Weigh { search, sight, obstacles, prior, clutter: clutter(seen, sight, config) };
    let Some(hypotheses) = hypotheses(&search, prior) else { return Fix::Ambiguous(Vec::new()) };
    weigh.decide(hypotheses)
}

/// A pair to look up: how far its length and its directions may be off.
struct Query {
    seed: Seed,
    shape: Shape,
    /// Metres: three deviations.
    gate: f64,
    /// Radians.
    turn_gate: f64,
    population: usize,
}

/// The pairs to look up: those of landmarks that have been used least, of these the rarest first.
fn queries(search: &Search<'_>) -> Vec<Query> {
    let Search { table, seen, config } = *search;
    let fit: Vec<usize> = (0..seen.len()).filter(|i| seen[*i].place_sd() <= PAIR_SD_MAX).collect();
    let mut all: Vec<Query> = Vec::new();
    for (from, i) in fit.iter().enumerate() {
        for j in &fit[from + 1..] {
            let shape = Shape::of(&seen[*i], &seen[*j]);
            if shape.length < PAIR_LENGTHS.0 || shape.length > PAIR_LENGTHS.1 {
                continue;
            }
            let gate = 3.0 * search.place_sd(*i).hypot(search.place_sd(*j));
            let direction_sd = |end: usize| search.direction_sd(&seen[end], table.worst.1);
            let direction_sd = direction_sd(*i).max(direction_sd(*j));
            let turn_gate = 3.0 * direction_sd.hypot(gate / (3.0 * shape.length));
            let population = table.pairs.population(&shape, gate, turn_gate);
            let seed = Seed { ends: [*i, *j], length: shape.length };
            all.push(Query { seed, shape, gate, turn_gate, population });
        }
    }
    // Of equally rare ones the longer, which tells a better heading.
    let rarity = |a: &Query, b: &Query| {
        a.population.cmp(&b.population).then(b.shape.length.total_cmp(&a.shape.length))
    };
    all.sort_by(rarity);
    let mut uses = vec![0_usize; seen.len()];
    let mut chosen = Vec::new();
    while chosen.len() < config.seeds_max {
        let worn = |query: &Query| query.seed.ends.iter().map(|end| uses[*end]).sum::<usize>();
        let Some(next) = (0..all.len()).min_by_key(|at| worn(&all[*at])) else { break };
        let query = all.remove(next);
        query.seed.ends.iter().for_each(|end| uses[*end] += 1);
        chosen.push(query);
    }
    chosen
}

/// All poses that explain enough; `None` if there are too many to try.
///
/// Ends early when no pose can have been overlooked that explains as many landmarks as the best, or one
/// less: whichever those are, both ends of some pair that was looked up are among them.
fn hypotheses(
    search: &Search<'_>,
    prior: Option<&UncertainPose<Level, Robot>>,
) -> Option<Vec<Hypothesis>> {
    let Search { table, seen, config } = *search;
    let mut found: Vec<Hypothesis> = Vec::new();
    let (mut tries, mut most) = (0, 0);
    let mut asked: Vec<[usize; 2]> = Vec::new();
    for Query { seed, shape, gate, turn_gate, .. } in queries(search) {
        table.pairs.alike(&shape, gate, turn_gate, |known| {
            tries += 1;
            if tries > config.tries_max {
                return;
            }
            let is_far = prior.is_some_and(|prior| is_far(prior, &search.pose_of(&seed, known)));
            let pair = [(seed.ends[0], known[0]), (seed.ends[1], known[1])];
            let is_known = |h: &Hypothesis| pair.iter().all(|m| h.matches.binary_search(m).is_ok());
            if is_far || found.iter().any(is_known) {
                return;
            }
            if let Some(hypothesis) = search.grow(&seed, known) {
                most = most.max(hypothesis.matches.len());
                found.push(hypothesis);
            }
        });
        if tries > config.tries_max {
            return None;
        }
        asked.push(seed.ends);
        if most > config.matches_min && !is_coverable(&asked, seen.len() - most + 1) {
            break;
        }
    }
    Some(found)
}

/// Whether so many landmarks can be found that every pair has one of them.
fn is_coverable(pairs: &[[usize; 2]], count: usize) -> bool {
    let Some([a, b]) = pairs.first() else { return true };
    count > 0
        && [a, b].into_iter().any(|end| {
            let rest: Vec<[usize; 2]> =
                pairs.iter().filter(|pair| !pair.contains(end)).copied().collect();
            is_coverable(&rest, count - 1)
        })
}

/// Whether a pose lies far outside of what a guess and a pair's own uncertainty allow.
fn is_far(prior: &UncertainPose<Level, Robot>, pose: &Pose<Level, Robot>) -> bool {
    let slack = Covariance::from_variances([0.25, 0.25, 0.03]);
    mahalanobis_sq(&between(&prior.pose, pose), &(prior.covariance + slack)) > 25.0
}

/// From one pose to another, as a vector.
fn between(from: &Pose<Level, Robot>, to: &Pose<Level, Robot>) -> Vector3<f64> {
    Vector3::new(to.x - from.x, to.y - from.y, difference(to.heading(), from.heading()))
}

/// Logarithm of the density of clutter over place, direction and kind, by kind: what the configuration says, or
/// as if all that is seen were clutter. A cluttered place must not look like a known one by chance.
fn clutter(seen: &[ObservedLandmark], sight: &Sight, config: &LocateConfig) -> [f64; KINDS] {
    let farthest = seen.iter().map(|l| l.at.norm()).fold(sight.range, f64::max);
    let area = (sight.half_field * farthest * farthest).max(1.0);
    LandmarkKind::ALL.map(|kind| {
        let count = seen.iter().filter(|l| l.kind == kind).count() as f64;
        let density = (config.clutter / KINDS as f64).max(count / area);
        let turn = if kind.is_two_sided() { PI } else { TAU };
        (density / turn).ln()
    })
}

/// What weighs poses against each other.
struct Weigh<'a> {
    search: Search<'a>,
    sight: &'a Sight,
    obstacles: Option<&'a Obstacles>,
    prior: Option<&'a UncertainPose<Level, Robot>>,
    clutter: [f64; KINDS],
}

impl Weigh<'_> {
    fn decide(&self, hypotheses: Vec<Hypothesis>) -> Fix {
        let config = self.search.config;
        // Without what was missed, which only lessens a weight: the likeliest are looked at first.
        let mut bounded: Vec<(f64, Hypothesis)> =
            hypotheses.into_iter().map(|h| (self.of_seen(&h), h)).collect();
        bounded.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| order(&a.1, &b.1)));
        let mut weighed: Vec<(f64, Hypothesis)> = Vec::new();
        let mut best = f64::NEG_INFINITY;
        for (bound, hypothesis) in bounded {
            // All that follow together weigh less than a hundredth of what would matter.
            if bound < best - config.odds - 10.0 {
                break;
            }
            let pose = hypothesis.fit.level_from_robot.pose;
            let is_known = |(_, other): &(f64, Hypothesis)| {
                is_near(&other.fit.level_from_robot.pose, &pose, config.apart)
            };
            let weight = bound + self.of_missed(&hypothesis);
            best = best.max(weight);
            match weighed.iter_mut().find(|known| is_known(known)) {
                Some(known) if known.0 < weight => *known = (weight, hypothesis),
                Some(_) => {}
                None => weighed.push((weight, hypothesis)),
            }
        }
        weighed.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| order(&a.1, &b.1)));
        let nowhere = self.search.seen.iter().map(|l| self.of_clutter(l.kind)).sum::<f64>();
        let first = weighed.first();
        let first = first.map(|(best, h)| (*best, h.fit.level_from_robot.covariance.sd(2)));
        let Some((best, heading_sd)) = first else { return Fix::NoMatch };
        if best - nowhere <= config.odds {
            return Fix::NoMatch;
        }
        let share = |weight: f64| (weight - best).exp();
        let total: f64 = weighed.iter().map(|(weight, _)| share(*weight)).sum();
        let others = total - 1.0;
        let is_unique = others.ln() < -config.odds && heading_sd <= config.heading_sd_max;
        let candidates = weighed.into_iter().take(config.candidates_max);
        let mut candidates = candidates.map(|(weight, hypothesis)| Candidate {
            level_from_robot: hypothesis.fit.level_from_robot,
            matches: hypothesis.matches,
            chi_sq: hypothesis.fit.chi_sq,
            weight: share(weight) / total,
        });
        match candidates.next() {
            Some(candidate) if is_unique => Fix::Unique(candidate),
            first => Fix::Ambiguous(first.into_iter().chain(candidates).collect()),
        }
    }

    /// What was seen, and the guess.
    fn of_seen(&self, hypothesis: &Hypothesis) -> f64 {
        let Search { table, seen, .. } = self.search;
        let UncertainPose { pose, covariance } = &hypothesis.fit.level_from_robot;
        let mut weight = 0.0;
        let mut matches = hypothesis.matches.iter().peekable();
        for (k, landmark) in seen.iter().enumerate() {
            let Some((_, number)) = matches.next_if(|(seen, _)| *seen == k) else {
                weight += self.of_clutter(landmark.kind);
                continue;
            };
            let known = &table.landmarks[*number as usize];
            let (residual, place) = self.search.pair((k, *number)).residual(pose);
            let turn = landmark.kind.turn(known.direction, landmark.direction + pose.heading());
            let sd = self.search.direction_sd(landmark, known.direction_sd);
            weight += self.detection(landmark.kind).ln()
                + ln_normal(mahalanobis_sq(&residual, &place), place.matrix().determinant(), 2)
                + ln_normal((turn / sd).powi(2), sd * sd, 1);
        }
        let prior = match self.prior {
            Some(prior) => {
                let both = prior.covariance + *covariance;
                let off_sq = mahalanobis_sq(&between(&prior.pose, pose), &both);
                ln_normal(off_sq, both.matrix().determinant(), 3)
            }
            None => -(table.area * TAU).ln(),
        };
        weight + prior + 0.5 * (TAU.powi(3) * covariance.matrix().determinant()).ln()
    }

    /// What should have been seen and was not.
    fn of_missed(&self, hypothesis: &Hypothesis) -> f64 {
        let table = self.search.table;
        let pose = &hypothesis.fit.level_from_robot.pose;
        let is_matched =
            |number: u32| hypothesis.matches.iter().any(|(_, known): &Match| *known == number);
        let should_be_seen = |number: &u32| {
            let landmark = &table.landmarks[*number as usize];
            !is_matched(*number)
                && self.sight.covers(pose, landmark)
                && self.obstacles.is_none_or(|o| o.leave_free(&pose.position(), landmark))
        };
        let near = table.grid.near(&pose.position(), self.sight.range);
        near.filter(should_be_seen)
            .map(|number| (1.0 - self.detection(table.landmarks[number as usize].kind)).ln())
            .sum()
    }

    fn detection(&self, kind: LandmarkKind) -> f64 {
        let config = self.search.config;
        if self.obstacles.is_none() {
            config.detection_in_the_dark
        } else if kind == LandmarkKind::Doorway {
            config.detection_of_doorways
        } else {
            config.detection
        }
    }

    fn of_clutter(&self, kind: LandmarkKind) -> f64 {
        self.clutter[kind as usize]
    }
}

/// Logarithm of a normal density of so many dimensions.
fn ln_normal(off_sq: f64, determinant: f64, dimensions: i32) -> f64 {
    -0.5 * off_sq - 0.5 * (TAU.powi(dimensions) * determinant).ln()
}

/// An order that does not depend on how hypotheses were found.
fn order(a: &Hypothesis, b: &Hypothesis) -> std::cmp::Ordering {
    let known = |h: &Hypothesis| -> Vec<u32> { h.matches.iter().map(|m| m.1).collect() };
    known(a).cmp(&known(b))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::Chance;

    #[test]
    fn a_cover_is_found_exactly_when_there_is_one() {
        let mut chance = Chance(9);
        for _ in 0..300 {
            let landmarks = 2 + (6.0 * chance.share()) as usize;
            let mut end = || (landmarks as f64 * chance.share()) as usize;
            let pairs: Vec<[usize; 2]> =
                (0..8).map(|_| [end(), end()]).filter(|[a, b]| a != b).collect();
            for count in 0..=landmarks {
                // All sets of so many landmarks, as bits.
                let covers =
                    |set: u32| pairs.iter().all(|pair| pair.iter().any(|end| set >> end & 1 == 1));
                let there_is = (0..1_u32 << landmarks)
                    .any(|set| set.count_ones() as usize == count && covers(set));
                assert_eq!(is_coverable(&pairs, count), there_is, "{pairs:?} {count}");
            }
        }
    }
}
