//! Writing patches down from bits: the quickest way from what a look said of a tile to its runs.
//!
//! Runs that are made here ascend and do not overlap by the way they are made, so that nothing has to be
//! checked afterwards.

use super::{EvidenceRun, TILE_CELLS, TILE_SIDE, TilePatch};

/// Where the runs of one row of a tile's cells begin and end, as bits: bit 3 is the cell in column 3.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct RowRuns {
    /// The cells that are in some run.
    taken: u64,
    /// Those that are one by themselves.
    single: u64,
    /// The first cells of runs.
    firsts: u64,
    /// The last ones: as many, each at or behind its first and before the next one's.
    lasts: u64,
}

impl RowRuns {
    /// With each of these cells as a run of its own, unless it is in a run already.
    #[inline]
    #[must_use]
    pub fn with_single(self, cells: u64) -> Self {
        let cells = cells & !self.taken;
        Self {
            taken: self.taken | cells,
            single: self.single | cells,
            firsts: self.firsts | cells,
            lasts: self.lasts | cells,
        }
    }

    /// With those of these cells that are not in a run already, neighbours as one run.
    #[inline]
    #[must_use]
    pub fn with_joined(self, cells: u64) -> Self {
        let cells = cells & !self.taken;
        Self {
            taken: self.taken | cells,
            single: self.single,
            firsts: self.firsts | (cells & !(cells << 1)),
            lasts: self.lasts | (cells & !(cells >> 1)),
        }
    }
}

/// Writes patches down. Reused from tile to tile, it allocates nothing but the patches.
#[derive(Debug, Default)]
pub struct PatchPen(Vec<EvidenceRun>);

/// No evidence for no cells.
const NOTHING: EvidenceRun = EvidenceRun { start: 0, length: 0, value: 0 };

impl PatchPen {
    /// The patch of a tile's rows, from below; `value` tells what each run adds, by the offset of its first
    /// cell in the tile, ascending, and by whether it is a single one. Equal neighbours become one run, and what adds nothing none.
    /// `None` if nothing is left.
    #[inline]
    pub fn write(
        &mut self,
        rows: impl Iterator<Item = RowRuns>,
        mut value: impl FnMut(usize, bool) -> i16,
    ) -> Option<TilePatch> {
        self.0.resize(TILE_CELLS, NOTHING);
        let runs: &mut [EvidenceRun; TILE_CELLS] = self.0.first_chunk_mut()?;
        // The first `count` are done; then comes the last one, which may go on.
        let (mut count, mut start, mut end, mut last) = (0_usize, 0_u32, 0_u32, 0_i16);
        let mut of_row = 0;
        for RowRuns { mut firsts, mut lasts, single, .. } in rows.take(TILE_SIDE) {
            while firsts != 0 {
                let column = firsts.trailing_zeros();
                let (from, to) = (of_row + column, of_row + lasts.trailing_zeros() + 1);
                firsts &= firsts - 1;
                lasts &= lasts.wrapping_sub(1);
                let value = value(from as usize, single >> column & 1 == 1);
                let begins = value != last || from != end;
                count += usize::from(begins && last != 0);
                start = if begins { from } else { start };
                (end, last) = (to, value);
                let length = end - start;
                runs[count % TILE_CELLS] =
                    EvidenceRun { start: start as u16, length: length as u16, value };
            }
            of_row += TILE_SIDE as u32;
        }
        let count = count + usize::from(last != 0);
        let runs = runs.get(..count).filter(|runs| !runs.is_empty())?;
        Some(TilePatch::of_sound(runs.to_vec()))
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn what_is_written_is_a_sound_patch_of_the_values_of_all_cells(
            rows in vec((any::<u64>(), any::<u64>(), any::<u64>(), any::<u64>()), TILE_SIDE),
            sparse in any::<bool>(),
        ) {
            // What marks, and two values that neighbours share; of one cell the first that holds it counts.
            let rows: Vec<[u64; 3]> = rows
                .into_iter()
                .map(|(a, b, c, d)| if sparse { [a & b & c & d, b, u64::MAX] } else { [a & b, c | d, d] })
                .collect();
            let value = |cell: usize, _| {
                let [single, free, other] = rows[cell / TILE_SIDE].map(|bits| bits >> (cell % TILE_SIDE) & 1 == 1);
                // Some say nothing, and some neighbours the same.
                if single { (cell % 5) as i16 / 2 * 30 - 30 } else if free { -40 } else if other { -10 } else { 0 }
            };
            let cells = Box::new(std::array::from_fn(|cell| value(cell, false)));
            let runs = rows.iter().map(|[single, free, other]| {
                RowRuns::default().with_single(*single).with_joined(*free).with_joined(*other)
            });
            let patch = PatchPen::default().write(runs, value).unwrap_or_default();
            prop_assert_eq!(TilePatch::new(patch.runs().to_vec()), Ok(patch.clone()));
            prop_assert_eq!(patch, TilePatch::from_cells(&cells));
        }
    }

    #[test]
    fn a_tile_that_says_nothing_has_no_patch_and_a_full_one_all_its_runs() {
        let mut pen = PatchPen::default();
        assert_eq!(pen.write(std::iter::empty(), |_, _| 7), None);
        let all = RowRuns::default().with_single(u64::MAX);
        assert_eq!(pen.write(std::iter::repeat_n(all, TILE_SIDE), |_, _| 0), None);
        let full = pen.write(std::iter::repeat(all), |cell, _| (cell % 2) as i16 + 1);
        assert_eq!(full.map(|patch| patch.runs().len()), Some(TILE_CELLS));
        let joined = RowRuns::default().with_joined(u64::MAX);
        let one = pen.write(std::iter::repeat_n(joined, TILE_SIDE), |_, _| -40);
        assert_eq!(one.map(|patch| patch.runs().len()), Some(1), "rows that go on");
    }
}
