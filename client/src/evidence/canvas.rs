//! Where one look's evidence comes together before it becomes a patch.

mod runs;

use std::collections::BTreeMap;

use mapfold_map::raster::{
    Cell, EvidencePatch, LogOdds, PatchPen, SensorClass, TILE_CELLS, TILE_SIDE, TileIndex,
};

use super::outline::whole;
use super::window::{Rows, Window, bits};
use runs::{Rounding, Sheet};

/// Grades of free evidence that whole pieces of rows can be laid with.
pub(super) const GRADES: usize = 4;

/// Tiles in the largest window: at cells of 5 cm, 800 m by 800 m.
const WINDOW_MOST: i64 = 1 << 16;

/// In what is noted of a tile, besides a bit for each grade that was laid: some cells have a value of their
/// own.
const MARKED: u8 = 1 << GRADES;

/// Evidence on a window of tiles. Reused from look to look, it allocates nothing once warm, the patch
/// that it gives away aside.
///
/// Cells are named by column and row in the window, from its lower left corner. A row of a tile's cells is
/// a word of bits. All is kept tile by tile and is clean between looks.
#[derive(Debug, Default)]
pub struct Canvas {
    corner: Option<TileIndex>,
    window: Window,
    /// What there is on a tile: grades and marks.
    noted: Vec<u8>,
    /// Grade by grade, the cells that were laid free; the highest counts.
    free: Vec<[Rows; GRADES]>,
    /// The cells that have a value of their own, whatever was laid.
    marked: Vec<u64>,
    /// Those values, millinats.
    values: Vec<i32>,
    pen: PatchPen,
    pub(super) fan: super::scanner::Fan,
    pub(super) bumps: super::scanner::Bumps,
    pub(super) outline: super::outline::Outline,
}

/// Where values of single cells are added.
pub(super) struct Marks<'a> {
    window: Window,
    noted: &'a mut [u8],
    marked: &'a mut [u64],
    values: &'a mut [i32],
}

impl Marks<'_> {
    /// Adds to the value of a cell of its own, millinats; what was laid there counts no more.
    #[inline]
    pub(super) fn add(&mut self, column: i32, row: i32, value: i32) {
        let Some(word) = self.window.word(column, row) else { return };
        self.noted[word / TILE_SIDE] |= MARKED;
        self.marked[word] |= 1 << (column as usize % TILE_SIDE);
        self.values[word * TILE_SIDE + column as usize % TILE_SIDE] += value;
    }

    /// Adds to the values of the cells that hold places in a row, a `step` of at most a cell apart, `side`
    /// of them before the middle one and as many behind it; places and steps are numbers with bits
    /// behind the point ([`fixed`](super::outline::fixed)).
    #[inline]
    pub(super) fn add_along(
        &mut self,
        [middle_x, middle_y]: [i64; 2],
        [step_x, step_y]: [i64; 2],
        side: u32,
        added: impl Iterator<Item = i32>,
    ) {
        let back = i64::from(side);
        let (mut x, mut y) = (middle_x - back * step_x, middle_y - back * step_y);
        let (column, row) = (whole(middle_x), whole(middle_y));
        let Some(word) = self.window.word(column, row) else { return };
        let tile = word / TILE_SIDE;
        // Mostly all in one tile: where its border is farther away than they reach.
        let reach = side + 1;
        let inner = (TILE_SIDE as u32).saturating_sub(2 * reach);
        let is_inner = |v: i32| (v as u32 % TILE_SIDE as u32).wrapping_sub(reach) < inner;
        if is_inner(column)
            && is_inner(row)
            && let Some(noted) = self.noted.get_mut(tile)
            && let Some(marked) = self.marked.as_chunks_mut::<TILE_SIDE>().0.get_mut(tile)
            && let Some(values) = self.values.as_chunks_mut::<TILE_CELLS>().0.get_mut(tile)
        {
            *noted |= MARKED;
            for value in added {
                let (column, row) = (whole(x) as usize % TILE_SIDE, whole(y) as usize % TILE_SIDE);
                marked[row] |= 1 << column;
                values[row * TILE_SIDE + column] += value;
                (x, y) = (x + step_x, y + step_y);
            }
        } else {
            for value in added {
                self.add(whole(x), whole(y), value);
                (x, y) = (x + step_x, y + step_y);
            }
        }
    }
}

impl Canvas {
    /// Begins a look that marks no cell outside of `low` to `high`; answers the cell in the window's
    /// corner and the window. `None` if that is larger than anything that a sensor sees.
    pub(super) fn begin(&mut self, low: Cell, high: Cell) -> Option<(Cell, Window)> {
        let (first, last) = (low.tile().0, high.tile().0);
        let wide = i64::from(last.x) - i64::from(first.x) + 1;
        let high = i64::from(last.y) - i64::from(first.y) + 1;
        if wide < 1 || high < 1 || wide.checked_mul(high)? > WINDOW_MOST {
            return None;
        }
        self.corner = Some(first);
        self.window = Window { tiles_wide: wide as usize, tiles_high: high as usize };
        let tiles = self.window.tiles();
        if self.noted.len() < tiles {
            // All is clean, so that nothing has to be kept.
            self.noted = vec![0; tiles];
            self.free = vec![[[0; TILE_SIDE]; GRADES]; tiles];
            self.marked = vec![0; tiles * TILE_SIDE];
            self.values = vec![0; tiles * TILE_CELLS];
        }
        Some((first.cell(0), self.window))
    }

