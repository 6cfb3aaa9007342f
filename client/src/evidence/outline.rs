//! The cells inside of an outline, row by row.
//!
//! Works in a window's own coordinates: the centre of the cell in column 3 and row 5 is the point
//! (3, 5). Knows nothing of beams.

use mapfold_map::geometry::Point;

/// An outline of straight edges, in any order; a cell is inside if its centre is.
///
/// An edge counts for the rows whose centre lines it crosses, its lower end included, its upper end not: so
/// edges that share their ends cross every row an even number of times, whatever the rounding, and
/// an edge that is laid twice takes itself away.
#[derive(Debug, Default)]
pub(super) struct Outline {
    /// Row and column of the first cell behind each crossing.
    crossings: Vec<(u32, i32)>,
    /// Row by row, where its crossings begin in `columns`.
    starts: Vec<u32>,
    columns: Vec<i32>,
    rows: usize,
}

/// Bits behind the point of the numbers in which edges are followed.
const POINT: u32 = 20;
const ONE: f64 = (1_u64 << POINT) as f64;

/// A corner of an outline, with so many bits behind the point.
pub(super) type Corner = [i64; 2];

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

/// A point as a corner.
pub(super) fn corner(p: &Point) -> Corner {
    [fixed(p.x), fixed(p.y)]
}

/// The first row whose centre is not below.
fn row(y: i64) -> i32 {
    whole(y + (1 << POINT) - 1)
}

impl Outline {
    /// Begins an outline in a window of so many rows.
    pub(super) fn begin(&mut self, rows: usize) {
        self.rows = rows;
        self.crossings.clear();
        self.starts.clear();
        self.starts.resize(rows + 1, 0);
    }

    /// Lays an edge.
    pub(super) fn edge(&mut self, a: Corner, b: Corner) {
        let (low, high) = if a[1] <= b[1] { (a, b) } else { (b, a) };
        let (from, to) = (row(low[1]).max(0), row(high[1]).min(self.rows as i32));
        if from >= to {
            return;
        }
        let slope = (high[0] - low[0]) as f64 / (high[1] - low[1]) as f64;
        let first = ((i64::from(from) << POINT) - low[1]) as f64 * slope;
        let (mut x, step) = (low[0] + first as i64, (slope * ONE) as i64);
        for row in from..to {
            // Rounding over the longest window: a hundredth of a cell.
            let column = whole(x.wrapping_add((1 << POINT) - 1));
            self.crossings.push((row as u32, column.max(0)));
            self.starts[row as usize + 1] += 1;
            x = x.wrapping_add(step);
        }
    }

    /// Visits the pieces of rows inside: row, first column, column behind the last.
    pub(super) fn rows(&mut self, mut visit: impl FnMut(i32, i32, i32)) {
        let mut sum = 0;
        for start in &mut self.starts {
            sum += *start;
            *start = sum;
        }
        self.columns.clear();
        self.columns.resize(self.crossings.len(), 0);
        // Every row's start moves on to its end, which is the next row's start.
        for (row, column) in &self.crossings {
            let end = &mut self.starts[*row as usize];
            self.columns[*end as usize] = *column;
            *end += 1;
        }
        let mut from = 0;
        for (row, to) in self.starts[..self.rows].iter().enumerate() {
            let columns = &mut self.columns[from as usize..*to as usize];
            sort(columns);
            for pair in columns.as_chunks::<2>().0 {
                if pair[0] < pair[1] {
                    visit(row as i32, pair[0], pair[1]);
                }
            }
            from = *to;
        }
    }
}

/// Sorts a few numbers.
fn sort(columns: &mut [i32]) {
    if columns.len() == 2 {
        // By far the most.
        if columns[0] > columns[1] {
            columns.swap(0, 1);
        }
        return;
    }
    if columns.len() > 16 {
        columns.sort_unstable();
        return;
    }
    for at in 1..columns.len() {
        let mut at = at;
        while at > 0 && columns[at - 1] > columns[at] {
            columns.swap(at - 1, at);
            at -= 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::collection::vec;
    use proptest::prelude::*;

    use super::*;

    fn inside(corners: &[Point], rows: usize) -> Vec<(i32, i32)> {
        let mut outline = Outline::default();
        outline.begin(rows);
        for (at, corner) in corners.iter().enumerate() {
            outline.edge(super::corner(corner), super::corner(&corners[(at + 1) % corners.len()]));
        }
        let mut cells = Vec::new();
        outline.rows(|row, from, to| cells.extend((from..to).map(|column| (column, row))));
        cells
    }

    #[test]
    fn a_square_holds_the_centres_in_it() {
        let corners =
            [(1.2, 0.9), (4.0, 0.9), (4.0, 3.0), (1.2, 3.0)].map(|(x, y)| Point::new(x, y));
        let cells = [(2, 1), (3, 1), (2, 2), (3, 2)];
        assert_eq!(inside(&corners, 9), cells);
    }

    proptest! {
        #[test]
        fn a_star_holds_the_centres_that_its_rays_pass(
            ranges in vec(0.5..30.0f64, 3..60), x in 31.0..33.0f64, y in 31.0..33.0f64,
        ) {
            let step = std::f64::consts::TAU / ranges.len() as f64;
            let corner = |at: usize| {
                let (sin, cos) = (step * at as f64).sin_cos();
                Point::new(x + ranges[at % ranges.len()] * cos, y + ranges[at % ranges.len()] * sin)
            };
            let corners: Vec<Point> = (0..ranges.len()).map(corner).collect();
            let cells = inside(&corners, 64);
            for row in 0..64 {
                for column in 0..64 {
                    let p = Point::new(f64::from(column) - x, f64::from(row) - y);
                    let at = (p.y.atan2(p.x).rem_euclid(std::f64::consts::TAU) / step) as usize;
                    let at = at.min(ranges.len() - 1);
                    let (a, b) = (corner(at) - Point::new(x, y), corner(at + 1) - Point::new(x, y));
                    // Left of the edge from a to b, seen along it, is inside.
                    let side = (b - a).perp(&(p - a));
                    if side.abs() > 1e-3 {
                        let held = cells.binary_search_by_key(&(row, column), |(c, r)| (*r, *c)).is_ok();
                        prop_assert_eq!(held, side > 0.0, "{} {}", column, row);
                    }
                }
            }
        }
    }
}
