//! The surveyor: readings and poses in, contributions out.
//!
//! Knows no server and no file; a robot with its own integration calls it just as the replay of a
//! log does. What it makes depends on the readings and its settings alone, ids included: surveying
//! the same log twice gives the same contributions bit for bit.

pub mod at_rest;
mod identity;
mod look;
mod mapped_walls;
mod probation;
mod whereabouts;

use std::sync::Arc;

use mapfold_map::geometry::{Covariance, Level, Odom, Pose, Robot, UncertainPose};
use mapfold_map::level::{Contribution, ContributionId, Provenance};
use mapfold_schema::v1;

pub use identity::Identity;
pub use look::Look;
pub use mapped_walls::MappedWalls;
pub use probation::Probation;
pub use whereabouts::{Basis, Whereabouts};

pub use crate::evidence::{KnownWalls, SonarVerdicts};
pub use crate::odometry::{DeadReckoning, OdometryNoise};

use crate::emulation::EmulationConfig;
use crate::evidence::{Canvas, ScannerEvidenceConfig, SonarEvidenceConfig};
use crate::log::{Log, Observation, Reading};
use crate::perception::Perception;
use crate::sensor::{ScannerProfile, Sensors, SonarProfile};

/// Where a robot takes its poses from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum PoseSource {
    /// The log's own (corrected) poses.
    Log,
    /// Dead reckoning from the first of them on.
    Odometry,
    /// Found on the map that the robot has, then tracked ([`Surveyor::localize_on`]). A robot without a scanner cannot
    /// find its place: it starts at the log's first pose.
    Localize,
}

/// Standard deviations of a pose that comes without any.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct PoseSd {
    /// Of x and of y, metres.
    pub position_m: f64,
    /// Of the heading, radians.
    pub heading_rad: f64,
}

impl PoseSd {
    /// What a good corrected log has: 3 cm and 0.3 degrees (published relations of such logs are
    /// met to 2 to 6 cm).
    pub const CORRECTED_LOG: Self =
        Self { position_m: 0.03, heading_rad: 0.3 * std::f64::consts::PI / 180.0 };

    fn covariance(&self) -> Covariance<3> {
        let (p, h) = (self.position_m * self.position_m, self.heading_rad * self.heading_rad);
        Covariance::from_variances([p, p, h])
    }
}

/// What one robot makes of readings.
#[derive(Debug, Clone, PartialEq)]
pub struct SurveyorConfig {
    /// The robot's slug.
    pub robot: String,
    /// The sensors that it uses: readings of others are passed over.
    pub sensors: Sensors,
    /// Whether its sonar is emulated from scans; it then uses no scanner.
    pub emulate_sonar: bool,
    /// Where its poses come from.
    pub poses: PoseSource,
    /// How certain the log's poses are; with dead reckoning, its start.
    pub pose_sd: PoseSd,
    /// What is claimed of the log's poses. The poses of one corrected log come out of one
    /// optimisation over these very scans: they share their errors, and these may be in the map
    /// that the scans make. That is [`Provenance::SharedMap`], and it keeps the map's covariances
    /// from shrinking below the poses' own. [`Provenance::Datum`] is for poses that were surveyed
    /// from outside, look by look.
    pub provenance: Provenance,
    /// How dead reckoning loses its certainty.
    pub odometry: OdometryNoise,
    /// Edge of the level's cells, metres.
    pub resolution: f64,
    /// SHA-256 of the log, or of whatever else the readings' numbers count in.
    pub source: [u8; 32],
}

impl SurveyorConfig {
    /// What a robot makes of a log at its own corrected poses, with what is usual of all else.
    pub fn of_log(robot: &str, sensors: Sensors, log: &Log, resolution: f64) -> Self {
        Self {
            robot: robot.to_owned(),
            sensors,
            emulate_sonar: false,
            poses: PoseSource::Log,
            pose_sd: PoseSd::CORRECTED_LOG,
            provenance: Provenance::SharedMap,
            odometry: OdometryNoise::STANDARD,
            resolution,
            source: log.digest,
        }
    }

