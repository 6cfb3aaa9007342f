//! The cells inside of an outline, 64 at a time.
//!
//! Works in a window's own coordinates: the centre of the cell in column 3 and row 5 is the point
//! (3, 5). Knows nothing of beams.

use mapfold_map::geometry::Point;
use mapfold_map::raster::TILE_SIDE;

use super::window::{Rows, Window, each_run};

/// An outline of straight edges, in any order; a cell is inside if its centre is.
///
/// An edge counts for the rows whose centre lines it crosses, its lower end included, its upper end not: so
/// edges that share their ends cross every row an even number of times, whatever the rounding, and
/// an edge that is laid twice takes itself away.
///
/// Each crossing turns one bit, that of the first cell behind it; a cell is inside if the number of bits
/// up to it in its row is odd, which is found out for 64 cells at a time.
#[derive(Debug, Default)]
pub(super) struct Outline {
    window: Window,
    /// The turned bits of the window, row by row of each tile. None is left when the outline has been visited.
    turned: Vec<u64>,
    /// Tile by tile, whether any bit was turned.
    is_turned: Vec<bool>,
    /// The first row that an edge crosses, and the one behind the last.
    rows: [i32; 2],
}

/// Bits behind the point of the numbers in which edges are followed.
const POINT: u32 = 20;

/// A number with bits behind the point, for numbers up to 2^30. Adding this much leaves the lowest bit of
/// a double just there, and is quicker than asking for a whole number.
pub(super) fn fixed(v: f64) -> i64 {
    const SHIFT: f64 = 1.5 * (1_u64 << (52 - POINT)) as f64;
    ((v + SHIFT).to_bits() as i64).wrapping_sub(SHIFT.to_bits() as i64)
}

/// The whole part of such a number, rounded down.
pub(super) fn whole(v: i64) -> i32 {
    (v >> POINT) as i32
}

/// A corner of an outline.
#[derive(Debug, Clone, Copy)]
pub(super) struct Corner {
    x: f64,
    y: f64,
    /// The first row whose centre is not below.
    row: i32,
}

/// A point as a corner.
pub(super) fn corner(p: &Point) -> Corner {
    Corner { x: p.x, y: p.y, row: whole(fixed(p.y) + (1 << POINT) - 1) }
}

impl Outline {
    /// Begins an outline in a window.
    pub(super) fn begin(&mut self, window: Window) {
        let words = window.tiles() * TILE_SIDE;
        if self.turned.len() < words {
            self.turned.resize(words, 0);
            self.is_turned.resize(window.tiles(), false);
        }
        self.rows = [window.rows(), 0];
        self.window = window;
    }

    /// Lays an edge.
    #[inline]
    pub(super) fn edge(&mut self, a: Corner, b: Corner) {
        if a.row != b.row {
            self.turn(a, b);
        }
    }

    /// Turns the bits behind an edge.
    #[inline(never)]
    fn turn(&mut self, a: Corner, b: Corner) {
        let (low, high) = if a.row <= b.row { (a, b) } else { (b, a) };
        let (from, to) = (low.row.max(0), high.row.min(self.window.rows()));
        if from >= to {
            return;
        }
        self.rows = [self.rows[0].min(from), self.rows[1].max(to)];
        let slope = (high.x - low.x) / (high.y - low.y);
        // Whether the ends of an edge that is all but level are in one row is a matter of rounding: what it
        // crosses lies between them all the same.
        let crossed = fixed(low.x + (f64::from(from) - low.y) * slope);
        let ends = [fixed(low.x), fixed(high.x)];
        let crossed = crossed.max(ends[0].min(ends[1])).min(ends[0].max(ends[1]));
        let mut x = crossed.wrapping_add((1 << POINT) - 1);
        let step = fixed(slope);
        let (mut row, to, wide) = (from as usize, to as usize, self.window.tiles_wide);
        // One row of tiles after the other: what is found by division stays the same in each.
        while row < to {
            let first = row / TILE_SIDE * wide;
            let tiles = &mut self.turned.as_chunks_mut::<TILE_SIDE>().0[first..][..wide];
            let is_turned = &mut self.is_turned[first..][..wide];
            let until = to.min((row | (TILE_SIDE - 1)) + 1);
            for row in row..until {
                // Rounding over a window of a thousand rows: a thousandth of a cell.
                let column = whole(x).max(0) as usize;
                let tile = column / TILE_SIDE;
                // What lies to the right of the window ends no row in it.
                if let (Some(cells), Some(is_turned)) =
                    (tiles.get_mut(tile), is_turned.get_mut(tile))
                {
                    cells[row % TILE_SIDE] ^= 1 << (column % TILE_SIDE);
                    *is_turned = true;
                }
                x = x.wrapping_add(step);
            }
            row = until;
        }
    }

