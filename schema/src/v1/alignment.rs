//! Where robots' own frames lie on a level.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use super::UncertainPose;

/// What speaks against a proposed alignment.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AlignmentDoubt {
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

/// A pose that a robot's map may have on the level, and what speaks for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct AlignmentCandidate {
    /// The pose.
    pub pose: UncertainPose,
    /// Share of the walls of the robot's map that lie where the level knows something.
    pub overlap: f64,
    /// Wall on which both maps agree, counted on both of them together.
    pub agreed_m: f64,
    /// Wall of either map where the other is free.
    pub conflicting_m: f64,
    /// Root mean square distance of walls that agree.
    pub residual_m: f64,
    /// Landmarks of the robot's map that the level has too.
    pub landmarks: u32,
}

/// A frame of which contributions are held, and where they seem to belong.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct UnalignedFrame {
    /// UUID of the frame.
    pub frame: Uuid,
    /// Who contributed in it.
    pub robots: Vec<String>,
    /// Contributions that are held.
    pub contributions: u32,
    /// Whether the first candidate may be believed.
    pub is_certain: bool,
    /// What speaks against the first candidate.
    pub doubts: Vec<AlignmentDoubt>,
    /// Poses, best first; none if nothing on the level resembles the robot's map.
    pub candidates: Vec<AlignmentCandidate>,
    /// What the second candidate comes to, as a share of the first.
    pub runner_up: f64,
}

/// An alignment in the log: contributions of a frame are folded at a pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Alignment {
    /// Its place in the level's log.
    pub revision: i64,
    /// The frame.
    pub frame: Uuid,
    /// `level_from_odom`: where it lies.
    pub pose: UncertainPose,
    /// When it was accepted.
    pub at: String,
    /// Public id of the token that accepted it; `rule` if the server did by itself.
    pub author: String,
    /// In the author's words.
    pub comment: String,
    /// Contributions that it put into the map.
    pub contributions: u32,
    /// Revision of the entry that withdrew it; absent while it stands.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub withdrawn: Option<i64>,
}

/// Frames of robots on a level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Alignments {
    /// Revision of the map that frames were held against.
    pub revision: i64,
    /// Frames of which contributions are held.
    pub unaligned: Vec<UnalignedFrame>,
    /// Alignments in the log, newest first, 100 at most.
    pub alignments: Vec<Alignment>,
}

/// An alignment to be accepted.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewAlignment {
    /// The pose; if absent, that of the first candidate, which must be certain then.
    #[serde(default)]
    pub pose: Option<UncertainPose>,
    /// What for, at most 500 bytes.
    #[serde(default)]
    pub comment: String,
}
