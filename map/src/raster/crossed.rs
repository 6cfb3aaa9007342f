//! The cells that a straight line passes through, from one place to another.

use super::Cell;
use crate::geometry::Point;

/// All cells that the line from `a` to `b` passes through, at `resolution` metres a cell, column by
/// column or row by row; a cell that it touches in a corner may be among them or not. Each has a side
/// in common with the next, so that no way leads through between two of them.
pub(crate) fn crossed(a: &Point, b: &Point, resolution: f64) -> Vec<Cell> {
    if (b.x - a.x).abs() >= (b.y - a.y).abs() {
        columns_crossed(a, b, resolution)
    } else {
        let turned = |p: &Point| Point::new(p.y, p.x);
        let mut cells = columns_crossed(&turned(a), &turned(b), resolution);
        for cell in &mut cells {
            *cell = Cell { column: cell.row, row: cell.column };
        }
        cells
    }
}

/// The same for a line that goes on to the right by more than it rises or falls.
fn columns_crossed(a: &Point, b: &Point, resolution: f64) -> Vec<Cell> {
    let (left, right) = if a.x <= b.x { (a, b) } else { (b, a) };
    let [first, last] = [left, right].map(|p| Cell::holding(p, resolution));
    let slope = if right.x > left.x { (right.y - left.y) / (right.x - left.x) } else { 0.0 };
    let edge = |column: i32| left.y + slope * (f64::from(column) * resolution - left.x);
    let row = |y: f64| Cell::holding(&Point::new(0.0, y), resolution).row;
    let mut cells = Vec::new();
    let mut enters = first.row;
    for column in first.column..=last.column {
        let leaves = if column == last.column { last.row } else { row(edge(column + 1)) };
        cells.extend((enters.min(leaves)..=enters.max(leaves)).map(|row| Cell { column, row }));
        enters = leaves;
    }
    cells
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::chance::Chance;

    #[test]
    fn no_place_of_the_line_lies_in_another_cell_and_no_way_leads_through() {
        let mut chance = Chance(11);
        for _ in 0..500 {
            let mut place =
                || Point::new(20.0 * chance.share() - 10.0, 20.0 * chance.share() - 10.0);
            let (a, b) = (place(), place());
            let cells = crossed(&a, &b, 0.05);
            for pair in cells.windows(2) {
                let apart =
                    pair[0].column.abs_diff(pair[1].column) + pair[0].row.abs_diff(pair[1].row);
                assert!(apart >= 1, "{a} to {b}: {pair:?} twice");
            }
            let known: BTreeSet<Cell> = cells.iter().copied().collect();
            assert_eq!(known.len(), cells.len(), "each once");
            let beside = |cell: &Cell| {
                [(1, 0), (-1, 0), (0, 1), (0, -1)]
                    .map(|(x, y)| Cell { column: cell.column + x, row: cell.row + y })
            };
            let mut reached = BTreeSet::from([cells[0]]);
            let mut next = vec![cells[0]];
            while let Some(cell) = next.pop() {
                next.extend(
                    beside(&cell).into_iter().filter(|c| known.contains(c) && reached.insert(*c)),
                );
            }
            assert_eq!(reached, known, "side by side");
            for step in 0..=2000 {
                let p = a + (b - a) * (f64::from(step) / 2000.0);
                assert!(known.contains(&Cell::holding(&p, 0.05)), "{a} to {b} at {p}");
            }
            for cell in &cells {
                // The distance of the cell's middle from the line, against half its diagonal.
                let (way, to) = (b - a, cell.centre(0.05) - a);
                let across = (way.x * to.y - way.y * to.x).abs() / way.norm();
                assert!(across <= 0.05 * 0.7072, "{cell:?} is {across} off the line");
            }
        }
    }

    #[test]
    fn a_place_is_a_line_too() {
        let p = Point::new(-0.01, 0.01);
        assert_eq!(crossed(&p, &p, 0.05), [Cell { column: -1, row: 0 }]);
    }
}
