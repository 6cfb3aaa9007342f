//! The points of one scan, with what makes stretches of them cheap to look at.

use std::ops::Range;

use mapfold_map::geometry::Point;

use super::guess::{Guess, Sums};
use super::points::ScanPoint;

/// The points of a scan in the order of the beams, with running sums over them.
#[derive(Debug, Default)]
pub(super) struct Cloud {
    /// The points.
    pub(super) points: Vec<ScanPoint>,
    /// Where they are, alone: what is looked at most lies closest.
    pub(super) at: Vec<Point>,
    /// `sums[i]` is over the points before `i`.
    sums: Vec<Sums>,
}

impl Cloud {
    /// Brings the rest up to date with `points`.
    pub(super) fn index(&mut self) {
        let Self { points, at, sums } = self;
        at.clear();
        at.extend(points.iter().map(|p| p.at));
        sums.clear();
        let mut sum = Sums::default();
        sums.push(sum);
        sums.extend(points.iter().map(|p| {
            sum = sum.with(&p.at, 1.0 / p.variance_along);
            sum
        }));
    }

    /// The points of a stretch but for its strays.
    pub(super) fn without<'a>(
        &'a self,
        stretch: &Range<usize>,
        stray: &'a [bool],
    ) -> impl DoubleEndedIterator<Item = &'a ScanPoint> + Clone + use<'a> {
        let points = self.points[stretch.clone()].iter().zip(&stray[stretch.clone()]);
        points.filter_map(|(point, stray)| (!stray).then_some(point))
    }

    /// Sums over a stretch.
    pub(super) fn sums(&self, stretch: &Range<usize>) -> Sums {
        self.sums[stretch.end].without(&self.sums[stretch.start])
    }

    /// The line through a stretch, its weights blind to its direction.
    pub(super) fn guess(&self, stretch: &Range<usize>) -> Guess {
        self.sums(stretch).guess()
    }
}
