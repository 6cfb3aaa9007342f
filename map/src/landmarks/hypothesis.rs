//! From two landmarks that may be two of the table's to a pose that explains as many as it can.

use super::fit::{Correspondence, PoseFit, fit_pose};
use super::locate::LocateConfig;
use super::pairs::middle;
use super::{LandmarkTable, ObservedLandmark};
use crate::geometry::{Level, Point, Pose, Robot, chi_square_quantile, difference, mahalanobis_sq};

/// The 99.9 % quantile of the standard normal distribution: a pose whose matches agree worse is none.
const WORST_SDS: f64 = 3.0902;

/// Which landmark seen is which of the table.
pub(super) type Match = (usize, u32);

/// Two landmarks seen that are looked for in the table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Seed {
    pub(super) ends: [usize; 2],
    pub(super) length: f64,
}

/// A pose and what it explains.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Hypothesis {
    pub(super) fit: PoseFit,
    /// Ascending by what was seen.
    pub(super) matches: Vec<Match>,
}

/// What was seen, held against a table.
#[derive(Debug, Clone, Copy)]
pub(super) struct Search<'a> {
    pub(super) table: &'a LandmarkTable,
    pub(super) seen: &'a [ObservedLandmark],
    pub(super) config: &'a LocateConfig,
}

