//! Aligning maps on recorded logs: a log is cut into two maps that share a part, the second in a frame of its own; and
//! maps that have nothing in common, or that bend, are aligned.

mod cuts;
mod outcome;
mod own_odometry;
mod strangers;

use std::f64::consts::TAU;
use std::path::Path;

use mapfold_map::alignment::{AlignmentConfig, Chart, align};
use mapfold_map::geometry::{Level as LevelFrame, Odom, Pose};
use mapfold_map::level::Level;

use crate::{Error, logs, report};
use cuts::Recorded;
use outcome::{COLUMNS, Tolerance, Tried};

/// Cells of the maps, metres.
const RESOLUTION_M: f64 = 0.05;
/// Directions in which each log is cut.
const CUTS: u32 = 6;
/// Shares of what the smaller map's robot saw standing that the other one saw too.
const OVERLAPS: [f64; 4] = [0.0, 0.2, 0.4, 0.6];
/// Poses of good corrected logs err by centimetres.
const RIGHT: Tolerance = (0.3, 0.02);
/// Those of the log that is kept aside are a particle filter's, and differ from its own wheels by up to 33 cm and 6 degrees
/// within 3 m of way (95th percentile).
const RIGHT_ASIDE: Tolerance = (0.6, 0.1);
/// Logs that no threshold was ever set by. Not in the sums: its tolerance is another.
const KEPT_ASIDE: [&str; 1] = ["birmingham"];

/// Cuts of all logs that were made together.
struct CutSet {
    name: &'static str,
    /// By what share of a step from direction to direction they are turned.
    turned: f64,
    /// The blocks of scans that the first robot has.
    parity: usize,
    /// What the second robot's frames are made of.
    frames: f64,
    /// Whether thresholds were set by them.
    is_looked_at: bool,
}

const SETS: [CutSet; 3] = [
    CutSet { name: "looked at", turned: 0.0, parity: 0, frames: 0.0, is_looked_at: true },
    CutSet { name: "looked at later", turned: 0.5, parity: 1, frames: 71.3, is_looked_at: true },
    CutSet { name: "held out", turned: 0.25, parity: 0, frames: 144.9, is_looked_at: false },
];

fn chart(level: &Level) -> Chart {
    Chart::of_map(level.map(), RESOLUTION_M, &AlignmentConfig::STANDARD)
}

/// A frame of a robot's own, from the level's, by a number.
fn away(number: f64) -> Pose<LevelFrame, LevelFrame> {
    let (x, y) = (60.0 * (1.7 * number).sin(), 60.0 * (2.9 * number).cos());
    Pose::new(x, y, 2.4 * number + 0.35)
}

fn tried(
    recorded: &Recorded,
    set: &CutSet,
    overlap: f64,
    right: Tolerance,
) -> Result<Tried, Error> {
    let mut tried = Tried::default();
    for cut in 0..CUTS {
        let direction = (f64::from(cut) + set.turned) / f64::from(CUTS) * TAU;
        let away = away(f64::from(cut) + 10.0 * overlap + set.frames);
        let cut = recorded.cut(direction, overlap, set.parity);
        let [first, second] = &cut.parts;
        let level = chart(&recorded.published_map(first));
        let own = chart(&recorded.map(second, |look| away.compose(&look.level_from_robot))?);
        let before = tokio::time::Instant::now();
        let alignment = align(&level, &own, &AlignmentConfig::STANDARD);
        let took = before.elapsed().as_secs_f64();
        let truth = away.inverse();
        // The frames are what they are taken for.
        let truth: Pose<LevelFrame, Odom> = Pose::new(truth.x, truth.y, truth.heading());
        tried.count(&alignment, &truth, right, (cut.standing, cut.seen), took);
    }
    Ok(tried)
}

/// Of each share in common, what a set of cuts came to; the sets at once.
fn tried_sets(
    recorded: &Recorded,
    sets: &[&CutSet],
    right: Tolerance,
) -> Result<Vec<Vec<Tried>>, Error> {
    let all = |set: &CutSet| -> Result<Vec<Tried>, Error> {
        OVERLAPS.iter().map(|overlap| tried(recorded, set, *overlap, right)).collect()
    };
    std::thread::scope(|scope| {
        let running: Vec<_> = sets.iter().map(|set| scope.spawn(|| all(set))).collect();
        let done = running.into_iter().map(std::thread::ScopedJoinHandle::join);
        done.map(|set| set.unwrap_or_else(|panic| std::panic::resume_unwind(panic))).collect()
    })
}

/// Rewrites the tables `own-odometry`, `strangers` and `alignment` of a page and answers what is not as it must be.
/// Further logs are looked for in `data`.
///
/// # Errors
/// A log or the page cannot be read or written.
pub fn table(page: &Path, data: Option<&Path>) -> Result<Vec<String>, Error> {
    let mut faults = own_odometry::table(page, data)?;
    faults.extend(strangers::table(page, data)?);
    let mut all = logs::further(data);
    all.push(("killian".to_owned(), logs::killian()));
    all.extend(logs::named(data, &KEPT_ASIDE));
    let mut rows = Vec::new();
    let mut sums = vec![vec![Tried::default(); OVERLAPS.len()]; SETS.len()];
    for (name, path) in &all {
        let recorded = Recorded::read(path)?;
        let is_aside = KEPT_ASIDE.iter().any(|aside| name.starts_with(aside));
        let right = if is_aside { RIGHT_ASIDE } else { RIGHT };
        let sets: Vec<&CutSet> =
            SETS.iter().filter(|set| !(is_aside && set.is_looked_at)).collect();
        for (set, tried) in sets.iter().zip(tried_sets(&recorded, &sets, right)?) {
            let sums = SETS.iter().zip(&mut sums).find(|(one, _)| one.name == set.name);
            if let Some((_, sums)) = sums.filter(|_| !is_aside) {
                sums.iter_mut().zip(&tried).for_each(|(sum, tried)| sum.add(tried));
            }
            for (overlap, tried) in OVERLAPS.iter().zip(&tried) {
                if is_aside && tried.wrong > 0 {
                    faults.push(format!("{} of {name} at {overlap} are wrong", tried.wrong));
                }
                let row = tried.row(name, set.name);
                report::say(&row.join(" | "));
                rows.push(row);
            }
        }
    }
    for (set, sums) in SETS.iter().zip(&sums) {
        for (overlap, sum) in OVERLAPS.iter().zip(sums) {
            rows.push(sum.row("all", set.name));
            let Tried { all, right, wrong, .. } = sum;
            let words = format!("of {all} alignments at {overlap}, {}, are", set.name);
            if *overlap >= 0.4 && 100 * right < 95 * all {
                faults.push(format!("{right} {words} right"));
            }
            if *wrong > 0 {
                faults.push(format!("{wrong} {words} wrong"));
            }
        }
    }
    let header: Vec<&str> = ["log", "cuts"].into_iter().chain(COLUMNS).collect();
    report::rewrite(page, "alignment", &report::table(&header, &rows))?;
    Ok(faults)
}
