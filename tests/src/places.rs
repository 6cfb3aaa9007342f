//! Finding places on recorded logs: how far must a robot drive that knows nothing, on a map that it did not help to
//! make, and is it ever told a wrong place?

use std::path::Path;

use mapfold_client::localization::{Fix, Seeker, SeekerConfig, view};
use mapfold_client::log::{Log, Observation, carmen};
use mapfold_client::perception::Perception;
use mapfold_client::replay::SensorChoice;
use mapfold_client::robot::{Surveyor, SurveyorConfig};
use mapfold_map::geometry::{Level as LevelFrame, Odom, Pose, Robot, difference};
use mapfold_map::level::{Contribution, Level, LevelConfig};
use mapfold_map::places::{LikelihoodField, PlacesConfig, View};

use crate::statistics::quantile;
use crate::{Error, logs, report};

/// Cells of the maps, metres.
const RESOLUTION_M: f64 = 0.05;
/// Scans in a block of a log: every other one makes the map, and each of the others is driven from its first scan on.
const BLOCK: usize = 20;
/// A pose this far off the log's is wrong: metres, radians. The log's own poses err by some centimetres.
const RIGHT: (f64, f64) = (0.3, 0.05);
/// The map does not reach where none of the scans that made it was taken within this distance, metres.
const REACH_M: f64 = 10.0;

/// One scan of a log.
struct Look {
    contribution: Contribution,
    view: View,
    odom_from_robot: Option<Pose<Odom, Robot>>,
}

/// What drives of one kind came to.
#[derive(Debug, Clone, Default)]
struct Drives {
    all: u32,
    right: u32,
    wrong: u32,
    undecided: u32,
    /// Metres driven until the place was told, of those that were right.
    way: Vec<f64>,
    /// Milliseconds of each look.
    milliseconds: Vec<f64>,
}

/// Which scans make the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Mapped {
    OtherBlocks,
    FirstHalf,
}

fn looks(path: &Path) -> Result<Vec<Look>, Error> {
    let fault = |fault: String| Error::Log { path: path.to_owned(), line: 0, fault };
    let log: Log = carmen::read(path).map_err(|e| fault(e.to_string()))?;
    let sensors = SensorChoice::default().choose(&log).map_err(|e| fault(e.to_string()))?;
    let profile = sensors.scanner.clone().ok_or_else(|| fault("no scanner".to_owned()))?;
    let config = SurveyorConfig::of_log("robot", sensors, &log, RESOLUTION_M);
    let mut surveyor = Surveyor::new(config, 0).map_err(|e| fault(e.to_string()))?;
    let mut perception = Perception::for_scanner(&profile);
    let mut looks = Vec::new();
    for reading in &log.readings {
        let Observation::Scan(scan) = &reading.observation else { continue };
        let Ok(look) = surveyor.survey(reading) else { continue };
        looks.push(Look {
            contribution: look.contribution,
            view: view(&perception.of(scan), &PlacesConfig::STANDARD),
            odom_from_robot: reading.odom_from_robot,
        });
    }
    Ok(looks)
}

fn pose(look: &Look) -> &Pose<LevelFrame, Robot> {
    &look.contribution.level_from_robot.pose
}

/// What the wheels say, or the log's poses where there are no wheels.
fn step(from: &Look, to: &Look) -> Pose<Robot, Robot> {
    match (from.odom_from_robot, to.odom_from_robot) {
        (Some(from), Some(to)) => from.inverse().compose(&to),
        _ => pose(from).inverse().compose(pose(to)),
    }
}

