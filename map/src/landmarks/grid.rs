//! Places by the squares that they lie in.

use crate::geometry::Point;

/// Numbered places, to be found by where they are.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Grid {
    side: f64,
    low: (i64, i64),
    columns: i64,
    rows: i64,
    /// For each square, where its numbers begin; and their end.
    starts: Vec<u32>,
    numbers: Vec<u32>,
}

/// Squares at most for each place: a few places far apart make larger squares, not many.
const SQUARES_PER_PLACE: i64 = 64;

impl Grid {
    /// Squares of about `side` metres over all places.
    pub(super) fn new(places: &[Point], side: f64) -> Self {
        let Some(first) = places.first() else { return Self::default() };
        let low = places.iter().fold(*first, |low, p| low.inf(p));
        let high = places.iter().fold(*first, |high, p| high.sup(p));
        let mut side = side;
        let squares = |side: f64| {
            let along = |from: f64, to: f64| (to / side).floor() - (from / side).floor() + 1.0;
            along(low.x, high.x) * along(low.y, high.y)
        };
        while squares(side) > (SQUARES_PER_PLACE * places.len() as i64) as f64 {
            side *= 2.0;
        }
        let square = |p: &Point| ((p.x / side).floor() as i64, (p.y / side).floor() as i64);
        let (low, high) = (square(&low), square(&high));
        let (columns, rows) = (high.0 - low.0 + 1, high.1 - low.1 + 1);
        let mut grid = Self {
            side,
            low,
            columns,
            rows,
            starts: vec![0; (columns * rows) as usize + 1],
            numbers: vec![0; places.len()],
        };
        let index = |p: &Point| {
            let (column, row) = square(p);
            ((row - low.1) * columns + column - low.0) as usize
        };
        for p in places {
            grid.starts[index(p) + 1] += 1;
        }
        for at in 1..grid.starts.len() {
            grid.starts[at] += grid.starts[at - 1];
        }
        let mut next = grid.starts.clone();
        for (number, p) in places.iter().enumerate() {
            let slot = &mut next[index(p)];
            grid.numbers[*slot as usize] = number as u32;
            *slot += 1;
        }
        grid
    }

    /// The numbers of all places within `reach` metres of `p` (and of some more), square by square.
    pub(super) fn near<'a>(&'a self, p: &Point, reach: f64) -> impl Iterator<Item = u32> + use<'a> {
        let clip =
            |v: f64, low: i64, count: i64| ((v / self.side).floor() as i64 - low).clamp(-1, count);
        let (column_from, column_to, row_from, row_to) = if self.numbers.is_empty() {
            (1, 0, 1, 0)
        } else {
            (
                clip(p.x - reach, self.low.0, self.columns).max(0),
                clip(p.x + reach, self.low.0, self.columns).min(self.columns - 1),
                clip(p.y - reach, self.low.1, self.rows).max(0),
                clip(p.y + reach, self.low.1, self.rows).min(self.rows - 1),
            )
        };
        (row_from..=row_to).filter(move |_| column_from <= column_to).flat_map(move |row| {
            let from = self.starts[(row * self.columns + column_from) as usize];
            let to = self.starts[(row * self.columns + column_to + 1) as usize];
            self.numbers[from as usize..to as usize].iter().copied()
        })
    }

    /// Area of the squares that hold a place, with those around them, square metres.
    pub(super) fn inhabited_area(&self) -> f64 {
        let holds = |column: i64, row: i64| {
            (0..self.columns).contains(&column) && (0..self.rows).contains(&row) && {
                let at = (row * self.columns + column) as usize;
                self.starts[at] < self.starts[at + 1]
            }
        };
        let squares = (-1..=self.rows).flat_map(|row| (-1..=self.columns).map(move |c| (c, row)));
        let inhabited = squares.filter(|(column, row)| {
            (-1..=1).any(|down| (-1..=1).any(|across| holds(column + across, row + down)))
        });
        inhabited.count() as f64 * self.side * self.side
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::Chance;

    #[test]
    fn all_that_is_near_is_found() {
        let mut chance = Chance(2);
        for count in [0, 1, 7, 300] {
            let mut place = || Point::new(60.0 * chance.share() - 20.0, 30.0 * chance.share());
            let places: Vec<Point> = (0..count).map(|_| place()).collect();
            let grid = Grid::new(&places, 3.0);
            for reach in [0.0, 0.5, 4.0, 100.0] {
                let p = place();
                let mut found: Vec<u32> = grid.near(&p, reach).collect();
                found.sort_unstable();
                assert!(found.windows(2).all(|pair| pair[0] < pair[1]), "each once");
                let near = |n: &u32| (places[*n as usize] - p).norm() <= reach;
                let expected: Vec<u32> = (0..count as u32).filter(near).collect();
                let found: Vec<u32> = found.into_iter().filter(near).collect();
                assert_eq!(found, expected);
            }
        }
    }

    #[test]
    fn few_places_far_apart_do_not_fill_the_memory() {
        let places = [Point::new(-1e7, -1e7), Point::new(1e7, 1e7)];
        let grid = Grid::new(&places, 2.0);
        assert!(grid.starts.len() < 200, "{}", grid.starts.len());
        assert_eq!(grid.near(&places[1], 1.0).filter(|n| *n == 1).count(), 1);
    }
}