    /// Where the robot starts that has to be told: where the log says, or else at the origin of its wheels' frame.
    fn start(
        &self,
        reading: &Reading,
        odom_from_robot: &Pose<Odom, Robot>,
    ) -> UncertainPose<Level, Robot> {
        let pose = reading.level_from_robot.unwrap_or_else(|| {
            let p = odom_from_robot;
            Pose::new(p.x, p.y, p.heading())
        });
        UncertainPose { pose, covariance: self.pose_sd.covariance() }
    }
}

/// Settings that cannot work.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SurveyorError {
    /// No sensor to survey with.
    #[error("the robot uses neither a scanner nor a sonar")]
    NoSensor,
    /// Emulated sonar needs to know where its transducers would sit.
    #[error("emulated sonar needs a sonar profile that places its transducers")]
    NoTransducers,
}

/// Why a reading gave no contribution.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Passed {
    /// Of a sensor that this robot does not use.
    OtherSensor,
    /// The log does not say where the robot was.
    NoPose,
    /// Dead reckoning, and no odometry.
    NoOdometry,
    /// Dead reckoning for so long that its covariance says nothing any more.
    Lost,
    /// Localization, and no map to localize on.
    NoMap,
    /// Before the robot had found its place, or while it was lost.
    Unplaced,
    /// Placed, but its map does not show there what it saw, or it turned out shortly afterwards that it was lost.
    Doubted,
}

/// A heading that is less certain than this is lost, radians: from half a radian on, first-order
/// covariances of dead reckoning are a fifth off and positions are biased.
const LOST_HEADING_SD: f64 = 0.5;

/// Makes contributions of one robot.
#[derive(Debug)]
pub struct Surveyor {
    config: SurveyorConfig,
    robot: Arc<str>,
    identity: Identity,
    reckoning: DeadReckoning,
    whereabouts: Option<Box<Whereabouts>>,
    /// Apart, for what it keeps to work in is large.
    scanner: Option<Box<Scanner>>,
    sonar: Option<SonarProfile>,
    sonar_evidence: SonarEvidenceConfig,
    emulation: Option<EmulationConfig>,
    canvas: Canvas,
}

#[derive(Debug)]
struct Scanner {
    profile: ScannerProfile,
    perception: Perception,
    evidence: ScannerEvidenceConfig,
}

impl Surveyor {
    /// A surveyor before its first reading. Dead reckoning starts at the first reading that
    /// [`Self::locate`] is asked about; `first` is its number.
    ///
    /// # Errors
    /// Settings that cannot work.
    pub fn new(config: SurveyorConfig, first: u32) -> Result<Self, SurveyorError> {
        let sonar = config.sensors.sonar.clone();
        if config.emulate_sonar && sonar.as_ref().is_none_or(|s| s.transducers.is_empty()) {
            return Err(SurveyorError::NoTransducers);
        }
        let scanner = config.sensors.scanner.clone().filter(|_| !config.emulate_sonar);
        if scanner.is_none() && sonar.is_none() {
            return Err(SurveyorError::NoSensor);
        }
        Ok(Self {
            robot: Arc::from(config.robot.as_str()),
            identity: Identity::new(&config, first),
            reckoning: DeadReckoning::new(config.odometry),
            whereabouts: None,
            scanner: scanner.map(|profile| {
                Box::new(Scanner {
                    perception: Perception::for_scanner(&profile),
                    evidence: ScannerEvidenceConfig::STANDARD,
                    profile,
                })
            }),
            sonar,
            sonar_evidence: SonarEvidenceConfig::STANDARD,
            emulation: config.emulate_sonar.then_some(EmulationConfig::STANDARD),
            canvas: Canvas::default(),
            config,
        })
    }

    /// The surveyor of a robot that finds its place itself, by this.
    #[must_use]
    pub fn localize_on(self, whereabouts: Whereabouts) -> Self {
        Self { whereabouts: Some(Box::new(whereabouts)), ..self }
    }

    /// What the robot knows of its place, if it finds it itself.
    pub fn whereabouts(&self) -> Option<&Whereabouts> {
        self.whereabouts.as_deref()
    }

    /// The sensors in use, as the robot declares them to the server.
    pub fn declared_sensors(&self) -> Vec<v1::SensorProfile> {
        let scanner = self.scanner.as_ref().map(|s| s.profile.to_wire());
        let sonar = self.sonar.as_ref().map(|s| s.to_wire(self.emulation.is_some()));
        scanner.into_iter().chain(sonar).collect()
    }