impl Search<'_> {
    /// Deviation of a landmark seen, the table's worst included, metres.
    pub(super) fn place_sd(&self, seen: usize) -> f64 {
        self.seen[seen].place_sd().hypot(self.table.worst.0)
    }

    /// Deviation of the direction between one seen and one known, radians.
    pub(super) fn direction_sd(&self, seen: &ObservedLandmark, known_sd: f64) -> f64 {
        seen.direction_sd.hypot(known_sd).max(self.config.direction_sd_min)
    }

    /// The pose at which the two ends of a seed lie where two landmarks of the table do.
    pub(super) fn pose_of(&self, seed: &Seed, known: [u32; 2]) -> Pose<Level, Robot> {
        let [p, q] = seed.ends.map(|end| self.seen[end].at);
        let [a, b] = known.map(|end| self.table.landmarks[end as usize].at);
        let (from, to) = (q - p, b - a);
        let heading = from.perp(&to).atan2(from.dot(&to));
        let (sin, cos) = heading.sin_cos();
        let (seen, known) = (middle(&p, &q), middle(&a, &b));
        let turned = Point::new(cos * seen.x - sin * seen.y, sin * seen.x + cos * seen.y);
        Pose::new(known.x - turned.x, known.y - turned.y, heading)
    }

    /// What the pose of a seed explains, if it explains enough, with the pose that fits all of it best.
    pub(super) fn grow(&self, seed: &Seed, known: [u32; 2]) -> Option<Hypothesis> {
        let matches = self.matches_of_seed(seed, known);
        if matches.len() < self.config.matches_min {
            return None;
        }
        let fit = self.fit(&matches)?;
        let matches = self.matches_of_fit(&fit);
        if matches.len() < self.config.matches_min {
            return None;
        }
        self.settled(matches)
    }

    fn fit(&self, matches: &[Match]) -> Option<PoseFit> {
        let pairs: Vec<Correspondence<'_>> = matches.iter().map(|m| self.pair(*m)).collect();
        fit_pose(&pairs).ok()
    }

    pub(super) fn pair(&self, (seen, known): Match) -> Correspondence<'_> {
        Correspondence { seen: &self.seen[seen], known: &self.table.landmarks[known as usize] }
    }

    /// The nearest landmark of the table for each one seen, within what the seed's uncertainty allows.
    fn matches_of_seed(&self, seed: &Seed, known: [u32; 2]) -> Vec<Match> {
        let pose = self.pose_of(seed, known);
        let [i, j] = seed.ends;
        let ends_variance = self.place_sd(i).powi(2) + self.place_sd(j).powi(2);
        let turn_variance = ends_variance / (seed.length * seed.length);
        let centre = middle(&self.seen[i].at, &self.seen[j].at);
        let mut matches = Vec::new();
        for (k, seen) in self.seen.iter().enumerate() {
            let at = pose.act(&seen.at);
            let arm_sq = (seen.at - centre).norm_squared();
            let variance = 0.25 * ends_variance + arm_sq * turn_variance + self.place_sd(k).powi(2);
            let reach = (self.config.gate * variance).sqrt();
            let mut nearest: Option<(f64, u32)> = None;
            for number in self.table.grid.near(&at, reach) {
                let landmark = &self.table.landmarks[number as usize];
                let distance_sq = (landmark.at - at).norm_squared();
                if landmark.kind != seen.kind
                    || distance_sq > reach * reach
                    || nearest.is_some_and(|(least, _)| distance_sq >= least)
                {
                    continue;
                }
                let turn = seen.kind.turn(landmark.direction, seen.direction + pose.heading());
                let sd_sq = self.direction_sd(seen, landmark.direction_sd).powi(2) + turn_variance;
                if turn * turn <= self.config.gate * sd_sq {
                    nearest = Some((distance_sq, number));
                }
            }
            if let Some((_, number)) = nearest {
                matches.push((k, number));
            }
        }
        one_to_one(&mut matches);
        matches
    }

    /// What a fitted pose explains, each landmark of the table once.
    fn matches_of_fit(&self, fit: &PoseFit) -> Vec<Match> {
        let pose = &fit.level_from_robot.pose;
        let mut possible: Vec<(f64, Match)> = Vec::new();
        for (k, seen) in self.seen.iter().enumerate() {
            let at = pose.act(&seen.at);
            let of_pose = fit.level_from_robot.covariance.transformed(&pose.j_point_pose(&seen.at));
            let widest = of_pose.matrix().trace() + self.place_sd(k).powi(2);
            for number in self.table.grid.near(&at, (self.config.gate * widest).sqrt()) {
                let landmark = &self.table.landmarks[number as usize];
                if landmark.kind != seen.kind {
                    continue;
                }
                let turn = seen.kind.turn(landmark.direction, seen.direction + pose.heading());
                let turn_sd_sq = self.direction_sd(seen, landmark.direction_sd).powi(2)
                    + fit.level_from_robot.covariance.matrix()[(2, 2)];
                let (residual, covariance) = self.pair((k, number)).residual(pose);
                let off_sq = mahalanobis_sq(&residual, &(covariance + of_pose));
                if off_sq <= self.config.gate && turn * turn <= self.config.gate * turn_sd_sq {
                    possible.push((off_sq, (k, number)));
                }
            }
        }
        possible.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut matches: Vec<Match> = Vec::new();
        for (_, (k, number)) in possible {
            if matches.iter().all(|(seen, known)| *seen != k && *known != number) {
                matches.push((k, number));
            }
        }
        matches.sort_unstable();
        matches
    }

    /// The hypothesis of these matches, without those that do not agree with the rest.
    fn settled(&self, mut matches: Vec<Match>) -> Option<Hypothesis> {
        loop {
            let fit = self.fit(&matches)?;
            if fit.chi_sq <= chi_square_quantile(2 * matches.len() - 3, WORST_SDS) {
                return Some(Hypothesis { fit, matches });
            }
            if matches.len() <= self.config.matches_min {
                return None;
            }
            let pose = &fit.level_from_robot.pose;
            let off = |m: &Match| {
                let (residual, covariance) = self.pair(*m).residual(pose);
                mahalanobis_sq(&residual, &covariance)
            };
            let worst = (0..matches.len())
                .max_by(|a, b| off(&matches[*a]).total_cmp(&off(&matches[*b])))?;
            matches.remove(worst);
        }
    }
}

/// Keeps the first match of each landmark of the table.
fn one_to_one(matches: &mut Vec<Match>) {
    let mut taken: Vec<u32> = Vec::with_capacity(matches.len());
    matches.retain(|(_, known)| {
        let is_new = !taken.contains(known);
        taken.push(*known);
        is_new
    });
}

/// Whether two poses are one for all purposes.
pub(super) fn is_near(
    a: &Pose<Level, Robot>,
    b: &Pose<Level, Robot>,
    (place, turn): (f64, f64),
) -> bool {
    (a.position() - b.position()).norm_squared() <= place * place
        && difference(a.heading(), b.heading()).abs() <= turn
}
