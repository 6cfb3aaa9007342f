//! The tracker: odometry in, looks in, a pose or "lost" out.

use std::f64::consts::PI;

use mapfold_map::geometry::{Level, Pose, Robot, UncertainPose, unit_normal};
use mapfold_map::landmarks::{FacesConfig, LandmarkTable, ObservedLandmark, landmarks_of_look};
use mapfold_map::vector::ObservedSegment;
use nalgebra::Vector3;

use super::filter::{Filter, Measurement, WallName, apart_sq};
use super::lines::{self, Reach};
use super::reference_walls::{ReferenceWall, ReferenceWalls};
use super::watchdog::{Tracking, Verdict, Watchdog, WatchdogConfig};
use super::{landmarks, sonar};
use crate::odometry::OdometryNoise;
use crate::sensor::{Ring, SonarProfile};

/// How a robot is tracked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackerConfig {
    /// How the wheels err.
    pub odometry: OdometryNoise,
    /// Squared deviations within which what was seen is what is known: the 99 % quantiles of chi-square with one,
    /// two and three degrees of freedom.
    pub gates: [f64; 3],
    /// Of two things that may have been seen, one must be likelier by this (twice the logarithm), or neither
    /// is believed.
    pub ambiguity: f64,
    /// Things closer than this are one, metres: it does not matter which was seen.
    pub same: f64,
    /// Metres that a wall seen and a wall known must both cover, or half of what was seen if that is less.
    pub overlap_min: f64,
    /// A wall seen may be turned against one known by this at most, radians.
    pub turn_max: f64,
    /// And this far off it at most, metres.
    pub offset_max: f64,
    /// Directions of landmarks are not known better than this, radians.
    pub direction_sd_min: f64,
    /// What fits nothing speaks against the pose only if a wall is known within this, metres.
    pub known_within: f64,
    /// What no sonar is better than: rough walls, and sound that takes its time to build up, metres.
    pub sonar_sd_min: f64,
    /// What a bad slip of the wheels may do: deviations ahead and aside, metres, and of the heading, radians.
    pub slip_sd: [f64; 3],
    /// Two such slips are never nearer to each other than this, metres driven.
    pub slips_apart: f64,
    /// A slip is believed if a look explains so many more segments and landmarks with it.
    pub slip_explains: usize,
    /// What makes landmarks of a look.
    pub faces: FacesConfig,
    /// When the robot is lost.
    pub watchdog: WatchdogConfig,
}

impl TrackerConfig {
    /// The defaults, for a differential drive on a smooth floor.
    pub const STANDARD: Self = Self {
        odometry: OdometryNoise::STANDARD,
        gates: [6.635, 9.210, 11.345],
        ambiguity: 4.0,
        same: 0.02,
        overlap_min: 0.2,
        turn_max: 20.0 * PI / 180.0,
        offset_max: 1.0,
        direction_sd_min: 3.0 * PI / 180.0,
        known_within: 1.0,
        sonar_sd_min: 0.02,
        slip_sd: [0.15, 0.03, 0.03],
        slips_apart: 5.0,
        slip_explains: 2,
        faces: FacesConfig::STANDARD,
        watchdog: WatchdogConfig::STANDARD,
    };
}

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

/// Tracks one robot from one fix on.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracker {
    config: TrackerConfig,
    filter: Filter,
    watchdog: Watchdog,
    /// Whether it has, since the last look.
    has_moved: bool,
    /// How far, since the last bad slip, metres.
    since_slip: f64,
}

/// Something that may have been seen, with its normalised innovation squared and cost (the negative logarithm of its
/// likelihood, twice).
struct Choice<'a, W> {
    what: &'a W,
    off_sq: f64,
    cost: f64,
}

impl Tracker {
    /// From a fix on.
    pub fn new(fix: UncertainPose<Level, Robot>, config: TrackerConfig) -> Self {
        Self {
            config,
            filter: Filter::new(fix),
            watchdog: Watchdog::default(),
            has_moved: false,
            since_slip: f64::INFINITY,
        }
    }

    /// Where the robot is, or why that is not known.
    pub fn state(&self) -> Tracking {
        match self.watchdog.lost() {
            None => Tracking::Tracked(*self.filter.pose()),
            Some(why) => Tracking::Lost(why),
        }
    }

    /// The estimate, believed or not.
    pub fn pose(&self) -> &UncertainPose<Level, Robot> {
        self.filter.pose()
    }

    /// How many of the last looks in a row contradict the pose.
    pub fn contradictions(&self) -> u32 {
        self.watchdog.contradictions()
    }

    /// Whether a fix that was found without this pose agrees with it (99.9 %). If a fix does not, one of the two is
    /// wrong: whoever believes the fix starts a new tracker from it.
    pub fn agrees(&self, fix: &UncertainPose<Level, Robot>) -> bool {
        apart_sq(self.filter.pose(), fix) <= 16.266
    }

    /// Something else has found the same pose in the same look, on the same map.
    pub fn found(&mut self, place: &UncertainPose<Level, Robot>) {
        self.filter.intersect(place);
    }

    /// The wheels have counted a step: the robot's pose now in its own frame before.
    pub fn moved(&mut self, step: &Pose<Robot, Robot>) {
        self.has_moved = true;
        self.since_slip += step.position().norm();
        self.filter.moved(&self.config.odometry.of_step(step));
        let covariance = &self.filter.pose().covariance;
        self.watchdog.moved(step.position().norm(), covariance, &self.config.watchdog);
    }

