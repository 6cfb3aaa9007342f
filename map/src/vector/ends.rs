//! Where the ends of pieces are.

use super::piece::PieceAt;
use super::squares::Squares;
use crate::geometry::Point;

/// Ends of pieces by the square that they lie in.
#[derive(Debug, Clone, Default)]
pub(super) struct Ends {
    squares: Squares<(PieceAt, Point)>,
}

impl Ends {
    pub(super) fn insert(&mut self, piece: PieceAt, at: Point) {
        self.squares.insert((piece, at), (at, at));
    }

    pub(super) fn remove(&mut self, piece: PieceAt, at: Point) {
        self.squares.remove((piece, at), (at, at));
    }

    /// All not further than `reach` metres from `at`, in no order that may be relied upon.
    pub(super) fn near(&self, at: Point, reach: f64) -> impl Iterator<Item = PieceAt> + '_ {
        let margin = Point::new(reach, reach);
        self.squares
            .near((at - margin, at + margin))
            .filter(move |(_, end)| (end - at).norm_squared() <= reach * reach)
            .map(|(piece, _)| piece)
    }
}
