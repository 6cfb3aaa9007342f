//! Where one look's evidence comes together before it becomes a patch.

use mapfold_map::raster::{
    Cell, EvidencePatch, EvidenceRun, LogOdds, SensorClass, TILE_CELLS, TILE_SIDE, TileIndex,
    TilePatch,
};

/// Most evidence for "free" that one look may give a cell, millinats: all its beams share one pose
/// error.
const FREE_MOST: i32 = -2000;
/// Most evidence for "occupied" that one look may give a cell, millinats.
const OCCUPIED_MOST: i32 = 3000;
/// Millinats of a log-odds step.
const STEP: i32 = (1000.0 / LogOdds::STEPS_PER_NAT) as i32;

/// Grades of free evidence that whole pieces of rows can be laid with.
pub(super) const GRADES: usize = 4;

/// No sheet has been taken for a place in the window yet.
const NONE: u32 = u32::MAX;

/// Tiles along each side of the largest window: at cells of 5 cm, 13 km.
const WINDOW_MOST: i32 = 4096;

/// A tile under way. A row of cells is a word of bits.
#[derive(Debug)]
struct Sheet {
    index: TileIndex,
    /// The rows on which anything is.
    rows: u64,
    /// Row by row, the cells that were laid free, grade by grade; the highest counts.
    free: [[u64; GRADES]; TILE_SIDE],
    /// Row by row, the cells that have a value of their own, whatever was laid.
    marked: [u64; TILE_SIDE],
    /// Those values, millinats.
    values: Box<[i16; TILE_CELLS]>,
}

/// Evidence on a window of tiles. Reused from look to look, it allocates nothing once warm, the patch
/// that it gives away aside.
///
/// Cells are named by column and row in the window, from its lower left corner.
#[derive(Debug, Default)]
pub struct Canvas {
    corner: Option<TileIndex>,
    tiles_wide: usize,
    /// Tile by tile of the window, the sheet that stands for it.
    places: Vec<u32>,
    /// Those in use first.
    sheets: Vec<Sheet>,
    used: usize,
    runs: Vec<EvidenceRun>,
    order: Vec<(TileIndex, u32)>,
    pub(super) fan: super::scanner::Fan,
    pub(super) outline: super::outline::Outline,
}

impl Sheet {
    fn blank(index: TileIndex) -> Self {
        Self {
            index,
            rows: 0,
            free: [[0; GRADES]; TILE_SIDE],
            marked: [0; TILE_SIDE],
            values: Box::new([0; TILE_CELLS]),
        }
    }
}

impl Canvas {
    /// Begins a look that marks no cell outside of `low` to `high`; answers the cell in the window's
    /// corner and the window's height in cells. `None` if that is larger than anything that a
    /// sensor sees.
    pub(super) fn begin(&mut self, low: Cell, high: Cell) -> Option<(Cell, usize)> {
        let (first, last) = (low.tile().0, high.tile().0);
        let wide = last.x.checked_sub(first.x)?;
        let high = last.y.checked_sub(first.y)?;
        if !(0..WINDOW_MOST).contains(&wide) || !(0..WINDOW_MOST).contains(&high) {
            return None;
        }
        self.corner = Some(first);
        self.tiles_wide = wide as usize + 1;
        let tiles_high = high as usize + 1;
        self.places.clear();
        self.places.resize(self.tiles_wide * tiles_high, NONE);
        Some((first.cell(0), tiles_high * TILE_SIDE))
    }

    /// The sheet under a tile of the window; `None` outside of it.
    #[inline]
    fn sheet(&mut self, x: usize, y: usize) -> Option<&mut Sheet> {
        if x >= self.tiles_wide {
            return None;
        }
        let place = self.places.get_mut(y * self.tiles_wide + x)?;
        if *place == NONE {
            *place = self.used as u32;
            let corner = self.corner?;
            let index = TileIndex { x: corner.x + x as i32, y: corner.y + y as i32 };
            match self.sheets.get_mut(self.used) {
                Some(sheet) => sheet.index = index,
                None => self.sheets.push(Sheet::blank(index)),
            }
            self.used += 1;
        }
        self.sheets.get_mut(*place as usize)
    }

