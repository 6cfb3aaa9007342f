//! Blocks: squares of cells in a tile, fine enough to tell what a change of evidence concerns.

use std::collections::BTreeMap;

use super::{Cell, TILE_CELLS, TILE_SIDE, Tile, TileIndex, TilePatch};
use crate::geometry::Point;

/// Cells along one side of a block: a tile has 8 times 8 blocks.
const BLOCK_SIDE: usize = TILE_SIDE / 8;

/// A set of blocks of one tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct Blocks(u64);

/// The blocks in which the evidence of one layer has changed.
pub(crate) type Touched = BTreeMap<TileIndex, Blocks>;

impl Blocks {
    /// The block that holds the cell at `offset`.
    fn holding(offset: usize) -> Self {
        let (row, column) = (offset / TILE_SIDE, offset % TILE_SIDE);
        Self(1 << (row / BLOCK_SIDE * 8 + column / BLOCK_SIDE))
    }

    /// The blocks that a patch adds to.
    pub(crate) fn of_patch(patch: &TilePatch) -> Self {
        let mut blocks = Self::default();
        for run in patch.runs() {
            let cells = run.range();
            // A step of a block's side cannot leave a block out: blocks begin at its multiples.
            let steps = cells.clone().step_by(BLOCK_SIDE).chain([cells.end - 1]);
            steps.for_each(|offset| blocks.add(Self::holding(offset)));
        }
        blocks
    }

    /// The blocks in which a tile holds any evidence.
    pub(crate) fn of_tile(tile: &Tile) -> Self {
        let mut blocks = Self::default();
        for offset in (0..TILE_CELLS).filter(|offset| tile.cells()[*offset] != 0) {
            blocks.add(Self::holding(offset));
        }
        blocks
    }

    /// The blocks that hold some places, tile by tile, ascending.
    pub(crate) fn under(
        places: impl Iterator<Item = Point>,
        resolution: f64,
    ) -> Vec<(TileIndex, Self)> {
        let mut tiles: Vec<(TileIndex, Self)> = Vec::new();
        for place in places {
            let (tile, offset) = Cell::holding(&place, resolution).tile();
            let block = Self::holding(offset);
            // Neighbours mostly share a tile with one of the last.
            match tiles.iter_mut().rev().find(|(other, _)| *other == tile) {
                Some((_, blocks)) => blocks.add(block),
                None => tiles.push((tile, block)),
            }
        }
        tiles.sort_unstable_by_key(|(tile, _)| *tile);
        tiles
    }

    pub(crate) fn add(&mut self, other: Self) {
        self.0 |= other.0;
    }

    pub(crate) fn overlaps(self, other: Self) -> bool {
        self.0 & other.0 != 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::Chance;

    #[test]
    fn a_patch_touches_the_blocks_of_its_cells_and_no_others() {
        let mut chance = Chance(3);
        let mut chance = |upto: usize| (chance.share() * upto as f64) as usize;
        for _ in 0..200 {
            let mut cells = Box::new([0_i16; TILE_CELLS]);
            for _ in 0..3 {
                let from = chance(TILE_CELLS);
                let to = TILE_CELLS.min(from + 1 + chance(200));
                cells[from..to].fill(7);
            }
            let patch = TilePatch::from_cells(&cells);
            let mut expected = Blocks::default();
            for offset in (0..TILE_CELLS).filter(|offset| cells[*offset] != 0) {
                expected.add(Blocks::holding(offset));
            }
            assert_eq!(Blocks::of_patch(&patch), expected);
            let mut tile = Tile::default();
            tile.add(&patch);
            assert_eq!(Blocks::of_tile(&tile), expected);
        }
    }

    #[test]
    fn places_are_found_in_the_tiles_and_blocks_that_hold_them() {
        let places = [Point::new(0.01, 0.01), Point::new(0.6, 0.01), Point::new(-0.01, 3.0)];
        let under = Blocks::under(places.into_iter(), 0.05);
        let tile = |x, y| TileIndex { x, y };
        assert_eq!(under, [(tile(-1, 0), Blocks(1 << 63)), (tile(0, 0), Blocks(0b11))]);
    }
}
