//! Weighted total least squares: the line of a set of points, with its covariance.
//!
//! Closed form for given weights (`N = -2 S_xy`, `D = S_yy - S_xx`, `alpha = atan2(N, D) / 2`,
//! `rho = n . c`): a first pass weighs every point by its range variance and needs sums only, which
//! for a stretch of a scan are differences of running sums and cost nothing (`guess`); the
//! next weigh it by its variance across the line found, until that no longer turns. The covariance
//! sums the points' own covariances through the Jacobians of the closed form,
//!
//! ```text
//! d alpha / dp_i = -(w_i / Lambda) (t_i n + e_i u),   Lambda = sqrt(N^2 + D^2)
//! d rho   / dp_i =  (w_i / W) n + (u . c) d alpha / dp_i
//! ```
//!
//! which for weights `1 / (n^T C_i n)` and residuals `e_i` that are small against the coordinates
//! `t_i` along the line is `1 / S_tt` and `1 / W` about the centre. A floor is added for what all
//! beams on one surface have in common and more beams do not average out. Only vector forms:
//! projections through `1 / tan(alpha)` have no place here.

use mapfold_map::geometry::{Covariance, Point, Sensor, UncertainLine};
use nalgebra::Matrix2;

use super::guess::Sums;
use super::hedge::Doubt;
use super::points::ScanPoint;
use super::tally::{Frame, Tally};
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
        Self { systematic_sd: profile.systematic_sd_m, linearity_min: 0.8 }
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
    /// Coordinates of the first and the last point along the line, the lesser first.
    pub span: (f64, f64),
    /// Sum of the points' weights, `1 / (n^T C n)`.
    pub(super) weight: f64,
    /// Second moment along the line about the middle, with these weights.
    pub(super) along: f64,
    /// Coordinate of the middle along the line.
    middle: f64,
}

impl LineFit {
    /// Signed distance of `p` from the line, away from the sensor.
    pub fn residual(&self, p: &Point) -> f64 {
        self.normal.dot(p) - self.line.line.rho()
    }

    /// Variance of the line's place across itself at the foot point of `p`.
    pub fn variance_at(&self, p: &Point) -> f64 {
        let c = self.line.covariance.matrix();
        let t = self.tangent.dot(p);
        (c[(0, 0)] - 2.0 * t * c[(0, 1)] + t * t * c[(1, 1)]).max(0.0)
    }

    /// The same line with the span of all of a wall's points, which need not all have been fitted.
    pub(super) fn spanning(self, first: &Point, last: &Point) -> Self {
        let (a, b) = (self.tangent.dot(first), self.tangent.dot(last));
        Self { span: (a.min(b), a.max(b)), ..self }
    }

    /// The line moved and less certain by what is in doubt about it; as it is where that leaves none.
    pub(super) fn moved(self, doubt: &Doubt) -> Self {
        let ([offset, slope], tm) = (doubt.mean, self.middle);
        let middle = self.normal * (self.line.line.rho() + offset) + self.tangent * tm;
        let normal = (self.normal - self.tangent * slope) / (1.0 + slope * slope).sqrt();
        let tangent = Point::new(-normal.y, normal.x);
        let (rho, tc) = (normal.dot(&middle), tangent.dot(&middle));
        let c = self.line.covariance.matrix();
        // About the middle. A slope is a turn the other way.
        let about_middle = [
            c[(0, 0)] - tm * (2.0 * c[(0, 1)] - tm * c[(1, 1)]) + doubt.spread[0],
            c[(0, 1)] - tm * c[(1, 1)] - doubt.spread[1],
            c[(1, 1)] + doubt.spread[2],
        ];
        match line_about(about_middle, rho, &normal, tc) {
            Some(line) if rho > 0.0 => Self { line, normal, tangent, middle: tc, ..self },
            _ => self,
        }
    }

    /// Length of wall that the points cover.
    pub fn length(&self) -> f64 {
        self.span.1 - self.span.0
    }