    /// Lays a grade of "free" on the cells `from` to `to` (not included) of a row.
    pub(super) fn lay(&mut self, row: i32, from: i32, to: i32, grade: usize) {
        let (row, from, to) = (row as usize, from as usize, to as usize);
        if from >= to {
            return;
        }
        let (first, last) = (from / TILE_SIDE, (to - 1) / TILE_SIDE);
        let at = row % TILE_SIDE;
        for x in first..=last {
            let Some(sheet) = self.sheet(x, row / TILE_SIDE) else { return };
            let mut cells = u64::MAX;
            if x == first {
                cells &= u64::MAX << (from % TILE_SIDE);
            }
            if x == last {
                cells &= u64::MAX >> (TILE_SIDE - 1 - (to - 1) % TILE_SIDE);
            }
            sheet.rows |= 1 << at;
            sheet.free[at][grade % GRADES] |= cells;
        }
    }

    /// Adds to the value of a cell of its own, millinats; what was laid there counts no more.
    #[inline]
    pub(super) fn add(&mut self, column: i32, row: i32, value: i16) {
        let (column, row) = (column as usize, row as usize);
        let Some(sheet) = self.sheet(column / TILE_SIDE, row / TILE_SIDE) else { return };
        let (column, row) = (column % TILE_SIDE, row % TILE_SIDE);
        sheet.rows |= 1 << row;
        sheet.marked[row] |= 1 << column;
        let cell = &mut sheet.values[row * TILE_SIDE + column];
        *cell = cell.saturating_add(value);
    }

    /// Takes the evidence out as a patch, capped and rounded to `step` (a multiple of the log-odds
    /// step), and leaves the canvas clean. `grades` are what was laid, in millinats.
    pub(super) fn take(
        &mut self,
        class: SensorClass,
        step: LogOdds,
        grades: [i16; GRADES],
    ) -> EvidencePatch {
        let sheets = &mut self.sheets[..self.used];
        self.order.clear();
        self.order.extend(sheets.iter().zip(0..).map(|(sheet, at)| (sheet.index, at)));
        self.order.sort_unstable();
        let rounding = Rounding::to(step);
        let grades = grades.map(|grade| rounding.of(grade));
        let runs = &mut self.runs;
        let tiles = self.order.iter().filter_map(|(index, at)| {
            runs.clear();
            take_runs(&mut sheets[*at as usize], grades, &rounding, runs);
            // Runs in the order of the cells are a patch; without any, the tile does not belong there.
            let patch = TilePatch::new(runs.clone()).ok()?;
            (!runs.is_empty()).then_some((*index, patch))
        });
        let tiles = tiles.collect();
        self.used = 0;
        self.corner = None;
        EvidencePatch { class, tiles }
    }
}

/// Takes a sheet's cells out as runs, and leaves it clean.
fn take_runs(
    sheet: &mut Sheet,
    grades: [i16; GRADES],
    rounding: &Rounding,
    runs: &mut Vec<EvidenceRun>,
) {
    let mut rows = std::mem::take(&mut sheet.rows);
    while rows != 0 {
        let row = rows.trailing_zeros() as usize;
        rows &= rows - 1;
        let start = row * TILE_SIDE;
        let marked = std::mem::take(&mut sheet.marked[row]);
        // Of each grade, what no higher one and no mark hides.
        let mut free = std::mem::take(&mut sheet.free[row]);
        let mut hidden = marked;
        for cells in free.iter_mut().rev() {
            *cells &= !hidden;
            hidden |= *cells;
        }
        let mut left = hidden;
        while left != 0 {
            let at = left.trailing_zeros();
            let (value, length) = if marked >> at & 1 == 1 {
                let value = std::mem::take(&mut sheet.values[start + at as usize]);
                (rounding.of(value), 1)
            } else {
                let laid = free.iter().zip(&grades).find(|(cells, _)| **cells >> at & 1 == 1);
                laid.map_or((0, 1), |(cells, value)| (*value, (cells >> at).trailing_ones()))
            };
            if value != 0 {
                push(runs, start + at as usize, length as usize, value);
            }
            let Some(behind) = u64::MAX.checked_shl(at + length) else { break };
            left &= behind;
        }
    }
}

/// How millinats become log-odds steps.
struct Rounding {
    /// Millinats.
    half_unit: i32,
    /// In 2^-22.
    units_per_millinat: i32,
    steps_per_unit: i32,
}

impl Rounding {
    fn to(step: LogOdds) -> Self {
        let unit = step.0.max(1) * STEP;
        // A little too much, so that whole units stay whole.
        let units_per_millinat = (1 << 22) / unit + 1;
        Self { half_unit: unit / 2, units_per_millinat, steps_per_unit: step.0 }
    }

