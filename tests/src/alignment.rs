//! Aligning maps on recorded logs: a log is cut into two maps that share a part, the second in a frame of its own.

use std::collections::BTreeSet;
use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use mapfold_client::log::{Log, Observation, carmen};
use mapfold_client::replay::SensorChoice;
use mapfold_client::robot::{Surveyor, SurveyorConfig};
use mapfold_map::alignment::{Alignment, AlignmentConfig, Chart, align};
use mapfold_map::geometry::{Level as LevelFrame, Odom, Point, Pose, difference};
use mapfold_map::level::{Contribution, Level, LevelConfig};
use mapfold_map::raster::{EvidenceRun, TileIndex};

use crate::statistics::quantile;
use crate::{Error, logs, report};

/// Cells of the maps, metres.
const RESOLUTION_M: f64 = 0.05;
/// Scans in a block of a log: blocks go to the two robots in turn, so that no scan is in both maps.
const BLOCK: usize = 5;
/// Directions in which each log is cut.
const CUTS: u32 = 6;
/// Shares of what the smaller map's robot saw standing that the other one saw too.
const OVERLAPS: [f64; 4] = [0.0, 0.2, 0.4, 0.6];
/// Side of the squares in which what both saw is counted, in cells: 0.4 m.
const COARSE: i32 = 8;
/// An alignment farther off than this in the middle of what both have seen is wrong: metres, radians. The log's own poses err
/// by centimetres.
const RIGHT: (f64, f64) = (0.3, 0.02);

type Area = BTreeSet<(i32, i32)>;

/// A log with what its looks saw.
struct Recorded {
    log: Log,
    path: PathBuf,
    /// Where each look was taken, by its reading, and the squares in which it saw something stand.
    looks: Vec<(usize, Point, Area)>,
}

fn surveyor(path: &Path, log: &Log, robot: &str) -> Result<Surveyor, Error> {
    let fault = |fault: String| Error::Log { path: path.to_owned(), line: 0, fault };
    let sensors = SensorChoice::default().choose(log).map_err(|e| fault(e.to_string()))?;
    let config = SurveyorConfig::of_log(robot, sensors, log, RESOLUTION_M);
    Surveyor::new(config, 0).map_err(|e| fault(e.to_string()))
}

fn area(contribution: &Contribution) -> Area {
    let tiles = contribution.evidence.iter().flat_map(|patch| &patch.tiles);
    let cells = tiles.flat_map(|(tile, patch): (&TileIndex, _)| {
        let occupied = patch.runs().iter().filter(|run| run.value > 0);
        occupied.flat_map(EvidenceRun::range).map(|offset| tile.cell(offset))
    });
    cells.map(|cell| (cell.column.div_euclid(COARSE), cell.row.div_euclid(COARSE))).collect()
}

impl Recorded {
    fn read(path: &Path) -> Result<Self, Error> {
        let fault = |fault: String| Error::Log { path: path.to_owned(), line: 0, fault };
        let log: Log = carmen::read(path).map_err(|e| fault(e.to_string()))?;
        let mut surveyor = surveyor(path, &log, "robot")?;
        let mut looks = Vec::new();
        for (index, reading) in log.readings.iter().enumerate() {
            if !matches!(reading.observation, Observation::Scan(_)) {
                continue;
            }
            let Ok(look) = surveyor.survey(reading) else { continue };
            let at = look.contribution.level_from_robot.pose.position();
            looks.push((index, at, area(&look.contribution)));
        }
        Ok(Self { log, path: path.to_owned(), looks })
    }

    /// The map that some of its looks make in a frame of its own.
    fn map(
        &self,
        looks: &[usize],
        odom_from_level: &Pose<LevelFrame, LevelFrame>,
    ) -> Result<Level, Error> {
        let mut surveyor = surveyor(&self.path, &self.log, "robot")?;
        let mut level = Level::new(LevelConfig::standard(RESOLUTION_M));
        let mut contributions = Vec::new();
        for look in looks {
            let mut reading = self.log.readings[self.looks[*look].0].clone();
            reading.level_from_robot =
                reading.level_from_robot.map(|pose| odom_from_level.compose(&pose));
            contributions.extend(surveyor.survey(&reading).map(|look| look.contribution));
        }
        level.fold(&contributions);
        Ok(level)
    }

