//! From one scan to straight pieces of wall and to clusters, with honest covariances.
//!
//! The steps, each a module of its own: [`plausibility`] throws out what is no surface;
//! [`correction`] makes ranges of readings, for scanners with a table; [`points`] gives positions
//! with covariance; [`breakpoints`] groups beams that may lie on one surface; [`split`] proposes
//! lines by Iterative End Point Fit, confirms them by least squares (`cloud`, `guess`, `explain`),
//! joins them, and settles which are walls (`settle`), from sums that are kept (`tally`); [`fit`] is the weighted total least squares
//! behind it, [`hedge`] what it owes to points that may be another wall's; [`ends`] says where and what the ends of a wall are; [`seen_through`] says where beams
//! went through its line beside it; [`clusters`] gathers what no line explains.
//!
//! Knows neither the robot's pose nor any map: results are in the robot frame and carry the
//! sensor's uncertainty only.

pub mod breakpoints;
mod cloud;
pub mod clusters;
pub mod correction;
pub mod ends;
mod explain;
pub mod fit;
mod guess;
pub mod hedge;
mod incidence;
mod percept;
pub mod plausibility;
pub mod points;
pub mod seen_through;
mod segment;
mod settle;
pub mod split;
mod tally;

use std::ops::Range;

use mapfold_map::geometry::Interval;
use mapfold_map::vector::{ObservedCluster, ObservedSegment};

use crate::sensor::{Scan, ScannerProfile};
use breakpoints::{Gap, Ring};
use cloud::Cloud;
use clusters::Gatherer;
use correction::BeamNoise;
use points::Directions;
use seen_through::Block;
use segment::Mount;
use split::{FoundLine, Splitter};

pub use correction::{Corrected, Corrector};
pub use percept::{Percept, Perception};
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
    /// What may stand beside walls.
    pub hedge: hedge::HedgeConfig,
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
            hedge: hedge::HedgeConfig::STANDARD,
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

/// Extracts the features of a scan whose ranges need no correction. Who has many of them keeps an
/// [`Extractor`].
pub fn extract(scan: &Scan, config: &Config) -> Features {
    let mut extractor = Extractor::new(config.clone());
    extractor.extract(scan);
    extractor.features
}

/// Extracts the features of a scan whose ranges have been corrected.
pub fn extract_corrected(corrected: &Corrected, config: &Config) -> Features {
    let mut extractor = Extractor::new(config.clone());
    extractor.find(&corrected.scan, &corrected.states, Some(&corrected.noise));
    extractor.features
}

/// Extracts features, scan after scan, in memory that it keeps: once it has seen scans of a kind,
/// it allocates no more.
#[derive(Debug)]
pub struct Extractor {
    config: Config,
    corrector: Option<Corrector>,
    corrected: Option<Corrected>,
    directions: Directions,
    states: Vec<BeamState>,
    cloud: Cloud,
    gaps: Vec<(usize, Gap)>,
    runs: Vec<Range<usize>>,
    splitter: Splitter,
    lines: Vec<FoundLine>,
    loose: Vec<Range<usize>>,
    gatherer: Gatherer,
    blocks: Vec<Block>,
    features: Features,
    /// Intervals that are no longer needed.
    spare: Vec<Vec<Interval>>,
}

impl Extractor {
    /// An extractor for one scanner, whose ranges it corrects if there is a table for them.
    pub fn for_scanner(profile: &ScannerProfile) -> Self {
        let corrector = Corrector::for_scanner(profile, correction::CorrectionConfig::STANDARD);
        Self { corrector, ..Self::new(Config::for_scanner(profile)) }
    }

    /// An extractor that takes ranges as they come.
    pub fn new(config: Config) -> Self {
        Self {
            config,
            corrector: None,
            corrected: None,
            directions: Directions::default(),
            states: Vec::new(),
            cloud: Cloud::default(),
            gaps: Vec::new(),
            runs: Vec::new(),
            splitter: Splitter::default(),
            lines: Vec::new(),
            loose: Vec::new(),
            gatherer: Gatherer::default(),
            blocks: Vec::new(),
            features: Features::default(),
            spare: Vec::new(),
        }
    }

    /// Its settings.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The features of a scan.
    pub fn extract(&mut self, scan: &Scan) -> &Features {
        let mut states = std::mem::take(&mut self.states);
        let directions = self.directions.of(scan);
        plausibility::judge_into(scan, directions, &self.config.plausibility, &mut states);
        if let Some(corrector) = &mut self.corrector {
            let corrected = match self.corrected.take() {
                Some(mut corrected) => {
                    corrector.correct_into(scan, &states, &mut corrected);
                    corrected
                }
                None => corrector.correct(scan, &states),
            };
            self.find(&corrected.scan, &corrected.states, Some(&corrected.noise));
            self.corrected = Some(corrected);
        } else {
            self.find(scan, &states, None);
        }
        self.states = states;
        &self.features
    }

