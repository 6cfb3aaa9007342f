//! Proposing poses, and which to believe.

use super::refine::refined;
use super::weigh::{deviations, weighed};
use super::{Alignment, AlignmentConfig, Candidate, Chart, Doubt};
use crate::geometry::{Level, Odom, Point, Pose, difference};
use crate::places::Known;

/// Candidates that are kept.
const CANDIDATES_MAX: usize = 8;
/// A structure is looked at by so many points first, and further only if these speak for it.
const FIRST: usize = 32;

/// A pose that one structure of each map proposes.
struct Proposed {
    /// What the surroundings of the structure come to there, in steps of fits.
    gain: i64,
    level_from_odom: Pose<Level, Odom>,
    /// The structure on the robot's map.
    at: Point,
}

/// Aligns a map that a robot made in a frame of its own with a level's. The same maps give the same answer. Its cost
/// grows with the number of structures of the one times that of the other, up to some seconds.
pub fn align(level: &Chart, own: &Chart, config: &AlignmentConfig) -> Alignment {
    let mut candidates: Vec<Candidate> = Vec::new();
    let mut tried: Vec<Pose<Level, Odom>> = Vec::new();
    let mut weighed_count = 0;
    for proposed in proposals(level, own, config) {
        let Proposed { level_from_odom, at, .. } = proposed;
        let is_known = |pose: &Pose<Level, Odom>| is_same(pose, &level_from_odom, &at, config);
        if tried.iter().any(is_known) {
            continue;
        }
        weighed_count += 1;
        if weighed_count > config.tries_max {
            break;
        }
        tried.push(level_from_odom);
        let pose = refined(level, own, &level_from_odom, &at);
        tried.push(pose);
        let is_known = |known: &Candidate| {
            is_same(&known.level_from_odom.pose, &pose, &own_middle(known), config)
        };
        let candidate = weighed(level, own, &pose, config);
        match candidates.iter_mut().find(|known| is_known(known)) {
            Some(known) if known.score(config) < candidate.score(config) => *known = candidate,
            Some(_) => {}
            None => candidates.push(candidate),
        }
    }
    candidates.retain(|candidate| candidate.score(config) > 0.0);
    candidates.sort_by(|a, b| b.score(config).total_cmp(&a.score(config)));
    let mut others: Vec<Candidate> = Vec::new();
    for candidate in candidates {
        let is_known = |known: &Candidate| {
            let pose = &candidate.level_from_odom.pose;
            is_same(&known.level_from_odom.pose, pose, &own_middle(known), config)
        };
        if !others.iter().any(is_known) {
            others.push(candidate);
        }
    }
    others.truncate(CANDIDATES_MAX);
    let mut alignment = Alignment { candidates: others, doubts: Vec::new() };
    alignment.doubts = doubts(&alignment, config);
    alignment
}

/// The middle of what both maps know, on the robot's.
fn own_middle(candidate: &Candidate) -> Point {
    candidate.level_from_odom.pose.inverse().act(&candidate.middle)
}

/// Poses at which the surroundings of a structure fit those of one like it, best first.
fn proposals(level: &Chart, own: &Chart, config: &AlignmentConfig) -> Vec<Proposed> {
    let mut proposed: Vec<Proposed> = Vec::new();
    for structure in &own.structures {
        let arms = own.around(&structure.at, config);
        if arms.len() < config.structure_points_min {
            continue;
        }
        for other in &level.structures {
            let Some(heading) = structure.heading_onto(other) else { continue };
            if let Some(gain) = gain(level, &other.at, heading, &arms, config) {
                let turned = Pose::<Level, Odom>::new(0.0, 0.0, heading).act(&structure.at);
                let origin = other.at - turned;
                let level_from_odom = Pose::new(origin.x, origin.y, heading);
                proposed.push(Proposed { gain, level_from_odom, at: structure.at });
            }
        }
        // Bounded memory, whatever the maps.
        if proposed.len() > 8 * config.proposals_max {
            keep_best(&mut proposed, config.proposals_max);
        }
    }
    keep_best(&mut proposed, config.proposals_max);
    proposed
}

fn keep_best(proposed: &mut Vec<Proposed>, most: usize) {
    proposed.sort_by_key(|proposed| std::cmp::Reverse(proposed.gain));
    proposed.truncate(most);
}

/// What points about a structure come to if it is `at` on the level, in steps of fits against the unknown; `None` if that
/// is too little.
fn gain(
    level: &Chart,
    at: &Point,
    heading: f64,
    arms: &[Point],
    config: &AlignmentConfig,
) -> Option<i64> {
    let (sin, cos) = heading.sin_cos();
    let neutral = i64::from(level.neutral(config));
    let mut gain = 0;
    for (index, arm) in arms.iter().enumerate() {
        if index == FIRST && gain <= 0 {
            return None;
        }
        let end = at + Point::new(cos * arm.x - sin * arm.y, sin * arm.x + cos * arm.y);
        if level.field.known(&end) != Known::Nothing || level.field.fit(&end) > neutral as u8 {
            gain += i64::from(level.field.fit(&end)) - neutral;
        }
    }
    (gain > 0).then_some(gain)
}

/// Whether two poses take a place on the robot's map to the same one on the level.
fn is_same(
    one: &Pose<Level, Odom>,
    other: &Pose<Level, Odom>,
    place: &Point,
    config: &AlignmentConfig,
) -> bool {
    (one.act(place) - other.act(place)).norm() < config.apart.0
        && difference(one.heading(), other.heading()).abs() < config.apart.1
}

fn doubts(alignment: &Alignment, config: &AlignmentConfig) -> Vec<Doubt> {
    let Some(best) = alignment.candidates.first() else { return vec![Doubt::LittleOverlap] };
    let (sd, turn_sd) = deviations(best);
    [
        (
            best.agreed < config.agreed_min || best.overlap < config.overlap_min,
            Doubt::LittleOverlap,
        ),
        (best.agreement() < config.agreement_min, Doubt::Conflict),
        (best.landmarks < config.landmarks_min, Doubt::FewLandmarks),
        (sd > config.sd_max.0 || turn_sd > config.sd_max.1, Doubt::Loose),
        (alignment.runner_up(config) > config.runner_up_max, Doubt::RunnerUp),
    ]
    .into_iter()
    .filter_map(|(is, doubt)| is.then_some(doubt))
    .collect()
}
