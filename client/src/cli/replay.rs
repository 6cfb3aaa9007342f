//! `mapfold-robot replay`.

use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::{Args, ValueEnum};
use mapfold_client::replay::{self, Competence, Cut, ReplayOptions, Report, SensorChoice, Window};
use mapfold_client::robot::{PoseSd, PoseSource};
use mapfold_client::sensor::Sensors;
use mapfold_client::sync::UploadConfig;
use mapfold_map::level::Provenance;
use rand::rngs::StdRng;
use tokio::sync::watch;

use super::{Where, progress, say, sensors};

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Poses {
    /// The log's own (corrected) poses.
    Log,
    /// Dead reckoning from the first pose on.
    Odometry,
    /// Found on the map as it is now, then tracked with odometry and the sensors.
    Localize,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Claim {
    /// The log's poses share their errors with the map.
    SharedMap,
    /// The log's poses were surveyed from outside, look by look.
    Datum,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Kinds {
    Scanner,
    Sonar,
    Both,
}

#[derive(Debug, Args)]
pub(super) struct Replay {
    /// A CARMEN log, plain or gzip.
    log: PathBuf,
    #[command(flatten)]
    place: Where,
    /// Slug of the robot.
    #[arg(long, value_name = "SLUG")]
    robot: String,
    /// Make the site, the level and the robot if they are missing (needs an administrator's token).
    #[arg(long)]
    create: bool,
    /// Where the robot's poses come from.
    #[arg(long, value_enum, default_value = "log")]
    poses: Poses,
    /// What is claimed of the log's poses.
    #[arg(long, value_enum, default_value = "shared-map")]
    provenance: Claim,
    /// Standard deviation of the log's positions, metres.
    #[arg(long, value_name = "M", default_value_t = PoseSd::CORRECTED_LOG.position_m, value_parser = deviation)]
    pose_sd: f64,
    /// Standard deviation of the log's headings, degrees.
    #[arg(long, value_name = "DEG", default_value = "0.3", value_parser = deviation)]
    heading_sd: f64,
    /// The robot's sensors: a preset (sick-lms, sick-pls, sick-lms1xx, sick-tim, hokuyo-urg,
    /// hokuyo-utm, rplidar, ir-led, sonar-ring) or a file of TOML or JSON, with the table that
    /// `calibrate` makes if there is one; what the log tells if absent. With --create, the server
    /// keeps it.
    #[arg(long, value_name = "FILE", value_parser = sensors)]
    sensor: Option<Sensors>,
    /// Which kinds of sensor to use; those of the log if absent.
    #[arg(long, value_enum, value_name = "KIND")]
    competence: Option<Kinds>,
    /// Make sonar readings out of the log's scans (demonstrations; labelled as emulated).
    #[arg(long)]
    emulate_sonar: bool,
    /// Where to begin: seconds after the log's first reading, or a share of its readings (33%).
    #[arg(long, value_name = "T")]
    from: Option<Cut>,
    /// Where to stop, not included.
    #[arg(long, value_name = "T")]
    to: Option<Cut>,
    /// How many times as fast as life; as fast as it goes if absent.
    #[arg(long, value_name = "X")]
    speed: Option<f64>,
    /// Edge of the cells of a level to be made, metres.
    #[arg(long, value_name = "M")]
    resolution: Option<f64>,
    /// Folder of the durable outbox; one under ./mapfold-robot-data if absent.
    #[arg(long, value_name = "DIR")]
    outbox: Option<PathBuf>,
    /// Folder of a mirror of the level, made or brought up to date first: walls that scanners have found tell
    /// which echoes of sonars come from behind them, and with --poses localize the robot finds itself on it (one
    /// under ./mapfold-robot-data if absent).
    #[arg(long, value_name = "DIR")]
    mirror: Option<PathBuf>,
    /// Give up after so many seconds; never if absent.
    #[arg(long, value_name = "SECONDS")]
    give_up_after: Option<u64>,
    /// Write a report (JSON) here.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
}

impl Replay {
    pub(super) async fn run(self, rng: StdRng) -> Result<ExitCode, Box<dyn std::error::Error>> {
        let api = self.place.api()?;
        let (progress, shown) = watch::channel(replay::ReplayProgress::default());
        let display = tokio::spawn(progress::show(shown, self.robot.clone()));
        let outcome = replay::run(self.options(), api, rng, &progress).await;
        drop(progress);
        display.await?;
        let report = outcome?;
        if let Some(file) = &self.report {
            let text = serde_json::to_string_pretty(&report)? + "\n";
            std::fs::write(file, text)
                .map_err(|e| format!("cannot write {}: {e}", file.display()))?;
        }
        say(&in_words(&report));
        Ok(if report.complete { ExitCode::SUCCESS } else { ExitCode::FAILURE })
    }

    fn options(&self) -> ReplayOptions {
        ReplayOptions {
            window: Window { from: self.from, to: self.to },
            speed: self.speed,
            create: self.create,
            resolution_m: self.resolution,
            sensors: SensorChoice {
                profile: self.sensor.clone(),
                competence: self.competence.map(|kinds| match kinds {
                    Kinds::Scanner => Competence::Scanner,
                    Kinds::Sonar => Competence::Sonar,
                    Kinds::Both => Competence::Both,
                }),
                emulate_sonar: self.emulate_sonar,
            },
            poses: match self.poses {
                Poses::Log => PoseSource::Log,
                Poses::Odometry => PoseSource::Odometry,
                Poses::Localize => PoseSource::Localize,
            },
            pose_sd: PoseSd { position_m: self.pose_sd, heading_rad: self.heading_sd.to_radians() },
            provenance: match self.provenance {
                Claim::SharedMap => Provenance::SharedMap,
                Claim::Datum => Provenance::Datum,
            },
            outbox: self.outbox.clone(),
            mirror: self.mirror.clone(),
            upload: UploadConfig {
                deadline: self.give_up_after.map(Duration::from_secs),
                ..UploadConfig::STANDARD
            },
            ..ReplayOptions::new(&self.log, self.place.level(), &self.robot)
        }
    }
}

/// A standard deviation: more than nothing, less than a building.
fn deviation(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(sd) if sd > 0.0 && sd < 100.0 => Ok(sd),
        Ok(_) => Err("it must be more than 0 and less than 100".to_owned()),
        Err(error) => Err(error.to_string()),
    }
}

fn in_words(report: &Report) -> String {
    let Report { robot, contributions, acknowledged, known, wall_seconds, .. } = report;
    let outcome = if report.trouble.is_none() {
        format!(
            "all {contributions} contributions are with the server ({acknowledged} acknowledged \
             now, {known} before)"
        )
    } else {
        let trouble = report.trouble.as_deref().unwrap_or("it is not clear why");
        format!(
            "not all of {contributions} contributions are with the server ({acknowledged} \
             acknowledged now, {known} before, {} waiting, {} refused): {trouble}",
            report.waiting, report.refused
        )
    };
    let cost = format!(
        "{wall_seconds:.1} s, {:.1} kB up each, {} repeated requests",
        report.bytes_up_per_contribution / 1e3,
        report.retries
    );
    let passed = report.passed.iter().map(|(reason, count)| format!("{count} readings {reason}"));
    let cut_short = report.cut_short.as_ref().map(|reason| {
        format!("the log is cut short ({reason}), so what came after is missing from the map")
    });
    let sonar = report.sonar.in_words();
    let all: Vec<String> =
        [outcome, cost].into_iter().chain(passed).chain(sonar).chain(cut_short).collect();
    format!("{robot}: {}", all.join("; "))
}
