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
    /// What is looked at most of them.
    pub(super) columns: Columns,
    /// The points after which beams without a point follow, ascending.
    pub(super) skips: Vec<usize>,
    /// Whether any of them has variance that its neighbours share.
    shares: bool,
    /// How much larger variances across a line can be than along the beam.
    turned_max: f64,
    /// `sums[i]` is over the points before `i`.
    sums: Vec<Sums>,
}

/// Of every point, column by column: what is looked at two at a time.
#[derive(Debug, Default)]
pub(super) struct Columns {
    /// Where it is.
    pub(super) x: Vec<f64>,
    /// See `x`.
    pub(super) y: Vec<f64>,
    /// Its variance along the beam.
    pub(super) along: Vec<f64>,
    /// Its variance across the beam.
    pub(super) across: Vec<f64>,
}

impl Columns {
    /// Where a point is.
    #[inline]
    pub(super) fn at(&self, i: usize) -> Point {
        Point::new(self.x[i], self.y[i])
    }

    fn each(&mut self) -> [&mut Vec<f64>; 4] {
        [&mut self.x, &mut self.y, &mut self.along, &mut self.across]
    }
}

/// The first of all values in an order, found four at a time; 0 of none.
fn foremost(values: &[f64], of: impl Fn(f64, f64) -> f64) -> f64 {
    let Some(first) = values.first() else { return 0.0 };
    let (fours, rest) = values.as_chunks::<4>();
    let mut found = [*first; 4];
    for four in fours {
        found = std::array::from_fn(|k| of(found[k], four[k]));
    }
    found.into_iter().chain(rest.iter().copied()).fold(*first, of)
}

impl Cloud {
    /// Brings all but the sums up to date with `points`, any of which may have variance that its neighbours
    /// share.
    pub(super) fn index(&mut self, shares: bool) {
        let Self { points, columns, skips, turned_max, .. } = self;
        for column in columns.each() {
            column.clear();
        }
        columns.x.extend(points.iter().map(|p| p.at.x));
        columns.y.extend(points.iter().map(|p| p.at.y));
        columns.along.extend(points.iter().map(|p| p.variance_along));
        columns.across.extend(points.iter().map(|p| p.variance_across));
        self.shares = shares;
        let most = foremost(&columns.across, |a, b| if b > a { b } else { a });
        let least = foremost(&columns.along, |a, b| if b < a { b } else { a });
        *turned_max = f64::max(1.0, most / least);
        skips.clear();
        skips.reserve(points.len());
        let Some(first) = points.first() else { return };
        if points[points.len() - 1].beam - first.beam + 1 > points.len() {
            let pairs = points.windows(2).enumerate();
            let apart = pairs.filter(|(_, pair)| pair[1].beam != pair[0].beam + 1);
            skips.extend(apart.map(|(i, _)| i));
        }
    }

    /// Turns all but the sums and the skips so that point `first` is the first.
    pub(super) fn turn(&mut self, first: usize) {
        self.points.rotate_left(first);
        for column in self.columns.each() {
            column.rotate_left(first);
        }
    }

    /// Brings the sums up to date.
    pub(super) fn sum(&mut self) {
        let Self { columns: Columns { x, y, along, .. }, sums, .. } = self;
        sums.clear();
        let mut sum = Sums::default();
        sums.push(sum);
        sums.extend(x.iter().zip(y).zip(along).map(|((x, y), along)| {
            sum = sum.with(&Point::new(*x, *y), 1.0 / *along);
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

    /// Sum of the variances that the neighbours of each point of a stretch share with it.
    pub(super) fn shared(&self, stretch: &Range<usize>) -> f64 {
        if !self.shares {
            return 0.0;
        }
        self.points[stretch.clone()].iter().map(|p| p.variance_shared).sum()
    }

    /// How much larger the variance of a point across any line can be than that along its beam.
    pub(super) fn turned_max(&self) -> f64 {
        self.turned_max
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
