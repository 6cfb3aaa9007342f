//! Bits and values of a tile, written down as the runs of a patch.

use mapfold_map::raster::{LogOdds, PatchPen, RowRuns, TILE_CELLS, TILE_SIDE, TilePatch};

use super::{GRADES, MARKED};
use crate::evidence::window::Rows;

/// Most evidence for "free" that one look may give a cell, millinats: all its beams share one pose
/// error.
const FREE_MOST: i32 = -2000;
/// Most evidence for "occupied" that one look may give a cell, millinats.
const OCCUPIED_MOST: i32 = 3000;
/// Millinats of a log-odds step.
const STEP: i32 = (1000.0 / LogOdds::STEPS_PER_NAT) as i32;

/// A tile under way.
pub(super) struct Sheet<'a> {
    /// The grades that were laid, and whether there are marks.
    pub(super) noted: u8,
    pub(super) free: &'a mut [Rows; GRADES],
    pub(super) marked: &'a mut Rows,
    pub(super) values: &'a mut [i32; TILE_CELLS],
}

/// Takes a tile's cells out as a patch, if they hold any evidence, and leaves it clean.
pub(super) fn take(
    sheet: Sheet,
    grades: [i16; GRADES],
    rounding: Rounding,
    pen: &mut PatchPen,
) -> Option<TilePatch> {
    let Sheet { noted, free, marked, values } = sheet;
    let laid = noted & !MARKED;
    let only = laid.trailing_zeros() as usize % GRADES;
    let patch = if laid & laid.wrapping_sub(1) == 0 {
        let grade = grades[only];
        let rows = free[only]
            .iter()
            .zip(&*marked)
            .map(|(free, marked)| RowRuns::default().with_single(*marked).with_joined(*free));
        let patch = pen.write(rows, |cell, is_marked| {
            // Without a branch, for which cells are marked is anyone's guess: others have no value.
            let value = rounding.of(std::mem::take(&mut values[cell % TILE_CELLS]));
            if is_marked { value } else { grade }
        });
        free[only] = [0; TILE_SIDE];
        patch
    } else {
        // Of each grade, what no higher one and no mark hides.
        let rows = marked.iter().enumerate().map(|(row, marked)| {
            let marks = RowRuns::default().with_single(*marked);
            free.iter().rev().fold(marks, |runs, free| runs.with_joined(free[row]))
        });
        let patch = pen.write(rows, |cell, is_marked| {
            let (row, column) = (cell / TILE_SIDE % TILE_SIDE, cell % TILE_SIDE);
            if is_marked {
                return rounding.of(std::mem::take(&mut values[cell % TILE_CELLS]));
            }
            let laid =
                free.iter().zip(&grades).rev().find(|(free, _)| free[row] >> column & 1 == 1);
            laid.map_or(0, |(_, grade)| *grade)
        });
        *free = [[0; TILE_SIDE]; GRADES];
        patch
    };
    *marked = [0; TILE_SIDE];
    patch
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
