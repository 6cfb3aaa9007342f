//! Bits and values of a tile, written down as the runs of a patch.

use mapfold_map::raster::{EvidenceRun, LogOdds, TILE_CELLS, TILE_SIDE, TilePatch};

use super::{GRADES, MARKED};
use crate::evidence::window::Rows;

/// Most evidence for "free" that one look may give a cell, millinats: all its beams share one pose
/// error.
const FREE_MOST: i32 = -2000;
/// Most evidence for "occupied" that one look may give a cell, millinats.
const OCCUPIED_MOST: i32 = 3000;
/// Millinats of a log-odds step.
const STEP: i32 = (1000.0 / LogOdds::STEPS_PER_NAT) as i32;

/// No evidence for no cells.
const NOTHING: EvidenceRun = EvidenceRun { start: 0, length: 0, value: 0 };

/// A tile under way.
pub(super) struct Sheet<'a> {
    /// The grades that were laid, and whether there are marks.
    pub(super) noted: u8,
    pub(super) free: &'a mut [Rows; GRADES],
    pub(super) marked: &'a mut Rows,
    pub(super) values: &'a mut [i32; TILE_CELLS],
}

/// Where the runs of a tile are written down. Reused from tile to tile.
#[derive(Debug, Default)]
pub(super) struct Runs(Vec<EvidenceRun>);

impl Runs {
    /// Takes a tile's cells out as a patch, if they hold any evidence, and leaves it clean.
    pub(super) fn take(
        &mut self,
        sheet: Sheet,
        grades: [i16; GRADES],
        rounding: Rounding,
    ) -> Option<TilePatch> {
        let Sheet { noted, free, marked, values } = sheet;
        self.0.resize(TILE_CELLS, NOTHING);
        let mut pen = Pen { runs: self.0.first_chunk_mut()?, count: 0, start: 0, end: 0, value: 0 };
        let laid = noted & !MARKED;
        let only = laid.trailing_zeros() as usize % GRADES;
        if laid & laid.wrapping_sub(1) == 0 {
            let (free, grade) = (&mut free[only], grades[only]);
            for (row, (free, marked)) in free.iter().zip(&*marked).enumerate() {
                let free = free & !marked;
                let starts = (free & !(free << 1)) | marked;
                let of_row = row * TILE_SIDE;
                pen.row(starts, free & !starts, of_row, |at| {
                    if marked >> at & 1 == 0 {
                        return grade;
                    }
                    rounding.of(std::mem::take(&mut values[(of_row + at as usize) % TILE_CELLS]))
                });
            }
            *free = [0; TILE_SIDE];
        } else {
            for (row, marked) in marked.iter().enumerate() {
                let (mut hidden, mut starts) = (*marked, *marked);
                // Of each grade, what no higher one and no mark hides.
                let mut seen = [0; GRADES];
                for (seen, free) in seen.iter_mut().zip(&*free).rev() {
                    *seen = free[row] & !hidden;
                    hidden |= *seen;
                    starts |= *seen & !(*seen << 1);
                }
                let of_row = row * TILE_SIDE;
                pen.row(starts, hidden & !starts, of_row, |at| {
                    let value = &mut values[(of_row + at as usize) % TILE_CELLS];
                    let laid = seen.iter().zip(&grades).find(|(seen, _)| **seen >> at & 1 == 1);
                    laid.map_or_else(|| rounding.of(std::mem::take(value)), |(_, grade)| *grade)
                });
            }
            *free = [[0; TILE_SIDE]; GRADES];
        }
        *marked = [0; TILE_SIDE];
        pen.patch()
    }
}

/// Writes runs down.
struct Pen<'a> {
    /// The first `count` are done; then comes the last one, which may go on.
    runs: &'a mut [EvidenceRun; TILE_CELLS],
    count: usize,
    /// The last run's first cell, the one behind it, and its value.
    start: u32,
    end: u32,
    value: i16,
}

impl Pen<'_> {
    /// Writes down a row's runs: they begin at `starts` and go on as far as `goes_on`.
    #[inline]
    fn row(
        &mut self,
        mut starts: u64,
        goes_on: u64,
        of_row: usize,
        mut value: impl FnMut(u32) -> i16,
    ) {
        while starts != 0 {
            let at = starts.trailing_zeros();
            starts &= starts - 1;
            let value = value(at);
            let length = 1 + (!(goes_on >> at >> 1)).trailing_zeros();
            self.push(of_row as u32 + at, length, value);
        }
    }

    /// Adds a run, to the last one if it only goes on.
    #[inline]
    fn push(&mut self, start: u32, length: u32, value: i16) {
        let begins = self.value != value || self.end != start;
        self.count += usize::from(begins && self.value != 0);
        self.start = if begins { start } else { self.start };
        (self.end, self.value) = (start + length, value);
        let length = self.end - self.start;
        self.runs[self.count % TILE_CELLS] =
            EvidenceRun { start: self.start as u16, length: length as u16, value };
    }

    /// The runs as a patch; `None` if there are none.
    fn patch(self) -> Option<TilePatch> {
        let count = self.count + usize::from(self.value != 0);
        let runs = self.runs.get(..count).filter(|runs| !runs.is_empty())?;
        // Runs in the order of the cells are a patch.
        TilePatch::new(runs.to_vec()).ok()
    }
}

/// How millinats become log-odds steps.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rounding {
    /// Millinats; enough to be added to make any evidence positive, and half a unit.
    offset: i64,
    /// The same in steps, without the half.
    offset_steps: i64,
    /// In 2^-32.
    units_per_millinat: i64,
    steps_per_unit: i64,
}

impl Rounding {
    pub(super) fn to(step: LogOdds) -> Self {
        let steps_per_unit = i64::from(step.0.max(1));
        let unit = steps_per_unit * i64::from(STEP);
        let below = i64::from(-FREE_MOST) / unit + 1;
        Self {
            offset: below * unit + unit / 2,
            offset_steps: below * steps_per_unit,
            // A little too much, so that whole units stay whole.
            units_per_millinat: (1 << 32) / unit + 1,
            steps_per_unit,
        }
    }

    /// Capped, and rounded to the nearest unit, halves away from zero.
    #[inline]
    pub(super) fn of(self, value: i32) -> i16 {
        let value = value.clamp(FREE_MOST, OCCUPIED_MOST);
        let positive = i64::from(value + (value >> 31)) + self.offset;
        let units = (positive * self.units_per_millinat) >> 32;
        (units * self.steps_per_unit - self.offset_steps) as i16
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn evidence_is_rounded_to_the_nearest_step() {
        let of = |value| Rounding::to(LogOdds(10)).of(value);
        let rounded = [-400, -351, -349, -51, -49, 49, 51, 849, 851].map(of);
        assert_eq!(rounded, [-40, -40, -30, -10, 0, 0, 10, 80, 90]);
        for step in [1, 2, 5, 7, 10, 50] {
            let rounding = Rounding::to(LogOdds(step));
            for value in -2500..3500 {
                let capped = f64::from(value).clamp(-2000.0, 3000.0);
                let units = (capped / f64::from(10 * step)).round() as i32;
                assert_eq!(i32::from(rounding.of(value)), units * step, "{step} {value}");
            }
        }
        assert_eq!([-4, -6, 4, 6].map(|v| Rounding::to(LogOdds(1)).of(v)), [0, -1, 0, 1]);
    }
}
