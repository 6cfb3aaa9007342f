//! Robots that find themselves: logs are played with `--poses localize` through a real server, on a map that another
//! robot made, and their poses are held against the published ones.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use mapfold_client::localization::CheckConfig;
use mapfold_client::log::carmen as reader;
use mapfold_map::geometry::{Level as LevelFrame, Pose, Robot as RobotFrame, difference};
use mapfold_map::level::{Level as MapLevel, LevelConfig};
use mapfold_map::places::{LikelihoodField, Place, PlacesConfig, View, place_near};
use mapfold_schema::instant::to_rfc3339;

use crate::carmen::Log;
use crate::coverage::{Coverage, measure};
use crate::database::Database;
use crate::level::Level;
use crate::robot::{Robot, Target};
use crate::server::Server;
use crate::statistics::quantile;
use crate::{Error, fleet, places, report};

/// Logs with corrected poses and odometry that may lie beside the repository. Not `belgioioso`, whose clock stands still:
/// poses are matched with scans by their times.
const LOGS: [&str; 5] = ["intel", "aces", "csail", "freiburg-101", "fhw"];

/// The site.
const SITE: &str = "trial";

/// A pose this far off the published one is wrong: metres, radians.
const WRONG: (f64, f64) = (0.5, 0.1);

/// Who takes which scans of a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Share {
    /// In turns: the map reaches everywhere.
    Turns,
    /// The first half makes the map, the other one may lead out of it.
    Halves,
}

impl Share {
    fn is_mapped(self, scan: usize, scans: usize) -> bool {
        match self {
            Self::Turns => scan.is_multiple_of(2),
            Self::Halves => 2 * scan < scans,
        }
    }
}

/// What became of a robot that finds itself.
#[derive(Debug, Clone, Default)]
struct Outcome {
    scans: usize,
    placed: usize,
    wrong: usize,
    /// Of those: where the map contradicts the published pose and bears the found one out.
    refuted: usize,
    /// Metres driven, and those of them between scans that were both placed.
    way: f64,
    way_placed: f64,
    position_m: Vec<f64>,
    heading_deg: Vec<f64>,
    /// The map of both robots, its second one at poses that it found or at the published ones.
    found: Coverage,
    published: Coverage,
}

/// Rewrites the table `trajectories` of a page.
///
/// # Errors
/// A program fails, or a file cannot be read or written.
pub async fn table(page: &Path, data: &Path, only: Option<&str>) -> Result<Vec<String>, Error> {
    let mut rows = Vec::new();
    let (mut wrong, mut refuted, mut placed) = (0, 0, 0);
    for name in LOGS.iter().filter(|name| only.is_none_or(|only| name.contains(only))) {
        let path = data.join(format!("logs/{name}.log.gz"));
        for (share, words) in [(Share::Turns, "in turns"), (Share::Halves, "halves")] {
            let outcome = trial(&path, share).await?;
            let row = row(name, words, &outcome);
            report::say(&row.join(" | "));
            wrong += outcome.wrong;
            refuted += outcome.refuted;
            placed += outcome.placed;
            rows.push(row);
        }
    }
    if only.is_none() {
        report::rewrite(page, "trajectories", &report::table(&HEADER, &rows))?;
    }
    // What is reached; the aim is one in a thousand.
    let is_too_many = 300 * (wrong - refuted) > placed;
    let fault =
        || format!("{wrong} of {placed} poses are wrong, and only {refuted} published ones");
    Ok(is_too_many.then(fault).into_iter().collect())
}

