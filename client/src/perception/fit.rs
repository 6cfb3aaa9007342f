//! Weighted total least squares: the line of a set of points, with its covariance.
//!
//! Closed form for given weights (`N = -2 S_xy`, `D = S_yy - S_xx`, `alpha = atan2(N, D) / 2`,
//! `rho = n . c`), two passes: the first weighs every point by its range variance, the second by
//! its variance across the line found. The covariance sums the points' own covariances through
//! the Jacobians of the closed form,
//!
//! ```text
//! d alpha / dp_i = -(w_i / Lambda) (t_i n + e_i u),   Lambda = sqrt(N^2 + D^2)
//! d rho   / dp_i =  (w_i / W) n + (u . c) d alpha / dp_i
//! ```
//!
//! and adds a floor for what all beams on one surface have in common and more beams do not
//! average out. Only vector forms: projections through `1 / tan(alpha)` have no place here.

use std::f64::consts::PI;

use mapfold_map::geometry::{Covariance, Point, Sensor, UncertainLine, tangent, unit_normal};
use nalgebra::Matrix2;

use super::points::ScanPoint;
use crate::sensor::ScannerProfile;

/// How a line is fitted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FitConfig {
    /// Error that all beams on one surface share, metres.
    pub systematic_sd: f64,
    /// Smallest `Lambda / (S_xx + S_yy)` of a line: below, the points are a blob.
    pub linearity_min: f64,
}

impl FitConfig {
    /// The settings that follow from a scanner's profile.
    pub fn for_scanner(profile: &ScannerProfile) -> Self {
        Self { systematic_sd: profile.systematic_sd_m, linearity_min: 0.9 }
    }
}

/// Points that give no line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FitError {
    /// Fewer than three.
    #[error("a line with covariance needs three points")]
    TooFew,
    /// All at one place, or as wide as they are long.
    #[error("the points do not lie along a line")]
    NotLinear,
}

/// A fitted line in the sensor frame, its normal pointing away from the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LineFit {
    /// The line and its covariance, floor included.
    pub line: UncertainLine<Sensor>,
    /// Normal and direction of the line.
    pub normal: Point,
    /// A quarter turn left of the normal; coordinates along the line count this way.
    pub tangent: Point,
    /// Number of points.
    pub count: usize,
    /// Sum of the squared residuals, each over its variance across the line.
    pub chi_sq: f64,
    /// Largest residual over its standard deviation.
    pub worst: f64,
    /// Least and greatest coordinate of the points along the line.
    pub span: (f64, f64),
}

impl LineFit {
    /// Signed distance of `p` from the line, away from the sensor.
    pub fn residual(&self, p: &Point) -> f64 {
        self.normal.dot(p) - self.line.line.rho()
    }

    /// Residual over the standard deviation of the point across the line.
    pub fn normalised(&self, point: &ScanPoint) -> f64 {
        self.residual(&point.at).abs() / point.variance(&self.normal).sqrt()
    }

    /// Variance of the line's place across itself at the foot point of `p`.
    pub fn variance_at(&self, p: &Point) -> f64 {
        let c = self.line.covariance.matrix();
        let t = self.tangent.dot(p);
        (c[(0, 0)] - 2.0 * t * c[(0, 1)] + t * t * c[(1, 1)]).max(0.0)
    }

    /// Length of wall that the points cover.
    pub fn length(&self) -> f64 {
        self.span.1 - self.span.0
    }

    /// Root mean square of the normalised residuals.
    pub fn rms(&self) -> f64 {
        (self.chi_sq / self.count as f64).sqrt()
    }
}

/// Weighted moments about a reference that lies among the points.
struct Moments {
    weight: f64,
    centre: Point,
    xx: f64,
    xy: f64,
    yy: f64,
}

