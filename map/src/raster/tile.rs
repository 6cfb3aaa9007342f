//! Tiles: square blocks of cells, the unit of storage, transfer and change tracking.

use super::{SensorClass, TilePatch};
use crate::geometry::Point;

/// Cells along one side of a tile.
pub const TILE_SIDE: usize = 64;
/// Cells of a tile.
pub const TILE_CELLS: usize = TILE_SIDE * TILE_SIDE;

/// A cell of a level's grid: cell (0, 0) has the level's origin as its lower left corner.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Cell {
    /// Cells to the right of the origin.
    pub column: i32,
    /// Cells up from the origin.
    pub row: i32,
}

/// `v.floor() as i32`, which on processors that are not asked for more than they all have is a call
/// into the mathematical library: too dear for what is done for every cell.
fn floor(v: f64) -> i32 {
    let cut = v as i32;
    if f64::from(cut) > v { cut.saturating_sub(1) } else { cut }
}

impl Cell {
    /// The cell that holds `p`, at `resolution` metres a cell.
    pub fn holding(p: &Point, resolution: f64) -> Self {
        Self { column: floor(p.x / resolution), row: floor(p.y / resolution) }
    }

    /// The centre of the cell.
    pub fn centre(&self, resolution: f64) -> Point {
        Point::new(
            (f64::from(self.column) + 0.5) * resolution,
            (f64::from(self.row) + 0.5) * resolution,
        )
    }

    /// The tile that holds the cell, and the cell's offset in it (row by row from below).
    pub fn tile(&self) -> (TileIndex, usize) {
        let side = TILE_SIDE as i32;
        let tile = TileIndex { x: self.column.div_euclid(side), y: self.row.div_euclid(side) };
        let offset = self.row.rem_euclid(side) * side + self.column.rem_euclid(side);
        (tile, offset as usize)
    }
}

/// A tile's place in a level's grid; tile (0, 0) has the level's origin as its lower left corner.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TileIndex {
    /// Tiles to the right of the origin.
    pub x: i32,
    /// Tiles up from the origin.
    pub y: i32,
}

impl TileIndex {
    /// The cell at `offset` of this tile.
    pub fn cell(&self, offset: usize) -> Cell {
        let side = TILE_SIDE as i32;
        Cell {
            column: self.x * side + (offset % TILE_SIDE) as i32,
            row: self.y * side + (offset / TILE_SIDE) as i32,
        }
    }
}

/// One layer's tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TileKey {
    /// The layer.
    pub class: SensorClass,
    /// The place.
    pub tile: TileIndex,
}

/// The evidence of one layer in one tile: log-odds steps, cell by cell, row by row from below.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Tile {
    cells: Box<[i32; TILE_CELLS]>,
}

impl Default for Tile {
    fn default() -> Self {
        Self { cells: Box::new([0; TILE_CELLS]) }
    }
}

impl Tile {
    /// A tile from its cells.
    pub fn new(cells: Box<[i32; TILE_CELLS]>) -> Self {
        Self { cells }
    }

    /// All cells in order.
    pub fn cells(&self) -> &[i32; TILE_CELLS] {
        &self.cells
    }

    /// Whether no cell holds any evidence: such a tile is the same as none.
    pub fn is_empty(&self) -> bool {
        self.cells.iter().all(|c| *c == 0)
    }

    /// Adds a patch. Sums wrap at the bounds of `i32`, which keeps addition a group; a cell needs
    /// ten million looks at full evidence to get there.
    pub fn add(&mut self, patch: &TilePatch) {
        for run in patch.runs() {
            for cell in &mut self.cells[run.range()] {
                *cell = cell.wrapping_add(i32::from(run.value));
            }
        }
    }

    /// Takes a patch out again, exactly.
    pub fn subtract(&mut self, patch: &TilePatch) {
        for run in patch.runs() {
            for cell in &mut self.cells[run.range()] {
                *cell = cell.wrapping_sub(i32::from(run.value));
            }
        }
    }

    /// Adds another tile's sums, cell by cell.
    pub fn add_tile(&mut self, other: &Self) {
        for (cell, more) in self.cells.iter_mut().zip(&*other.cells) {
            *cell = cell.wrapping_add(*more);
        }
    }

    /// Takes another tile's sums out again, exactly.
    pub fn subtract_tile(&mut self, other: &Self) {
        for (cell, less) in self.cells.iter_mut().zip(&*other.cells) {
            *cell = cell.wrapping_sub(*less);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_quick_floor_is_the_floor() {
        let odd =
            [f64::NAN, f64::INFINITY, f64::NEG_INFINITY, -0.0, 2_147_483_647.5, -2_147_483_648.5];
        let near_whole = (-3000..3000).flat_map(|k| {
            let v = f64::from(k) * 0.5;
            [v, v.next_up(), v.next_down()]
        });
        for v in near_whole.chain(odd) {
            assert_eq!(floor(v), v.floor() as i32, "{v}");
        }
    }
}
