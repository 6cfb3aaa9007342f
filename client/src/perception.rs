//! From one scan to straight pieces of wall and to clusters, with honest covariances.
//!
//! The steps, each a module of its own: [`plausibility`] throws out what is no surface;
//! [`correction`] makes ranges of readings, for scanners with a table; [`points`] gives positions with covariance; [`breakpoints`] groups beams that may lie on one
//! surface; [`split`] proposes lines by Iterative End Point Fit and confirms them by least
//! squares; [`fit`] is the weighted total least squares behind it; [`ends`] says where and what
//! the ends of a wall are; [`seen_through`] says where beams went through its line beside it;
//! [`clusters`] gathers what no line explains.
//!
//! Knows neither the robot's pose nor any map: results are in the robot frame and carry the
//! sensor's uncertainty only.

pub mod breakpoints;
pub mod clusters;
pub mod correction;
pub mod ends;
pub mod fit;
pub mod plausibility;
pub mod points;
pub mod seen_through;
mod segment;
pub mod split;

use mapfold_map::vector::{ObservedCluster, ObservedSegment};

use crate::sensor::{Scan, ScannerProfile};
pub use correction::{Corrected, Corrector};
pub use plausibility::BeamState;

/// Every setting of extraction, one struct an algorithm.
#[derive(Debug, Clone, PartialEq)]
pub struct Config {
    /// What a reading's noise is.
    pub noise: points::NoiseConfig,
    /// Which readings are no surface.
    pub plausibility: plausibility::PlausibilityConfig,
    /// Which neighbours may lie on one surface.
    pub breakpoints: breakpoints::BreakpointConfig,
    /// When a run of points is a line.
    pub split: split::SplitConfig,
    /// How a line is fitted.
    pub fit: fit::FitConfig,
    /// What the ends of a wall are.
    pub ends: ends::EndsConfig,
    /// When a beam went through a wall's line.
    pub seen_through: seen_through::SeenThroughConfig,
    /// What makes a cluster.
    pub clusters: clusters::ClusterConfig,
}

impl Config {
    /// The settings that follow from a scanner's profile.
    pub fn for_scanner(profile: &ScannerProfile) -> Self {
        Self {
            noise: points::NoiseConfig::for_scanner(profile),
            plausibility: plausibility::PlausibilityConfig::for_scanner(profile),
            breakpoints: breakpoints::BreakpointConfig::default(),
            split: split::SplitConfig::default(),
            fit: fit::FitConfig::for_scanner(profile),
            ends: ends::EndsConfig::default(),
            seen_through: seen_through::SeenThroughConfig::default(),
            clusters: clusters::ClusterConfig::for_scanner(profile),
        }
    }
}

/// What became of a beam.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BeamUse {
    /// It gave no point; why.
    NoPoint(BeamState),
    /// Its point lies on a segment, by index.
    Segment(u32),
    /// Its point belongs to a cluster, by index.
    Cluster(u32),
    /// Nothing explains its point.
    Unexplained,
}

/// What one scan shows, in the robot frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Features {
    /// Straight pieces of wall, in the order of the beams.
    pub segments: Vec<ObservedSegment>,
    /// What no line explains.
    pub clusters: Vec<ObservedCluster>,
    /// What became of each beam.
    pub beams: Vec<BeamUse>,
}

/// Extracts the features of a scan whose ranges need no correction.
pub fn extract(scan: &Scan, config: &Config) -> Features {
    extract_plausible(scan, &plausibility::judge(scan, &config.plausibility), config)
}

/// Extracts the features of a scan whose beams have been judged.
pub fn extract_plausible(scan: &Scan, states: &[BeamState], config: &Config) -> Features {
    features(scan, states, points::points(scan, states, &config.noise), config)
}

/// Extracts the features of a scan whose ranges have been corrected.
pub fn extract_corrected(corrected: &Corrected, config: &Config) -> Features {
    let mut points = points::points(&corrected.scan, &corrected.states, &config.noise);
    points::with_noise(&mut points, &corrected.noise);
    features(&corrected.scan, &corrected.states, points, config)
}

fn features(
    scan: &Scan,
    states: &[BeamState],
    points: Vec<points::ScanPoint>,
    config: &Config,
) -> Features {
    let ring = breakpoints::Ring { closed: scan.is_full_circle(), beams: scan.ranges.len() };
    let (points, runs) =
        breakpoints::runs(points, ring, scan.geometry.increment, &config.breakpoints, &config.fit);
    let mut lines = Vec::new();
    let mut loose = Vec::new();
    for run in &runs {
        split::lines(&points, run.clone(), scan.geometry.increment, config, &mut lines, &mut loose);
    }
    let segments = ends::segments(&points, &runs, &lines, ring, scan, &config.ends);
    let clusters = clusters::clusters(&points, &loose, &config.clusters);
    let mut beams: Vec<BeamUse> = states
        .iter()
        .map(|state| match state {
            BeamState::Hit => BeamUse::Unexplained,
            other => BeamUse::NoPoint(*other),
        })
        .collect();
    let mut features = Features::default();
    let sweep = seen_through::Sweep { points: &points, ring, increment: scan.geometry.increment };
    for (line, ended) in lines.iter().zip(segments) {
        let Some(ended) = ended else { continue };
        for &point in &line.members {
            beams[points[point].beam] = BeamUse::Segment(features.segments.len() as u32);
        }
        features.segments.push(segment::in_robot_frame(line, &ended, &sweep, scan, config));
    }
    for cluster in clusters {
        for &point in &cluster.members {
            beams[points[point].beam] = BeamUse::Cluster(features.clusters.len() as u32);
        }
        features.clusters.push(segment::cluster_in_robot_frame(&cluster, scan));
    }
    features.beams = beams;
    features
}
