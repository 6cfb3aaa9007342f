//! `mapfold-robot locate`.

use std::io::Write as _;
use std::path::PathBuf;
use std::process::ExitCode;

use clap::Args;
use mapfold_client::localization::{
    Candidate, Fix, KnownLevel, Localized, Localizer, LocalizerConfig, NOTHING_KNOWN, Seeker, view,
};
use mapfold_client::log::{Log, Observation, Reading, carmen};
use mapfold_client::perception::Perception;
use mapfold_client::replay::{Competence, SensorChoice, known_level};
use mapfold_client::sensor::{Scan, Sensors};
use mapfold_client::sync::{Mirror, MirrorConfig};
use mapfold_map::geometry::{Level, Odom, Pose, Robot, UncertainPose};
use serde_json::{Value, json};

use super::{Where, say, sensors};

#[derive(Debug, Args)]
pub(super) struct Locate {
    /// A CARMEN log, plain or gzip.
    log: PathBuf,
    #[command(flatten)]
    place: Where,
    /// Only this scan, counted from 0 among the log's scans.
    #[arg(long, value_name = "N", conflicts_with = "track")]
    scan: Option<usize>,
    /// Use the log's odometry too: seek over several scans, then track.
    #[arg(long)]
    track: bool,
    /// The scanner: a preset or a file of TOML or JSON; what the log tells if absent.
    #[arg(long, value_name = "FILE", value_parser = sensors)]
    sensor: Option<Sensors>,
    /// Folder of the mirror of the level, which is brought up to date first; one under ./mapfold-robot-data if absent.
    #[arg(long, value_name = "DIR")]
    mirror: Option<PathBuf>,
}

impl Locate {
    pub(super) async fn run(self) -> Result<ExitCode, Box<dyn std::error::Error>> {
        let log = carmen::read(&self.log)?;
        for line in log.summary.damage() {
            say(&line);
        }
        if self.track && log.readings.iter().all(|reading| reading.odom_from_robot.is_none()) {
            return Err("the log holds no odometry, which --track needs".into());
        }
        let choice = SensorChoice {
            profile: self.sensor.clone(),
            competence: Some(Competence::Scanner),
            emulate_sonar: false,
        };
        let scanner = choice.choose(&log)?.scanner.ok_or("there is no profile of the scanner")?;
        let config = LocalizerConfig::STANDARD;
        let known = self.known(&config).await?;
        let mut perception = Perception::for_scanner(&scanner);
        let outcome = if self.track {
            track(&log, &known, &mut perception, &config)
        } else {
            self.each(&log, &known, &mut perception, &config)
        };
        let counts = outcome?;
        say(&counts.in_words());
        Ok(if log.summary.cut_short.is_none() { ExitCode::SUCCESS } else { ExitCode::FAILURE })
    }

    /// The level as the server has it now or, if it cannot be reached, as the mirror has it.
    async fn known(
        &self,
        config: &LocalizerConfig,
    ) -> Result<KnownLevel, Box<dyn std::error::Error>> {
        let level = self.place.level();
        let folder = self.mirror.clone().unwrap_or_else(|| Mirror::default_folder(&level));
        let mut mirror = Mirror::open(&folder, &level, MirrorConfig::STANDARD)?;
        if let Some(error) = mirror.refresh_if_reachable(&self.place.api()?).await? {
            say(&format!("{error}; going by the mirror at revision {}", mirror.revision()));
        }
        known_level(&mirror, config).ok_or_else(|| format!("{level} {NOTHING_KNOWN}").into())
    }

    /// The fix of each scan by itself.
    fn each(
        &self,
        log: &Log,
        known: &KnownLevel,
        perception: &mut Perception,
        config: &LocalizerConfig,
    ) -> Result<Counts, Box<dyn std::error::Error>> {
        let mut counts = Counts::default();
        let scans = scans(log).enumerate().filter(|(n, _)| self.scan.is_none_or(|only| only == *n));
        for (_, (reading, scan)) in scans {
            let view = view(&perception.of(scan), &config.places);
            let mut seeker = Seeker::new(config.seeker, config.places);
            let fix = seeker.seen(&known.field, &view, &[]);
            counts.count(&fix);
            write(&of_fix(reading.time_s, &fix, view.beams.len()))?;
        }
        if counts.scans == 0 {
            return Err(format!(
                "there is no such scan: the log has {}, counted from 0",
                log.summary.scans
            )
            .into());
        }
        Ok(counts)
    }
}

