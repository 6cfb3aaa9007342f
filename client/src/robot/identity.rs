//! Ids that follow from what a contribution is made of.
//!
//! A UUIDv7 whose time is the reading's and whose 74 other bits are from the SHA-256 of the robot,
//! the log, every setting that changes the content, and the reading's number. The level's frame is
//! not among them: the same log played into two servers gives the same ids.

use mapfold_map::level::{ContributionId, Provenance};
use mapfold_schema::v1::RangeCorrection;
use sha2::{Digest, Sha256};
use uuid::Uuid;

use super::{OdometryNoise, PoseSd, PoseSource, SurveyorConfig};
use crate::log::Reading;
use crate::sensor::{MountedAt, ScannerProfile, Sensors, SonarProfile};

/// Counts changes of what the same readings come to within a version.
const CONTENT: u32 = 2;

/// Gives ids to the contributions of one surveyor.
#[derive(Debug, Clone)]
pub struct Identity {
    settings: Sha256,
}

impl Identity {
    /// The ids under these settings; `first` is the number of the reading at which dead reckoning
    /// starts.
    pub fn new(config: &SurveyorConfig, first: u32) -> Self {
        // Taken apart to the last field: one that is new cannot be forgotten here.
        let SurveyorConfig {
            robot,
            sensors: Sensors { scanner, sonar },
            emulate_sonar,
            poses,
            pose_sd: PoseSd { position_m, heading_rad },
            provenance,
            odometry: OdometryNoise { along, across, turn_per_metre, turn_per_turn },
            resolution,
            source,
        } = config;
        let mut settings = Sha256::new();
        let mut put = |bytes: &[u8]| {
            // Lengths first: no two lists of fields read the same.
            settings.update((bytes.len() as u64).to_be_bytes());
            settings.update(bytes);
        };
        // What the same readings come to may change with every version.
        put(env!("CARGO_PKG_VERSION").as_bytes());
        put(&CONTENT.to_be_bytes());
        put(robot.as_bytes());
        put(source);
        put(&[u8::from(*emulate_sonar)]);
        put(&[match provenance {
            Provenance::Datum => 0,
            Provenance::SharedMap => 1,
            Provenance::Odometry => 2,
        }]);
        let mut figures = vec![*resolution, *position_m, *heading_rad];
        figures.extend([along, across, turn_per_metre, turn_per_turn]);
        match poses {
            PoseSource::Log => put(b"log"),
            PoseSource::Odometry => {
                put(b"odometry");
                figures.push(f64::from(first));
            }
            // Of the map that it went by nothing: who plays on after a pause has a newer one.
            PoseSource::Localize => {
                put(b"localize");
                figures.push(f64::from(first));
            }
        }
        if let Some(scanner) = scanner {
            let ScannerProfile {
                model: _,
                range_min_m,
                range_max_m,
                range_sd_m,
                range_sd_per_m,
                bearing_sd_rad,
                systematic_sd_m,
                mount,
                correction,
            } = scanner;
            put(b"scanner");
            figures.extend([range_min_m, range_max_m, range_sd_m, range_sd_per_m]);
            figures.extend([bearing_sd_rad, systematic_sd_m]);
            figures.extend(placed(mount));
            if let Some(table) = correction {
                let RangeCorrection {
                    distances_m,
                    incidences_rad,
                    bias_m,
                    sd_m,
                    incidence_max_rad,
                } = table;
                put(b"correction");
                figures.extend(distances_m.iter().chain(incidences_rad));
                figures.extend(bias_m.iter().chain(sd_m).flatten());
                figures.push(*incidence_max_rad);
            }
        }
        if let Some(sonar) = sonar {
            let SonarProfile {
                model: _,
                range_min_m,
                range_max_m,
                range_sd_m,
                range_sd_per_m,
                cone_rad,
                transducers,
            } = sonar;
            put(b"sonar");
            figures.extend([range_min_m, range_max_m, range_sd_m, range_sd_per_m, cone_rad]);
            figures.extend(transducers.iter().flat_map(placed));
        }
        for figure in figures {
            put(&figure.to_be_bytes());
        }
        Self { settings }
    }

    /// The id of the contribution from this reading.
    pub fn of(&self, reading: &Reading) -> ContributionId {
        let digest = self.settings.clone().chain_update(reading.index.to_be_bytes()).finalize();
        let mut chance = [0; 10];
        chance.copy_from_slice(&digest[..10]);
        let millis = u64::try_from(observed_at_us(reading) / 1000).unwrap_or(0);
        let uuid: Uuid = uuid::Builder::from_unix_timestamp_millis(millis, &chance).into_uuid();
        ContributionId(uuid.into_bytes())
    }
}

fn placed(mount: &MountedAt) -> [f64; 3] {
    let MountedAt { x_m, y_m, heading_rad } = *mount;
    [x_m, y_m, heading_rad]
}

/// When the reading was taken, in microseconds since 1970; logs that count from zero were taken
/// in 1970.
pub(super) fn observed_at_us(reading: &Reading) -> i64 {
    // Saturates; readers refuse times that would.
    (reading.time_s * 1e6).round() as i64
}
