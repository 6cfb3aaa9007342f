//! Exact traversal of the cells along a ray.

use mapfold_map::geometry::Point;
use mapfold_map::raster::Cell;

/// Visits the cells from `start` along the unit vector `direction` for `length`, each with the
/// distances at which the ray enters and leaves it (Amanatides and Woo 1987). All in cells: the cell
/// in column 3 and row 5 reaches from (3, 5) to (4, 6).
pub(super) fn walk(
    start: &Point,
    direction: &Point,
    length: f64,
    mut visit: impl FnMut(Cell, f64, f64),
) {
    let mut cell = Cell::holding(start, 1.0);
    let (mut next_x, step_x, delta_x) = axis(start.x, direction.x, cell.column);
    let (mut next_y, step_y, delta_y) = axis(start.y, direction.y, cell.row);
    let mut entered = 0.0;
    while entered < length {
        let left = next_x.min(next_y).min(length);
        visit(cell, entered, left);
        if next_x <= next_y {
            cell.column += step_x;
            entered = next_x;
            next_x += delta_x;
        } else {
            cell.row += step_y;
            entered = next_y;
            next_y += delta_y;
        }
    }
}

/// Distance to the first border along one axis, the step there, and the distance from border to
/// border.
fn axis(start: f64, direction: f64, cell: i32) -> (f64, i32, f64) {
    let within = start - f64::from(cell);
    let delta = direction.abs().recip();
    if direction > 0.0 {
        ((1.0 - within) * delta, 1, delta)
    } else if direction < 0.0 {
        (within * delta, -1, delta)
    } else {
        (f64::INFINITY, 0, f64::INFINITY)
    }
}

#[cfg(test)]
mod tests {
    use mapfold_map::geometry::unit_normal;
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #[test]
        fn cells_follow_each_other_and_hold_their_piece_of_the_ray(
            x in -400.0..400.0f64, y in -400.0..400.0f64, angle in -4.0..4.0f64, length in 0.2..300.0f64,
        ) {
            let (start, direction) = (Point::new(x, y), unit_normal(angle));
            let mut pieces = Vec::new();
            walk(&start, &direction, length, |cell, from, to| pieces.push((cell, from, to)));
            prop_assert_eq!(pieces[0].1.total_cmp(&0.0), std::cmp::Ordering::Equal);
            prop_assert!((pieces[pieces.len() - 1].2 - length).abs() < 1e-9);
            for pair in pieces.windows(2) {
                let ((a, _, left), (b, entered, _)) = (pair[0], pair[1]);
                prop_assert!((left - entered).abs() < 1e-9);
                prop_assert_eq!((a.column - b.column).abs() + (a.row - b.row).abs(), 1);
            }
            for (cell, from, to) in pieces {
                if to - from > 1e-6 {
                    let middle = start + direction * (0.5 * (from + to));
                    prop_assert_eq!(Cell::holding(&middle, 1.0), cell);
                }
            }
        }
    }
}
