//! How the cost of folding a contribution grows with the map, and what taking many out costs.
//!
//! Vast floors of equal rooms ([`rooms`]), so that the surroundings of a look stay the same while the
//! number of walls grows a thousandfold ([`cost`]); and real logs.

pub mod cost;
pub mod rooms;

use std::path::Path;

use mapfold_client::log::carmen;
use mapfold_client::replay::SensorChoice;
use mapfold_client::robot::{Surveyor, SurveyorConfig};
use mapfold_map::level::{Contribution, Level, LevelConfig};
use mapfold_map::raster::TILE_SIDE;
use tokio::time::Instant;

use self::cost::Cost;
use self::rooms::{RESOLUTION_M, Rooms};
use crate::statistics::quantile;
use crate::{Error, logs, report};

/// Segments of the maps in which the cost of one more contribution is measured.
const SEGMENTS: [u64; 4] = [1_000, 10_000, 100_000, 1_000_000];
/// Contributions that are measured in each of them, and how many of them in a row.
const MEASURED: usize = 400;
const IN_A_ROW: usize = 20;
/// One more contribution may cost so many times as much in the largest map as in the smallest.
const GROWTH_MAX: f64 = 1.5;
/// Contributions of the map that some are taken out of, and every how many-th is.
const ALL: usize = 100_000;
const OUT_OF: usize = 100;
/// How often a log is folded; the median counts.
const TURNS: usize = 5;

/// Times of taking contributions out of a map and putting them back, seconds.
struct Reverts {
    fold: f64,
    out: f64,
    back: f64,
    /// Whether the map was then what it would have been without them, and what it was before.
    is_exact: [bool; 2],
}

impl Reverts {
    fn measure() -> Self {
        let mut rooms = Rooms::at_least((ALL / 2) as u64);
        let count = rooms.count();
        let looks: Vec<Contribution> = (0..ALL as u64).map(|n| rooms.look(n % count)).collect();
        let folded = |looks: &mut dyn Iterator<Item = &Contribution>| {
            let mut level = Level::new(LevelConfig::standard(RESOLUTION_M));
            level.fold(looks);
            level
        };
        let is_out = |number: usize| number.is_multiple_of(OUT_OF);
        let out: Vec<&Contribution> = looks.iter().step_by(OUT_OF).collect();
        let begin = Instant::now();
        let mut level = folded(&mut looks.iter());
        let fold = begin.elapsed().as_secs_f64();
        let full = level.map().clone();
        let begin = Instant::now();
        level.unfold(out.iter().copied());
        let taken = begin.elapsed().as_secs_f64();
        let kept = looks.iter().enumerate().filter(|(number, _)| !is_out(*number));
        let never = folded(&mut kept.map(|(_, look)| look));
        let is_never = level.map() == never.map();
        let begin = Instant::now();
        level.fold(out.iter().copied());
        let back = begin.elapsed().as_secs_f64();
        Self { fold, out: taken, back, is_exact: [is_never, *level.map() == full] }
    }
}

/// What folding a whole log costs.
struct Folded {
    contributions: usize,
    /// How many a second, one by one and all at once.
    rates: [f64; 2],
    /// Tiles of the map, all layers.
    tiles: usize,
    /// Bytes of their sums, as they are kept once later looks have begun slices of their own.
    packed: usize,
}

impl Folded {
    fn row(&self, name: &str) -> Vec<String> {
        let [single, bulk] = self.rates;
        let tile_m2 = (TILE_SIDE as f64 * RESOLUTION_M).powi(2);
        let bytes = self.packed as f64 / self.tiles as f64;
        vec![
            name.to_owned(),
            self.contributions.to_string(),
            format!("{single:.0}"),
            format!("{bulk:.0}"),
            self.tiles.to_string(),
            format!("{bytes:.0}"),
            format!("{:.2}", 365.0 * bytes / tile_m2 / 1e6),
        ]
    }
}

