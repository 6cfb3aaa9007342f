//! One trial: a log is played as a fleet into a fresh server, and the map is measured.

use std::path::Path;

use crate::Error;
use crate::carmen::Log;
use crate::coverage::{Coverage, measure};
use crate::database::Database;
use crate::fleet::{self, Run};
use crate::level::Level;
use crate::robot::Robot;
use crate::server::Server;

/// The site and level of every trial.
const PLACE: (&str, &str) = ("trial", "floor");

/// Exports that must be the same whatever the engine.
pub const EXPORTS: [&str; 2] = ["geojson", "nav2"];

/// What a map must reach.
pub const EXPLAINED_SHARE_MIN: f64 = 0.90;

/// What it must stay below.
pub const THROUGH_SHARE_MAX: f64 = 0.02;

/// What a trial showed.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// The engine, as a word.
    pub engine: &'static str,
    /// Newest revision of the log.
    pub revision: i64,
    /// Published segments.
    pub segments: usize,
    /// Published clusters.
    pub clusters: usize,
    /// Published tiles of all layers.
    pub tiles: usize,
    /// What the run took.
    pub run: Run,
    /// How well the map agrees with the log, where the log is of lasers.
    pub coverage: Option<Coverage>,
    /// Each export's bytes: GeoJSON and Nav2.
    pub exports: Vec<Vec<u8>>,
    /// The server's own digest of the whole map, made by folding its log from nothing.
    pub map_digest: String,
}

impl Outcome {
    /// All figures in one sentence.
    pub fn sentence(&self, scans: usize) -> String {
        let seconds = self.run.wall.as_secs_f64();
        let coverage = self.coverage.map_or(String::new(), |coverage| {
            format!(
                ", {:.2} % of {} returns explained, {:.2} % run through a segment",
                100.0 * coverage.explained_share(),
                coverage.returns,
                100.0 * coverage.through_share()
            )
        });
        format!(
            "{}: {} contributions in {seconds:.1} s ({:.0}/s), {} bytes up and {} down a scan, \
             {} segments, {} clusters, {} tiles{coverage}",
            self.engine,
            self.revision,
            self.revision as f64 / seconds,
            self.run.bytes_up / scans as u64,
            self.run.bytes_down / scans as u64,
            self.segments,
            self.clusters,
            self.tiles,
        )
    }

    /// What differs between two outcomes that must be the same, in words.
    pub fn differences(&self, other: &Self) -> Vec<&'static str> {
        let mut differences = Vec::new();
        if self.revision != other.revision {
            differences.push("revision");
        }
        if self.map_digest != other.map_digest {
            differences.push("map digest");
        }
        for (at, format) in EXPORTS.into_iter().enumerate() {
            if self.exports.get(at) != other.exports.get(at) {
                differences.push(format);
            }
        }
        differences
    }
}

/// Whether a map agrees with its readings as well as every map must.
pub fn is_within_bounds(coverage: &Coverage) -> bool {
    coverage.explained_share() >= EXPLAINED_SHARE_MIN
        && coverage.through_share() < THROUGH_SHARE_MAX
}

/// Plays robots into a fresh server on `database`, measures the map against `log`, and asks the
/// server to check itself (`verify`).
///
/// # Errors
/// A program fails, or an answer is not what it should be.
pub async fn play(
    database: Database,
    robots: &[Robot],
    log: Option<&Log>,
    folder: &Path,
) -> Result<Outcome, Error> {
    let engine = database.engine();
    let mut server = Server::start(database).await?;
    let folder = folder.join(engine);
    std::fs::create_dir_all(&folder).map_err(|e| Error::file(&folder, e))?;
    let run = fleet::play(&server, PLACE.0, PLACE.1, robots, &folder).await?;
    let level = Level::new(server.api()?, PLACE.0, PLACE.1);
    let (replica, floor) = level.floor().await?;
    let mut exports = Vec::new();
    for format in EXPORTS {
        exports.push(level.export(format).await?);
    }
    let revision = level.describe().await?.revision;
    server.stop().await?;
    let map_digest = server.verify().await?;
    Ok(Outcome {
        engine,
        revision,
        segments: replica.segments.len(),
        clusters: replica.clusters.len(),
        tiles: replica.tiles.len(),
        run,
        coverage: log.map(|log| measure(&floor, log)),
        exports,
        map_digest,
    })
}