async fn trial(path: &Path, share: Share) -> Result<Outcome, Error> {
    let log = Log::read(path)?;
    let folder = tempfile::tempdir().map_err(|e| Error::file("a temporary folder", e))?;
    let parts =
        [true, false].map(|mapped| (mapped, folder.path().join(format!("{mapped}.log.gz"))));
    let scans = log.scans.len();
    for (mapped, part) in &parts {
        log.write_those(|scan| share.is_mapped(scan, scans) == *mapped, part)?;
    }
    let [(_, first), (_, second)] = &parts;
    let server = Server::start(Database::Sqlite).await?;
    let mut coverage = Vec::new();
    let mut found = Vec::new();
    for poses in ["localize", "log"] {
        let robot = |name: &str, log: &Path, poses: &str| Robot {
            name: name.to_owned(),
            log: log.to_owned(),
            options: vec!["--poses".to_owned(), poses.to_owned()],
        };
        let at = folder.path().join(poses);
        let mirror = at.join("mirror").display().to_string();
        fleet::play(&server, SITE, poses, &[robot("anna", first, "log")], &at).await?;
        let level = Level::new(server.api()?, SITE, poses);
        // What the first robot has sent must be in the map that the second one fetches.
        level.folded().await?;
        let second = robot("bruno", second, poses).with(&["--mirror", &mirror]);
        let target = Target {
            url: server.url(),
            token: server.admin_token().to_owned(),
            site: SITE.to_owned(),
            level: poses.to_owned(),
        };
        second.start(&target, &at)?.finish().await?;
        let (_, floor) = level.floor().await?;
        coverage.push(measure(&floor, &log));
        if poses == "localize" {
            found = level.log().await?;
        }
    }
    let mut outcome = Outcome { found: coverage[0], published: coverage[1], ..Outcome::default() };
    let truth = reader::read(second).map_err(|e| Error::Log {
        path: second.clone(),
        line: 0,
        fault: e.to_string(),
    })?;
    let witness = Witness::new(first, second)?;
    let mut last: Option<(Pose<LevelFrame, RobotFrame>, bool)> = None;
    for reading in &truth.readings {
        let Some(published) = reading.level_from_robot else { continue };
        let at_us = (reading.time_s * 1e6).round() as i64;
        let at = to_rfc3339(at_us);
        let entry = found.iter().find(|e| e.robot == "bruno" && e.observed_at == at);
        outcome.scans += 1;
        if let Some(entry) = entry {
            let [x, y, heading] = entry.pose;
            let off_m = (published.x - x).hypot(published.y - y);
            let off_rad = difference(heading, published.heading()).abs();
            outcome.placed += 1;
            if off_m > WRONG.0 || off_rad > WRONG.1 {
                let found = Pose::new(x, y, heading);
                let of = witness.hold(at_us, &published, &found);
                outcome.wrong += 1;
                outcome.refuted += usize::from(of.as_ref().is_some_and(Held::refutes));
                report::say(&format!(
                    "wrong at {at}: {off_m:.2} m, {:.1} degrees{}",
                    off_rad.to_degrees(),
                    of.map_or_else(String::new, |of| of.to_string())
                ));
            }
            outcome.position_m.push(off_m);
            outcome.heading_deg.push(off_rad.to_degrees());
        }
        if let Some((before, was_placed)) = last {
            let way = (published.position() - before.position()).norm();
            outcome.way += way;
            if was_placed && entry.is_some() {
                outcome.way_placed += way;
            }
        }
        last = Some((published, entry.is_some()));
    }
    Ok(outcome)
}

/// The map that the first robot makes at the published poses, and what the second one sees.
struct Witness {
    field: LikelihoodField,
    views: BTreeMap<i64, View>,
}

/// How well a scan fits the map at the published pose and at the found one.
struct Held {
    published: Place,
    found: Place,
}

impl Witness {
    fn new(first: &Path, second: &Path) -> Result<Self, Error> {
        let mut level = MapLevel::new(LevelConfig::standard(places::RESOLUTION_M));
        let mapped = places::looks(first)?;
        level.fold(mapped.iter().map(|look| &look.contribution));
        let config = &PlacesConfig::STANDARD;
        let field = LikelihoodField::of_map(level.map(), places::RESOLUTION_M, config);
        let seen = places::looks(second)?.into_iter();
        let views = seen.map(|look| (look.contribution.observed_at_us, look.view)).collect();
        Ok(Self { field, views })
    }

    /// The scan of a time at both poses, each moved to where it fits best nearby.
    fn hold(
        &self,
        at_us: i64,
        published: &Pose<LevelFrame, RobotFrame>,
        found: &Pose<LevelFrame, RobotFrame>,
    ) -> Option<Held> {
        let view = self.views.get(&at_us)?;
        let [published, found] = [published, found].map(|p| place_near(&self.field, view, p));
        Some(Held { published, found })
    }
}

impl Held {
    /// Whether the map contradicts the published pose and bears the found one out.
    fn refutes(&self) -> bool {
        let CheckConfig { gain_min, hits_min, .. } = CheckConfig::STANDARD;
        self.published.gain() < gain_min && self.found.hits >= hits_min
    }
}

impl fmt::Display for Held {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { published, found } = self;
        write!(
            f,
            "; published: {:.0} nat, {:.0} % of {} beams hit; found: {:.0} nat, {:.0} %",
            published.fit,
            100.0 * published.hits,
            published.beams,
            found.fit,
            100.0 * found.hits
        )
    }
}

const HEADER: [&str; 14] = [
    "log",
    "shared",
    "scans",
    "placed",
    "of the way %",
    "wrong",
    "of them published",
    "cm, median",
    "p95",
    "degrees, median",
    "p95",
    "explained %, found",
    "published",
    "through %, found / published",
];

fn row(name: &str, words: &str, outcome: &Outcome) -> Vec<String> {
    let share = |s: f64| format!("{:.2}", 100.0 * s);
    let of = |values: &[f64], q: f64, digits: usize| {
        if values.is_empty() { "-".to_owned() } else { format!("{:.digits$}", quantile(values, q)) }
    };
    let centimetres: Vec<f64> = outcome.position_m.iter().map(|m| 100.0 * m).collect();
    vec![
        format!("{name} *"),
        words.to_owned(),
        outcome.scans.to_string(),
        outcome.placed.to_string(),
        format!("{:.1}", 100.0 * outcome.way_placed / outcome.way.max(f64::MIN_POSITIVE)),
        outcome.wrong.to_string(),
        outcome.refuted.to_string(),
        of(&centimetres, 0.5, 1),
        of(&centimetres, 0.95, 1),
        of(&outcome.heading_deg, 0.5, 2),
        of(&outcome.heading_deg, 0.95, 2),
        share(outcome.found.explained_share()),
        share(outcome.published.explained_share()),
        format!(
            "{} / {}",
            share(outcome.found.through_share()),
            share(outcome.published.through_share())
        ),
    ]
}
