//! Finding places on recorded logs: how far must a robot drive that knows nothing, on a map that it did not help to
//! make, what does a single look tell, and is it ever told a wrong place? And the same on plans of real buildings.

mod answers;
mod on_plans;

use std::path::{Path, PathBuf};

use mapfold_client::localization::{Fix, Seeker, SeekerConfig, view};
use mapfold_client::log::{Log, Observation, carmen};
use mapfold_client::perception::Perception;
use mapfold_client::replay::SensorChoice;
use mapfold_client::robot::{Surveyor, SurveyorConfig};
use mapfold_client::sensor::Scan;
use mapfold_map::geometry::{Level as LevelFrame, Odom, Pose, Robot, difference};
use mapfold_map::landmarks::{LandmarkTable, LearnedConfig, landmarks_of_map};
use mapfold_map::level::{Contribution, Level, LevelConfig};
use mapfold_map::places::{LikelihoodField, PlacesConfig, View};

use crate::statistics::quantile;
use crate::{Error, logs, report};

use answers::{Answers, in_view};

/// Cells of the maps, metres.
pub(crate) const RESOLUTION_M: f64 = 0.05;
/// Scans in a block of a log: every other one makes the map, and each of the others is driven from its first scan on.
const BLOCK: usize = 20;
/// A pose this far off the log's is wrong: metres, radians. The log's own poses err by some centimetres.
const RIGHT: (f64, f64) = (0.3, 0.05);
/// The map does not reach where none of the scans that made it was taken within this distance, metres.
const REACH_M: f64 = 10.0;

/// Of so many looks at most each is also asked for its place by itself.
const SINGLE_MAX: usize = 300;
/// Of so many looks at each of the other buildings at most each is asked for its place too.
const STRANGERS_MAX: usize = 30;

/// One scan of a log.
pub(crate) struct Look {
    scan: Scan,
    pub(crate) contribution: Contribution,
    pub(crate) view: View,
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
    OtherScans,
    OtherBlocks,
    FirstHalf,
}

impl Mapped {
    fn is_mapped(self, index: usize, count: usize) -> bool {
        match self {
            Self::OtherScans => index.is_multiple_of(2),
            Self::OtherBlocks => (index / BLOCK).is_multiple_of(2),
            Self::FirstHalf => 2 * index < count,
        }
    }

    fn in_words(self) -> &'static str {
        match self {
            Self::OtherScans => "every other scan",
            Self::OtherBlocks => "every other block",
            Self::FirstHalf => "first half",
        }
    }
}

const REACHES: [&str; 2] = ["reaches", "does not reach"];

/// What the scans of a log show at the log's poses.
///
/// # Errors
/// The log cannot be read, or has no scanner.
pub(crate) fn looks(path: &Path) -> Result<Vec<Look>, Error> {
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
            scan: scan.clone(),
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

/// Whether two poses are one to within so many metres and radians.
fn is_at(
    found: &Pose<LevelFrame, Robot>,
    truth: &Pose<LevelFrame, Robot>,
    within: (f64, f64),
) -> bool {
    (found.position() - truth.position()).norm() < within.0
        && difference(found.heading(), truth.heading()).abs() < within.1
}

/// What the wheels say, or the log's poses where there are no wheels.
fn step(from: &Look, to: &Look) -> Pose<Robot, Robot> {
    match (from.odom_from_robot, to.odom_from_robot) {
        (Some(from), Some(to)) => from.inverse().compose(&to),
        _ => pose(from).inverse().compose(pose(to)),
    }
}

/// The map that some looks make, and which looks these are.
struct Mapping<'a> {
    looks: &'a [Look],
    mapped: Mapped,
    level: Level,
    field: LikelihoodField,
}

impl<'a> Mapping<'a> {
    fn new(looks: &'a [Look], mapped: Mapped) -> Self {
        let mut level = Level::new(LevelConfig::standard(RESOLUTION_M));
        let of_map = (0..looks.len()).filter(|i| mapped.is_mapped(*i, looks.len()));
        level.fold(of_map.map(|i| &looks[i].contribution));
        let field = LikelihoodField::of_map(level.map(), RESOLUTION_M, &PlacesConfig::STANDARD);
        Self { looks, mapped, level, field }
    }

