//! Upper bounds over blocks of places, coarse to fine.
//!
//! Level `k` holds, for every position of a window of `2^k` cells, the greatest value in it. Windows are kept
//! at steps of half their side, and half as much longer for it, so that a block's own window is always
//! inside one that is kept: a third of the memory of all positions, for bounds hardly looser.

/// Levels: blocks of 64, 32, ... 1 cells.
pub(super) const LEVELS: usize = 7;

/// A rectangle of values with a margin around it, so that what reaches beyond needs no asking.
#[derive(Debug, Clone, PartialEq, Default)]
struct Layer {
    /// Cells are so many halvings coarser than the finest.
    shift: u32,
    width: usize,
    /// Cells of the margin to the left and below.
    margin: i32,
    cells: Vec<u8>,
}

/// All levels of a map.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Pyramid {
    layers: Vec<Layer>,
    outside: u8,
}

impl Pyramid {
    /// Of `width` by `height` values, row by row from below; beyond them it is `outside`. Blocks are asked
    /// for with offsets of at most `reach` cells.
    pub(super) fn new(
        values: &[u8],
        (width, height): (usize, usize),
        outside: u8,
        reach: usize,
    ) -> Self {
        // A multiple of the coarsest step, so that every level's margin is whole.
        let coarsest = 1 << (LEVELS - 1);
        let margin = (reach + coarsest).next_multiple_of(coarsest);
        let (full_width, full_height) = (width + 2 * margin, height + 2 * margin);
        let mut window = vec![outside; full_width * full_height];
        for (row, values) in values.chunks_exact(width.max(1)).enumerate() {
            let start = (row + margin) * full_width + margin;
            window[start..start + width].copy_from_slice(values);
        }
        let whole = |shift: u32, cells: Vec<u8>, width: usize| Layer {
            shift,
            width,
            margin: (margin >> shift) as i32,
            cells,
        };
        let mut layers = vec![whole(0, window.clone(), full_width)];
        for level in 1..LEVELS as u32 {
            let half = 1 << (level - 1);
            widen(&mut window, full_width, half);
            layers.push(if half == 1 {
                let mut kept = window.clone();
                widen(&mut kept, full_width, 1);
                whole(0, kept, full_width)
            } else {
                let mut kept = Vec::new();
                let columns = full_width.div_ceil(half);
                for y in (0..full_height).step_by(half) {
                    let above = (y + half).min(full_height - 1);
                    for x in (0..full_width).step_by(half) {
                        let right = (x + half).min(full_width - 1);
                        let at = |x: usize, y: usize| window[y * full_width + x];
                        kept.push(
                            at(x, y).max(at(right, y)).max(at(x, above)).max(at(right, above)),
                        );
                    }
                }
                whole(level - 1, kept, columns)
            });
        }
        Self { layers, outside }
    }

    /// Where the value of a cell lies in a level, as a sum with that of another: `place(a) + offset(b)` is the
    /// place of `a + b` if `a` begins a block of the level.
    pub(super) fn place(&self, level: usize, x: i32, y: i32) -> i64 {
        let margin = self.layers[level].margin;
        self.offset(level, x, y) + i64::from(margin) * (self.layers[level].width as i64 + 1)
    }

    /// See [`Self::place`].
    pub(super) fn offset(&self, level: usize, x: i32, y: i32) -> i64 {
        let layer = &self.layers[level];
        i64::from(y >> layer.shift) * layer.width as i64 + i64::from(x >> layer.shift)
    }

    /// No less than the greatest value in the block of the level that a place and an offset give.
    pub(super) fn value(&self, level: usize, place: i64) -> u8 {
        let found = usize::try_from(place).ok().and_then(|at| self.layers[level].cells.get(at));
        found.copied().unwrap_or(self.outside)
    }
}

/// Makes each value the greatest of itself, that `by` to the right, that `by` above, and that of both.
fn widen(values: &mut [u8], width: usize, by: usize) {
    for row in values.chunks_exact_mut(width) {
        for x in 0..width.saturating_sub(by) {
            row[x] = row[x].max(row[x + by]);
        }
    }
    let down = by * width;
    for at in 0..values.len().saturating_sub(down) {
        values[at] = values[at].max(values[at + down]);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn no_block_holds_more_than_its_bound(
            values in prop::collection::vec(0..50_u8, 21 * 13),
            outside in 0..50_u8,
            (x, y) in (0..21_i32, 0..13_i32),
            (dx, dy) in (-40..40_i32, -40..40_i32),
        ) {
            let pyramid = Pyramid::new(&values, (21, 13), outside, 40);
            let at = |x: i32, y: i32| {
                let inside = (0..21).contains(&x) && (0..13).contains(&y);
                if inside { values[(y * 21 + x) as usize] } else { outside }
            };
            for level in 0..LEVELS {
                let side = 1 << level;
                let (x, y) = (x / side * side, y / side * side);
                let bound = pyramid.value(
                    level,
                    pyramid.place(level, x, y) + pyramid.offset(level, dx, dy),
                );
                let block = (0..side).flat_map(|i| (0..side).map(move |j| (i, j)));
                let most = block.map(|(i, j)| at(x + dx + i, y + dy + j)).max().unwrap();
                prop_assert!(bound >= most);
                if level == 0 {
                    prop_assert_eq!(bound, most);
                }
            }
        }
    }
}
