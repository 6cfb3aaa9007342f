//! Weighted sums over points about a line that is nearly the one sought: what is asked of them is whether
//! the line explains them, and what line they ask for.
//!
//! Two points are looked at at a time, column by column, with one division for both. What has been summed
//! once is kept: a stretch that gains or loses a few points at its ends is summed by these alone.

use std::ops::Range;

use mapfold_map::geometry::Point;

use super::cloud::{Cloud, Columns};
use super::points::ScanPoint;

/// A line that is nearly the one sought.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Frame {
    pub(super) normal: Point,
    pub(super) tangent: Point,
    pub(super) centre: Point,
}

/// Weighted sums about the centre of a frame: t along it, e across it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Tally {
    /// Number of points.
    pub(super) count: usize,
    /// Sums of the weights, `1 / (n^T C n)`, and with them of t, e and their products.
    weight: f64,
    t: f64,
    e: f64,
    tt: f64,
    te: f64,
    /// The sum of the squared residuals, each over its variance.
    pub(super) ee: f64,
    /// The largest of these, of points that were added.
    pub(super) worst: f64,
}

/// Weighted central moments in a frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct Moments {
    pub(super) weight: f64,
    t_mean: f64,
    e_mean: f64,
    pub(super) tt: f64,
    pub(super) te: f64,
    pub(super) ee: f64,
}

/// Two numbers, of two points.
type Two = [f64; 2];

#[inline]
fn both(of: impl Fn(usize) -> f64) -> Two {
    [of(0), of(1)]
}

/// What two points, or one twice, add: weight, t, e, tt, te, ee.
#[inline]
fn parts(frame: &Frame, [x, y, along, across]: [Two; 4]) -> [Two; 6] {
    let Frame { normal: n, tangent: u, centre: c } = frame;
    // Along and across the line from the sensor, times the range: what a beam makes of it.
    let towards = both(|k| n.x * x[k] + n.y * y[k]);
    let beside = both(|k| u.x * x[k] + u.y * y[k]);
    let (rho, foot) = (n.x * c.x + n.y * c.y, u.x * c.x + u.y * c.y);
    let square = both(|k| x[k] * x[k] + y[k] * y[k]);
    let variance =
        both(|k| along[k] * (towards[k] * towards[k]) + across[k] * (beside[k] * beside[k]));
    let inverse_both = 1.0 / (variance[0] * variance[1]);
    let inverse = [inverse_both * variance[1], inverse_both * variance[0]];
    let w = both(|k| square[k] * inverse[k]);
    let e = both(|k| towards[k] - rho);
    // Where its beam meets the line, and not the foot of its end there, is its place: errors lie along the
    // beam, and what they do along the wall is not the wall's doing.
    let slip = both(|k| (along[k] - across[k]) * (towards[k] * beside[k]) * inverse[k]);
    let t = both(|k| beside[k] - foot - e[k] * slip[k]);
    let (wt, we) = (both(|k| w[k] * t[k]), both(|k| w[k] * e[k]));
    [w, wt, we, both(|k| wt[k] * t[k]), both(|k| wt[k] * e[k]), both(|k| we[k] * e[k])]
}

impl Frame {
    /// The tally of a stretch.
    #[inline(never)]
    pub(super) fn tally_of(&self, columns: &Columns, stretch: &Range<usize>) -> Tally {
        let Columns { x, y, along, across } = columns;
        let [x, y, along, across] = [x, y, along, across].map(|c| &c[stretch.clone()]);
        let ((x, x_last), (y, y_last)) = (x.as_chunks::<2>(), y.as_chunks::<2>());
        let (along, along_last) = along.as_chunks::<2>();
        let (across, across_last) = across.as_chunks::<2>();
        let pairs = x.len();
        let (y, along, across) = (&y[..pairs], &along[..pairs], &across[..pairs]);
        let mut sums = [[0.0; 2]; 6];
        let mut worst = [0.0; 2];
        for i in 0..pairs {
            let parts = parts(self, [x[i], y[i], along[i], across[i]]);
            for (sum, part) in sums.iter_mut().zip(parts) {
                *sum = [sum[0] + part[0], sum[1] + part[1]];
            }
            worst = [larger(worst[0], parts[5][0]), larger(worst[1], parts[5][1])];
        }
        let [weight, t, e, tt, te, ee] = sums.map(|[a, b]| a + b);
        let worst = larger(worst[0], worst[1]);
        let mut tally = Tally { count: 2 * pairs, weight, t, e, tt, te, ee, worst };
        if let ([x], [y], [along], [across]) = (x_last, y_last, along_last, across_last) {
            tally.add(&parts(self, [[*x; 2], [*y; 2], [*along; 2], [*across; 2]]));
        }
        tally
    }

