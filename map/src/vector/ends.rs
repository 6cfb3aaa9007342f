//! Where the ends of pieces are.

use std::collections::BTreeMap;

use super::piece::PieceAt;
use crate::geometry::Point;

/// Edge of a square, metres.
const SIDE: f64 = 4.0;

/// Ends of pieces by the square that they lie in.
#[derive(Debug, Clone, Default)]
pub(super) struct Ends {
    squares: BTreeMap<(i32, i32), Vec<(Point, PieceAt)>>,
}

impl Ends {
    fn square(v: f64) -> i32 {
        (v / SIDE).floor() as i32
    }

    pub(super) fn insert(&mut self, piece: PieceAt, at: Point) {
        let square = (Self::square(at.x), Self::square(at.y));
        self.squares.entry(square).or_default().push((at, piece));
    }

    pub(super) fn remove(&mut self, piece: PieceAt, at: Point) {
        let square = (Self::square(at.x), Self::square(at.y));
        if let Some(ends) = self.squares.get_mut(&square) {
            if let Some(index) = ends.iter().position(|(_, other)| *other == piece) {
                ends.swap_remove(index);
            }
            if ends.is_empty() {
                self.squares.remove(&square);
            }
        }
    }

    /// All not further than `reach` metres from `at`, in no order that may be relied upon.
    pub(super) fn near(&self, at: Point, reach: f64) -> impl Iterator<Item = PieceAt> + '_ {
        let (x0, x1) = (Self::square(at.x - reach), Self::square(at.x + reach));
        let (y0, y1) = (Self::square(at.y - reach), Self::square(at.y + reach));
        (x0..=x1)
            .flat_map(move |x| (y0..=y1).map(move |y| (x, y)))
            .filter_map(|square| self.squares.get(&square))
            .flatten()
            .filter(move |(end, _)| (end - at).norm_squared() <= reach * reach)
            .map(|(_, piece)| *piece)
    }
}
