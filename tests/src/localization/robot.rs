//! One simulated robot on its way through the laboratory.

use mapfold_client::localization::{ReferenceWalls, Tracker, TrackerConfig, Tracking};
use mapfold_client::perception::Extractor;
use mapfold_client::robot::OdometryNoise;
use mapfold_client::robot::at_rest::{self, AtRestConfig};
use mapfold_client::sensor::{
    Ring, Scan, ScanGeometry, ScannerProfile, Sonar, SonarProfile, preset,
};
use mapfold_map::geometry::{Covariance, Level, Pose, Robot, UncertainPose, mahalanobis_sq, wrap};
use mapfold_map::landmarks::{FacesConfig, Fix, LocateConfig, Sight, landmarks_of_look, locate};
use mapfold_map::vector::ObservedSegment;
use nalgebra::Vector3;

use super::laboratory::Drawn;
use super::limit::limit_m;
use crate::plane::Point;
use crate::range::{AT_REST, calibrated};
use crate::simulation::{IrHead, IrScanner, Noise, Platform, Scanner, SonarRing, World};

/// What a robot looks with.
#[derive(Debug)]
pub(super) enum Eyes {
    /// The paper's head, with the table that this crate has measured for it.
    Infrared(IrScanner, Box<ScannerProfile>),
    /// A modern scanner with a noise of a centimetre.
    Modern(Scanner, Box<ScannerProfile>),
    /// A ring of sonars.
    Sonar(SonarRing, SonarProfile),
}

/// What a robot sees with.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sensor {
    /// An infrared head with its table.
    Infrared,
    /// A modern scanner with a noise of a centimetre.
    Modern,
    /// A ring of sonars.
    Sonar,
}

impl Eyes {
    /// Those of one run.
    ///
    /// # Errors
    /// Words for what the calibration refuses.
    pub(super) fn of(sensor: Sensor, seed: u64, noise: &mut Noise) -> Result<Self, String> {
        match sensor {
            Sensor::Infrared => {
                let head = IrHead::of_seed(seed);
                let done = calibrated(&head, 30, noise)?;
                Ok(Self::Infrared(IrScanner::new(head), Box::new(done.profile)))
            }
            Sensor::Modern => {
                let base = preset("sick-lms").and_then(|s| s.scanner).ok_or("no sick-lms")?;
                let profile = ScannerProfile {
                    range_sd_m: 0.01,
                    range_sd_per_m: 0.0,
                    systematic_sd_m: 0.003,
                    ..base
                };
                Ok(Self::Modern(Scanner::default(), Box::new(profile)))
            }
            Sensor::Sonar => {
                let base = preset("sonar-ring").and_then(|s| s.sonar).ok_or("no sonar-ring")?;
                // The sonars of the simulation, by their own data sheet.
                let profile = SonarProfile { range_sd_m: 0.01, range_sd_per_m: 0.005, ..base };
                Ok(Self::Sonar(SonarRing::in_smooth_rooms(), profile))
            }
        }
    }

    fn extractor(&self) -> Option<Extractor> {
        match self {
            Self::Infrared(_, profile) | Self::Modern(_, profile) => {
                Some(Extractor::for_scanner(profile))
            }
            Self::Sonar(..) => None,
        }
    }

    /// Scans of a robot that stands, or the one of a robot that passes.
    fn scan(
        &self,
        world: &World,
        pose: (Point, f64),
        sweeps: usize,
        noise: &mut Noise,
    ) -> Option<Scan> {
        let scans: Vec<Scan> = (0..sweeps)
            .map(|_| {
                let (ranges, range_max) = match self {
                    Self::Infrared(scanner, _) => {
                        let beams = scanner.sweep(world, pose, noise);
                        let ranges =
                            beams.iter().map(|b| b.reading_m.unwrap_or(f64::INFINITY)).collect();
                        (ranges, f64::INFINITY)
                    }
                    Self::Modern(scanner, _) => (scanner.scan(world, pose, noise), scanner.cap_m),
                    Self::Sonar(..) => (Vec::new(), 0.0),
                };
                Scan {
                    geometry: ScanGeometry {
                        first_bearing: -std::f64::consts::FRAC_PI_2,
                        increment: 1f64.to_radians(),
                    },
                    ranges,
                    range_max,
                    robot_from_sensor: Pose::identity(),
                    repeats: Vec::new(),
                }
            })
            .collect();
        let all: Vec<&Scan> = scans.iter().collect();
        at_rest::mean(&all, &AtRestConfig::STANDARD).or_else(|| scans.into_iter().next())
    }