    /// Visits the tiles of the window that hold any cell inside, with their column and row among the
    /// window's tiles. Nothing is left of the outline.
    pub(super) fn tiles(&mut self, mut visit: impl FnMut(usize, usize, &Rows)) {
        let [from, to] = self.rows.map(|row| row.max(0) as usize);
        let wide = self.window.tiles_wide;
        for y in from / TILE_SIDE..to.div_ceil(TILE_SIDE) {
            // Whether what ends a tile's rows to the left is inside: all bits or none.
            let mut inside = [0_u64; TILE_SIDE];
            let mut ends_inside = false;
            let tiles = self.turned.as_chunks_mut().0[y * wide..][..wide].iter_mut();
            let is_turned = self.is_turned[y * wide..][..wide].iter_mut();
            for (x, (tile, is_turned)) in tiles.zip(is_turned).enumerate() {
                if !std::mem::take(is_turned) {
                    if ends_inside {
                        visit(x, y, &inside);
                    }
                    continue;
                }
                let (mut any, mut last) = (0, 0);
                for (cells, inside) in tile.iter_mut().zip(&mut inside) {
                    let mut odd = *cells;
                    for shift in [1, 2, 4, 8, 16, 32] {
                        odd ^= odd << shift;
                    }
                    odd ^= *inside;
                    *inside = (odd.cast_signed() >> 63).cast_unsigned();
                    *cells = odd;
                    any |= odd;
                    last |= *inside;
                }
                ends_inside = last != 0;
                if any != 0 {
                    visit(x, y, tile);
                    *tile = [0; TILE_SIDE];
                }
            }
        }
    }

    /// Visits the pieces of rows inside, tile by tile: row, first column, column behind the last.
    /// Nothing is left of the outline.
    pub(super) fn pieces(&mut self, mut visit: impl FnMut(i32, i32, i32)) {
        self.tiles(|x, y, rows| {
            for (row, cells) in rows.iter().enumerate() {
                each_run(*cells, |from, to| {
                    let column = |at: u32| (x * TILE_SIDE) as i32 + at as i32;
                    visit((y * TILE_SIDE + row) as i32, column(from), column(to));
                });
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    fn inside(corners: &[Point]) -> Vec<(i32, i32)> {
        let mut outline = Outline::default();
        outline.begin(Window { tiles_wide: 2, tiles_high: 2 });
        for (at, corner) in corners.iter().enumerate() {
            outline.edge(super::corner(corner), super::corner(&corners[(at + 1) % corners.len()]));
        }
        let mut cells = Vec::new();
        outline.pieces(|row, from, to| cells.extend((from..to).map(|column| (row, column))));
        assert!(outline.turned.iter().all(|row| *row == 0), "something is left");
        cells.sort_unstable();
        cells
    }

    #[test]
    fn a_square_holds_the_centres_in_it() {
        let corners =
            [(1.2, 0.9), (4.0, 0.9), (4.0, 3.0), (1.2, 3.0)].map(|(x, y)| Point::new(x, y));
        assert_eq!(inside(&corners), [(1, 2), (1, 3), (2, 2), (2, 3)]);
    }

    #[test]
    fn an_edge_that_is_level_but_for_rounding_ends_where_its_ends_are() {
        // Between these two numbers a row begins, by rounding.
        let border = 3.0 + 0.5 / f64::from(1 << POINT);
        let (below, above) = (border - 1e-9, border + 1e-9);
        for (left, right) in [(below, above), (above, below)] {
            let corners = [(50.2, left), (60.8, right), (60.8, 5.5), (50.2, 5.5)]
                .map(|(x, y)| Point::new(x, y));
            let cells = inside(&corners);
            assert!(
                cells
                    .iter()
                    .all(|(row, column)| (3..=5).contains(row) && (51..=60).contains(column))
            );
            assert!(cells.len() >= 20, "{cells:?}");
        }
    }

    proptest! {
        #[test]
        fn a_star_holds_the_centres_that_its_rays_pass(
            ranges in vec(0.5..30.0f64, 3..60), x in 31.0..90.0f64, y in 31.0..90.0f64,
        ) {
            let step = std::f64::consts::TAU / ranges.len() as f64;
            let corner = |at: usize| {
                let (sin, cos) = (step * at as f64).sin_cos();
                Point::new(x + ranges[at % ranges.len()] * cos, y + ranges[at % ranges.len()] * sin)
            };
            let corners: Vec<Point> = (0..ranges.len()).map(corner).collect();
            let cells = inside(&corners);
            for row in 0..128 {
                for column in 0..128 {
                    let p = Point::new(f64::from(column) - x, f64::from(row) - y);
                    let at = (p.y.atan2(p.x).rem_euclid(std::f64::consts::TAU) / step) as usize;
                    let at = at.min(ranges.len() - 1);
                    let (a, b) = (corner(at) - Point::new(x, y), corner(at + 1) - Point::new(x, y));
                    // Left of the edge from a to b, seen along it, is inside.
                    let side = (b - a).perp(&(p - a));
                    if side.abs() > 1e-3 {
                        let held = cells.binary_search(&(row, column)).is_ok();
                        prop_assert_eq!(held, side > 0.0, "{} {}", column, row);
                    }
                }
            }
        }
    }
}
