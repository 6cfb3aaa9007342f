//! `mapfold-robot extract`.

use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use mapfold_client::geojson::{PlacedFeatures, feature_collection};
use mapfold_client::log::{Observation, carmen};
use mapfold_client::perception::{BeamUse, Features, Perception};
use mapfold_client::replay::{Competence, SensorChoice};
use mapfold_client::sensor::Sensors;

use super::{say, sensors};

#[derive(Debug, Args)]
pub(super) struct Extract {
    /// A CARMEN log, plain or gzip.
    log: PathBuf,
    /// Only this scan, counted from 0 among the log's scans.
    #[arg(long, value_name = "N")]
    scan: Option<usize>,
    /// The scanner: a preset (sick-lms, sick-pls, sick-lms1xx, sick-tim, hokuyo-urg, hokuyo-utm,
    /// rplidar, ir-led) or a file of TOML or JSON; what the log tells if absent.
    #[arg(long, value_name = "FILE", value_parser = sensors)]
    sensor: Option<Sensors>,
    /// The GeoJSON file to write.
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

impl Extract {
    pub(super) fn run(self) -> Result<ExitCode, Box<dyn std::error::Error>> {
        let log = carmen::read(&self.log)?;
        for line in log.summary.damage() {
            say(&line);
        }
        let choice = SensorChoice {
            profile: self.sensor,
            competence: Some(Competence::Scanner),
            emulate_sonar: false,
        };
        let scanner = choice.choose(&log)?.scanner.ok_or("there is no profile of the scanner")?;
        let mut perception = Perception::for_scanner(&scanner);
        let mut found: Vec<(u32, f64, _, Features)> = Vec::new();
        let mut count = 0;
        for reading in &log.readings {
            let Observation::Scan(scan) = &reading.observation else { continue };
            let wanted = self.scan.is_none_or(|n| n == count);
            count += 1;
            if let (true, Some(pose)) = (wanted, reading.level_from_robot) {
                let features = perception.of(scan).features.clone();
                found.push((reading.index, reading.time_s, pose, features));
            }
        }
        if found.is_empty() {
            return Err(
                format!("there is no such scan: the log has {count}, counted from 0").into()
            );
        }
        let placed =
            found.iter().map(|(scan, time_s, level_from_robot, features)| PlacedFeatures {
                scan: *scan,
                time_s: *time_s,
                level_from_robot: *level_from_robot,
                features,
            });
        let text = serde_json::to_string(&feature_collection(placed))?;
        std::fs::write(&self.out, text)
            .map_err(|e| format!("cannot write {}: {e}", self.out.display()))?;
        say(&in_words(found.iter().map(|(_, _, _, features)| features)));
        Ok(match &log.summary.cut_short {
            None => ExitCode::SUCCESS,
            Some(reason) => super::failed(&format!(
                "{} holds no more than what came before the log was cut short ({reason})",
                self.out.display()
            )),
        })
    }
}

fn in_words<'a>(all: impl Iterator<Item = &'a Features>) -> String {
    let (mut scans, mut segments, mut clusters) = (0_u32, 0, 0);
    let (mut points, mut on_wall, mut in_cluster) = (0_u32, 0_u32, 0_u32);
    for features in all {
        scans += 1;
        segments += features.segments.len();
        clusters += features.clusters.len();
        for beam in &features.beams {
            points += u32::from(!matches!(beam, BeamUse::NoPoint(_)));
            on_wall += u32::from(matches!(beam, BeamUse::Segment(_)));
            in_cluster += u32::from(matches!(beam, BeamUse::Cluster(_)));
        }
    }
    let percent = |n: u32| 100.0 * f64::from(n) / f64::from(points.max(1));
    format!(
        "scans: {scans}; segments: {segments}; clusters: {clusters}; of {points} end points {:.1} % \
         lie on segments, {:.1} % in clusters",
        percent(on_wall),
        percent(in_cluster)
    )
}