/// Drives all parts of a log that do not make the map, those where the map reaches and those where it does not; `now`
/// is a clock in seconds.
fn drives(looks: &[Look], mapped: Mapped, now: &dyn Fn() -> f64) -> [Drives; 2] {
    let is_mapped = |index: usize| match mapped {
        Mapped::OtherBlocks => (index / BLOCK).is_multiple_of(2),
        Mapped::FirstHalf => 2 * index < looks.len(),
    };
    let of_map = || looks.iter().enumerate().filter(|(i, _)| is_mapped(*i)).map(|(_, look)| look);
    let mut level = Level::new(LevelConfig::standard(RESOLUTION_M));
    level.fold(of_map().map(|look| &look.contribution));
    let field = LikelihoodField::of_map(level.map(), RESOLUTION_M, &PlacesConfig::STANDARD);
    let mut outcome = [Drives::default(), Drives::default()];
    let mut start = 0;
    while start < looks.len() {
        if is_mapped(start) {
            start += 1;
            continue;
        }
        let end = (start..looks.len()).find(|i| is_mapped(*i)).unwrap_or(looks.len());
        let end = end.min(start + BLOCK);
        let is_reached = of_map()
            .any(|look| (pose(look).position() - pose(&looks[start]).position()).norm() < REACH_M);
        drive(&looks[start..end], &field, now, &mut outcome[usize::from(!is_reached)]);
        start = end;
    }
    outcome
}

fn drive(looks: &[Look], field: &LikelihoodField, now: &dyn Fn() -> f64, into: &mut Drives) {
    into.all += 1;
    let mut seeker = Seeker::new(SeekerConfig::STANDARD, PlacesConfig::STANDARD);
    let mut way = 0.0;
    for (index, look) in looks.iter().enumerate() {
        if let Some(before) = index.checked_sub(1).and_then(|i| looks.get(i)) {
            let step = step(before, look);
            way += step.position().norm();
            seeker.moved(&step);
        }
        if !seeker.is_due() {
            continue;
        }
        let started = now();
        let fix = seeker.seen(field, &look.view, &[]);
        into.milliseconds.push(1e3 * (now() - started));
        let Fix::Unique(found) = fix else { continue };
        let (found, truth) = (found.level_from_robot.pose, pose(look));
        let is_right = (found.position() - truth.position()).norm() < RIGHT.0
            && difference(found.heading(), truth.heading()).abs() < RIGHT.1;
        if is_right {
            into.right += 1;
            into.way.push(way);
        } else {
            into.wrong += 1;
        }
        return;
    }
    into.undecided += 1;
}

/// Rewrites the table `places` of a page and answers what is not as it must be. Further logs are looked for in
/// `data`.
///
/// # Errors
/// A log or the page cannot be read or written.
pub fn table(page: &Path, data: Option<&Path>) -> Result<Vec<String>, Error> {
    let started = tokio::time::Instant::now();
    let now = || started.elapsed().as_secs_f64();
    let mut recorded = vec![("killian".to_owned(), logs::killian())];
    recorded.extend(logs::further(data));
    let (mut rows, mut wrong, mut all) = (Vec::new(), 0, 0);
    for (name, path) in recorded {
        let looks = looks(&path)?;
        for (part, mapped) in
            [("every other block", Mapped::OtherBlocks), ("first half", Mapped::FirstHalf)]
        {
            let both = drives(&looks, mapped, &now);
            for (where_to, drives) in ["reaches", "does not reach"].into_iter().zip(&both) {
                if drives.all == 0 {
                    continue;
                }
                let counts = [drives.all, drives.right, drives.undecided, drives.wrong];
                let [median, p95] = [0.5, 0.95].map(|q| {
                    if drives.way.is_empty() {
                        "-".to_owned()
                    } else {
                        format!("{:.1}", quantile(&drives.way, q))
                    }
                });
                let times =
                    [0.5, 0.99].map(|q| format!("{:.0}", quantile(&drives.milliseconds, q)));
                let mut row = [&name, part, where_to].map(|s: &str| s.to_owned()).to_vec();
                row.extend(counts.map(|n| n.to_string()));
                row.extend([median, p95]);
                row.extend(times);
                report::say(&row.join(" | "));
                rows.push(row);
                wrong += drives.wrong;
                all += drives.all;
            }
        }
    }
    let header = [
        "log",
        "map of",
        "the map",
        "drives",
        "right",
        "undecided",
        "wrong",
        "way m, median",
        "p95",
        "a look ms, median",
        "p99",
    ];
    report::rewrite(page, "places", &report::table(&header, &rows))?;
    // What is reached; the aim is one in a thousand.
    let is_too_many = 100 * wrong > all;
    Ok(is_too_many
        .then(|| format!("{wrong} of {all} drives were told a wrong place"))
        .into_iter()
        .collect())
}
