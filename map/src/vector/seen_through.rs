//! Free-space evidence against walls: what robots have looked through is not solid.

use super::VectorConfig;
use super::wall::Wall;
use crate::geometry::{Interval, Point};
use crate::raster::{Blocks, Cell, LogOdds, SensorClass, Tile, TileIndex, TileKey};

/// Read access to the grid's evidence for the vector fold.
pub(crate) trait Evidence {
    /// One layer's tile, if it holds any evidence.
    fn tile(&self, key: TileKey) -> Option<&Tile>;
    /// Edge of a cell, metres.
    fn resolution(&self) -> f64;
}

/// Reads cells of the scanner layer; neighbours mostly share a tile, which is looked up once.
pub(super) struct Reader<'a, E> {
    grid: &'a E,
    tile: Option<(TileIndex, Option<&'a Tile>)>,
}

impl<'a, E: Evidence> Reader<'a, E> {
    pub(super) fn new(grid: &'a E) -> Self {
        Self { grid, tile: None }
    }

    pub(super) fn value(&mut self, p: &Point) -> i32 {
        let (index, offset) = Cell::holding(p, self.grid.resolution()).tile();
        let tile = match self.tile {
            Some((at, tile)) if at == index => tile,
            _ => {
                let tile = self.grid.tile(TileKey { class: SensorClass::Scanner, tile: index });
                self.tile = Some((index, tile));
                tile
            }
        };
        tile.map_or(0, |tile| tile.cells()[offset])
    }
}

/// Cells to either side of a line that have to be free as well for the line to lie in free space:
/// a wall may lie a cell off its estimate.
const CELLS_BESIDE: i32 = 1;
/// Cells behind a line that only beams through it reach: hits smear their evidence less deep.
const CELLS_BEHIND: [i32; 2] = [2, 3];

/// What the grid says against a wall.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct SeenThrough {
    /// The parts that scanners have looked through, ascending, disjoint.
    pub(super) open: Vec<Interval>,
    /// How many looks went through, where any did, open or not; ascending, disjoint.
    pub(super) looks: Vec<(Interval, f64)>,
}

/// Where scanners have looked through what was seen of a wall. Two things open it, sample by sample:
/// * the cells on and beside the line are all free, or
/// * the cells just behind it are free by more than one look, and by more than a share
///   (`config.through_share`) of those that saw the wall there, not counting the looks at another face close behind it (`backs`),
///   whose viewers freed those cells.
///
/// Single samples inside a piece are noise; ends are trimmed sample by sample.
pub(super) fn seen_through<E: Evidence>(
    wall: &Wall,
    backs: &[&Wall],
    grid: &E,
    config: &VectorConfig,
) -> SeenThrough {
    let resolution = grid.resolution();
    let free_below = LogOdds::from_nat(config.free_below).0;
    let one_look = LogOdds::from_nat(config.free_look).0.max(1);
    let towards_free = wall.towards_free * resolution;
    let step = step_mm(resolution);
    let least = (config.seen_through_min * 1e3).round() as i64;
    let mut reader = Reader::new(grid);
    let (mut through, mut went_through) = (Vec::new(), Vec::new());
    for piece in &wall.seen {
        let mut open: Option<i64> = None;
        let mut end = piece.from;
        for at in samples(piece, step) {
            let middle = at + step / 2;
            let p = middle_of_sample(wall, at, step);
            let mut value = |cells: i32| reader.value(&(p + towards_free * f64::from(cells)));
            let lies_in_free_space =
                (-CELLS_BESIDE..=CELLS_BESIDE).all(|cells| value(cells) < free_below);
            let seen = lies_in_free_space || {
                let behind = CELLS_BEHIND.iter().map(|cells| value(-cells)).max().unwrap_or(0);
                let mut looks = f64::from(-behind.min(0)) / f64::from(one_look);
                if looks > 0.0 {
                    looks -= backs.iter().map(|back| back.looks_beside(&p)).sum::<i64>() as f64;
                }
                if looks > 0.0 {
                    went_through.push((Interval { from: at, to: at + step }, looks));
                }
                looks > (config.through_share * wall.looks_at(middle) as f64).max(1.0)
            };
            match (seen, open) {
                (true, None) => open = Some(at),
                (false, Some(from)) => {
                    through.push(Interval { from, to: at });
                    open = None;
                }
                _ => {}
            }
            end = at + step;
        }
        if let Some(from) = open {
            through.push(Interval { from, to: end });
        }
        through.retain(|i| i.length() >= least || i.from <= piece.from || i.to >= piece.to);
    }
    SeenThrough { open: through, looks: went_through }
}

/// Whether scanners have looked through all of `points`.
pub(super) fn all_free<'a, E: Evidence>(
    points: impl Iterator<Item = &'a Point>,
    grid: &E,
    config: &VectorConfig,
) -> bool {
    let free_below = LogOdds::from_nat(config.free_below).0;
    let mut reader = Reader::new(grid);
    let mut points = points.peekable();
    points.peek().is_some() && points.all(|p| reader.value(p) < free_below)
}

/// The blocks of cells that [`seen_through`] reads for what was seen of a wall.
pub(super) fn blocks_along(wall: &Wall, resolution: f64) -> Vec<(TileIndex, Blocks)> {
    let step = step_mm(resolution);
    let towards_free = wall.towards_free * resolution;
    let samples = wall.seen.iter().flat_map(|piece| samples(piece, step));
    let places = samples.flat_map(|at| {
        let p = middle_of_sample(wall, at, step);
        let behind = CELLS_BEHIND.iter().map(|cells| -cells);
        behind
            .chain(-CELLS_BESIDE..=CELLS_BESIDE)
            .map(move |cells| p + towards_free * f64::from(cells))
    });
    Blocks::under(places, resolution)
}

/// Length of a sample, millimetres.
fn step_mm(resolution: f64) -> i64 {
    ((resolution * 1e3).round() as i64).max(1)
}

/// Where the samples of a piece begin. They sit on multiples of the step, so that they do not move
/// when the piece grows.
fn samples(piece: &Interval, step: i64) -> impl Iterator<Item = i64> + use<> {
    let (first, end) = (piece.from.div_euclid(step), piece.to);
    (first..).map(move |number| number * step).take_while(move |at| *at < end)
}

fn middle_of_sample(wall: &Wall, at: i64, step: i64) -> Point {
    wall.axes.at((at + step / 2) as f64 * 1e-3)
}