    /// How far landmarks are seen.
    fn sight(&self) -> Sight {
        let range = match self {
            Self::Infrared(..) => 4.0,
            Self::Modern(..) => 8.0,
            Self::Sonar(..) => 0.0,
        };
        Sight { range, half_field: std::f64::consts::FRAC_PI_2 }
    }

    /// The bound of what can be known at a stop, metres.
    pub(super) fn limit(&self, world: &World, pose: (Point, f64)) -> Option<[f64; 2]> {
        let bearings: Vec<f64> = (-90..=90).map(|i| f64::from(i).to_radians()).collect();
        let sweeps = (AT_REST as f64).sqrt();
        match self {
            Self::Infrared(scanner, _) => limit_m(world, pose, &bearings, 4.1, |range, cosine| {
                scanner.head.deviation(range, cosine.acos()) / sweeps
            }),
            Self::Modern(scanner, _) => {
                limit_m(world, pose, &bearings, 30.0, |_, _| scanner.range_sd_m / sweeps)
            }
            Self::Sonar(..) => None,
        }
    }
}

/// How the platform's wheels err, as whoever has measured them would write it down.
pub(super) const ODOMETRY: OdometryNoise = OdometryNoise {
    along: 0.028,
    across: 0.01,
    turn_per_metre: 1.5 * std::f64::consts::PI / 180.0,
    turn_per_turn: 1.5 * std::f64::consts::PI / 180.0,
};

/// Deviations of where a robot is put down: metres, radians.
const START_SD: (f64, f64) = (0.03, 0.02);

/// A robot and what it believes.
pub(super) struct Tracked<'a> {
    eyes: &'a Eyes,
    drawn: &'a Drawn,
    walls: ReferenceWalls,
    extractor: Option<Extractor>,
    platform: Platform,
    config: TrackerConfig,
    tracker: Tracker,
    /// Fixes that took the place of a tracked pose.
    pub(super) refixed: u32,
}

impl<'a> Tracked<'a> {
    /// A robot that was put down at a pose, more or less.
    pub(super) fn new(
        eyes: &'a Eyes,
        drawn: &'a Drawn,
        at: (Point, f64),
        bad_slips: bool,
        noise: &mut Noise,
    ) -> Self {
        let (place, turn) = START_SD;
        let start = Pose::new(
            at.0.x + noise.normal(place),
            at.0.y + noise.normal(place),
            at.1 + noise.normal(turn),
        );
        let covariance = Covariance::from_variances([place * place, place * place, turn * turn]);
        let config = TrackerConfig { odometry: ODOMETRY, ..TrackerConfig::STANDARD };
        Self {
            eyes,
            drawn,
            walls: ReferenceWalls::of_plan(&drawn.plan),
            extractor: eyes.extractor(),
            platform: if bad_slips {
                Platform::poor(noise)
            } else {
                Platform::poor(noise).without_bad_slips()
            },
            config,
            tracker: Tracker::new(UncertainPose { pose: start, covariance }, config),
            refixed: 0,
        }
    }

    /// What it believes, rightly or not.
    pub(super) fn pose(&self) -> &UncertainPose<Level, Robot> {
        self.tracker.pose()
    }

    /// Whether it knows that it does not know.
    pub(super) fn is_lost(&self) -> bool {
        matches!(self.tracker.state(), Tracking::Lost(_))
    }

    /// Drives a step.
    pub(super) fn drive(&mut self, from: (Point, f64), to: (Point, f64), noise: &mut Noise) {
        let [ahead, left, turned] = self.platform.count(from, to, noise);
        self.tracker.moved(&Pose::new(ahead, left, turned));
    }

