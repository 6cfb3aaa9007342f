//! A log cut into two maps that share a part.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mapfold_client::log::{Log, Observation, Reading, carmen};
use mapfold_client::replay::SensorChoice;
use mapfold_client::robot::{Surveyor, SurveyorConfig};
use mapfold_map::geometry::{Level as LevelFrame, Odom, Point, Pose, Robot};
use mapfold_map::level::{Contribution, Level, LevelConfig};
use mapfold_map::raster::{EvidenceRun, TileIndex};

use super::RESOLUTION_M;
use crate::Error;

/// Scans in a block of a log: blocks go to the two robots in turn, so that no scan is in both maps.
const BLOCK: usize = 5;
/// Side of the squares in which what both saw is counted, in cells: 0.4 m.
const COARSE: i32 = 8;

type Area = BTreeSet<(i32, i32)>;

/// One scan of a log.
pub(super) struct Look {
    /// Its place among the readings.
    reading: usize,
    /// As published.
    pub(super) level_from_robot: Pose<LevelFrame, Robot>,
    /// By the wheels, if the log has them.
    pub(super) odom_from_robot: Option<Pose<Odom, Robot>>,
    /// What it says at the published pose.
    contribution: Contribution,
    /// The squares in which it saw something stand, and those in which it saw anything.
    standing: Area,
    seen: Area,
}

/// A log with what its looks saw.
pub(super) struct Recorded {
    log: Log,
    path: PathBuf,
    pub(super) looks: Vec<Look>,
}

/// Two sets of looks, by their numbers, and what they have in common.
pub(super) struct Cut {
    pub(super) parts: [Vec<usize>; 2],
    /// Share of what the robot of the smaller map saw standing that the other one saw standing too.
    pub(super) standing: f64,
    /// Share of what the robot of the smaller map saw at all that the other one saw too.
    pub(super) seen: f64,
}

fn surveyor(path: &Path, log: &Log, robot: &str) -> Result<Surveyor, Error> {
    let fault = |fault: String| Error::Log { path: path.to_owned(), line: 0, fault };
    let sensors = SensorChoice::default().choose(log).map_err(|e| fault(e.to_string()))?;
    let config = SurveyorConfig::of_log(robot, sensors, log, RESOLUTION_M);
    Surveyor::new(config, 0).map_err(|e| fault(e.to_string()))
}

fn area(contribution: &Contribution, counts: impl Fn(i16) -> bool) -> Area {
    let tiles = contribution.evidence.iter().flat_map(|patch| &patch.tiles);
    let cells = tiles.flat_map(|(tile, patch): (&TileIndex, _)| {
        let counted = patch.runs().iter().filter(|run| counts(run.value));
        counted.flat_map(EvidenceRun::range).map(|offset| tile.cell(offset))
    });
    cells.map(|cell| (cell.column.div_euclid(COARSE), cell.row.div_euclid(COARSE))).collect()
}

/// Every other block of some looks.
pub(super) fn blocks(looks: impl Iterator<Item = usize>, parity: usize) -> Vec<usize> {
    looks.filter(|look| look / BLOCK % 2 == parity).collect()
}

/// Share of the smaller of two areas that both have.
fn common<'a>(of: impl Fn(usize) -> &'a Area, parts: &[Vec<usize>; 2]) -> f64 {
    let [first, second] = [0, 1]
        .map(|part| -> Area { parts[part].iter().flat_map(|look| of(*look)).copied().collect() });
    let both = first.intersection(&second).count() as f64;
    both / (first.len().min(second.len()) as f64).max(1.0)
}

impl Recorded {
    pub(super) fn read(path: &Path) -> Result<Self, Error> {
        let fault = |fault: String| Error::Log { path: path.to_owned(), line: 0, fault };
        let log: Log = carmen::read(path).map_err(|e| fault(e.to_string()))?;
        let mut surveyor = surveyor(path, &log, "robot")?;
        let mut looks = Vec::new();
        for (index, reading) in log.readings.iter().enumerate() {
            if !matches!(reading.observation, Observation::Scan(_)) {
                continue;
            }
            let Ok(look) = surveyor.survey(reading) else { continue };
            looks.push(Look {
                reading: index,
                level_from_robot: look.contribution.level_from_robot.pose,
                odom_from_robot: reading.odom_from_robot,
                standing: area(&look.contribution, |value| value > 0),
                seen: area(&look.contribution, |value| value != 0),
                contribution: look.contribution,
            });
        }
        Ok(Self { log, path: path.to_owned(), looks })
    }

    /// The map that some of its looks make at the published poses.
    pub(super) fn published_map(&self, looks: &[usize]) -> Level {
        let mut level = Level::new(LevelConfig::standard(RESOLUTION_M));
        level.fold(looks.iter().map(|look| &self.looks[*look].contribution));
        level
    }

    /// The map that some of its looks make, each at the pose that `place` gives it.
    pub(super) fn map(
        &self,
        looks: &[usize],
        place: impl Fn(&Look) -> Pose<LevelFrame, Robot>,
    ) -> Result<Level, Error> {
        let mut surveyor = surveyor(&self.path, &self.log, "robot")?;
        let mut level = Level::new(LevelConfig::standard(RESOLUTION_M));
        let mut contributions = Vec::new();
        for look in looks.iter().map(|look| &self.looks[*look]) {
            let reading = Reading {
                level_from_robot: Some(place(look)),
                ..self.log.readings[look.reading].clone()
            };
            contributions.extend(surveyor.survey(&reading).map(|look| look.contribution));
        }
        level.fold(&contributions);
        Ok(level)
    }

    /// Cuts it across a direction, radians, into two sets of looks, which saw a share in common of what the smaller one
    /// saw stand. The first one has the blocks of that `parity`.
    pub(super) fn cut(&self, direction: f64, overlap: f64, parity: usize) -> Cut {
        let (sin, cos) = direction.sin_cos();
        let along =
            |look: usize| self.looks[look].level_from_robot.position().dot(&Point::new(cos, sin));
        let mut order: Vec<usize> = (0..self.looks.len()).collect();
        order.sort_by(|a, b| along(*a).total_cmp(&along(*b)));
        let half = order.len() / 2;
        // By bisection: how many looks about the middle are in the reach of both, or, negative, of none.
        let (mut low, mut high) = (-(half as i64) + 3, half as i64);
        let parts = |shared: i64| {
            let first = &order[..(half as i64 + shared).clamp(1, order.len() as i64) as usize];
            let second = &order[(half as i64 - shared).clamp(0, order.len() as i64 - 1) as usize..];
            let of = |part: &[usize], parity: usize| {
                let mut looks = blocks(part.iter().copied(), parity);
                looks.sort_unstable();
                looks
            };
            [of(first, parity), of(second, 1 - parity)]
        };
        let standing = |parts: &_| common(|look| &self.looks[look].standing, parts);
        while high - low > 1 {
            let middle = low + (high - low) / 2;
            if standing(&parts(middle)) <= overlap {
                low = middle;
            } else {
                high = middle;
            }
        }
        let parts = parts(low);
        Cut {
            standing: standing(&parts),
            seen: common(|look| &self.looks[look].seen, &parts),
            parts,
        }
    }
}
