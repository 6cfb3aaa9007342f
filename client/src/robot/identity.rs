//! Ids that follow from what a contribution is made of.
//!
//! A UUIDv7 whose time is the reading's and whose 74 other bits are from the SHA-256 of the robot,
//! the log, every setting that changes the content, and the reading's number. The level's frame is
//! not among them: the same log played into two servers gives the same ids.

use mapfold_map::level::{ContributionId, Provenance};
use sha2::{Digest, Sha256};
use uuid::Uuid;

use super::{PoseSource, SurveyorConfig};
use crate::log::Reading;

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
        let mut settings = Sha256::new();
        let mut put = |bytes: &[u8]| {
            // Lengths first: no two lists of fields read the same.
            settings.update((bytes.len() as u64).to_be_bytes());
            settings.update(bytes);
        };
        // What the same readings come to may change with every version.
        put(env!("CARGO_PKG_VERSION").as_bytes());
        put(&CONTENT.to_be_bytes());
        put(config.robot.as_bytes());
        put(&config.source);
        put(&[u8::from(config.emulate_sonar)]);
        put(&[match config.provenance {
            Provenance::Datum => 0,
            Provenance::SharedMap => 1,
            Provenance::Odometry => 2,
        }]);
        let noise = &config.odometry;
        let mut figures = vec![
            config.resolution,
            config.pose_sd.position_m,
            config.pose_sd.heading_rad,
            noise.along,
            noise.across,
            noise.turn_per_metre,
            noise.turn_per_turn,
        ];
        match config.poses {
            PoseSource::Log => put(b"log"),
            PoseSource::Odometry => {
                put(b"odometry");
                figures.push(f64::from(first));
            }
        }
        if let Some(s) = &config.sensors.scanner {
            put(b"scanner");
            figures.extend([
                s.range_min_m,
                s.range_max_m,
                s.range_sd_m,
                s.range_sd_per_m,
                s.bearing_sd_rad,
                s.systematic_sd_m,
                s.mount.x_m,
                s.mount.y_m,
                s.mount.heading_rad,
            ]);
            if let Some(table) = &s.correction {
                put(b"correction");
                figures.extend(&table.distances_m);
                figures.extend(&table.incidences_rad);
                figures.extend(table.bias_m.iter().flatten());
                figures.extend(table.sd_m.iter().flatten());
                figures.push(table.incidence_max_rad);
            }
        }
        if let Some(s) = &config.sensors.sonar {
            put(b"sonar");
            figures.extend([
                s.range_min_m,
                s.range_max_m,
                s.range_sd_m,
                s.range_sd_per_m,
                s.cone_rad,
            ]);
            figures.extend(s.transducers.iter().flat_map(|t| [t.x_m, t.y_m, t.heading_rad]));
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

/// When the reading was taken, in microseconds since 1970; logs that count from zero were taken
/// in 1970.
pub(super) fn observed_at_us(reading: &Reading) -> i64 {
    // Saturates; readers refuse times that would.
    (reading.time_s * 1e6).round() as i64
}