    /// The robot has looked with its scanner: segments in the robot frame, held against walls and, what they do not
    /// tell, against landmarks.
    pub fn seen(
        &mut self,
        segments: &[ObservedSegment],
        walls: &ReferenceWalls,
        table: Option<&LandmarkTable>,
    ) -> TrackReport {
        let mut without = self.clone();
        let (mut report, mut verdict) = without.held_against(segments, walls, table);
        // Wheels rarely slip badly: that must explain what nothing else does.
        let may_have_slipped = self.has_moved && self.since_slip > self.config.slips_apart;
        if may_have_slipped && report.refused >= self.config.slip_explains {
            let mut with = self.clone();
            with.filter.slip(&with.config.slip_sd);
            let (slipped, of_slipped) = with.held_against(segments, walls, table);
            let used = |report: &TrackReport| report.walls.len() + report.landmarks.len();
            let more = self.config.slip_explains;
            if slipped.refused + more <= report.refused && used(&slipped) >= used(&report) + more {
                without = with;
                without.since_slip = 0.0;
                (report, verdict) = (TrackReport { slipped: true, ..slipped }, of_slipped);
            }
        }
        *self = without;
        self.has_moved = false;
        self.watchdog.looked(&verdict, &self.config.watchdog);
        report
    }

    /// A look, taken in as it is.
    fn held_against(
        &mut self,
        segments: &[ObservedSegment],
        walls: &ReferenceWalls,
        table: Option<&LandmarkTable>,
    ) -> (TrackReport, Verdict) {
        let mut report = TrackReport::default();
        let mut verdict = Verdict::default();
        let mut used = Vec::new();
        for (index, wall) in self.paired(segments, walls, &mut verdict, &mut report) {
            let segment = &segments[index];
            let length = segment.to - segment.from;
            // The gate again: what came before has made the pose more certain.
            if let Some(off_sq) = self.line(wall, segment).and_then(|m| self.take(&m)) {
                verdict.use_wall(length, &wall.normal);
                report.nis += off_sq;
                report.freedom += 2;
                report.walls.push((index, wall.name));
                used.push(segment);
            } else {
                verdict.refuse_wall(length, &wall.normal);
                report.refused += 1;
            }
        }
        if let Some(table) = table {
            self.landmarks(segments, &used, walls, table, &mut report);
        }
        (verdict.off_sq, verdict.freedom) = (report.nis, report.freedom);
        (report, verdict)
    }

    /// The robot has listened with its ring of sonars. Walls echo where they are met squarely, corners of the table
    /// wherever they lie within a cone.
    pub fn heard(
        &mut self,
        ring: &Ring,
        profile: &SonarProfile,
        walls: &ReferenceWalls,
        table: Option<&LandmarkTable>,
    ) -> TrackReport {
        let mut report = TrackReport::default();
        let mut verdict = Verdict::default();
        for index in 0..ring.sonars.len() {
            let pose = self.filter.pose();
            let Some(echo) = sonar::echo(ring, index, profile, self.config.sonar_sd_min) else {
                continue;
            };
            let sources = sonar::sources(&echo, pose, walls, table);
            let choices =
                sources.iter().filter_map(|source| self.choice(source, &source.measurement));
            let same = |a: &sonar::Source, b: &sonar::Source| {
                (a.measurement.innovation.x - b.measurement.innovation.x).abs() < self.config.same
            };
            let told = best(choices, self.config.gates[0], self.config.ambiguity, same);
            if let Told::One(Choice { what, off_sq, .. }) = told {
                self.filter.update(&what.measurement);
                report.nis += off_sq;
                report.freedom += 1;
                report.walls.extend(what.wall.map(|name| (index, name)));
            } else {
                report.refused += 1;
            }
        }
        // Most of what a sonar hears in vain are detours: that proves nothing, only that something fits does.
        (verdict.off_sq, verdict.freedom) = (report.nis, report.freedom);
        self.watchdog.looked(&verdict, &self.config.watchdog);
        report
    }

    /// Which wall each segment is, if that is clear: the surest first.
    fn paired<'a>(
        &self,
        segments: &[ObservedSegment],
        walls: &'a ReferenceWalls,
        verdict: &mut Verdict,
        report: &mut TrackReport,
    ) -> Vec<(usize, &'a ReferenceWall)> {
        let config = &self.config;
        let pose = self.filter.pose();
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
                Told::Several => report.refused += 1,
                Told::None if walls.near(&middle, &middle, config.known_within).is_empty() => {}
                Told::None => {
                    let normal = unit_normal(segment.line.line.alpha() + pose.pose.heading());
                    verdict.refuse_wall(segment.to - segment.from, &normal);
                    report.refused += 1;
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
        report: &mut TrackReport,
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
                report.refused += usize::from(!known.is_empty());
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
                report.nis += off_sq;
                report.freedom += freedom;
                report.landmarks.push((seen, *number));
            } else {
                report.refused += 1;
            }
        }
    }

    fn line(&self, wall: &ReferenceWall, segment: &ObservedSegment) -> Option<Measurement<2>> {
        let TrackerConfig { overlap_min, turn_max, offset_max, .. } = self.config;
        let reach = Reach { overlap_min, turn_max, offset_max };
        lines::measure(wall, segment, &self.filter.pose().pose, &reach)
    }

    fn choice<'a, W, const N: usize>(
        &self,
        what: &'a W,
        measurement: &Measurement<N>,
    ) -> Option<Choice<'a, W>> {
        let (off_sq, ln_determinant) = self.filter.deviation(measurement)?;
        Some(Choice { what, off_sq, cost: off_sq + ln_determinant })
    }

    /// Takes a measurement in if it passes its gate, and tells its normalised innovation squared.
    fn take<const N: usize>(&mut self, measurement: &Measurement<N>) -> Option<f64> {
        let (off_sq, _) = self.filter.deviation(measurement)?;
        let gate = self.config.gates.get(N.checked_sub(1)?)?;
        (off_sq <= *gate).then(|| {
            self.filter.update(measurement);
            off_sq
        })
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