    /// What the beams of the last scan were.
    pub fn states(&self) -> &[BeamState] {
        self.corrected.as_ref().map_or(&self.states, |corrected| &corrected.states)
    }

    /// The last scan with corrected ranges, if they are corrected.
    pub fn corrected_scan(&self) -> Option<&Scan> {
        self.corrected.as_ref().map(|corrected| &corrected.scan)
    }

    /// The features of the last scan.
    pub fn features(&self) -> &Features {
        &self.features
    }

    fn find(&mut self, scan: &Scan, states: &[BeamState], noise: Option<&[BeamNoise]>) {
        let config = &self.config;
        let increment = scan.geometry.increment;
        let directions = self.directions.of(scan);
        points::points_into(scan, states, directions, &config.noise, &mut self.cloud.points);
        if let Some(noise) = noise {
            points::with_noise(&mut self.cloud.points, noise);
        }
        self.cloud.index(noise.is_some());
        let ring = Ring { closed: scan.is_full_circle(), beams: scan.ranges.len() };
        breakpoints::find_runs(
            &mut self.cloud,
            ring,
            increment,
            &config.breakpoints,
            &mut self.gaps,
            &mut self.runs,
        );
        self.cloud.sum();
        self.lines.clear();
        self.loose.clear();
        self.splitter.begin(self.cloud.points.len());
        for run in &self.runs {
            self.splitter.lines(
                &self.cloud,
                run,
                increment,
                config,
                &mut self.lines,
                &mut self.loose,
            );
        }
        self.gatherer.gather(&self.cloud.points, &self.loose, &config.clusters);
        self.describe(scan, states, ring);
    }

    /// Fills in the features from what was found.
    fn describe(&mut self, scan: &Scan, states: &[BeamState], ring: Ring) {
        let config = &self.config;
        let Features { segments, clusters, beams } = &mut self.features;
        self.spare.extend(segments.drain(..).map(|segment| {
            let mut seen_through = segment.seen_through;
            seen_through.clear();
            seen_through
        }));
        for cluster in clusters.drain(..) {
            self.gatherer.recycle(cluster.hull);
        }
        beams.clear();
        beams.extend(states.iter().map(|state| match state {
            BeamState::Hit => BeamUse::Unexplained,
            other => BeamUse::NoPoint(*other),
        }));
        let points = &self.cloud.points;
        let directions = self.directions.of(scan);
        seen_through::blocks(&self.cloud, &self.lines, &self.loose, &mut self.blocks);
        let view = ends::View { points, directions, runs: &self.runs, ring, config: &config.ends };
        let sweep = seen_through::Sweep {
            cloud: &self.cloud,
            blocks: &self.blocks,
            ring,
            increment: scan.geometry.increment,
        };
        let mount = Mount::of(scan);
        // Lines, runs and blocks all ascend, and every line lies in a run and is a block.
        let (mut run, mut block) = (0, 0);
        for (i, line) in self.lines.iter().enumerate() {
            while self.runs[run].end <= line.first() {
                run += 1;
            }
            while self.blocks[block].points.start < line.first() {
                block += 1;
            }
            let Some(ended) = view.ends(&self.lines, i, run) else { continue };
            let own = BeamUse::Segment(segments.len() as u32);
            let (first, last) = (points[line.first()].beam, points[line.last()].beam);
            let mut count = line.points.len();
            if !line.has_strays && last + 1 == first + count {
                beams[first..=last].fill(own);
            } else {
                count = 0;
                for at in line.points.clone() {
                    if !(line.has_strays && self.splitter.stray[at]) {
                        beams[points[at].beam] = own;
                        count += 1;
                    }
                }
            }
            let room = || Vec::with_capacity(2 * config.seen_through.stretches_max);
            let seen_through = self.spare.pop().unwrap_or_else(room);
            segments.push(segment::in_robot_frame(
                line,
                (block, count),
                &ended,
                &mount,
                &sweep,
                &config.seen_through,
                seen_through,
            ));
        }
        // Places of the clusters that are large enough among all that were gathered.
        for (place, cluster) in self.gatherer.found.iter_mut().enumerate() {
            if cluster.count < config.clusters.points_min {
                continue;
            }
            for part in self.gatherer.parts.iter().filter(|part| part.cluster == place) {
                for at in part.points.clone() {
                    beams[points[at].beam] = BeamUse::Cluster(clusters.len() as u32);
                }
            }
            clusters.push(segment::cluster_in_robot_frame(cluster, &mount, &config.clusters));
        }
    }
}
