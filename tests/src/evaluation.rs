//! Every log there is, played as a fleet into SQLite and into PostgreSQL, and the table of what
//! came of it.

use std::path::{Path, PathBuf};

use crate::carmen::Log;
use crate::database::Database;
use crate::simulation::{Recording, Scanner, hall, office, record};
use crate::trial::{self, Outcome};
use crate::{Error, fleet, logs, report};

/// Logs with corrected poses that may lie beside the repository. The `wean` logs there have raw
/// odometry only.
const FURTHER: [&str; 7] =
    ["intel", "aces", "belgioioso", "fhw", "freiburg-101", "csail", "birmingham"];

/// Logs whose poses come from a localizer that ran beside the robot, scan by scan, not from an
/// optimisation over the whole log: their maps are shown, but not held to the bounds.
const LOCALIZED: [&str; 1] = ["birmingham"];

/// Metres between the scans of a simulated drive, as in the recorded logs.
const SIMULATED_STEP_M: f64 = 0.5;

/// Seed of the simulated drives.
const SIMULATED_SEED: u64 = 20;

struct Source {
    name: String,
    path: PathBuf,
}

/// Plays all logs, rewrites the table `maps` of the report, and answers what is not as it must be.
///
/// # Errors
/// A program fails, or a file cannot be read or written.
pub async fn maps(
    page: &Path,
    data: Option<&Path>,
    only: Option<&str>,
) -> Result<Vec<String>, Error> {
    let folder = tempfile::tempdir().map_err(|e| Error::file("a temporary folder", e))?;
    let sources = sources(data, folder.path())?;
    let mut rows = Vec::new();
    let mut faults = Vec::new();
    for source in sources.iter().filter(|s| only.is_none_or(|text| s.name.contains(text))) {
        let log = Log::read(&source.path)?;
        let scratch = folder.path().join(format!("{}.trial", source.name));
        std::fs::create_dir_all(&scratch).map_err(|e| Error::file(&scratch, e))?;
        let robots = fleet::cut(&log, &scratch)?;
        let mut outcomes = Vec::new();
        for database in [Database::Sqlite, Database::new_postgres().await?] {
            let outcome = trial::play(database, &robots, Some(&log), &scratch).await?;
            report::say(&format!("{}: {}", source.name, outcome.sentence(log.scans.len())));
            rows.push(row(&source.name, &log, &outcome));
            outcomes.push(outcome);
        }
        faults.extend(faults_of(&source.name, &outcomes));
    }
    if only.is_none() {
        report::rewrite(page, "maps", &report::table(&HEADER, &rows))?;
    }
    Ok(faults)
}

/// The committed log, and either the further ones or simulated worlds.
fn sources(data: Option<&Path>, folder: &Path) -> Result<Vec<Source>, Error> {
    let committed = logs::killian();
    let mut sources = vec![Source { name: "killian".to_owned(), path: committed }];
    let further = data.map(|data| data.join("logs")).filter(|logs| logs.is_dir());
    if let Some(logs) = further {
        for name in FURTHER {
            let path = logs.join(format!("{name}.log.gz"));
            sources.push(Source { name: format!("{name} *"), path });
        }
        return Ok(sources);
    }
    for world in [office(), hall()] {
        let path = folder.join(format!("{}.log", world.name));
        let recording = Recording::Scanner(Scanner::default());
        record(&world, SIMULATED_STEP_M, &recording, SIMULATED_SEED, &path)?;
        sources.push(Source { name: format!("{} (simulated)", world.name), path });
    }
    Ok(sources)
}

fn faults_of(name: &str, outcomes: &[Outcome]) -> Vec<String> {
    let mut faults = Vec::new();
    for outcome in outcomes {
        let held = !LOCALIZED.iter().any(|log| name.starts_with(log));
        if held && !outcome.coverage.as_ref().is_some_and(trial::is_within_bounds) {
            faults.push(format!("{name} on {}: the map misses the bounds", outcome.engine));
        }
    }
    if let [sqlite, postgres] = outcomes {
        for difference in sqlite.differences(postgres) {
            faults.push(format!("{name}: {difference} of SQLite and PostgreSQL differ"));
        }
    }
    faults
}

const HEADER: [&str; 13] = [
    "log",
    "engine",
    "scans",
    "contributions",
    "wall time s",
    "contributions/s",
    "bytes up/scan",
    "segments",
    "clusters",
    "tiles",
    "GeoJSON kB",
    "explained %",
    "through %",
];

fn row(name: &str, log: &Log, outcome: &Outcome) -> Vec<String> {
    let (scans, seconds) = (log.scans.len(), outcome.run.wall.as_secs_f64());
    let coverage = outcome.coverage.unwrap_or_default();
    vec![
        name.to_owned(),
        outcome.engine.to_owned(),
        scans.to_string(),
        outcome.revision.to_string(),
        format!("{seconds:.1}"),
        format!("{:.0}", outcome.revision as f64 / seconds),
        (outcome.run.bytes_up / scans as u64).to_string(),
        outcome.segments.to_string(),
        outcome.clusters.to_string(),
        outcome.tiles.to_string(),
        (outcome.exports.first().map_or(0, Vec::len) / 1000).to_string(),
        format!("{:.2}", 100.0 * coverage.explained_share()),
        format!("{:.2}", 100.0 * coverage.through_share()),
    ]
}