    /// The identity that the contribution from this reading has or would have.
    pub fn id(&self, reading: &Reading) -> ContributionId {
        self.identity.of(reading)
    }

    /// Where the robot was at this reading. To be asked of every reading in its order, as dead
    /// reckoning lives from one to the next.
    ///
    /// # Errors
    /// A reading that gives no contribution, and why.
    pub fn locate(&mut self, reading: &Reading) -> Result<UncertainPose<Level, Robot>, Passed> {
        let used = match reading.observation {
            Observation::Scan(_) => self.scanner.is_some() || self.emulation.is_some(),
            Observation::Ring(_) => self.sonar.is_some() && self.emulation.is_none(),
        };
        if !used {
            return Err(Passed::OtherSensor);
        }
        match self.config.poses {
            PoseSource::Log => {
                let pose = reading.level_from_robot.ok_or(Passed::NoPose)?;
                Ok(UncertainPose { pose, covariance: self.config.pose_sd.covariance() })
            }
            PoseSource::Odometry => {
                let odom_from_robot = reading.odom_from_robot.ok_or(Passed::NoOdometry)?;
                let start = || self.config.start(reading, &odom_from_robot);
                let pose = self.reckoning.carry_on(odom_from_robot, start);
                if pose.covariance.sd(2) > LOST_HEADING_SD { Err(Passed::Lost) } else { Ok(pose) }
            }
            PoseSource::Localize => self.find(reading),
        }
    }

    /// Where the robot is by its map and its wheels.
    fn find(&mut self, reading: &Reading) -> Result<UncertainPose<Level, Robot>, Passed> {
        let ring = look::ring(self, reading);
        let whereabouts = self.whereabouts.as_mut().ok_or(Passed::NoMap)?;
        let odom_from_robot = reading.odom_from_robot.ok_or(Passed::NoOdometry)?;
        whereabouts.moved_to(odom_from_robot);
        match (&mut self.scanner, &reading.observation, ring, &self.sonar) {
            (Some(scanner), Observation::Scan(scan), ..) => {
                whereabouts.seen(&scanner.perception.of(scan))
            }
            // What the scanner says is far better than what the ring could add.
            (Some(_), ..) => whereabouts.carried(),
            (None, _, Some(ring), Some(sonar)) => {
                if !whereabouts.has_begun() {
                    whereabouts.told(self.config.start(reading, &odom_from_robot));
                }
                whereabouts.heard(&ring, sonar)
            }
            (None, ..) => Err(Passed::OtherSensor),
        }
    }

    /// What the robot saw from there.
    pub fn observe(
        &mut self,
        reading: &Reading,
        level_from_robot: UncertainPose<Level, Robot>,
    ) -> Look {
        self.observe_among(reading, level_from_robot, None)
    }

    /// What the robot saw from there, among walls that it knows already: from its mirror, say.
    pub fn observe_among(
        &mut self,
        reading: &Reading,
        level_from_robot: UncertainPose<Level, Robot>,
        walls: Option<&dyn KnownWalls>,
    ) -> Look {
        let mut contribution = Contribution {
            id: self.id(reading),
            robot: Arc::clone(&self.robot),
            observed_at_us: identity::observed_at_us(reading),
            level_from_robot,
            provenance: match self.config.poses {
                PoseSource::Log => self.config.provenance,
                PoseSource::Odometry => Provenance::Odometry,
                PoseSource::Localize => Provenance::SharedMap,
            },
            segments: Vec::new(),
            clusters: Vec::new(),
            evidence: Vec::new(),
        };
        let sonar = look::fill(self, reading, walls, &mut contribution);
        let basis = self.whereabouts.as_ref().map(|whereabouts| whereabouts.basis().clone());
        Look { contribution, emulated: self.emulation.is_some(), basis, sonar }
    }

    /// [`Self::locate`] and [`Self::observe`] in one.
    ///
    /// # Errors
    /// A reading that gives no contribution, and why.
    pub fn survey(&mut self, reading: &Reading) -> Result<Look, Passed> {
        let level_from_robot = self.locate(reading)?;
        Ok(self.observe(reading, level_from_robot))
    }
}
