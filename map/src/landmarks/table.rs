//! A level's landmarks, ready to be searched.

use super::Landmark;
use super::grid::Grid;
use super::pairs::Pairs;
use crate::geometry::Point;

/// Distances of landmarks that are searched for as pairs, metres: closer ones tell no direction, farther
/// ones are rarely seen together.
pub(super) const PAIR_LENGTHS: (f64, f64) = (0.6, 8.0);
/// A landmark less certain than this is no end of a searched pair: it would widen the search for all.
/// It still counts as a match. Metres.
pub(super) const PAIR_SD_MAX: f64 = 0.15;
/// Edge of the squares that landmarks are found by, metres.
const SQUARE: f64 = 2.0;

/// Landmarks of one level and the pairs among them. Takes some 72 bytes a landmark and 20 a pair.
#[derive(Debug, Clone, PartialEq)]
pub struct LandmarkTable {
    pub(super) landmarks: Vec<Landmark>,
    pub(super) grid: Grid,
    pub(super) pairs: Pairs,
    /// The largest deviations among the ends of pairs: of place, metres, and direction, radians.
    pub(super) worst: (f64, f64),
    /// Where a robot may be that sees any of them, square metres.
    pub(super) area: f64,
}

impl LandmarkTable {
    /// From landmarks; what is found is told by their numbers in this order.
    pub fn new(landmarks: Vec<Landmark>) -> Self {
        let places: Vec<Point> = landmarks.iter().map(|l| l.at).collect();
        let grid = Grid::new(&places, SQUARE);
        let is_fit = |l: &Landmark| l.place_sd() <= PAIR_SD_MAX;
        let pairs = Pairs::new(&landmarks, &grid, PAIR_LENGTHS, is_fit);
        let worst = landmarks.iter().filter(|l| is_fit(l)).fold((0.0, 0.0), |(place, turn), l| {
            (f64::max(place, l.place_sd()), f64::max(turn, l.direction_sd))
        });
        let area = Grid::new(&places, PAIR_LENGTHS.1).inhabited_area();
        Self { landmarks, grid, pairs, worst, area }
    }

    /// The landmarks.
    pub fn landmarks(&self) -> &[Landmark] {
        &self.landmarks
    }

    /// Those within `reach` metres of a place, with their numbers, in no order that means anything.
    pub fn near(&self, at: Point, reach: f64) -> impl Iterator<Item = (u32, &Landmark)> {
        let all = self.grid.near(&at, reach);
        let numbered = all.map(|number| (number, &self.landmarks[number as usize]));
        numbered.filter(move |(_, l)| (l.at - at).norm_squared() <= reach * reach)
    }

    /// Bytes that its landmarks and pairs take.
    pub fn bytes(&self) -> usize {
        self.landmarks.len() * size_of::<Landmark>() + self.pairs.bytes()
    }

    /// Number of pairs.
    pub fn pair_count(&self) -> usize {
        self.pairs.len()
    }
}