/// The fix of each scan from all that came before it.
fn track(
    log: &Log,
    known: &KnownLevel,
    perception: &mut Perception,
    config: &LocalizerConfig,
) -> Result<Counts, Box<dyn std::error::Error>> {
    let mut counts = Counts::default();
    let mut localizer = Localizer::new(*config);
    let mut last: Option<Pose<Odom, Robot>> = None;
    for (reading, scan) in scans(log) {
        let Some(odom_from_robot) = reading.odom_from_robot else { continue };
        if let Some(last) = last {
            localizer.moved(&last.inverse().compose(&odom_from_robot));
        }
        last = Some(odom_from_robot);
        let percept = perception.of(scan);
        let view = view(&percept, &config.places);
        match localizer.seen(&view, &percept.features.segments, known) {
            Localized::Tracked(pose, report) => {
                counts.scans += 1;
                counts.tracked += 1;
                let matched = report.walls.len() + report.landmarks.len();
                let mut told = of_pose(reading.time_s, "tracked", &pose);
                told["matched"] = matched.into();
                told["runner_up"] = Value::Null;
                write(&told)?;
            }
            Localized::Doubted(_) => {
                counts.count(&Fix::NoMatch);
                write(&of_fix(reading.time_s, &Fix::NoMatch, view.beams.len()))?;
            }
            Localized::Sought(fix) => {
                counts.count(&fix);
                write(&of_fix(reading.time_s, &fix, view.beams.len()))?;
            }
            Localized::NotDue => {}
        }
    }
    Ok(counts)
}

fn scans(log: &Log) -> impl Iterator<Item = (&Reading, &Scan)> {
    log.readings.iter().filter_map(|reading| match &reading.observation {
        Observation::Scan(scan) => Some((reading, scan)),
        Observation::Ring(_) => None,
    })
}

/// How many scans came to what.
#[derive(Debug, Default)]
struct Counts {
    scans: u32,
    unique: u32,
    ambiguous: u32,
    tracked: u32,
}

impl Counts {
    fn count(&mut self, fix: &Fix) {
        self.scans += 1;
        match fix {
            Fix::Unique(_) => self.unique += 1,
            Fix::Ambiguous(_) => self.ambiguous += 1,
            Fix::NoMatch => {}
        }
    }

    fn in_words(&self) -> String {
        let Self { scans, unique, ambiguous, tracked } = self;
        let none = scans - unique - ambiguous - tracked;
        format!(
            "scans: {scans}; tracked {tracked}, unique {unique}, ambiguous {ambiguous}, no match {none}"
        )
    }
}

fn of_pose(time_s: f64, kind: &str, pose: &UncertainPose<Level, Robot>) -> Value {
    let c = pose.covariance.matrix();
    let row = |i: usize| [c[(i, 0)], c[(i, 1)], c[(i, 2)]];
    json!({
        "time": time_s,
        "kind": kind,
        "x": pose.pose.x,
        "y": pose.pose.y,
        "heading": pose.pose.heading(),
        "covariance": [row(0), row(1), row(2)],
    })
}

/// One line: the best place if there is one, how many beams end on what is known there, and the next best with how
/// much less likely it is, in nats.
fn of_fix(time_s: f64, fix: &Fix, beams: usize) -> Value {
    let (kind, candidates): (&str, &[Candidate]) = match fix {
        Fix::Unique(found) => ("unique", std::slice::from_ref(found)),
        Fix::Ambiguous(candidates) => ("ambiguous", candidates),
        Fix::NoMatch => ("no_match", &[]),
    };
    let Some(best) = candidates.first() else { return json!({ "time": time_s, "kind": kind }) };
    let mut told = of_pose(time_s, kind, &best.level_from_robot);
    told["matched"] = ((best.hits * beams as f64).round() as u64).into();
    told["runner_up"] = candidates.get(1).map_or(Value::Null, |next| {
        let pose = &next.level_from_robot.pose;
        json!({
            "x": pose.x,
            "y": pose.y,
            "heading": pose.heading(),
            "behind_nat": best.weight - next.weight,
        })
    });
    told
}

fn write(line: &Value) -> std::io::Result<()> {
    writeln!(std::io::stdout().lock(), "{line}")
}