    /// A point as the line sees it.
    #[inline]
    pub(super) fn local(&self, point: &ScanPoint) -> Local {
        let (n, u) = (&self.normal, &self.tangent);
        let off = n.dot(&point.at) - self.line.line.rho();
        let (towards, beside) = (point.direction.dot(n), point.direction.dot(u));
        let (along, across) = (point.variance_along, point.variance_across);
        let weight = 1.0 / (along * towards * towards + across * beside * beside);
        let slip = (along - across) * towards * beside * weight;
        let place = u.dot(&point.at) - self.middle - off * slip;
        Local { weight, place, off, towards }
    }

    /// How many of these points, the outermost of one end in their order inwards, stand together
    /// off the line: the largest number whose summed residuals are more than `sds` deviations from
    /// nothing. Each alone may lie well within its own noise. The sum of `m` weighted residuals has the
    /// variance `W_m - W_m^2 / W - T_m^2 / S_tt`, for the line has followed them as far as it could.
    pub(super) fn astray(&self, end: &[Local], sds: f64) -> usize {
        let [per_weight, per_along] = [1.0 / self.weight, 1.0 / self.along];
        let (mut weight, mut along, mut sum) = (0.0, 0.0, 0.0);
        let (mut worst, mut astray) = (sds * sds, 0);
        for (i, point) in end.iter().enumerate() {
            weight += point.weight;
            along += point.weight * point.place;
            sum += point.weight * point.off;
            let variance = weight - weight * weight * per_weight - along * along * per_along;
            if sum * sum > worst * variance && variance > 0.0 {
                worst = sum * sum / variance;
                astray = i + 1;
            }
        }
        astray
    }

    /// How far these points bow off the line between their ends, and the standard deviation of
    /// that, metres: the regression of their residuals on what is left of `t^2` when the
    /// line has taken its part.
    pub(super) fn bow<'a>(&self, points: impl Iterator<Item = &'a ScanPoint>) -> (f64, f64) {
        let (mut ttt, mut tttt, mut tte) = (0.0, 0.0, 0.0);
        for point in points {
            let Local { weight: w, place: t, off: e, .. } = self.local(point);
            let tt = t * t;
            ttt += w * tt * t;
            tttt += w * tt * tt;
            tte += w * tt * e;
        }
        let left = tttt - self.along * self.along / self.weight - ttt * ttt / self.along;
        let quarter = 0.25 * self.length() * self.length();
        (quarter * (tte / left).abs(), quarter / left.sqrt())
    }

    /// By how much more than their noise its points scatter, as a variance, at least 1.
    pub(super) fn scatter(&self) -> f64 {
        (self.chi_sq / (self.count - 2) as f64).max(1.0)
    }

    /// Root mean square of the normalised residuals.
    pub fn rms(&self) -> f64 {
        (self.chi_sq / self.count as f64).sqrt()
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
    let first = points.clone().next().ok_or(FitError::TooFew)?.at;
    let last = points.clone().last().map_or(first, |point| point.at);
    let sums = points.clone().fold(Sums::default(), |sums, point| {
        sums.with(&(point.at - first), 1.0 / point.variance_along)
    });
    let mut guess = sums.guess();
    guess.centre += first;
    let shared = points.clone().map(|point| point.variance_shared).sum();
    let again = move |frame: &Frame| frame.tally(points.clone());
    let frame = guess.frame();
    let fitted = fit_from((frame, again(&frame)), [&first, &last], shared, again, config);
    fitted.map(|(fit, ..)| fit)
}