    /// Capped, and rounded to the nearest unit.
    fn of(&self, value: i16) -> i16 {
        let value = i32::from(value).clamp(FREE_MOST, OCCUPIED_MOST);
        let units = ((value.abs() + self.half_unit) as u32 * self.units_per_millinat as u32) >> 22;
        (value.signum() * units as i32 * self.steps_per_unit) as i16
    }
}

fn push(runs: &mut Vec<EvidenceRun>, start: usize, length: usize, value: i16) {
    match runs.last_mut() {
        Some(run) if run.value == value && run.range().end == start => run.length += length as u16,
        _ => runs.push(EvidenceRun { start: start as u16, length: length as u16, value }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GRADED: [i16; GRADES] = [-100, -200, -300, -400];

    fn canvas() -> Canvas {
        let mut canvas = Canvas::default();
        let cell = |column, row| Cell { column, row };
        assert_eq!(canvas.begin(cell(-5, 3), cell(70, 20)), Some((cell(-64, 0), 64)));
        canvas
    }

    fn painted(canvas: &mut Canvas, step: i32) -> Vec<(i32, u16, u16, i16)> {
        let patch = canvas.take(SensorClass::Scanner, LogOdds(step), GRADED);
        let of = |(index, tile): (&TileIndex, &TilePatch)| -> Vec<_> {
            tile.runs().iter().map(|run| (index.x, run.start, run.length, run.value)).collect()
        };
        patch.tiles.iter().flat_map(of).collect()
    }

    #[test]
    fn a_mark_outdoes_what_is_laid_and_the_higher_grade_the_lower() {
        let mut canvas = canvas();
        canvas.lay(0, 64, 74, 3);
        canvas.add(67, 0, 500);
        canvas.lay(0, 64, 76, 0);
        canvas.add(67, 0, 250);
        assert_eq!(
            painted(&mut canvas, 1),
            [(0, 0, 3, -40), (0, 3, 1, 75), (0, 4, 6, -40), (0, 10, 2, -10)]
        );
        assert!(painted(&mut canvas, 1).is_empty());
    }

    #[test]
    fn one_look_cannot_say_more_than_its_cap() {
        let mut canvas = canvas();
        for _ in 0..100 {
            canvas.add(65, 0, 850);
            canvas.add(73, 0, -400);
        }
        assert_eq!(painted(&mut canvas, 10), [(0, 1, 1, 300), (0, 9, 1, -200)]);
    }

    #[test]
    fn rows_are_laid_across_tiles_and_what_lies_outside_of_the_window_is_left_out() {
        let mut canvas = canvas();
        canvas.lay(5, 60, 131, 3);
        canvas.lay(6, 64, 66, 3);
        canvas.lay(6, 190, 300, 2);
        canvas.lay(64, 0, 9, 2);
        canvas.add(-1, 3, 900);
        canvas.add(192, 3, 900);
        let row = 5 * 64;
        assert_eq!(
            painted(&mut canvas, 10),
            // The full row of the middle tile goes on in the next row.
            [(-1, row + 60, 4, -40), (0, row, 66, -40), (1, row, 3, -40), (1, row + 126, 2, -30)]
        );
    }

    #[test]
    fn evidence_is_rounded_to_the_nearest_step() {
        let of = |value| Rounding::to(LogOdds(10)).of(value);
        let rounded = [-400, -351, -349, -51, -49, 49, 51, 849, 851].map(of);
        assert_eq!(rounded, [-40, -40, -30, -10, 0, 0, 10, 80, 90]);
        for step in [1, 2, 5, 7, 10, 50] {
            let rounding = Rounding::to(LogOdds(step));
            for value in -2500..3500_i16 {
                let capped = f64::from(value).clamp(-2000.0, 3000.0);
                let units = (capped / f64::from(10 * step)).round() as i32;
                assert_eq!(i32::from(rounding.of(value)), units * step, "{step} {value}");
            }
        }
        assert_eq!([-4, -6, 4, 6].map(|v| Rounding::to(LogOdds(1)).of(v)), [0, -1, 0, 1]);
    }

    #[test]
    fn a_window_that_no_sensor_sees_is_refused() {
        let mut canvas = Canvas::default();
        let far = Cell { column: i32::MAX, row: 0 };
        assert_eq!(canvas.begin(Cell { column: i32::MIN, row: 0 }, far), None);
        canvas.add(0, 0, 900);
        assert!(painted(&mut canvas, 1).is_empty());
    }
}