    /// The tally of points that need not follow each other.
    pub(super) fn tally<'a>(&self, points: impl Iterator<Item = &'a ScanPoint>) -> Tally {
        let mut tally = Tally::default();
        for p in points {
            let one = [p.at.x, p.at.y, p.variance_along, p.variance_across];
            tally.add(&parts(self, one.map(|value| [value; 2])));
        }
        tally
    }

    /// The line that the moments ask for.
    pub(super) fn turned(&self, slope: f64, moments: &Moments) -> Self {
        let stretch = 1.0 / (1.0 + slope * slope).sqrt();
        Self {
            normal: (self.normal - self.tangent * slope) * stretch,
            tangent: (self.tangent + self.normal * slope) * stretch,
            centre: self.centre + self.tangent * moments.t_mean + self.normal * moments.e_mean,
        }
    }
}

#[inline]
fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

impl Tally {
    fn add(&mut self, parts: &[Two; 6]) {
        let [w, t, e, tt, te, ee] = parts.map(|[part, _]| part);
        *self = Self {
            count: self.count + 1,
            weight: self.weight + w,
            t: self.t + t,
            e: self.e + e,
            tt: self.tt + tt,
            te: self.te + te,
            ee: self.ee + ee,
            worst: larger(self.worst, ee),
        };
    }

    /// Without what `other` holds; the worst of all stays as it was.
    fn without(self, other: &Self) -> Self {
        Self {
            count: self.count - other.count,
            weight: self.weight - other.weight,
            t: self.t - other.t,
            e: self.e - other.e,
            tt: self.tt - other.tt,
            te: self.te - other.te,
            ee: self.ee - other.ee,
            worst: self.worst,
        }
    }

    /// With what `other` holds.
    fn with(self, other: &Self) -> Self {
        Self {
            count: self.count + other.count,
            weight: self.weight + other.weight,
            t: self.t + other.t,
            e: self.e + other.e,
            tt: self.tt + other.tt,
            te: self.te + other.te,
            ee: self.ee + other.ee,
            worst: larger(self.worst, other.worst),
        }
    }

    /// The moments about the mean.
    pub(super) fn moments(&self) -> Moments {
        let (t_mean, e_mean) = (self.t / self.weight, self.e / self.weight);
        Moments {
            weight: self.weight,
            t_mean,
            e_mean,
            tt: self.tt - self.t * t_mean,
            te: self.te - self.t * e_mean,
            ee: self.ee - self.e * e_mean,
        }
    }
}

impl Moments {
    /// Regression of e on t.
    pub(super) fn slope(&self) -> f64 {
        self.te / self.tt
    }
}

/// What is known of a stretch without strays about a frame.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Held {
    pub(super) frame: Frame,
    pub(super) points: Range<usize>,
    pub(super) tally: Tally,
}

impl Held {
    /// Sums up a stretch.
    pub(super) fn of(cloud: &Cloud, frame: Frame, points: &Range<usize>) -> Self {
        let tally = frame.tally_of(&cloud.columns, points);
        Self { frame, points: points.clone(), tally }
    }

