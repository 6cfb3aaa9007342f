//! Vast floors of equal rooms: however many there are, a look has the same surroundings.

use std::collections::BTreeMap;
use std::sync::Arc;

use mapfold_map::geometry::{Covariance, Pose, UncertainLine, UncertainPose};
use mapfold_map::level::{Contribution, ContributionId, Level, LevelConfig, Provenance};
use mapfold_map::raster::{Cell, EvidencePatch, SensorClass, TILE_CELLS, TilePatch};
use mapfold_map::vector::{EndKind, Facing, ObservedEnd, ObservedSegment};

use crate::simulation::Noise;

/// Size of a room, metres, and the thickness of its walls.
const ROOM_M: (f64, f64) = (5.0, 4.0);
const WALL_M: f64 = 0.15;
/// Edge of a cell, metres.
pub const RESOLUTION_M: f64 = 0.05;
/// Looks without evidence that every room gets; each is of all four walls.
const LOOKS_A_ROOM: u64 = 2;
/// Rooms whose looks are made and folded at once.
const AT_ONCE: u64 = 2048;
/// What one look says of a free and of an occupied cell, log-odds steps.
const FREE: i16 = -40;
const OCCUPIED: i16 = 85;

/// Rooms in `rows` of `columns`, and the chance that looks at them are made with.
#[derive(Debug)]
pub struct Rooms {
    columns: u64,
    rows: u64,
    noise: Noise,
    looks: u64,
}

impl Rooms {
    /// At least `rooms` of them, in about as many rows as columns.
    pub fn at_least(rooms: u64) -> Self {
        let columns = (rooms as f64).sqrt().ceil().max(1.0) as u64;
        Self { columns, rows: rooms.div_ceil(columns), noise: Noise::of_seed(rooms), looks: 0 }
    }

    /// How many there are.
    pub fn count(&self) -> u64 {
        self.columns * self.rows
    }

    /// A room chosen at random that has at least `margin` others on every side.
    pub fn inner(&mut self, margin: u64) -> u64 {
        let mut pick = |all: u64| {
            let least = margin.min((all - 1) / 2);
            least + (self.noise.share() * (all - 2 * least) as f64) as u64
        };
        let (column, row) = (pick(self.columns), pick(self.rows));
        row * self.columns + column
    }

    /// The rooms not more than `reach` rooms from `room`, itself among them.
    pub fn around(&self, room: u64, reach: u64) -> impl Iterator<Item = u64> + use<> {
        let (column, row, columns) = (room % self.columns, room / self.columns, self.columns);
        let span = |at: u64, all: u64| at.saturating_sub(reach)..=(at + reach).min(all - 1);
        let across = span(column, columns);
        span(row, self.rows).flat_map(move |row| across.clone().map(move |c| row * columns + c))
    }

    /// A level in which every room has got its looks, without evidence.
    pub fn level(&mut self) -> Level {
        let mut level = Level::new(LevelConfig::standard(RESOLUTION_M));
        for from in (0..self.count()).step_by(AT_ONCE as usize) {
            let rooms = from..self.count().min(from + AT_ONCE);
            let looks: Vec<Contribution> =
                (0..LOOKS_A_ROOM).flat_map(|_| rooms.clone()).map(|room| self.look(room)).collect();
            level.fold(&looks);
        }
        level
    }

    /// A new look at a room's four walls from somewhere in its middle.
    pub fn look(&mut self, room: u64) -> Contribution {
        let number = self.looks;
        self.looks += 1;
        let noise = &mut self.noise;
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

    /// The same with the room's evidence: free inside, occupied along its walls.
    pub fn look_with_evidence(&mut self, room: u64) -> Contribution {
        let mut look = self.look(room);
        let corner = |steps: (u64, u64)| {
            let x = steps.0 as f64 * (ROOM_M.0 + WALL_M);
            let y = steps.1 as f64 * (ROOM_M.1 + WALL_M);
            Cell {
                column: (x / RESOLUTION_M).round() as i32,
                row: (y / RESOLUTION_M).round() as i32,
            }
        };
        let from = corner((room % self.columns, room / self.columns));
        let size = [ROOM_M.0, ROOM_M.1].map(|side| (side / RESOLUTION_M).round() as i32);
        let mut tiles = BTreeMap::new();
        for row in -1..=size[1] {
            for column in -1..=size[0] {
                let is_inside = (0..size[0]).contains(&column) && (0..size[1]).contains(&row);
                let cell = Cell { column: from.column + column, row: from.row + row };
                let (tile, at) = cell.tile();
                tiles.entry(tile).or_insert_with(|| Box::new([0_i16; TILE_CELLS]))[at] =
                    if is_inside { FREE } else { OCCUPIED };
            }
        }
        let tiles = tiles.into_iter().map(|(t, cells)| (t, TilePatch::from_cells(&cells)));
        look.evidence = vec![EvidencePatch { class: SensorClass::Scanner, tiles: tiles.collect() }];
        look
    }
}