fn log(path: &Path) -> Result<Folded, Error> {
    let fault = |fault: String| Error::Log { path: path.to_owned(), line: 0, fault };
    let log = carmen::read(path).map_err(|e| fault(e.to_string()))?;
    let sensors = SensorChoice::default().choose(&log).map_err(|e| fault(e.to_string()))?;
    let config = SurveyorConfig::of_log("robot", sensors, &log, RESOLUTION_M);
    let mut surveyor = Surveyor::new(config, 0).map_err(|e| fault(e.to_string()))?;
    let looks: Vec<Contribution> = log
        .readings
        .iter()
        .filter_map(|reading| surveyor.survey(reading).ok())
        .map(|look| look.contribution)
        .collect();
    let rate = |batch: usize| {
        let times: Vec<f64> = (0..TURNS)
            .map(|_| {
                let mut level = Level::new(LevelConfig::standard(RESOLUTION_M));
                let begin = Instant::now();
                for some in looks.chunks(batch) {
                    level.fold(some);
                }
                begin.elapsed().as_secs_f64()
            })
            .collect();
        looks.len() as f64 / quantile(&times, 0.5)
    };
    let mut level = Level::new(LevelConfig::standard(RESOLUTION_M));
    let slices = level.fold(&looks).slices;
    let packed =
        slices.iter().filter_map(|at| level.sums(at)).map(|sums| sums.clone().packed().bytes());
    Ok(Folded {
        contributions: looks.len(),
        rates: [rate(1), rate(looks.len().max(1))],
        tiles: level.map().tiles.len(),
        packed: packed.sum(),
    })
}

/// Rewrites the tables `growth` of the report and answers what is not as it must be.
///
/// # Errors
/// A log or the report cannot be read or written.
pub fn tables(page: &Path, data: Option<&Path>) -> Result<Vec<String>, Error> {
    // Before anything else leaves free memory behind that would not count for them.
    let costs = cost::measure(&SEGMENTS, MEASURED, IN_A_ROW);
    let least = &costs[0];
    let killian = logs::killian();
    let intel = data.map(|data| data.join("logs/intel.log.gz")).filter(|path| path.is_file());
    let mut logs = Vec::new();
    for (name, path) in [("intel *", intel), ("killian", Some(killian))] {
        let Some(path) = path else { continue };
        logs.push(log(&path)?.row(name));
    }
    let rows: Vec<Vec<String>> = costs.iter().map(|cost| row(cost, least)).collect();
    let reverts = Reverts::measure();
    let acts = [
        [format!("fold {ALL} at once"), format!("{:.2}", reverts.fold)].to_vec(),
        [format!("take {} of them out", ALL / OUT_OF), format!("{:.3}", reverts.out)].to_vec(),
        ["put them back".to_owned(), format!("{:.3}", reverts.back)].to_vec(),
    ];
    let log_header = [
        "log",
        "contributions",
        "one by one /s",
        "all at once /s",
        "tiles",
        "bytes/tile, packed",
        "MB/m2 after a year of such days",
    ];
    let header = [
        "segments",
        "contributions",
        "bytes/segment",
        "µs, first at a place",
        "p95",
        "ratio",
        "µs, next there",
        "p95",
        "ratio",
        "µs, taken out",
        "p95",
        "ratio",
    ];
    let text = [
        report::table(&log_header, &logs),
        report::table(&header, &rows),
        report::table(&["act", "s"], &acts),
    ];
    report::rewrite(page, "growth", &text.join("\n"))?;
    let mut faults = Vec::new();
    for cost in &costs {
        let ratios = [cost.first.median / least.first.median, cost.next.median / least.next.median];
        let worst = ratios[0].max(ratios[1]);
        if worst > GROWTH_MAX {
            let segments = cost.segments;
            faults.push(format!("one more costs {worst:.2} times as much at {segments} segments"));
        }
    }
    if reverts.is_exact != [true; 2] {
        faults.push("a map is not what it was, or would have been, after a revert".to_owned());
    }
    Ok(faults)
}

fn row(cost: &Cost, least: &Cost) -> Vec<String> {
    let bytes = cost.bytes.map_or_else(|| "?".to_owned(), |bytes| format!("{bytes:.0}"));
    let mut row = vec![cost.segments.to_string(), cost.contributions.to_string(), bytes];
    let kinds = [(cost.first, least.first), (cost.next, least.next), (cost.out, least.out)];
    for (spread, least) in kinds {
        row.push(format!("{:.0}", spread.median));
        row.push(format!("{:.0}", spread.p95));
        row.push(format!("{:.2}", spread.median / least.median));
    }
    row
}
