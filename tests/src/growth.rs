//! How the cost of folding a contribution grows with the map, and what taking many out costs.
//!
//! Vast floors of equal rooms, so that the density of walls stays the same while their number
//! grows a thousandfold; and real logs.

use std::path::Path;
use std::sync::Arc;

use mapfold_client::log::carmen;
use mapfold_client::replay::SensorChoice;
use mapfold_client::robot::{OdometryNoise, PoseSd, PoseSource, Surveyor, SurveyorConfig};
use mapfold_map::geometry::{Covariance, Pose, UncertainLine, UncertainPose};
use mapfold_map::level::{Contribution, ContributionId, Level, LevelConfig, Provenance};
use mapfold_map::raster::{Cell, EvidencePatch, SensorClass, TILE_CELLS, TilePatch};
use mapfold_map::vector::{EndKind, Facing, ObservedEnd, ObservedSegment};

use crate::simulation::Noise;
use crate::{Error, report};

/// Size of a room, metres, and the thickness of its walls.
const ROOM_M: (f64, f64) = (5.0, 4.0);
const WALL_M: f64 = 0.15;
/// Looks that every room has got before anything is measured; each is of all four walls.
const LOOKS_A_ROOM: u64 = 2;
/// Segments of the map at which the cost of one more contribution is measured.
const SEGMENTS: [u64; 4] = [1_000, 10_000, 100_000, 1_000_000];
/// One more contribution may cost so many times as much in the largest map as in the smallest.
const GROWTH_MAX: f64 = 1.5;
/// Contributions whose folding is timed, one by one.
const TIMED: u64 = 2_000;

/// A floor of equal rooms in rows of `columns`.
struct Floor {
    columns: u64,
}

impl Floor {
    fn of_rooms(rooms: u64) -> Self {
        Self { columns: (rooms as f64).sqrt().ceil().max(1.0) as u64 }
    }

    /// Look number `number`, which is at room `room`.
    fn look(&self, number: u64, room: u64, noise: &mut Noise) -> Contribution {
        let column = (room % self.columns) as f64;
        let row = (room / self.columns) as f64;
        let (half_x, half_y) = (ROOM_M.0 / 2.0, ROOM_M.1 / 2.0);
        let middle = (column * (ROOM_M.0 + WALL_M) + half_x, row * (ROOM_M.1 + WALL_M) + half_y);
        let off = (noise.share() - 0.5, noise.share() - 0.5);
        // Distances of the walls, the directions to them, and half of their lengths.
        let walls = [
            (half_x - off.0, 0.0, half_y, -off.1),
            (half_y - off.1, 1.0, half_x, off.0),
            (half_x + off.0, 2.0, half_y, off.1),
            (half_y + off.1, 3.0, half_x, -off.0),
        ];
        let segments = walls
            .iter()
            .map(|&(distance, quarter, half, foot)| {
                let alpha = quarter * std::f64::consts::FRAC_PI_2;
                let covariance = Covariance::from_variances([4e-6, 1e-6]);
                let rho = distance + noise.normal(0.002);
                let end = ObservedEnd { kind: EndKind::Corner, sd: 0.01 };
                let (line, _) =
                    UncertainLine::normal_form(rho, alpha + noise.normal(0.001), covariance);
                ObservedSegment {
                    line,
                    from: foot - half,
                    to: foot + half,
                    facing: Facing::Origin,
                    ends: [end, end],
                    seen_through: Vec::new(),
                    points: 80,
                }
            })
            .collect();
        let mut id = [0; 16];
        // Spread over the order of identities, as those of many robots are.
        id[..8].copy_from_slice(&number.wrapping_mul(0x9e37_79b9_7f4a_7c15).to_be_bytes());
        id[8..].copy_from_slice(&number.to_be_bytes());
        Contribution {
            id: ContributionId(id),
            robot: Arc::from(["ada", "bob", "cy"][(number % 3) as usize]),
            observed_at_us: number as i64,
            level_from_robot: UncertainPose {
                pose: Pose::new(
                    middle.0 + off.0 + noise.normal(0.01),
                    middle.1 + off.1 + noise.normal(0.01),
                    noise.normal(0.002),
                ),
                covariance: Covariance::from_variances([1e-4, 1e-4, 4e-6]),
            },
            provenance: Provenance::SharedMap,
            segments,
            clusters: Vec::new(),
            evidence: Vec::new(),
        }
    }

    /// The same with a square of evidence round the robot, so that what the evidence touches is
    /// published anew.
    fn look_with_evidence(&self, number: u64, room: u64, noise: &mut Noise) -> Contribution {
        let mut look = self.look(number, room, noise);
        let pose = &look.level_from_robot.pose;
        let mut tiles = std::collections::BTreeMap::new();
        for row in 0..60 {
            for column in 0..60 {
                let offset = |cells: i32| 0.05 * f64::from(cells) - 1.5;
                let at = pose.position()
                    + mapfold_map::geometry::Point::new(offset(column), offset(row));
                let (tile, cell) = Cell::holding(&at, 0.05).tile();
                tiles.entry(tile).or_insert_with(|| Box::new([0_i16; TILE_CELLS]))[cell] = -40;
            }
        }
        let tiles = tiles.into_iter().map(|(t, cells)| (t, TilePatch::from_cells(&cells)));
        look.evidence = vec![EvidencePatch { class: SensorClass::Scanner, tiles: tiles.collect() }];
        look
    }
}