    /// Looks, standing or in passing, and goes by what it sees.
    pub(super) fn look(
        &mut self,
        world: &World,
        truth: (Point, f64),
        stands: bool,
        noise: &mut Noise,
    ) {
        if let Eyes::Sonar(sonars, profile) = self.eyes {
            let rounds: Vec<Ring> = sonars
                .ping_rounds(world, truth, if stands { AT_REST } else { 2 }, noise)
                .into_iter()
                .map(|round| ring(sonars, &round))
                .collect();
            let rounds: Vec<&Ring> = rounds.iter().collect();
            if let Some(ring) = at_rest::steady(&rounds, &AtRestConfig::STANDARD) {
                self.tracker.heard(&ring, profile, &self.walls, Some(&self.drawn.table));
            }
            return;
        }
        // Who is lost stays for a better look.
        let stands = stands || self.is_lost();
        let segments = self.segments(world, truth, if stands { AT_REST } else { 1 }, noise);
        self.tracker.seen(&segments, &self.walls, Some(&self.drawn.table));
        // Who stands has the time to ask where that may be. A fix is believed where the tracked pose is not.
        if stands || self.is_lost() {
            // Who is not lost does not look for himself at the other end of the building.
            let around = (!self.is_lost()).then(|| self.widened());
            if let Some(fix) = self.fix(&segments, around.as_ref()) {
                let is_doubted = self.tracker.contradictions() > 0 && !self.tracker.agrees(&fix);
                if self.is_lost() || is_doubted {
                    self.tracker = Tracker::new(fix, self.config);
                    self.refixed += 1;
                }
            }
        }
    }

    fn segments(
        &mut self,
        world: &World,
        truth: (Point, f64),
        sweeps: usize,
        noise: &mut Noise,
    ) -> Vec<ObservedSegment> {
        let scan = self.eyes.scan(world, truth, sweeps, noise);
        let both = self.extractor.as_mut().zip(scan);
        both.map(|(extractor, scan)| extractor.extract(&scan).segments.clone()).unwrap_or_default()
    }

    /// What it believes, ten times less certain.
    fn widened(&self) -> UncertainPose<Level, Robot> {
        let UncertainPose { pose, covariance } = *self.pose();
        let least = Covariance::from_variances([0.01, 0.01, 0.001]);
        UncertainPose { pose, covariance: (covariance + least).scaled(100.0) }
    }

    /// The place that a look alone tells, if it is the only one.
    fn fix(
        &self,
        segments: &[ObservedSegment],
        around: Option<&UncertainPose<Level, Robot>>,
    ) -> Option<UncertainPose<Level, Robot>> {
        let seen = landmarks_of_look(segments, &FacesConfig::STANDARD);
        let Drawn { table, obstacles, .. } = self.drawn;
        let sight = self.eyes.sight();
        match locate(table, &seen, &sight, Some(obstacles), around, &LocateConfig::STANDARD) {
            Fix::Unique(candidate) => Some(candidate.level_from_robot),
            Fix::Ambiguous(_) | Fix::NoMatch => None,
        }
    }

    /// How far off the belief is along x and y, metres, in heading, radians, and normalised.
    pub(super) fn error(&self, truth: (Point, f64)) -> Error {
        let believed = self.pose();
        let heading = wrap(believed.pose.heading() - truth.1);
        let (x, y) = (believed.pose.x - truth.0.x, believed.pose.y - truth.0.y);
        let nees = mahalanobis_sq(&Vector3::new(x, y, heading), &believed.covariance);
        Error { x: x.abs(), y: y.abs(), heading: heading.abs(), nees }
    }
}

/// How far a robot is off.
#[derive(Debug, Clone, Copy)]
pub(super) struct Error {
    /// Metres.
    pub(super) x: f64,
    /// Metres.
    pub(super) y: f64,
    /// Radians.
    pub(super) heading: f64,
    /// Of three degrees of freedom.
    pub(super) nees: f64,
}

fn ring(sonars: &SonarRing, round: &[f64]) -> Ring {
    let sonar = |(bearing, range): (&f64, &f64)| Sonar {
        robot_from_sensor: Pose::new(0.0, 0.0, *bearing),
        range: (*range > 0.0).then_some(*range),
        is_steady: true,
    };
    let all = sonars.bearings_rad.iter().zip(round);
    Ring { cone: sonars.cone_rad, sonars: all.map(sonar).collect() }
}