/// Fits a line to points that have been summed about a frame: their first and last, the sum of the variances
/// that neighbours share, and a way to sum them about another. The frame in which the line was found goes with
/// it.
///
/// # Errors
/// As for [`fit_line`].
pub(super) fn fit_from(
    (mut frame, mut tally): (Frame, Tally),
    ends: [&Point; 2],
    shared: f64,
    again: impl Fn(&Frame) -> Tally,
    config: &FitConfig,
) -> Result<(LineFit, Frame, Tally), FitError> {
    let count = tally.count;
    if count < 3 {
        return Err(FitError::TooFew);
    }
    let mut moments = tally.moments();
    for _ in 0..STEPS_MAX {
        let slope = moments.slope();
        // NaN is no small slope.
        if slope.abs() < SLOPE_SETTLED {
            break;
        }
        frame = frame.turned(slope, &moments);
        tally = again(&frame);
        moments = tally.moments();
    }
    let slope = moments.slope();
    let along = moments.tt;
    // As wide as their noise makes them, points may still be a line. Written so that NaN fails too.
    let width = (moments.ee - count as f64).max(0.0);
    if !(along > 0.0 && along - width >= config.linearity_min * (along + width)) {
        return Err(FitError::NotLinear);
    }
    let Frame { mut normal, centre, .. } = frame.turned(slope, &moments);
    if normal.dot(&centre) < 0.0 {
        normal = -normal;
    }
    let tangent = Point::new(-normal.y, normal.x);
    let (rho, tc) = (normal.dot(&centre), tangent.dot(&centre));
    let [a, b] = ends.map(|end| tangent.dot(end));
    let span = (a.min(b), a.max(b));

    let half_length = 0.5 * (span.1 - span.0);
    // The variance of a mean of errors that are all alike is at most the mean of their variances.
    let floor = config.systematic_sd * config.systematic_sd + shared / count as f64;
    let chi_sq = (moments.ee - slope * moments.te).max(0.0);
    // Points that scatter more than their sensor should know the line no better than they do.
    let scatter = (chi_sq / (count - 2) as f64).max(1.0);
    let tilt = scatter / along + floor / (3.0 * half_length * half_length);
    let shift = scatter / moments.weight + floor;
    // Points without extent give no finite matrix.
    let line = line_about([shift, 0.0, tilt], rho, &normal, tc).ok_or(FitError::NotLinear)?;
    let weight = moments.weight;
    let fit = LineFit { line, normal, tangent, count, chi_sq, span, weight, along, middle: tc };
    Ok((fit, frame, tally))
}

/// A line whose variance of the offset at `middle` along it, covariance with its angle and variance of that
/// are these.
fn line_about(
    [offset, both, angle]: [f64; 3],
    rho: f64,
    normal: &Point,
    middle: f64,
) -> Option<UncertainLine<Sensor>> {
    let cross = both + middle * angle;
    let at_foot = offset + middle * (both + cross);
    let covariance = Covariance::new(Matrix2::new(at_foot, cross, cross, angle)).ok()?;
    Some(UncertainLine::normal_form(rho, normal.y.atan2(normal.x), covariance).0)
}

/// Most turns of the frame, and the slope in it from which on no more is needed, radians: the error
/// left is of the order of its square.
const STEPS_MAX: usize = 3;
const SLOPE_SETTLED: f64 = 0.02;

/// A point as a line sees it. Where its beam meets the line, and not the foot of its end there, is its place:
/// errors lie along the beam, and what they do along the wall is not the wall's doing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Local {
    /// `1 / (n^T C n)`.
    pub(super) weight: f64,
    /// Where its beam meets the line, from the line's middle.
    pub(super) place: f64,
    /// How far off the line it ended, away from the sensor.
    pub(super) off: f64,
    /// The cosine of its beam on the normal.
    pub(super) towards: f64,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::perception::points::NoiseConfig;
    use mapfold_map::geometry::{tangent, unit_normal};
    use proptest::prelude::*;
    use std::f64::consts::PI;

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
            assert!((fit.length() - 3.0).abs() < 1e-9 && fit.chi_sq < 1e-9);
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
    fn the_covariance_is_that_of_the_closed_form_through_its_jacobians() {
        // C = sum J_i C_i J_i^T with J_i by central differences, against the fit's covariance, with
        // residuals as large as the noise.
        let points = wall(1.5, -2.0, (-2.0, 0.7), 15, |i| 0.01 * ((i * 7 % 5) as f64 - 2.0));
        let fit = fit_line(points.iter(), &NO_FLOOR).unwrap();
        let weights: Vec<f64> = points.iter().map(|p| 1.0 / p.variance(&fit.normal)).collect();
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
        assert!(difference < 5e-3 * covariance.amax(), "{difference:e}");
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