    fn is_mapped(&self, index: usize) -> bool {
        self.mapped.is_mapped(index, self.looks.len())
    }

    fn reaches(&self, look: &Look) -> bool {
        let near = |of: &Look| (pose(of).position() - pose(look).position()).norm() < REACH_M;
        self.looks.iter().enumerate().any(|(i, of)| self.is_mapped(i) && near(of))
    }

    /// Asks looks that are not in the map for their places, each by itself: where the map reaches and where it does
    /// not; `now` is a clock in seconds.
    fn single(&self, now: &dyn Fn() -> f64) -> [Answers; 2] {
        let segments = self.level.map().segments.iter().map(|(id, segment)| (id, segment.as_ref()));
        let learned = landmarks_of_map(segments, &LearnedConfig::STANDARD);
        let table = LandmarkTable::new(learned.values().map(|learned| learned.landmark).collect());
        let every = (self.looks.len() / 2).div_ceil(SINGLE_MAX);
        let mut outcome = [Answers::default(), Answers::default()];
        let others = self.looks.iter().enumerate().filter(|(i, _)| !self.is_mapped(*i));
        for (_, look) in others.step_by(every) {
            let landmarks = in_view(&look.scan, pose(look), &table);
            let answers = &mut outcome[usize::from(!self.reaches(look))];
            answers.ask(&self.field, &look.view, pose(look), landmarks, now);
        }
        outcome
    }

    /// Asks looks at other buildings for their places on this map.
    fn strangers<'b>(
        &self,
        buildings: impl Iterator<Item = &'b [Look]>,
        now: &dyn Fn() -> f64,
    ) -> Answers {
        let mut answers = Answers::default();
        for looks in buildings {
            let every = looks.len().div_ceil(STRANGERS_MAX).max(1);
            for look in looks.iter().step_by(every) {
                answers.ask_stranger(&self.field, &look.view, now);
            }
        }
        answers
    }

    /// Drives all parts of a log that do not make the map.
    fn drives(&self, now: &dyn Fn() -> f64) -> [Drives; 2] {
        let mut outcome = [Drives::default(), Drives::default()];
        let mut start = 0;
        while start < self.looks.len() {
            if self.is_mapped(start) {
                start += 1;
                continue;
            }
            let end = (start..self.looks.len()).find(|i| self.is_mapped(*i));
            let end = end.unwrap_or(self.looks.len()).min(start + BLOCK);
            let is_reached = self.reaches(&self.looks[start]);
            let into = &mut outcome[usize::from(!is_reached)];
            drive(&self.looks[start..end], &self.field, now, into);
            start = end;
        }
        outcome
    }
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
        let is_right = is_at(&found, truth, RIGHT);
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

/// Killian Court last: it takes longer than all the others.
fn recorded(data: Option<&Path>) -> impl Iterator<Item = (String, PathBuf)> {
    logs::further(data).into_iter().chain([("killian".to_owned(), logs::killian())])
}

/// Rewrites the table `places` of a page and answers what is not as it must be. Further logs are looked for in
/// `data`.
///
/// # Errors
/// A log or the page cannot be read or written.
pub fn table(page: &Path, data: Option<&Path>) -> Result<Vec<String>, Error> {
    let started = tokio::time::Instant::now();
    let now = || started.elapsed().as_secs_f64();
    let (mut rows, mut wrong, mut all) = (Vec::new(), 0, 0);
    for (name, path) in recorded(data) {
        let looks = looks(&path)?;
        for mapped in [Mapped::OtherBlocks, Mapped::FirstHalf] {
            let both = Mapping::new(&looks, mapped).drives(&now);
            for (where_to, drives) in REACHES.into_iter().zip(&both) {
                if drives.all > 0 {
                    rows.push([label(&name, mapped, where_to), drives.row()].concat());
                    report::say(&rows[rows.len() - 1].join(" | "));
                }
                wrong += drives.wrong;
                all += drives.all;
            }
        }
    }
    let header = [&LABEL[..], &Drives::HEADER].concat();
    report::rewrite(page, "places", &report::table(&header, &rows))?;
    // What is reached; the aim is one in a thousand.
    let is_too_many = 100 * wrong > all;
    Ok(is_too_many
        .then(|| format!("{wrong} of {all} drives were told a wrong place"))
        .into_iter()
        .collect())
}