    /// Cuts it across a direction into two sets of looks, which saw a share in common of what the smaller one saw stand;
    /// and that share.
    fn cut(&self, direction: f64, overlap: f64) -> ([Vec<usize>; 2], f64) {
        let (sin, cos) = direction.sin_cos();
        let along = |look: usize| self.looks[look].1.dot(&Point::new(cos, sin));
        let mut order: Vec<usize> = (0..self.looks.len()).collect();
        order.sort_by(|a, b| along(*a).total_cmp(&along(*b)));
        let half = order.len() / 2;
        // By bisection: how many looks about the middle are in the reach of both, or, negative, of none.
        let (mut low, mut high) = (-(half as i64) + 3, half as i64);
        let parts = |shared: i64| {
            let first = &order[..(half as i64 + shared).clamp(1, order.len() as i64) as usize];
            let second = &order[(half as i64 - shared).clamp(0, order.len() as i64 - 1) as usize..];
            let of = |part: &[usize], parity: usize| {
                let mut looks: Vec<usize> =
                    part.iter().copied().filter(|look| look / BLOCK % 2 == parity).collect();
                looks.sort_unstable();
                looks
            };
            [of(first, 0), of(second, 1)]
        };
        let share = |parts: &[Vec<usize>; 2]| {
            let seen = |looks: &[usize]| -> Area {
                looks.iter().flat_map(|look| self.looks[*look].2.iter().copied()).collect()
            };
            let (first, second) = (seen(&parts[0]), seen(&parts[1]));
            let both = first.intersection(&second).count() as f64;
            both / (first.len().min(second.len()) as f64).max(1.0)
        };
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if share(&parts(middle)) <= overlap {
                low = middle;
            } else {
                high = middle;
            }
        }
        let parts = parts(low);
        let share = share(&parts);
        (parts, share)
    }
}

/// What alignments of one kind came to.
#[derive(Debug, Clone, Default)]
struct Tried {
    all: u32,
    right: u32,
    wrong: u32,
    /// Not told, though the best candidate was right.
    held_back: u32,
    overlaps: Vec<f64>,
    /// Metres and degrees, of those that are right.
    off: Vec<(f64, f64)>,
    /// Normalised squares of these errors.
    nees: Vec<f64>,
    seconds: Vec<f64>,
}

/// How far a pose is off in the middle of what both maps have seen.
fn off(
    found: &Pose<LevelFrame, Odom>,
    truth: &Pose<LevelFrame, Odom>,
    middle: &Point,
) -> (f64, f64) {
    let there = truth.inverse().act(middle);
    let turned = difference(found.heading(), truth.heading()).abs();
    ((found.act(&there) - middle).norm(), turned)
}

impl Tried {
    fn count(&mut self, alignment: &Alignment, truth: &Pose<LevelFrame, Odom>) {
        self.all += 1;
        let Some(best) = alignment.candidates.first() else { return };
        let found = best.level_from_odom.pose;
        let (metres, radians) = off(&found, truth, &best.middle);
        let is_right = metres < RIGHT.0 && radians < RIGHT.1;
        match (alignment.aligned().is_some(), is_right) {
            (true, true) => {
                self.right += 1;
                self.off.push((metres, radians.to_degrees()));
                let mut error = found.vector() - truth.vector();
                error.z = difference(found.heading(), truth.heading());
                let covariance = best.level_from_odom.covariance.matrix();
                if let Some(root) = covariance.cholesky() {
                    self.nees.push(error.dot(&root.solve(&error)) / 3.0);
                }
            }
            (true, false) => self.wrong += 1,
            (false, true) => self.held_back += 1,
            (false, false) => {}
        }
    }
}

