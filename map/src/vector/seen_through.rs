//! Free-space evidence against walls: what robots have looked through is not solid.

use super::VectorConfig;
use super::wall::Wall;
use crate::geometry::{Interval, Point};
use crate::raster::{Cell, LogOdds, SensorClass, Tile, TileIndex, TileKey};

/// Read access to the grid's evidence for the vector fold.
pub(crate) trait Evidence {
    /// One layer's tile, if it holds any evidence.
    fn tile(&self, key: TileKey) -> Option<&Tile>;
    /// Edge of a cell, metres.
    fn resolution(&self) -> f64;
}

/// Reads cells of the scanner layer; neighbours mostly share a tile, which is looked up once.
struct Reader<'a, E> {
    grid: &'a E,
    tile: Option<(TileIndex, Option<&'a Tile>)>,
}

impl<E: Evidence> Reader<'_, E> {
    fn value(&mut self, p: &Point) -> i32 {
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

/// Cells to either side of a line that have to be free as well for the line to be seen through
/// there: a wall may lie a cell off its estimate.
const CELLS_ACROSS: i32 = 1;

/// The parts of `pieces` (ascending, disjoint) that scanners have looked through: stretches of at
/// least `config.seen_through_min` on which all cells on and beside the line are free.
pub(super) fn seen_through<E: Evidence>(
    wall: &Wall,
    pieces: &[Interval],
    grid: &E,
    config: &VectorConfig,
) -> Vec<Interval> {
    let resolution = grid.resolution();
    let free_below = LogOdds::from_nat(config.free_below).0;
    let across = wall.towards_free() * resolution;
    let step = ((resolution * 1e3).round() as i64).max(1);
    let least = (config.seen_through_min * 1e3).round() as i64;
    let mut reader = Reader { grid, tile: None };
    let mut through = Vec::new();
    for piece in pieces {
        let mut open: Option<i64> = None;
        // Samples sit on multiples of the step, so that they do not move when the piece grows.
        let mut at = piece.from.div_euclid(step) * step;
        while at < piece.to {
            let p = wall.line.at((at as f64 + 0.5 * step as f64) * 1e-3);
            let free = (-CELLS_ACROSS..=CELLS_ACROSS)
                .all(|k| reader.value(&(p + across * f64::from(k))) < free_below);
            match (free, open) {
                (true, None) => open = Some(at),
                (false, Some(from)) => {
                    through.push(Interval { from, to: at });
                    open = None;
                }
                _ => {}
            }
            at += step;
        }
        if let Some(from) = open {
            through.push(Interval { from, to: at });
        }
    }
    through.retain(|i| i.length() >= least);
    through
}

/// Whether scanners have looked through all of `points`.
pub(super) fn all_free<'a, E: Evidence>(
    points: impl Iterator<Item = &'a Point>,
    grid: &E,
    config: &VectorConfig,
) -> bool {
    let free_below = LogOdds::from_nat(config.free_below).0;
    let mut reader = Reader { grid, tile: None };
    let mut points = points.peekable();
    points.peek().is_some() && points.all(|p| reader.value(p) < free_below)
}

/// The tiles that the evidence for or against a wall may lie in.
pub(super) fn tiles_along(wall: &Wall, resolution: f64) -> Vec<TileIndex> {
    let side = resolution * crate::raster::TILE_SIDE as f64;
    let mut tiles = Vec::new();
    for piece in &wall.seen {
        let samples = (piece.length() as f64 * 1e-3 / (0.25 * side)).ceil() as i64;
        for i in 0..=samples.max(1) {
            let t =
                piece.from_m() + (piece.to_m() - piece.from_m()) * i as f64 / samples.max(1) as f64;
            let p = wall.line.at(t);
            let margin = 0.5 * side;
            for corner in [(-1.0, -1.0), (-1.0, 1.0), (1.0, -1.0), (1.0, 1.0)] {
                let q = p + Point::new(corner.0, corner.1) * margin;
                tiles.push(Cell::holding(&q, resolution).tile().0);
            }
        }
    }
    tiles.sort_unstable();
    tiles.dedup();
    tiles
}
