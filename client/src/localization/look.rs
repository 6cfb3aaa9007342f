//! One look of a robot, held against what is known: which wall or landmark each thing seen is, and how likely the whole
//! look is.

use std::f64::consts::PI;

use mapfold_map::geometry::unit_normal;
use mapfold_map::landmarks::{LandmarkTable, ObservedLandmark, landmarks_of_look};
use mapfold_map::vector::ObservedSegment;
use nalgebra::Vector3;

use super::filter::{Filter, Measurement, WallName};
use super::lines::{self, Reach};
use super::reference_walls::{ReferenceWall, ReferenceWalls};
use super::tracker::TrackerConfig;
use super::watchdog::Verdict;
use super::{landmarks, sonar};
use crate::sensor::{Ring, SonarProfile};

/// What a look came to.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TrackReport {
    /// Segments (by place in the look; of a ring, its sonars) and the walls that they were.
    pub walls: Vec<(usize, WallName)>,
    /// Landmarks of the look and what they were: number in the table.
    pub landmarks: Vec<(ObservedLandmark, u32)>,
    /// Whether the wheels must have slipped badly before.
    pub slipped: bool,
    /// How many segments, landmarks or echoes fitted nothing that is known there, or more than one thing.
    pub refused: usize,
    /// Normalised innovation squared of what was used, summed.
    pub nis: f64,
    /// Its degrees of freedom.
    pub freedom: usize,
}

/// A look that is being held against what is known, from where a filter has it that the robot is.
pub(super) struct Look<'a> {
    config: &'a TrackerConfig,
    filter: &'a mut Filter,
    /// What it has come to.
    pub(super) report: TrackReport,
    /// The same for the watchdog.
    pub(super) verdict: Verdict,
    /// Logarithm of how much likelier it is from there than if all in it were unknown.
    pub(super) evidence: f64,
}

/// Something that may have been seen, with its normalised innovation squared and cost (the negative logarithm of its
/// likelihood, twice).
struct Choice<'a, W> {
    what: &'a W,
    off_sq: f64,
    cost: f64,
}

impl<'a> Look<'a> {
    pub(super) fn new(config: &'a TrackerConfig, filter: &'a mut Filter) -> Self {
        let (report, verdict) = (TrackReport::default(), Verdict::default());
        Self { config, filter, report, verdict, evidence: 0.0 }
    }

    /// Takes in what a scanner has seen.
    pub(super) fn see(
        mut self,
        segments: &[ObservedSegment],
        walls: &ReferenceWalls,
        table: Option<&LandmarkTable>,
    ) -> Self {
        let mut used = Vec::new();
        for (index, wall) in self.paired(segments, walls) {
            let segment = &segments[index];
            let length = segment.to - segment.from;
            // The gate again: what came before has made the pose more certain.
            if let Some(off_sq) = self.line(wall, segment).and_then(|m| self.take(&m)) {
                self.verdict.use_wall(length, &wall.normal);
                self.report.nis += off_sq;
                self.report.freedom += 2;
                self.report.walls.push((index, wall.name));
                used.push(segment);
            } else {
                self.verdict.refuse_wall(length, &wall.normal);
                self.report.refused += 1;
            }
        }
        if let Some(table) = table {
            self.landmarks(segments, &used, walls, table);
        }
        self.judged()
    }

    /// Takes in what a ring of sonars has heard.
    pub(super) fn hear(
        mut self,
        ring: &Ring,
        profile: &SonarProfile,
        walls: &ReferenceWalls,
        table: Option<&LandmarkTable>,
    ) -> Self {
        let config = self.config;
        for index in 0..ring.sonars.len() {
            let pose = self.filter.pose();
            let Some(echo) = sonar::echo(ring, index, profile, config.sonar_sd_min) else {
                continue;
            };
            let sources = sonar::sources(&echo, pose, walls, table);
            let choices =
                sources.iter().filter_map(|source| self.choice(source, &source.measurement));
            let same = |a: &sonar::Source, b: &sonar::Source| {
                (a.measurement.innovation.x - b.measurement.innovation.x).abs() < config.same
            };
            let told = best(choices, config.gates[0], config.ambiguity, same);
            if let Told::One(Choice { what, off_sq, .. }) = told {
                self.filter.update(&what.measurement);
                self.report.nis += off_sq;
                self.report.freedom += 1;
                self.report.walls.extend(what.wall.map(|name| (index, name)));
            } else {
                self.report.refused += 1;
            }
        }
        // Most of what a sonar hears in vain are detours: that proves nothing, only that something fits does.
        self.judged()
    }

    fn judged(mut self) -> Self {
        (self.verdict.off_sq, self.verdict.freedom) = (self.report.nis, self.report.freedom);
        self
    }