/// Rewrites the table `alignment` of a page and answers what is not as it must be. Further logs are looked for in
/// `data`.
///
/// # Errors
/// A log or the page cannot be read or written.
pub fn table(page: &Path, data: Option<&Path>) -> Result<Vec<String>, Error> {
    let config = AlignmentConfig::STANDARD;
    let mut all = logs::further(data);
    all.push(("killian".to_owned(), logs::killian()));
    let mut rows = Vec::new();
    let mut faults = Vec::new();
    let mut sums = vec![Tried::default(); OVERLAPS.len()];
    for (name, path) in all {
        let recorded = Recorded::read(&path)?;
        for (overlap, sum) in OVERLAPS.iter().zip(&mut sums) {
            let mut tried = Tried::default();
            for cut in 0..CUTS {
                let ([first, second], share) =
                    recorded.cut(f64::from(cut) / f64::from(CUTS) * TAU, *overlap);
                let number = f64::from(cut) + 10.0 * overlap;
                let away = Pose::new(
                    60.0 * (1.7 * number).sin(),
                    60.0 * (2.9 * number).cos(),
                    2.4 * number + 0.35,
                );
                let level = recorded.map(&first, &Pose::identity())?;
                let own = recorded.map(&second, &away)?;
                let chart = |level: &Level| Chart::of_map(level.map(), RESOLUTION_M, &config);
                let (level, own) = (chart(&level), chart(&own));
                let before = tokio::time::Instant::now();
                let alignment = align(&level, &own, &config);
                let took = before.elapsed().as_secs_f64();
                let truth = away.inverse();
                // The frames are what they are taken for.
                let truth = Pose::new(truth.x, truth.y, truth.heading());
                tried.count(&alignment, &truth);
                tried.overlaps.push(share);
                tried.seconds.push(took);
            }
            sum.add(&tried);
            let row = tried.row(&name, *overlap);
            report::say(&row.join(" | "));
            rows.push(row);
        }
    }
    for (overlap, sum) in OVERLAPS.iter().zip(&sums) {
        rows.push(sum.row("all", *overlap));
        if *overlap >= 0.4 && 100 * sum.right < 95 * sum.all {
            faults.push(format!("{} of {} alignments at {overlap} are right", sum.right, sum.all));
        }
        if sum.wrong > 0 {
            faults.push(format!("{} of {} alignments at {overlap} are wrong", sum.wrong, sum.all));
        }
    }
    let header = [
        "log",
        "overlap",
        "measured",
        "tried",
        "right",
        "not told",
        "of these right",
        "wrong",
        "off cm, median",
        "greatest",
        "off °, median",
        "greatest",
        "NEES",
        "s, median",
        "greatest",
    ];
    report::rewrite(page, "alignment", &report::table(&header, &rows))?;
    Ok(faults)
}

impl Tried {
    fn add(&mut self, other: &Self) {
        self.all += other.all;
        self.right += other.right;
        self.wrong += other.wrong;
        self.held_back += other.held_back;
        self.overlaps.extend(&other.overlaps);
        self.off.extend(&other.off);
        self.nees.extend(&other.nees);
        self.seconds.extend(&other.seconds);
    }

    fn row(&self, name: &str, overlap: f64) -> Vec<String> {
        let share = self.overlaps.iter().sum::<f64>() / self.overlaps.len() as f64;
        let mut row = vec![
            name.to_owned(),
            format!("{:.0} %", 100.0 * overlap),
            format!("{:.0} %", 100.0 * share),
        ];
        let not_told = self.all - self.right - self.wrong;
        row.extend(
            [self.all, self.right, not_told, self.held_back, self.wrong].map(|n| n.to_string()),
        );
        let told = |values: Vec<f64>, scale: f64, digits: usize| {
            [0.5, 1.0].map(|q| {
                if values.is_empty() {
                    "-".to_owned()
                } else {
                    format!("{:.digits$}", scale * quantile(&values, q))
                }
            })
        };
        row.extend(told(self.off.iter().map(|off| off.0).collect(), 100.0, 1));
        row.extend(told(self.off.iter().map(|off| off.1).collect(), 1.0, 2));
        let nees = self.nees.iter().sum::<f64>() / self.nees.len() as f64;
        row.push(if self.nees.is_empty() { "-".to_owned() } else { format!("{nees:.2}") });
        row.extend(told(self.seconds.clone(), 1.0, 1));
        row
    }
}
