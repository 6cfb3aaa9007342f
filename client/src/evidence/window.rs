//! A window of tiles in which one look is worked out.
//!
//! Cells are named by column and row in the window, from its lower left corner.

use mapfold_map::raster::TILE_SIDE;

/// One bit for each cell of a tile, a word for each row.
pub(super) type Rows = [u64; TILE_SIDE];

/// How large a window is.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Window {
    pub(super) tiles_wide: usize,
    pub(super) tiles_high: usize,
}

impl Window {
    /// Tiles in the window.
    pub(super) fn tiles(self) -> usize {
        self.tiles_wide * self.tiles_high
    }

    /// Rows of cells.
    pub(super) fn rows(self) -> i32 {
        (self.tiles_high * TILE_SIDE) as i32
    }

    /// Columns of cells.
    pub(super) fn columns(self) -> i32 {
        (self.tiles_wide * TILE_SIDE) as i32
    }

    /// Where the word of a cell's row is among the words of the window, tile by tile (row by row of tiles)
    /// and in a tile row by row; `None` outside of the window.
    #[inline]
    pub(super) fn word(self, column: i32, row: i32) -> Option<usize> {
        // What is negative becomes too large.
        let (column, row) = (column as u32 as usize, row as u32 as usize);
        let side = TILE_SIDE;
        let is_inside = column < self.tiles_wide * side && row < self.tiles_high * side;
        is_inside
            .then(|| (row & !(side - 1)) * self.tiles_wide + (column & !(side - 1)) + row % side)
    }
}

/// The bits `from` to `to` (not included) of a word; `from < to <= 64`.
#[inline]
pub(super) fn bits(from: u32, to: u32) -> u64 {
    (u64::MAX << (from % 64)) & (u64::MAX >> ((64 - to) % 64))
}

/// Visits the runs of ones in a word: first bit, and the one behind the last.
#[inline]
pub(super) fn each_run(mut word: u64, mut visit: impl FnMut(u32, u32)) {
    while word != 0 {
        let from = word.trailing_zeros();
        let to = from + (word >> from).trailing_ones();
        visit(from, to);
        word &= u64::MAX.checked_shl(to).unwrap_or(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_of_ones_make_their_word() {
        for word in [0, 1, u64::MAX, 1 << 63, 0b1011, 0xf0f0_0000_0000_ffff, u64::MAX << 1] {
            let (mut made, mut last) = (0, None);
            each_run(word, |from, to| {
                assert!(last < Some(from), "{word:b}: runs ascend with gaps");
                made |= bits(from, to);
                last = Some(to);
            });
            assert_eq!(made, word);
        }
    }

    #[test]
    fn a_window_holds_its_cells_and_no_others() {
        let window = Window { tiles_wide: 3, tiles_high: 2 };
        assert_eq!(window.word(0, 0), Some(0));
        assert_eq!(window.word(191, 127), Some(6 * TILE_SIDE - 1));
        assert_eq!(window.word(66, 65), Some(4 * TILE_SIDE + 1));
        for outside in [(-1, 0), (0, -1), (192, 0), (0, 128), (i32::MIN, i32::MAX)] {
            assert_eq!(window.word(outside.0, outside.1), None);
        }
    }
}
