//! Where on a level a whole map lies that a robot made in a frame of its own.
//!
//! Structures propose, whole maps dispose. Each two walls of the robot's map that are not parallel, laid onto each such two of
//! the level, give a pose of the robot's whole frame; the best by what is around them are moved to where the two maps
//! fit best, and weighed both ways: what is occupied on either map against what is known on the other. What only one
//! of them has seen counts for nothing, so that maps which share a part are aligned by that part. An
//! alignment is told only if the two maps agree where both know, share enough wall in enough directions, and no other
//! pose comes near it.

mod chart;
mod decide;
mod moved;
mod refine;
mod structure;
mod weigh;

use crate::geometry::{Level, Odom, Point, UncertainPose};
use crate::landmarks::LearnedConfig;
use crate::places::PlacesConfig;
use crate::raster::LogOdds;
use crate::vector::ConfirmedConfig;

pub use chart::Chart;
pub use decide::align;
pub use moved::moved;

/// When a map is taken to lie somewhere.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AlignmentConfig {
    /// What a cell is known to be, and how well the end of a beam fits there.
    pub places: PlacesConfig,
    /// Which landmarks a map has.
    pub landmarks: LearnedConfig,
    /// Shorter walls make no structures, metres.
    pub wall_min: f64,
    /// Walls make one if their lines meet so close to both, metres.
    pub structure_reach: f64,
    /// Most structures of a map, those of the longest walls.
    pub structures_max: usize,
    /// What is occupied so far about a structure proposes with it, metres.
    pub structure_range: f64,
    /// A structure with fewer squares about it that are occupied proposes nothing.
    pub structure_points_min: usize,
    /// Most of these squares that are looked at.
    pub structure_points_max: usize,
    /// Most proposals that are looked at again, those that fit best.
    pub proposals_max: usize,
    /// Most of them that are weighed, each unlike those before.
    pub tries_max: usize,
    /// What is occupied is weighed once in squares of this side, metres.
    pub grain: f64,
    /// What a square counts that is occupied on one map and free on the other, where one on which they agree counts 1.
    pub conflict_cost: f64,
    /// Wall on which both maps agree, metres, counted on both of them together: less is no alignment.
    pub agreed_min: f64,
    /// Share of the robot's map of which the level knows anything: what lies mostly beyond is no alignment, however
    /// well the rest fits.
    pub overlap_min: f64,
    /// Share on which they agree of what both know: less is no alignment.
    pub agreement_min: f64,
    /// Landmarks that both maps have where they overlap: fewer are no alignment.
    pub landmarks_min: usize,
    /// Landmarks are the same if they are so close: metres, radians.
    pub landmark_apart: (f64, f64),
    /// The next best pose comes to no more than this share of the best one.
    pub runner_up_max: f64,
    /// Poses are others if they are so far apart where the maps overlap: metres, radians.
    pub apart: (f64, f64),
    /// Deviations that an alignment may have at most where the maps overlap: metres, radians.
    pub sd_max: (f64, f64),
    /// Deviation of what the walls of two maps say of each other, metres. Common to a wall's length.
    pub spread: f64,
    /// Length of wall that errs together, metres.
    pub correlation: f64,
    /// Deviation that no length of wall takes out, metres: maps are of cells, and the poses they are made of err together.
    pub common: f64,
}

impl AlignmentConfig {
    /// The defaults: strict, as a wrong alignment spoils a map.
    pub const STANDARD: Self = Self {
        places: PlacesConfig::STANDARD,
        landmarks: LearnedConfig {
            confirmed: ConfirmedConfig {
                looks_min: 1,
                existence_min: LogOdds(0),
                ..ConfirmedConfig::STANDARD
            },
            ..LearnedConfig::STANDARD
        },
        wall_min: 0.25,
        structure_reach: 4.0,
        structures_max: 1500,
        structure_range: 8.0,
        structure_points_min: 30,
        structure_points_max: 160,
        proposals_max: 4000,
        tries_max: 300,
        grain: 0.2,
        conflict_cost: 2.0,
        agreed_min: 30.0,
        overlap_min: 0.1,
        agreement_min: 0.93,
        landmarks_min: 1,
        landmark_apart: (0.3, 0.2),
        runner_up_max: 0.5,
        apart: (1.0, 0.15),
        sd_max: (0.15, 0.015),
        spread: 0.05,
        correlation: 5.0,
        common: 0.01,
    };
}

/// A pose of a robot's frame on the level, and what speaks for it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// The pose of the robot's own frame.
    pub level_from_odom: UncertainPose<Level, Odom>,
    /// Where both maps know something, on the level: the middle of what they agree on, metres.
    pub middle: Point,
    /// Share of what is occupied on the robot's map of which the level knows anything.
    pub overlap: f64,
    /// Wall on which both maps agree, metres, counted on both of them together.
    pub agreed: f64,
    /// Wall of either map where the other is free, metres.
    pub conflicting: f64,
    /// Root mean square distance of walls that agree, metres.
    pub residual: f64,
    /// Landmarks of the robot's map that the level has too.
    pub landmarks: usize,
}

impl Candidate {
    /// Share on which the maps agree of what both know.
    pub fn agreement(&self) -> f64 {
        self.agreed / (self.agreed + self.conflicting).max(f64::MIN_POSITIVE)
    }

    /// What it comes to, metres of wall.
    pub fn score(&self, config: &AlignmentConfig) -> f64 {
        self.agreed - config.conflict_cost * self.conflicting
    }
}

/// Why a candidate is not believed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Doubt {
    /// The maps agree on too little wall, or on too little of the robot's.
    LittleOverlap,
    /// They contradict each other.
    Conflict,
    /// They have too few landmarks in common.
    FewLandmarks,
    /// What they agree on leaves it free to slide or to turn.
    Loose,
    /// Another pose comes near it.
    RunnerUp,
}

/// What an alignment came to: candidates, best first.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Alignment {
    /// Poses that were proposed, best first; each other by [`AlignmentConfig::apart`].
    pub candidates: Vec<Candidate>,
    /// What speaks against the best one; nothing if it may be believed.
    pub doubts: Vec<Doubt>,
}

impl Alignment {
    /// The pose, if it may be believed.
    pub fn aligned(&self) -> Option<&Candidate> {
        self.candidates.first().filter(|_| self.doubts.is_empty())
    }

    /// What the next best pose comes to, as a share of the best one; 0 if there is none.
    pub fn runner_up(&self, config: &AlignmentConfig) -> f64 {
        match self.candidates.as_slice() {
            [best, next, ..] => {
                next.score(config).max(0.0) / best.score(config).max(f64::MIN_POSITIVE)
            }
            _ => 0.0,
        }
    }
}