/// Mean microseconds of folding one more contribution at each of [`SEGMENTS`], with the number of
/// segments that there really were.
fn growth() -> Vec<(usize, f64)> {
    let mut rows = Vec::new();
    for segments in SEGMENTS {
        let rooms = segments.div_ceil(4);
        let floor = Floor::of_rooms(rooms);
        let mut noise = Noise::of_seed(segments);
        let mut level = Level::new(LevelConfig::standard(0.05));
        let mut number = 0;
        for round in 0..LOOKS_A_ROOM {
            for from in (0..rooms).step_by(4096) {
                let looks: Vec<Contribution> = (from..rooms.min(from + 4096))
                    .map(|room| {
                        number += 1;
                        floor.look(round * rooms + room, room, &mut noise)
                    })
                    .collect();
                level.fold(&looks);
            }
        }
        let more: Vec<Contribution> = (0..TIMED)
            .map(|i| {
                let room = (noise.share() * rooms as f64) as u64;
                floor.look_with_evidence(number + i, room.min(rooms - 1), &mut noise)
            })
            .collect();
        let begin = tokio::time::Instant::now();
        for look in &more {
            level.fold([look]);
        }
        let micros = begin.elapsed().as_secs_f64() * 1e6 / TIMED as f64;
        rows.push((level.map().segments.len(), micros));
    }
    rows
}

/// Seconds of taking 1000 of 100 000 contributions out, of putting them back, and of folding all
/// of them from nothing.
fn revert() -> (f64, f64, f64) {
    const ALL: u64 = 100_000;
    let rooms = ALL / LOOKS_A_ROOM;
    let floor = Floor::of_rooms(rooms);
    let mut noise = Noise::of_seed(1);
    let looks: Vec<Contribution> =
        (0..ALL).map(|number| floor.look(number, number % rooms, &mut noise)).collect();
    let mut level = Level::new(LevelConfig::standard(0.05));
    let begin = tokio::time::Instant::now();
    level.fold(&looks);
    let fold = begin.elapsed().as_secs_f64();
    let out: Vec<&Contribution> = looks.iter().step_by(100).collect();
    let begin = tokio::time::Instant::now();
    level.unfold(out.iter().copied());
    let taken = begin.elapsed().as_secs_f64();
    let begin = tokio::time::Instant::now();
    level.fold(out.iter().copied());
    (taken, begin.elapsed().as_secs_f64(), fold)
}

/// Contributions a second of a whole log, folded one by one and all at once.
fn log(path: &Path) -> Result<(usize, f64, f64), Error> {
    let fault = |fault: String| Error::Log { path: path.to_owned(), line: 0, fault };
    let log = carmen::read(path).map_err(|e| fault(e.to_string()))?;
    let sensors = SensorChoice::default().choose(&log).map_err(|e| fault(e.to_string()))?;
    let config = SurveyorConfig {
        robot: "robot".to_owned(),
        sensors,
        emulate_sonar: false,
        poses: PoseSource::Log,
        pose_sd: PoseSd::CORRECTED_LOG,
        provenance: Provenance::SharedMap,
        odometry: OdometryNoise::STANDARD,
        resolution: 0.05,
        source: log.digest,
    };
    let mut surveyor = Surveyor::new(config, 0).map_err(|e| fault(e.to_string()))?;
    let looks: Vec<Contribution> = log
        .readings
        .iter()
        .filter_map(|reading| surveyor.survey(reading).ok())
        .map(|look| look.contribution)
        .collect();
    let mut one_by_one = Level::new(LevelConfig::standard(0.05));
    let begin = tokio::time::Instant::now();
    for look in &looks {
        one_by_one.fold([look]);
    }
    let single = looks.len() as f64 / begin.elapsed().as_secs_f64();
    let mut at_once = Level::new(LevelConfig::standard(0.05));
    let begin = tokio::time::Instant::now();
    at_once.fold(&looks);
    Ok((looks.len(), single, looks.len() as f64 / begin.elapsed().as_secs_f64()))
}

/// Rewrites the tables `growth` of the report and answers what is not as it must be.
///
/// # Errors
/// A log or the report cannot be read or written.
pub fn tables(page: &Path, data: Option<&Path>) -> Result<Vec<String>, Error> {
    let killian = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/killian.log.gz");
    let intel = data.map(|data| data.join("logs/intel.log.gz")).filter(|path| path.is_file());
    let mut logs = Vec::new();
    for (name, path) in [("intel *", intel), ("killian", Some(killian))] {
        let Some(path) = path else { continue };
        let (looks, single, bulk) = log(&path)?;
        let row =
            [name.to_owned(), looks.to_string(), format!("{single:.0}"), format!("{bulk:.0}")];
        logs.push(row.to_vec());
    }
    let grown = growth();
    let least = grown.first().map_or(f64::NAN, |(_, micros)| *micros);
    let rows: Vec<Vec<String>> = grown
        .iter()
        .map(|(segments, micros)| {
            vec![segments.to_string(), format!("{micros:.0}"), format!("{:.2}", micros / least)]
        })
        .collect();
    let (out, back, all) = revert();
    let reverts = [
        ["fold 100 000 at once".to_owned(), format!("{all:.2}")].to_vec(),
        ["take 1000 of them out".to_owned(), format!("{out:.3}")].to_vec(),
        ["put them back".to_owned(), format!("{back:.3}")].to_vec(),
    ];
    let text = [
        report::table(&["log", "contributions", "one by one /s", "all at once /s"], &logs),
        report::table(&["segments in the map", "µs for one more contribution", "ratio"], &rows),
        report::table(&["act", "s"], &reverts),
    ];
    report::rewrite(page, "growth", &text.join("\n"))?;
    let worst = grown.iter().map(|(_, micros)| micros / least).fold(0.0, f64::max);
    let fault = format!("one more contribution costs {worst:.2} times as much in a larger map");
    Ok(if worst <= GROWTH_MAX { Vec::new() } else { vec![fault] })
}
