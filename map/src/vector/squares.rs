//! A spatial index: what reaches into which squares of the level.

use super::buckets::Buckets;
use crate::geometry::Point;

/// A rectangle by its lower left and upper right corner.
pub(super) type Extent = (Point, Point);

/// Edge of a square, metres.
const SIDE: f64 = 4.0;

/// A rectangle in little space; contains the one that it was made from.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Frame {
    low: [f32; 2],
    high: [f32; 2],
}

impl Frame {
    fn around((low, high): Extent) -> Self {
        let down = |v: f64| (v as f32).next_down();
        let up = |v: f64| (v as f32).next_up();
        Self { low: [down(low.x), down(low.y)], high: [up(high.x), up(high.y)] }
    }

    fn overlaps(&self, other: &Self) -> bool {
        (0..2).all(|k| self.low[k] <= other.high[k] && other.low[k] <= self.high[k])
    }

    /// The square that holds the lower left corner, and the one that holds the upper right.
    fn corner_squares(&self) -> [(i32, i32); 2] {
        let square = |v: f32| (f64::from(v) / SIDE).floor() as i32;
        [self.low, self.high].map(|[x, y]| (square(x), square(y)))
    }

    fn squares(&self) -> impl Iterator<Item = (i32, i32)> + use<> {
        let [(x0, y0), (x1, y1)] = self.corner_squares();
        (x0..=x1).flat_map(move |x| (y0..=y1).map(move |y| (x, y)))
    }
}

/// Things by the squares that they reach into.
#[derive(Debug, Clone)]
pub(super) struct Squares<K> {
    squares: Buckets<(i32, i32), (Frame, K)>,
}

impl<K> Default for Squares<K> {
    fn default() -> Self {
        Self { squares: Buckets::default() }
    }
}

impl<K: Copy + PartialEq> Squares<K> {
    pub(super) fn insert(&mut self, thing: K, extent: Extent) {
        let frame = Frame::around(extent);
        for square in frame.squares() {
            self.squares.insert(square, (frame, thing));
        }
    }

    /// Removes a thing that was inserted with the same extent.
    pub(super) fn remove(&mut self, thing: K, extent: Extent) {
        for square in Frame::around(extent).squares() {
            self.squares.remove(&square, |(_, other)| *other == thing);
        }
    }

    /// All whose extents overlap `extent` (and perhaps some that miss it by a hair), each once, in
    /// no order that may be relied upon.
    pub(super) fn near(&self, extent: Extent) -> impl Iterator<Item = K> + '_ {
        let wanted = Frame::around(extent);
        let [first, _] = wanted.corner_squares();
        wanted.squares().flat_map(move |at| {
            let is_first = move |frame: &Frame| {
                // In the first of the squares that both reach into.
                let [from, _] = frame.corner_squares();
                at == (from.0.max(first.0), from.1.max(first.1))
            };
            let things = self.squares.at(&at).iter();
            things
                .filter(move |(frame, _)| frame.overlaps(&wanted) && is_first(frame))
                .map(|(_, thing)| *thing)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::Chance;

    #[test]
    fn near_finds_each_overlapping_extent_once() {
        let mut chance = Chance(5);
        let mut chance = |upto: f64| chance.share() * upto;
        let mut extent = || {
            let low = Point::new(chance(40.0) - 20.0, chance(40.0) - 20.0);
            (low, low + Point::new(chance(12.0), chance(2.0)))
        };
        let mut index = Squares::default();
        let all: Vec<Extent> = (0..300).map(|_| extent()).collect();
        for (thing, extent) in all.iter().enumerate() {
            index.insert(thing, *extent);
        }
        for thing in (0..300).step_by(3) {
            index.remove(thing, all[thing]);
        }
        for _ in 0..200 {
            let (low, high) = extent();
            let overlaps = |(from, to): &Extent| {
                from.x <= high.x && low.x <= to.x && from.y <= high.y && low.y <= to.y
            };
            let expected: Vec<usize> =
                (0..300).filter(|k| k % 3 != 0 && overlaps(&all[*k])).collect();
            let mut found: Vec<usize> = index.near((low, high)).collect();
            found.sort_unstable();
            assert_eq!(found, expected);
        }
        for (thing, extent) in all.iter().enumerate() {
            index.remove(thing, *extent);
        }
        assert!(index.squares.is_empty());
    }
}