    /// The same of a stretch that may differ at its ends.
    pub(super) fn over(&self, cloud: &Cloud, points: &Range<usize>) -> Self {
        let Range { start, end } = self.points;
        let changed = start.abs_diff(points.start) + end.abs_diff(points.end);
        if 2 * changed > points.len() {
            return Self::of(cloud, self.frame, points);
        }
        let mut tally = self.tally;
        let sum = |from: usize, to: usize| self.frame.tally_of(&cloud.columns, &(from..to));
        let (was, is) = (&self.points, points);
        if is.start < was.start {
            tally = tally.with(&sum(is.start, was.start));
        } else if is.start > was.start {
            tally = tally.without(&sum(was.start, is.start));
        }
        if is.end > was.end {
            tally = tally.with(&sum(was.end, is.end));
        } else if is.end < was.end {
            tally = tally.without(&sum(is.end, was.end));
        }
        Self { frame: self.frame, points: points.clone(), tally }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::perception::points::NoiseConfig;
    use mapfold_map::geometry::{tangent, unit_normal};

    const NOISE: NoiseConfig =
        NoiseConfig { range_sd: 0.02, range_sd_per_metre: 0.002, bearing_sd: 0.003 };

    /// Points about the line at 1.5 m under 0.7 rad, and a frame that is nearly it.
    fn cloud(count: usize) -> (Cloud, Frame) {
        let mut cloud = Cloud::default();
        cloud.points.extend((0..count).map(|i| {
            let off = 0.01 * ((i * 7 % 5) as f64 - 2.0);
            let p = unit_normal(0.7) * (1.5 + off) + tangent(0.7) * (-1.0 + 0.11 * i as f64);
            ScanPoint::new(i, p.norm(), p / p.norm(), &NOISE)
        }));
        cloud.index(false);
        let (normal, tangent) = (unit_normal(0.71), tangent(0.71));
        (cloud, Frame { normal, tangent, centre: normal * 1.5 + tangent * 0.1 })
    }

    fn assert_alike(a: &Tally, b: &Tally) {
        let sums = |t: &Tally| [t.weight, t.t, t.e, t.tt, t.te, t.ee];
        // Weights are of the order of 1e4, residuals of 1e-2.
        for ((a, b), scale) in sums(a).into_iter().zip(sums(b)).zip([1e5, 1e5, 1e3, 1e5, 1e3, 1e1])
        {
            assert!((a - b).abs() < 1e-9 * scale, "{a} {b}");
        }
        assert_eq!(a.count, b.count);
    }

    #[test]
    fn two_at_a_time_is_one_at_a_time_by_definition() {
        for count in [0, 1, 2, 7, 30] {
            let (cloud, frame) = cloud(count);
            let found = frame.tally_of(&cloud.columns, &(0..count));
            let mut expected = Tally { count, ..Tally::default() };
            for p in &cloud.points {
                let w = 1.0 / p.variance(&frame.normal);
                let d = p.at - frame.centre;
                // What an error along the beam and across it does along the line as it does it off it.
                let c = p.covariance();
                let slip = (frame.tangent.transpose() * c.matrix() * frame.normal)[0] * w;
                let (e, t) = (frame.normal.dot(&d), frame.tangent.dot(&d));
                let t = t - e * slip;
                expected.weight += w;
                (expected.t, expected.e) = (expected.t + w * t, expected.e + w * e);
                (expected.tt, expected.te) = (expected.tt + w * t * t, expected.te + w * t * e);
                expected.ee += w * e * e;
                expected.worst = expected.worst.max(w * e * e);
            }
            assert_alike(&found, &expected);
            assert!((found.worst - expected.worst).abs() < 1e-9);
            assert_alike(&frame.tally(cloud.points.iter()), &expected);
        }
    }

    #[test]
    fn what_is_held_follows_its_ends() {
        let (cloud, frame) = cloud(40);
        let held = Held::of(&cloud, frame, &(10..30));
        for points in [10..30, 8..30, 12..30, 10..33, 10..27, 7..25, 13..34, 0..40, 20..25] {
            let found = held.over(&cloud, &points);
            assert_eq!(found.points, points);
            assert_alike(&found.tally, &Held::of(&cloud, frame, &points).tally);
        }
    }
}