const LABEL: [&str; 3] = ["log", "map of", "the map"];

fn label(name: &str, mapped: Mapped, where_to: &str) -> Vec<String> {
    [name, mapped.in_words(), where_to].map(str::to_owned).to_vec()
}

/// Rewrites the tables `looks`, `strange-looks` and `on-plans` of a page, of single looks at logs, at other buildings than the
/// map's, and at plans of real buildings, and answers what is not as it must be. Further logs and plans are looked for in `data`.
///
/// # Errors
/// A log or the page cannot be read or written; the server that takes plans fails.
pub async fn single_looks(page: &Path, data: &Path) -> Result<Vec<String>, Error> {
    let started = tokio::time::Instant::now();
    let now = || started.elapsed().as_secs_f64();
    let on_plans::Asked { mut asked, mut wrong } = on_plans::table(page, data, &now).await?;
    let (mut rows, mut strangers) = (Vec::new(), Vec::new());
    let buildings: Result<Vec<(String, Vec<Look>)>, Error> =
        recorded(Some(data)).map(|(name, path)| Ok((name, looks(&path)?))).collect();
    let buildings = buildings?;
    for (name, looks) in &buildings {
        for mapped in [Mapped::OtherScans, Mapped::OtherBlocks, Mapped::FirstHalf] {
            let mapping = Mapping::new(looks, mapped);
            if mapped == Mapped::OtherScans {
                let others = buildings.iter().filter(|(other, _)| other != name);
                let answers = mapping.strangers(others.map(|(_, looks)| looks.as_slice()), &now);
                strangers.push([vec![name.clone()], answers.strangers_row()].concat());
                report::say(&strangers[strangers.len() - 1].join(" | "));
                asked += answers.asked;
                wrong += answers.wrong;
            }
            let both = mapping.single(&now);
            for (where_to, answers) in REACHES.into_iter().zip(&both) {
                if answers.asked > 0 {
                    rows.push([label(name, mapped, where_to), answers.row()].concat());
                    report::say(&rows[rows.len() - 1].join(" | "));
                }
                asked += answers.asked;
                wrong += answers.wrong;
            }
        }
    }
    let header = [&LABEL[..], &Answers::HEADER].concat();
    report::rewrite(page, "looks", &report::table(&header, &rows))?;
    let header = [&["map of"][..], &Answers::STRANGERS].concat();
    report::rewrite(page, "strange-looks", &report::table(&header, &strangers))?;
    report::say(&format!("{wrong} of {asked} wrong"));
    let is_too_many = 1000 * wrong > asked;
    let words = || format!("{wrong} of {asked} were told a wrong place");
    Ok(is_too_many.then(words).into_iter().collect())
}

impl Drives {
    const HEADER: [&str; 8] = [
        "drives",
        "right",
        "undecided",
        "wrong",
        "way m, median",
        "p95",
        "a look ms, median",
        "p99",
    ];

    fn row(&self) -> Vec<String> {
        let counts = [self.all, self.right, self.undecided, self.wrong];
        let way = [0.5, 0.95].map(|q| {
            if self.way.is_empty() {
                "-".to_owned()
            } else {
                format!("{:.1}", quantile(&self.way, q))
            }
        });
        let times = [0.5, 0.99].map(|q| format!("{:.0}", quantile(&self.milliseconds, q)));
        let counts = counts.map(|n| n.to_string());
        counts.into_iter().chain(way).chain(times).collect()
    }
}
