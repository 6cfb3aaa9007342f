//! Exact traversal of the cells along a line, row by row.

use mapfold_map::geometry::Point;

use super::outline::{fixed, whole};

/// Visits the cells that the line from `a` to `b` passes through, row by row upwards: row, first
/// column, column behind the last. All in cells: the cell in column 3 and row 5 reaches from (3, 5) to
/// (4, 6). Exact but for rounding, to a millionth of a cell.
pub(super) fn stroke(a: &Point, b: &Point, mut visit: impl FnMut(i32, i32, i32)) {
    let (low, high) = if a.y <= b.y { (a, b) } else { (b, a) };
    let cell = |v: f64| whole(fixed(v));
    let (first, last) = (cell(low.y), cell(high.y));
    // Not a number where the line is level, but then there is one row only.
    let slope = (high.x - low.x) / (high.y - low.y);
    let mut x = low.x + (f64::from(first) + 1.0 - low.y) * slope;
    let mut entered = cell(low.x);
    // Whether the ends of a line that is all but level are in one row is a matter of rounding: it goes no
    // farther than its ends all the same.
    let left = cell(high.x);
    let (leftmost, rightmost) = (entered.min(left), entered.max(left));
    for row in first..last {
        let left = cell(x).max(leftmost).min(rightmost);
        visit(row, entered.min(left), entered.max(left) + 1);
        entered = left;
        x += slope;
    }
    visit(last, entered.min(left), entered.max(left) + 1);
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use mapfold_map::geometry::unit_normal;
    use mapfold_map::raster::Cell;
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn a_line_that_is_level_but_for_rounding_ends_where_its_ends_are() {
        // Between these two numbers a row begins, by rounding.
        let border = 4.0 - 0.5 / f64::from(1 << 20);
        let (below, above) = (border - 1e-9, border + 1e-9);
        for (left, right) in [(below, above), (above, below)] {
            let mut columns = BTreeSet::new();
            stroke(&Point::new(10.5, left), &Point::new(20.5, right), |row, from, to| {
                assert!((3..=4).contains(&row));
                columns.extend(from..to);
            });
            assert!(columns.into_iter().eq(10..21));
        }
    }

    proptest! {
        #[test]
        fn the_cells_are_those_that_hold_a_place_of_the_line_and_follow_each_other(
            x in -400.0..400.0f64, y in -400.0..400.0f64, angle in -4.0..4.0f64, length in 0.2..300.0f64,
        ) {
            let (a, direction) = (Point::new(x, y), unit_normal(angle));
            let mut cells = BTreeSet::new();
            let mut last: Option<(i32, i32, i32)> = None;
            stroke(&a, &(a + direction * length), |row, from, to| {
                assert!(from < to);
                if let Some((below, left, right)) = last {
                    assert_eq!(below + 1, row);
                    assert!(from < right && left < to, "two rows have a side in common");
                }
                cells.extend((from..to).map(|column| Cell { column, row }));
                last = Some((row, from, to));
            });
            // Every place of the line is in a cell.
            for step in 0..=20_000 {
                let place = a + direction * (length * f64::from(step) / 20_000.0);
                let near = [-1e-5, 1e-5].map(|off| Cell::holding(&place.add_scalar(off), 1.0));
                let held = Cell::holding(&place, 1.0);
                if near == [held; 2] {
                    prop_assert!(cells.contains(&held), "{} {}", held.column, held.row);
                }
            }
            // And every cell is touched.
            for cell in cells {
                let corners = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(right, up)| {
                    let to = Point::new(f64::from(cell.column + right), f64::from(cell.row + up)) - a;
                    direction.perp(&to)
                });
                prop_assert!(corners.iter().any(|side| *side <= 1e-5));
                prop_assert!(corners.iter().any(|side| *side >= -1e-5));
            }
        }
    }
}
