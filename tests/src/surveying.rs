//! Simulated robots that look at a world from anywhere, and the contributions that they make of it.

use mapfold_client::log::{Observation, Reading};
use mapfold_client::robot::{OdometryNoise, PoseSd, PoseSource, Surveyor, SurveyorConfig};
use mapfold_client::sensor::{Scan, ScanGeometry, Sensors, preset};
use mapfold_map::geometry::Pose;
use mapfold_map::level::{Contribution, Provenance};

use crate::Error;
use crate::plane::Point;
use crate::simulation::{Noise, Scanner, World};

/// Edge of a cell, metres.
pub(crate) const RESOLUTION_M: f64 = 0.05;
/// A morning in 2026, seconds since 1970.
pub(crate) const START_S: f64 = 1_790_000_000.0;
/// Standard deviations of a pose, which the robot knows, metres and radians.
const POSE_SD: (f64, f64) = (0.01, 0.003);

/// A robot with a scanner that looks half a turn ahead.
pub(crate) struct Looker(Surveyor);

impl Looker {
    /// A robot; `source` tells its contributions from those of others.
    pub(crate) fn new(robot: &str, source: u8) -> Result<Self, Error> {
        let sensors = preset("sick-lms").map(|s| Sensors { sonar: None, ..s }).unwrap_or_default();
        let config = SurveyorConfig {
            robot: robot.to_owned(),
            sensors,
            emulate_sonar: false,
            poses: PoseSource::Log,
            pose_sd: PoseSd { position_m: POSE_SD.0, heading_rad: POSE_SD.1 },
            provenance: Provenance::Datum,
            odometry: OdometryNoise::STANDARD,
            resolution: RESOLUTION_M,
            source: [source; 32],
        };
        Surveyor::new(config, 0).map(Self).map_err(Error::Survey)
    }

    /// Its `index`th look, from a place and a heading that it knows but for their noise; `None` if it makes
    /// nothing of it.
    pub(crate) fn look(
        &mut self,
        world: &World,
        (at, heading): (Point, f64),
        (index, time_s): (u32, f64),
        noise: &mut Noise,
    ) -> Option<Contribution> {
        let scanner = Scanner::default();
        let ranges = scanner.scan(world, (at, heading), noise);
        let told = Pose::new(
            at.x + noise.normal(POSE_SD.0),
            at.y + noise.normal(POSE_SD.0),
            heading + noise.normal(POSE_SD.1),
        );
        let reading = Reading {
            index,
            time_s,
            level_from_robot: Some(told),
            odom_from_robot: None,
            observation: Observation::Scan(Scan {
                geometry: ScanGeometry {
                    first_bearing: -std::f64::consts::FRAC_PI_2,
                    increment: 1f64.to_radians(),
                },
                ranges,
                range_max: scanner.cap_m,
                robot_from_sensor: Pose::identity(),
                repeats: Vec::new(),
            }),
        };
        self.0.survey(&reading).ok().map(|look| look.contribution)
    }
}
