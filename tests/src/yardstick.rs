//! The bare loop: the least code that finds lines in a scan, as a measure of what a machine allows.
//!
//! Iterative End Point Fit and closed-form total least squares from prefix sums; no covariance, no
//! merging, no ends, no clusters. What extraction costs and finds is held against this, on the same
//! scans, in the same run.

use crate::simulation::Fan;

/// A line, its normal pointing away from the scanner, and its first and last beam.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BareLine {
    /// Distance of the line, metres.
    pub rho: f64,
    /// Angle of its normal, radians.
    pub alpha: f64,
    /// Where along it the first and the last point lie, metres from the foot point.
    pub span: (f64, f64),
}

/// Settings of the bare loop, by hand.
#[derive(Debug, Clone, Copy)]
pub struct BareLoop {
    /// Neighbours farther apart are not of one wall, metres.
    pub gap_m: f64,
    /// Farther from the chord a run is split, metres.
    pub split_m: f64,
    /// Fewest points of a line.
    pub points_min: usize,
    /// Shortest line, metres.
    pub length_min_m: f64,
}

impl BareLoop {
    /// The settings that suit a scanner of this range noise best, as far as trying tells.
    pub fn for_noise(range_sd_m: f64) -> Self {
        Self { gap_m: 0.5, split_m: 4.0 * range_sd_m + 0.01, points_min: 10, length_min_m: 0.4 }
    }

    /// Finds lines.
    pub fn lines(&self, fan: &Fan, ranges: &[f64], found: &mut Vec<BareLine>) {
        found.clear();
        let mut points = Vec::with_capacity(ranges.len());
        let mut sums = vec![[0.0; 5]];
        for (beam, range) in ranges.iter().enumerate().filter(|(_, r)| r.is_finite()) {
            let (sin, cos) = fan.bearing(beam).sin_cos();
            let (x, y) = (range * cos, range * sin);
            let before = sums[points.len()];
            let own = [x, y, x * x, x * y, y * y];
            sums.push(std::array::from_fn(|i| before[i] + own[i]));
            points.push((x, y));
        }
        let mut from = 0;
        for i in 1..=points.len() {
            let apart = i == points.len() || {
                let (dx, dy) = (points[i].0 - points[i - 1].0, points[i].1 - points[i - 1].1);
                dx * dx + dy * dy > self.gap_m * self.gap_m
            };
            if apart {
                self.split(&points, &sums, from, i, found);
                from = i;
            }
        }
    }

    fn split(
        &self,
        points: &[(f64, f64)],
        sums: &[[f64; 5]],
        from: usize,
        to: usize,
        found: &mut Vec<BareLine>,
    ) {
        if to - from < self.points_min {
            return;
        }
        let (a, b) = (points[from], points[to - 1]);
        let (dx, dy) = (b.0 - a.0, b.1 - a.1);
        let length = dx.hypot(dy).max(1e-9);
        let (nx, ny) = (-dy / length, dx / length);
        let (mut farthest, mut at) = (0.0, from);
        for (i, p) in points[from..to].iter().enumerate() {
            let off = (nx * (p.0 - a.0) + ny * (p.1 - a.1)).abs();
            if off > farthest {
                (farthest, at) = (off, from + i);
            }
        }
        if farthest > self.split_m {
            self.split(points, sums, from, at + 1, found);
            self.split(points, sums, at, to, found);
        } else if length >= self.length_min_m {
            found.push(fit(points, sums, from, to));
        }
    }
}

fn fit(points: &[(f64, f64)], sums: &[[f64; 5]], from: usize, to: usize) -> BareLine {
    let n = (to - from) as f64;
    let [x, y, xx, xy, yy]: [f64; 5] = std::array::from_fn(|i| (sums[to][i] - sums[from][i]) / n);
    let mut alpha = 0.5 * (-2.0 * (xy - x * y)).atan2(yy - y * y - (xx - x * x));
    let mut rho = alpha.cos() * x + alpha.sin() * y;
    if rho < 0.0 {
        (rho, alpha) = (-rho, alpha + std::f64::consts::PI);
    }
    let (sin, cos) = alpha.sin_cos();
    let along = |p: (f64, f64)| cos * p.1 - sin * p.0;
    BareLine { rho, alpha, span: (along(points[from]), along(points[to - 1])) }
}