    /// Where to lay a grade of "free" on the cells of a tile, by its column and row among the window's.
    #[inline]
    pub(super) fn free(&mut self, x: usize, y: usize, grade: usize) -> Option<&mut Rows> {
        let tile = y * self.window.tiles_wide + x;
        *self.noted.get_mut(tile)? |= 1 << (grade % GRADES);
        Some(&mut self.free.get_mut(tile)?[grade % GRADES])
    }

    /// Lays a grade of "free" on the cells `from` to `to` (not included) of a row.
    #[inline]
    pub(super) fn lay(&mut self, row: i32, from: i32, to: i32, grade: usize) {
        let (to, mut from) = (to.min(self.window.columns()), from.max(0));
        let grade = grade % GRADES;
        while from < to {
            let Some(word) = self.window.word(from, row) else { return };
            let tile = word / TILE_SIDE;
            let (Some(noted), Some(free)) = (self.noted.get_mut(tile), self.free.get_mut(tile))
            else {
                return;
            };
            let until = to.min((from | (TILE_SIDE as i32 - 1)) + 1);
            *noted |= 1 << grade;
            free[grade][word % TILE_SIDE] |= bits(from as u32 % 64, (until - 1) as u32 % 64 + 1);
            from = until;
        }
    }

    /// To mark single cells.
    pub(super) fn marks(&mut self) -> Marks<'_> {
        Marks {
            window: self.window,
            noted: &mut self.noted,
            marked: &mut self.marked,
            values: &mut self.values,
        }
    }

    /// Takes the evidence out as a patch, capped and rounded to `step` (a multiple of the log-odds
    /// step), and leaves the canvas clean. `grades` are what was laid, in millinats.
    pub(super) fn take(
        &mut self,
        class: SensorClass,
        step: LogOdds,
        grades: [i16; GRADES],
    ) -> EvidencePatch {
        let rounding = Rounding::to(step);
        let grades = grades.map(|grade| rounding.of(i32::from(grade)));
        let mut tiles = BTreeMap::new();
        let Some(corner) = self.corner.take() else { return EvidencePatch { class, tiles } };
        let window = self.window;
        // In the order of the tiles' indices.
        for x in 0..window.tiles_wide {
            for y in 0..window.tiles_high {
                let tile = y * window.tiles_wide + x;
                let noted = std::mem::take(&mut self.noted[tile]);
                if noted == 0 {
                    continue;
                }
                let sheet = Sheet {
                    noted,
                    free: &mut self.free[tile],
                    marked: &mut self.marked.as_chunks_mut().0[tile],
                    values: &mut self.values.as_chunks_mut().0[tile],
                };
                if let Some(patch) = runs::take(sheet, grades, rounding, &mut self.pen) {
                    let index = TileIndex { x: corner.x + x as i32, y: corner.y + y as i32 };
                    tiles.insert(index, patch);
                }
            }
        }
        EvidencePatch { class, tiles }
    }
}

#[cfg(test)]
mod tests {
    use mapfold_map::raster::TilePatch;

    use super::*;

    const GRADED: [i16; GRADES] = [-100, -200, -300, -400];

    fn canvas() -> Canvas {
        let mut canvas = Canvas::default();
        let cell = |column, row| Cell { column, row };
        assert_eq!(
            canvas.begin(cell(-5, 3), cell(70, 20)),
            Some((cell(-64, 0), Window { tiles_wide: 3, tiles_high: 1 }))
        );
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
        canvas.marks().add(67, 0, 500);
        canvas.lay(0, 64, 76, 0);
        canvas.marks().add(67, 0, 250);
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
            canvas.marks().add(65, 0, 850);
            canvas.marks().add(73, 0, -400);
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
        canvas.marks().add(-1, 3, 900);
        canvas.marks().add(192, 3, 900);
        let row = 5 * 64;
        assert_eq!(
            painted(&mut canvas, 10),
            // The full row of the middle tile goes on in the next row.
            [(-1, row + 60, 4, -40), (0, row, 66, -40), (1, row, 3, -40), (1, row + 126, 2, -30)]
        );
    }

    #[test]
    fn a_window_that_no_sensor_sees_is_refused() {
        let mut canvas = Canvas::default();
        let far = Cell { column: i32::MAX, row: 0 };
        assert_eq!(canvas.begin(Cell { column: i32::MIN, row: 0 }, far), None);
        canvas.marks().add(0, 0, 900);
        assert!(painted(&mut canvas, 1).is_empty());
    }
}
