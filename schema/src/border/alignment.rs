//! Where robots' own frames lie, between the wire and the map's types.

use mapfold_map::alignment::{Alignment, AlignmentConfig, Candidate, Doubt};
use mapfold_map::geometry::{Covariance, UncertainPose};

use super::violations::Violation;
use crate::v1;

/// Heading of a pose: a full turn either way.
const HEADING_MAX_RAD: f64 = std::f64::consts::TAU;

/// A pose in some frame.
pub fn wire_pose<A: Copy, B: Copy>(pose: &UncertainPose<A, B>) -> v1::UncertainPose {
    let UncertainPose { pose, covariance } = pose;
    v1::UncertainPose {
        x_m: pose.x,
        y_m: pose.y,
        heading_rad: pose.heading(),
        covariance: covariance.rows(),
    }
}

/// Checks a pose of a frame that somebody names.
///
/// # Errors
/// What is wrong with it: it must be finite and no farther than `coordinate_max_m`, its covariance positive semi-definite.
pub fn check_pose(pose: &v1::UncertainPose, coordinate_max_m: f64) -> Result<(), Vec<Violation>> {
    let mut wrong = Vec::new();
    let mut expect = |fine: bool, pointer: &str, detail: String| {
        if !fine {
            let (pointer, code) = (format!("/pose/{pointer}"), "out_of_range".to_owned());
            wrong.push(Violation { pointer, code, detail });
        }
    };
    for (value, pointer) in [(pose.x_m, "x_m"), (pose.y_m, "y_m")] {
        let detail = format!("at most {coordinate_max_m} m from the level's origin");
        expect(value.abs() <= coordinate_max_m, pointer, detail);
    }
    let fine = pose.heading_rad.abs() <= HEADING_MAX_RAD;
    expect(fine, "heading_rad", "at most a full turn either way".to_owned());
    if let Err(error) = Covariance::from_rows(pose.covariance) {
        expect(false, "covariance", error.to_string());
    }
    if wrong.is_empty() { Ok(()) } else { Err(wrong) }
}

/// A proposal for a frame.
pub fn wire_proposal(
    frame: uuid::Uuid,
    robots: &[String],
    contributions: u32,
    found: &Alignment,
    config: &AlignmentConfig,
) -> v1::UnalignedFrame {
    v1::UnalignedFrame {
        frame,
        robots: robots.to_vec(),
        contributions,
        is_certain: found.aligned().is_some(),
        doubts: found.doubts.iter().map(|doubt| wire_doubt(*doubt)).collect(),
        candidates: found.candidates.iter().map(wire_candidate).collect(),
        runner_up: found.runner_up(config),
    }
}

fn wire_candidate(candidate: &Candidate) -> v1::AlignmentCandidate {
    v1::AlignmentCandidate {
        pose: wire_pose(&candidate.level_from_odom),
        overlap: candidate.overlap,
        agreed_m: candidate.agreed,
        conflicting_m: candidate.conflicting,
        residual_m: candidate.residual,
        landmarks: candidate.landmarks as u32,
    }
}

fn wire_doubt(doubt: Doubt) -> v1::AlignmentDoubt {
    match doubt {
        Doubt::LittleOverlap => v1::AlignmentDoubt::LittleOverlap,
        Doubt::Conflict => v1::AlignmentDoubt::Conflict,
        Doubt::FewLandmarks => v1::AlignmentDoubt::FewLandmarks,
        Doubt::Loose => v1::AlignmentDoubt::Loose,
        Doubt::RunnerUp => v1::AlignmentDoubt::RunnerUp,
    }
}
