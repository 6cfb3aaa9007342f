//! The tracker: odometry in, looks in, a pose or "lost" out.

use std::f64::consts::PI;

use mapfold_map::geometry::{Level, Pose, Robot, UncertainPose};
use mapfold_map::landmarks::{FacesConfig, LandmarkTable};
use mapfold_map::vector::ObservedSegment;

use super::filter::apart_sq;
use super::look::{Look, TrackReport};
use super::reference_walls::ReferenceWalls;
use super::slips::{Opinions, SlipConfig};
use super::watchdog::{Tracking, Watchdog, WatchdogConfig};
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
    /// How wheels slip badly.
    pub slips: SlipConfig,
    /// Share of what is seen that is not known.
    pub unknown_share: f64,
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
        slips: SlipConfig::STANDARD,
        unknown_share: 0.2,
        faces: FacesConfig::STANDARD,
        watchdog: WatchdogConfig::STANDARD,
    };
}

/// Tracks one robot from one fix on.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracker {
    config: TrackerConfig,
    opinions: Opinions,
    watchdog: Watchdog,
}

impl Tracker {
    /// From a fix on.
    pub fn new(fix: UncertainPose<Level, Robot>, config: TrackerConfig) -> Self {
        Self { config, opinions: Opinions::new(fix), watchdog: Watchdog::default() }
    }

    /// Where the robot is, or why that is not known.
    pub fn state(&self) -> Tracking {
        match self.watchdog.lost() {
            None => Tracking::Tracked(*self.opinions.pose()),
            Some(why) => Tracking::Lost(why),
        }
    }

    /// The estimate, believed or not.
    pub fn pose(&self) -> &UncertainPose<Level, Robot> {
        self.opinions.pose()
    }

    /// How many of the last looks in a row contradict the pose.
    pub fn contradictions(&self) -> u32 {
        self.watchdog.contradictions()
    }

    /// Whether a fix that was found without this pose agrees with it (99.9 %). If a fix does not, one of the two is
    /// wrong: whoever believes the fix starts a new tracker from it.
    pub fn agrees(&self, fix: &UncertainPose<Level, Robot>) -> bool {
        apart_sq(self.opinions.pose(), fix) <= 16.266
    }

    /// Something else has found the same pose in the same look, on the same map.
    pub fn found(&mut self, place: &UncertainPose<Level, Robot>) {
        self.opinions.each(|filter| filter.intersect(place));
    }

    /// The wheels have counted a step: the robot's pose now in its own frame before.
    pub fn moved(&mut self, step: &Pose<Robot, Robot>) {
        self.opinions.moved(&self.config.odometry.of_step(step));
        let covariance = &self.opinions.pose().covariance;
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
        let config = &self.config;
        let (looked, slipped) = self.opinions.look(&config.slips, |filter| {
            let look = Look::new(config, filter).see(segments, walls, table);
            ((look.report, look.verdict), look.evidence)
        });
        let (report, verdict) = looked;
        self.watchdog.looked(&verdict, &config.watchdog);
        TrackReport { slipped, ..report }
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
        let config = &self.config;
        // What fits by chance alone is so much of what is heard that it tells nothing of slips.
        let (report, verdict) = self.opinions.each(|filter| {
            let look = Look::new(config, filter).hear(ring, profile, walls, table);
            (look.report, look.verdict)
        });
        self.watchdog.looked(&verdict, &config.watchdog);
        report
    }
}
