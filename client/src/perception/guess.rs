//! Lines of stretches of points, from running sums: they cost the same for three points as for three
//! hundred.
//!
//! Their weights know of the range alone and not of the line's direction, which tells how much of a
//! range's error lies across it: what they are good for is to be asked whether they may be lines.

use mapfold_map::geometry::Point;

use super::points::ScanPoint;
use super::tally::{Frame, Tally};

/// Sums over points: of their weights, and of their coordinates and products with these weights.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Sums {
    weight: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Sums {
    /// With one more point.
    pub(super) fn with(&self, p: &Point, weight: f64) -> Self {
        let (wx, wy) = (weight * p.x, weight * p.y);
        Self {
            weight: self.weight + weight,
            x: self.x + wx,
            y: self.y + wy,
            xx: self.xx + wx * p.x,
            xy: self.xy + wx * p.y,
            yy: self.yy + wy * p.y,
        }
    }

    /// Without what `other` holds.
    pub(super) fn without(&self, other: &Self) -> Self {
        Self {
            weight: self.weight - other.weight,
            x: self.x - other.x,
            y: self.y - other.y,
            xx: self.xx - other.xx,
            xy: self.xy - other.xy,
            yy: self.yy - other.yy,
        }
    }

    /// The line through these points, with their weights as they are.
    pub(super) fn guess(&self) -> Guess {
        let centre = Point::new(self.x, self.y) / self.weight;
        let xx = self.xx - self.x * centre.x;
        let xy = self.xy - self.x * centre.y;
        let yy = self.yy - self.y * centre.y;
        let (numerator, denominator) = (-2.0 * xy, yy - xx);
        let lambda = (numerator * numerator + denominator * denominator).sqrt();
        let mut normal = half_angle(denominator, numerator, lambda);
        if normal.dot(&centre) < 0.0 {
            normal = -normal;
        }
        let tangent = Point::new(-normal.y, normal.x);
        Guess {
            weight: self.weight,
            centre,
            normal,
            tangent,
            rho: normal.dot(&centre),
            spread: xx + yy,
            lambda,
        }
    }
}

/// The direction at half the angle of (x, y), whose length is `norm`, by square roots.
fn half_angle(x: f64, y: f64, norm: f64) -> Point {
    // Whichever half is large is taken from the root, the other from it: no digits are lost.
    let large = (0.5 * (1.0 + x.abs() / norm)).sqrt();
    let small = 0.5 * y.abs() / (norm * large);
    let (cos, sin) = if x >= 0.0 { (large, small) } else { (small, large) };
    Point::new(cos, if y < 0.0 { -sin } else { sin })
}

/// A line through points whose weights do not know its direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Guess {
    /// Sum of the weights.
    pub(super) weight: f64,
    /// Mean of the points.
    pub(super) centre: Point,
    /// Normal, away from the sensor.
    pub(super) normal: Point,
    /// A quarter turn left of it.
    pub(super) tangent: Point,
    /// Distance from the sensor.
    pub(super) rho: f64,
    /// `S_xx + S_yy = S_tt + S_nn`.
    spread: f64,
    /// `S_tt - S_nn`.
    lambda: f64,
}

impl Guess {
    /// The line as a frame for sums.
    pub(super) fn frame(&self) -> Frame {
        Frame { normal: self.normal, tangent: self.tangent, centre: self.centre }
    }

    /// The line of the same points with weights that know its direction, as this guess has it: from
    /// their sums about it.
    pub(super) fn refined(&self, tally: &Tally) -> Option<Self> {
        if tally.count < 3 {
            return None;
        }
        let moments = tally.moments();
        let Frame { mut normal, mut tangent, centre } =
            self.frame().turned(moments.slope(), &moments);
        if normal.dot(&centre) < 0.0 {
            (normal, tangent) = (-normal, -tangent);
        }
        Some(Self {
            weight: moments.weight,
            centre,
            normal,
            tangent,
            rho: normal.dot(&centre),
            spread: moments.tt + moments.ee,
            lambda: moments.tt - moments.ee,
        })
    }

    /// Second moment along the line about the centre.
    pub(super) fn along(&self) -> f64 {
        0.5 * (self.spread + self.lambda)
    }

    /// Second moment across the line, the least of any line.
    pub(super) fn off(&self) -> f64 {
        0.5 * (self.spread - self.lambda)
    }

    /// Signed distance of `p` from the line, away from the sensor.
    pub(super) fn residual(&self, p: &Point) -> f64 {
        self.normal.dot(p) - self.rho
    }

    /// Square of the residual of a point over its variance across the line.
    pub(super) fn normalised_sq(&self, point: &ScanPoint) -> f64 {
        let residual = self.residual(&point.at);
        residual * residual / point.variance(&self.normal)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::perception::points::NoiseConfig;
    use mapfold_map::geometry::{tangent, unit_normal};

    const NOISE: NoiseConfig =
        NoiseConfig { range_sd: 0.02, range_sd_per_metre: 0.002, bearing_sd: 0.003 };

    #[test]
    fn a_guess_of_running_sums_is_the_line_of_its_points() {
        for degrees in (-180..180).step_by(7) {
            let alpha = f64::from(degrees).to_radians();
            let points: Vec<ScanPoint> = (0..25)
                .map(|i| {
                    let off = 0.01 * (f64::from(i * 7 % 5) - 2.0);
                    let t = -2.0 + 0.11 * f64::from(i);
                    let p = unit_normal(alpha) * (1.5 + off) + tangent(alpha) * t;
                    ScanPoint::new(i as usize, p.norm(), p / p.norm(), &NOISE)
                })
                .collect();
            let mut sums = vec![Sums::default()];
            for p in &points {
                sums.push(sums[sums.len() - 1].with(&p.at, 1.0 / p.variance_along));
            }
            let guess = sums[20].without(&sums[5]).guess();
            // What the definition says of a total least squares line: weighted residuals sum to
            // nothing, by themselves and times the coordinate along it.
            let (mut e_sum, mut te_sum, mut tt_sum) = (0.0, 0.0, 0.0);
            for p in &points[5..20] {
                let w = 1.0 / p.variance_along;
                let (t, e) = (guess.tangent.dot(&(p.at - guess.centre)), guess.residual(&p.at));
                e_sum += w * e;
                te_sum += w * t * e;
                tt_sum += w * t * t;
            }
            assert!(e_sum.abs() < 1e-9 * guess.weight && te_sum.abs() < 1e-9 * guess.weight);
            assert!((guess.along() / tt_sum - 1.0).abs() < 1e-9);
            assert!(guess.rho > 0.0 && (guess.normal - unit_normal(alpha)).norm() < 0.02);
        }
    }
}