impl Moments {
    fn of<'a>(
        points: impl Iterator<Item = &'a ScanPoint>,
        reference: Point,
        weight: impl Fn(&ScanPoint) -> f64,
    ) -> Self {
        let (mut w_sum, mut x, mut y, mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0);
        for point in points {
            let (w, d) = (weight(point), point.at - reference);
            w_sum += w;
            x += w * d.x;
            y += w * d.y;
            xx += w * d.x * d.x;
            xy += w * d.x * d.y;
            yy += w * d.y * d.y;
        }
        let mean = Point::new(x, y) / w_sum;
        Self {
            weight: w_sum,
            centre: reference + mean,
            xx: xx - w_sum * mean.x * mean.x,
            xy: xy - w_sum * mean.x * mean.y,
            yy: yy - w_sum * mean.y * mean.y,
        }
    }

    /// Angle of the normal (mod pi) and `Lambda`.
    fn normal(&self) -> (f64, f64) {
        let (numerator, denominator) = (-2.0 * self.xy, self.yy - self.xx);
        (0.5 * numerator.atan2(denominator), numerator.hypot(denominator))
    }
}

/// Fits a line to points in the sensor frame.
///
/// # Errors
/// Too few points, or points that do not lie along a line.
pub fn fit_line<'a, I>(points: I, config: &FitConfig) -> Result<LineFit, FitError>
where
    I: Iterator<Item = &'a ScanPoint> + Clone,
{
    let reference = points.clone().next().ok_or(FitError::TooFew)?.at;
    let first = Moments::of(points.clone(), reference, |p| 1.0 / p.variance_along);
    let n = unit_normal(first.normal().0);
    let weight_across = |n: &Point, p: &ScanPoint| 1.0 / p.variance(n);
    let second = Moments::of(points.clone(), reference, |p| weight_across(&n, p));
    let (mut alpha, lambda) = second.normal();
    // Written so that NaN fails too.
    if !(lambda > 0.0 && lambda >= config.linearity_min * (second.xx + second.yy)) {
        return Err(FitError::NotLinear);
    }
    if unit_normal(alpha).dot(&second.centre) < 0.0 {
        alpha += PI;
    }
    let (normal, along) = (unit_normal(alpha), tangent(alpha));
    let (rho, tc) = (normal.dot(&second.centre), along.dot(&second.centre));

    let (mut c_rr, mut c_ra, mut c_aa) = (0.0, 0.0, 0.0);
    let (mut count, mut chi_sq, mut worst) = (0_usize, 0.0, 0.0_f64);
    let mut shared = 0.0;
    let mut span = (f64::INFINITY, f64::NEG_INFINITY);
    for point in points {
        let d = point.at - second.centre;
        let (t, e) = (along.dot(&d), normal.dot(&d));
        // The weights of the last pass are held fixed; they used the normal of the first.
        let w = weight_across(&n, point);
        let j_alpha = (normal * t + along * e) * (-w / lambda);
        let j_rho = normal * (w / second.weight) + j_alpha * tc;
        let (xx, xy, yy) = point.entries();
        let through =
            |a: &Point, b: &Point| a.x * (xx * b.x + xy * b.y) + a.y * (xy * b.x + yy * b.y);
        c_rr += through(&j_rho, &j_rho);
        c_ra += through(&j_rho, &j_alpha);
        c_aa += through(&j_alpha, &j_alpha);
        let squared = e * e / point.variance(&normal);
        count += 1;
        shared += point.variance_shared;
        chi_sq += squared;
        worst = worst.max(squared);
        span = (span.0.min(t + tc), span.1.max(t + tc));
    }
    if count < 3 {
        return Err(FitError::TooFew);
    }
    let half_length = 0.5 * (span.1 - span.0);
    // The variance of a mean of errors that are all alike is at most the mean of their variances.
    let shift = config.systematic_sd.powi(2) + shared / count as f64;
    let tilt = shift / (3.0 * half_length * half_length);
    let fitted = Matrix2::new(c_rr, c_ra, c_ra, c_aa)
        + Matrix2::new(shift + tc * tc * tilt, tc * tilt, tc * tilt, tilt);
    // A sum of J C J^T is positive semi-definite; a matrix that is not is no line's.
    let covariance = Covariance::new(fitted).map_err(|_not_a_covariance| FitError::NotLinear)?;
    let (line, _) = UncertainLine::normal_form(rho, alpha, covariance);
    Ok(LineFit { line, normal, tangent: along, count, chi_sq, worst: worst.sqrt(), span })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::perception::points::NoiseConfig;
    use proptest::prelude::*;

    const NO_FLOOR: FitConfig = FitConfig { systematic_sd: 0.0, linearity_min: 0.9 };
    const NOISE: NoiseConfig =
        NoiseConfig { range_sd: 0.02, range_sd_per_metre: 0.002, bearing_sd: 0.003 };

    /// Points on the line (rho, alpha) from `from` to `to`, pushed off it by `off(i)`.
    fn wall(
        rho: f64,
        alpha: f64,
        (from, to): (f64, f64),
        count: usize,
        off: impl Fn(usize) -> f64,
    ) -> Vec<ScanPoint> {
        (0..count)
            .map(|i| {
                let t = from + (to - from) * i as f64 / (count - 1) as f64;
                let p = unit_normal(alpha) * (rho + off(i)) + tangent(alpha) * t;
                ScanPoint::new(i, p.norm(), p / p.norm(), &NOISE)
            })
            .collect()
    }

    #[test]
    fn exact_points_give_the_exact_line_at_every_angle() {
        for degrees in (-180..180).step_by(5) {
            let alpha = f64::from(degrees).to_radians();
            let fit = fit_line(wall(2.0, alpha, (-1.0, 2.0), 20, |_| 0.0).iter(), &NO_FLOOR);
            let fit = fit.unwrap();
            assert!((fit.line.line.rho() - 2.0).abs() < 1e-12, "{degrees}");
            let turn = mapfold_map::geometry::difference(fit.line.line.alpha(), alpha);
            assert!(turn.abs() < 1e-12, "{degrees}: {turn}");
            assert!((fit.length() - 3.0).abs() < 1e-9 && fit.worst < 1e-9);
        }
    }

    #[test]
    fn degenerate_points_are_refused() {
        let one_place = vec![wall(2.0, 0.0, (0.0, 1.0), 5, |_| 0.0)[0]; 5];
        assert_eq!(fit_line(one_place.iter(), &NO_FLOOR), Err(FitError::NotLinear));
        let two = wall(2.0, 0.0, (0.0, 1.0), 2, |_| 0.0);
        assert_eq!(fit_line(two.iter(), &NO_FLOOR), Err(FitError::TooFew));
        assert_eq!(fit_line([].iter(), &NO_FLOOR), Err(FitError::TooFew));
        let blob = wall(2.0, 0.3, (-0.1, 0.1), 10, |i| if i % 2 == 0 { 0.1 } else { -0.1 });
        assert_eq!(fit_line(blob.iter(), &NO_FLOOR), Err(FitError::NotLinear));
    }

    #[test]
    fn the_covariance_is_the_closed_form_for_weights_across_the_line() {
        // w = 1 / (n^T C n): var(alpha) = 1 / S_tt, var(rho) = 1 / W + tc^2 / S_tt,
        // cov = tc / S_tt; exact for points on the line.
        let points = wall(2.0, 0.7, (-0.5, 2.5), 30, |_| 0.0);
        let fit = fit_line(points.iter(), &NO_FLOOR).unwrap();
        let (n, u) = (unit_normal(0.7), tangent(0.7));
        let w = |p: &ScanPoint| 1.0 / p.variance(&n);
        let total: f64 = points.iter().map(w).sum();
        let tc = points.iter().map(|p| w(p) * u.dot(&p.at)).sum::<f64>() / total;
        let s_tt: f64 = points.iter().map(|p| w(p) * (u.dot(&p.at) - tc).powi(2)).sum();
        let c = fit.line.covariance.matrix();
        assert!((c[(1, 1)] * s_tt - 1.0).abs() < 1e-9);
        assert!((c[(0, 1)] * s_tt / tc - 1.0).abs() < 1e-9);
        assert!((c[(0, 0)] - (1.0 / total + tc * tc / s_tt)).abs() < 1e-9 * c[(0, 0)]);
    }

    #[test]
    fn twice_the_points_halve_the_covariance_but_not_the_floor() {
        let once = wall(2.0, 0.7, (-1.0, 1.0), 20, |_| 0.0);
        let twice: Vec<_> = once.iter().chain(&once).copied().collect();
        let (a, b) = (
            fit_line(once.iter(), &NO_FLOOR).unwrap().line.covariance,
            fit_line(twice.iter(), &NO_FLOOR).unwrap().line.covariance,
        );
        assert!((a.matrix() - b.matrix() * 2.0).amax() < 1e-15);
        let floor = FitConfig { systematic_sd: 0.01, ..NO_FLOOR };
        let with = fit_line(twice.iter(), &floor).unwrap().line.covariance;
        let added = with.matrix() - b.matrix();
        // At the middle of the wall: the floor itself; its tilt: sd / (L / 2) / sqrt(3).
        assert!((added[(0, 0)] - 1e-4).abs() < 1e-9 && (added[(1, 1)] - 1e-4 / 3.0).abs() < 1e-9);
    }

    /// The closed form alone, with given weights: what the Jacobians are derivatives of.
    fn closed_form(points: &[Point], weights: &[f64]) -> (f64, f64) {
        let total: f64 = weights.iter().sum();
        let c = points.iter().zip(weights).map(|(p, w)| p * *w).sum::<Point>() / total;
        let sum = |f: &dyn Fn(&Point) -> f64| {
            points.iter().zip(weights).map(|(p, w)| w * f(&(p - c))).sum::<f64>()
        };
        let (xx, xy, yy) = (sum(&|d| d.x * d.x), sum(&|d| d.x * d.y), sum(&|d| d.y * d.y));
        let mut alpha = 0.5 * (-2.0 * xy).atan2(yy - xx);
        if unit_normal(alpha).dot(&c) < 0.0 {
            alpha += PI;
        }
        (unit_normal(alpha).dot(&c), alpha)
    }

    #[test]
    fn the_jacobians_are_those_of_the_closed_form() {
        // C = sum J_i C_i J_i^T with J_i by central differences, against the fit's covariance.
        let points = wall(1.5, -2.0, (-2.0, 0.7), 15, |i| 0.01 * ((i * 7 % 5) as f64 - 2.0));
        let fit = fit_line(points.iter(), &NO_FLOOR).unwrap();
        let first = Moments::of(points.iter(), points[0].at, |p| 1.0 / p.variance_along);
        let n = unit_normal(first.normal().0);
        let weights: Vec<f64> = points.iter().map(|p| 1.0 / p.variance(&n)).collect();
        let at: Vec<Point> = points.iter().map(|p| p.at).collect();
        let h = 1e-6;
        let mut covariance = Matrix2::zeros();
        for (i, point) in points.iter().enumerate() {
            let mut j = Matrix2::zeros();
            for axis in 0..2 {
                let moved = |by: f64| {
                    let mut at = at.clone();
                    at[i][axis] += by;
                    closed_form(&at, &weights)
                };
                let (plus, minus) = (moved(h), moved(-h));
                j[(0, axis)] = (plus.0 - minus.0) / (2.0 * h);
                j[(1, axis)] = (plus.1 - minus.1) / (2.0 * h);
            }
            covariance += j * point.covariance().matrix() * j.transpose();
        }
        let difference = (covariance - fit.line.covariance.matrix()).amax();
        assert!(difference < 1e-8 * covariance.amax(), "{difference:e}");
    }

    proptest! {
        #[test]
        fn turning_the_points_turns_the_line_and_nothing_else(
            turn in -PI..PI, rho in 0.3..10.0, alpha in -PI..PI, from in -3.0..0.0, length in 0.5..5.0,
        ) {
            let off = |i: usize| 0.004 * ((i * 13 % 7) as f64 - 3.0);
            let a = fit_line(wall(rho, alpha, (from, from + length), 25, off).iter(), &NO_FLOOR);
            let b =
                fit_line(wall(rho, alpha + turn, (from, from + length), 25, off).iter(), &NO_FLOOR);
            let (a, b) = (a.unwrap(), b.unwrap());
            prop_assert!((a.line.line.rho() - b.line.line.rho()).abs() < 1e-9);
            let turned = mapfold_map::geometry::difference(
                b.line.line.alpha(), a.line.line.alpha() + turn);
            prop_assert!(turned.abs() < 1e-9);
            let scale = a.line.covariance.matrix().amax();
            prop_assert!((a.line.covariance.matrix() - b.line.covariance.matrix()).amax() < 1e-7 * scale);
            prop_assert!((a.chi_sq - b.chi_sq).abs() < 1e-6 * (1.0 + a.chi_sq));
        }
    }
}
