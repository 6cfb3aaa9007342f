//! Robots that find themselves: logs are played with `--poses localize` through a real server, on a map that another
//! robot made, and their poses are held against the published ones.

use std::path::Path;

use mapfold_client::log::carmen as reader;
use mapfold_map::geometry::{Level as LevelFrame, Pose, Robot as RobotFrame, difference};
use mapfold_schema::instant::to_rfc3339;

use crate::carmen::Log;
use crate::coverage::{Coverage, measure};
use crate::database::Database;
use crate::level::Level;
use crate::robot::{Robot, Target};
use crate::server::Server;
use crate::statistics::quantile;
use crate::{Error, fleet, report};

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
    let (mut wrong, mut placed) = (0, 0);
    for name in LOGS.iter().filter(|name| only.is_none_or(|only| name.contains(only))) {
        let path = data.join(format!("logs/{name}.log.gz"));
        for (share, words) in [(Share::Turns, "in turns"), (Share::Halves, "halves")] {
            let outcome = trial(&path, share).await?;
            let row = row(name, words, &outcome);
            report::say(&row.join(" | "));
            wrong += outcome.wrong;
            placed += outcome.placed;
            rows.push(row);
        }
    }
    if only.is_none() {
        report::rewrite(page, "trajectories", &report::table(&HEADER, &rows))?;
    }
    // What is reached; none should be.
    let is_too_many = 100 * wrong > placed;
    Ok(is_too_many.then(|| format!("{wrong} of {placed} poses are wrong")).into_iter().collect())
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
    let mut last: Option<(Pose<LevelFrame, RobotFrame>, bool)> = None;
    for reading in &truth.readings {
        let Some(published) = reading.level_from_robot else { continue };
        let at = to_rfc3339((reading.time_s * 1e6).round() as i64);
        let entry = found.iter().find(|e| e.robot == "bruno" && e.observed_at == at);
        outcome.scans += 1;
        if let Some(entry) = entry {
            let [x, y, heading] = entry.pose;
            let off_m = (published.x - x).hypot(published.y - y);
            let off_rad = difference(heading, published.heading()).abs();
            outcome.placed += 1;
            outcome.wrong += usize::from(off_m > WRONG.0 || off_rad > WRONG.1);
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

const HEADER: [&str; 13] = [
    "log",
    "shared",
    "scans",
    "placed",
    "of the way %",
    "wrong",
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