    /// Which wall each segment is, if that is clear: the surest first.
    fn paired<'w>(
        &mut self,
        segments: &[ObservedSegment],
        walls: &'w ReferenceWalls,
    ) -> Vec<(usize, &'w ReferenceWall)> {
        let config = self.config;
        let pose = *self.filter.pose();
        let mut pairs: Vec<(f64, usize, &ReferenceWall)> = Vec::new();
        for (index, segment) in segments.iter().enumerate() {
            let [a, b] =
                [segment.from, segment.to].map(|t| pose.pose.act(&segment.line.line.at(t)));
            let near = walls.near(&a, &b, config.offset_max);
            let measured = near.iter().filter_map(|wall| {
                let measurement = self.line(wall, segment)?;
                self.choice(wall, &measurement)
            });
            let middle = (a + b) * 0.5;
            let same =
                |a: &&ReferenceWall, b: &&ReferenceWall| a.continues(b, &middle, config.same);
            match best(measured, config.gates[1], config.ambiguity, same) {
                Told::One(choice) => pairs.push((choice.off_sq, index, choice.what)),
                Told::Several => self.report.refused += 1,
                Told::None if walls.near(&middle, &middle, config.known_within).is_empty() => {}
                Told::None => {
                    let normal = unit_normal(segment.line.line.alpha() + pose.pose.heading());
                    self.verdict.refuse_wall(segment.to - segment.from, &normal);
                    self.report.refused += 1;
                }
            }
        }
        pairs.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        pairs.into_iter().map(|(_, index, wall)| (index, wall)).collect()
    }

    /// What landmarks of the look tell beyond the lines that were used.
    fn landmarks(
        &mut self,
        segments: &[ObservedSegment],
        used: &[&ObservedSegment],
        walls: &ReferenceWalls,
        table: &LandmarkTable,
    ) {
        for seen in landmarks_of_look(segments, &self.config.faces) {
            let news = landmarks::news(&seen, used);
            if news == landmarks::News::Nothing {
                continue;
            }
            let pose = *self.filter.pose();
            let at = pose.pose.act(&seen.at);
            let shared = walls.shared_near(&at);
            let near = table.near(at, self.config.offset_max);
            let mut known: Vec<_> = near.filter(|(_, known)| known.kind == seen.kind).collect();
            known.sort_unstable_by_key(|(number, _)| *number);
            let measure = |known| {
                let least = self.config.direction_sd_min;
                landmarks::measure(known, &seen, &pose.pose, shared, least)
            };
            let choices = known.iter().filter_map(|k| self.choice(k, &measure(k.1)));
            let same = |_: &_, _: &_| false;
            let chosen = best(choices, self.config.gates[2], self.config.ambiguity, same);
            let Told::One(Choice { what: (number, known), .. }) = chosen else {
                self.report.refused += usize::from(!known.is_empty());
                continue;
            };
            let measurement = measure(known);
            let (taken, freedom) = match news {
                landmarks::News::Along(line) => {
                    let along = measurement.along(&Vector3::new(line.x, line.y, 0.0));
                    (self.take(&along), 1)
                }
                _ => (self.take(&measurement), 3),
            };
            if let Some(off_sq) = taken {
                self.report.nis += off_sq;
                self.report.freedom += freedom;
                self.report.landmarks.push((seen, *number));
            } else {
                self.report.refused += 1;
            }
        }
    }

    fn line(&self, wall: &ReferenceWall, segment: &ObservedSegment) -> Option<Measurement<2>> {
        let TrackerConfig { overlap_min, turn_max, offset_max, .. } = *self.config;
        let reach = Reach { overlap_min, turn_max, offset_max };
        lines::measure(wall, segment, &self.filter.pose().pose, &reach)
    }

    fn choice<'w, W, const N: usize>(
        &self,
        what: &'w W,
        measurement: &Measurement<N>,
    ) -> Option<Choice<'w, W>> {
        let (off_sq, ln_determinant) = self.filter.deviation(measurement)?;
        Some(Choice { what, off_sq, cost: off_sq + ln_determinant })
    }

    /// Takes a measurement in if it passes its gate, and tells its normalised innovation squared.
    fn take<const N: usize>(&mut self, measurement: &Measurement<N>) -> Option<f64> {
        let (off_sq, ln_determinant) = self.filter.deviation(measurement)?;
        let gate = self.config.gates.get(N.checked_sub(1)?)?;
        (off_sq <= *gate).then(|| {
            self.filter.update(measurement);
            self.evidence += self.evidence_of::<N>(off_sq + ln_determinant);
            off_sq
        })
    }

    /// What a thing that fits adds to the evidence: the logarithm of its Gaussian density against that of something unknown
    /// that may lie anywhere within reach, and of how often things are known against how often they are not.
    fn evidence_of<const N: usize>(&self, cost: f64) -> f64 {
        let TrackerConfig { unknown_share, turn_max, offset_max, .. } = *self.config;
        let ln_room = match N {
            1 => (2.0 * offset_max).ln(),
            2 => (2.0 * offset_max * 2.0 * turn_max).ln(),
            _ => ((2.0 * offset_max).powi(2) * 2.0 * PI).ln(),
        };
        let ln_density = -0.5 * (cost + N as f64 * (2.0 * PI).ln());
        ln_density + ln_room + ((1.0 - unknown_share) / unknown_share).ln()
    }
}

/// What something seen is.
enum Told<'a, W> {
    One(Choice<'a, W>),
    /// One of several.
    Several,
    None,
}

/// The likeliest of those within the gate, unless another one that is not the same may as well be it.
fn best<'a, W>(
    choices: impl Iterator<Item = Choice<'a, W>>,
    gate: f64,
    ambiguity: f64,
    same: impl Fn(&W, &W) -> bool,
) -> Told<'a, W> {
    let within: Vec<Choice<'a, W>> = choices.filter(|choice| choice.off_sq <= gate).collect();
    let Some(first) = within.iter().min_by(|a, b| a.cost.total_cmp(&b.cost)) else {
        return Told::None;
    };
    let rivals = |other: &&Choice<'_, W>| {
        other.cost < first.cost + ambiguity && !std::ptr::eq(other.what, first.what)
    };
    if within.iter().filter(rivals).any(|other| !same(first.what, other.what)) {
        return Told::Several;
    }
    Told::One(Choice { ..*first })
}
