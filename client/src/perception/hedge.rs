//! What a line owes to points at its ends that may be another surface's.
//!
//! Where a wall ends, beams go on to something else, and noise may hide by how much: the last points of
//! a line may lie on it by chance. That the outermost `m` of an end hit something that stands out by an unknown
//! step along their beams is one hypothesis for every `m`; the line is the mean over all of them, each
//! by the probability that the points give it, and its covariance that of the mixture (Bayesian model
//! averaging, Hoeting and others 1999). With `e_i` the residuals, `w_i` the weights, `t_i` the places along the
//! line from its middle, `k_i` the cosines of the beams on the normal, and sums over the `m` points,
//!
//! ```text
//! g = (sum w k / W, sum w k t / S_tt)           what a step of 1 does to offset and slope
//! V = sum w k^2 - W g_0^2 - S_tt g_1^2          what the points know of the step
//! d = s (sum w k e) / V,  s = a / (1 + a),  a = V step_sd^2
//! p ~ prior exp(s (sum w k e)^2 / 2 V) / sqrt(1 + a)
//! ```
//!
//! the line moves by `-d g`, and knows `s g g^T / V` less. Precise ranges show every step, or that there is none, and
//! the hypotheses weigh nothing; the coarser they are, the more of this is honest doubt.

use super::fit::{LineFit, Local};

/// What may stand beside walls.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HedgeConfig {
    /// How likely it is, before its points are looked at, that those at one end of a line are not
    /// all its own.
    pub foreign_share: f64,
    /// Standard deviation of the step from a wall to what adjoins it, metres along the beam: door frames and
    /// furniture; larger ones show at any noise.
    pub step_sd: f64,
    /// Most points at either end that are asked, beside a third of all.
    pub points_max: usize,
}

impl HedgeConfig {
    /// The default.
    pub const STANDARD: Self = Self { foreign_share: 0.3, step_sd: 0.3, points_max: 16 };
}

/// By how much a line moves: offset at its middle, and slope.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Doubt {
    /// The mean.
    pub(super) mean: [f64; 2],
    /// The covariance about it: offset, both, slope.
    pub(super) spread: [f64; 3],
}

impl LineFit {
    /// The line with the doubt about both of its ends in it, of the outermost points of each in their order
    /// inwards.
    pub(super) fn hedged(self, ends: [&[Local]; 2], config: &HedgeConfig) -> Self {
        let [first, last] = ends.map(|end| self.doubt(end, config));
        let mean = [first.mean[0] + last.mean[0], first.mean[1] + last.mean[1]];
        let mut spread = first.spread;
        for (sum, more) in spread.iter_mut().zip(last.spread) {
            *sum += more;
        }
        self.moved(&Doubt { mean, spread })
    }

    /// The doubt that the outermost points of one end, in their order inwards, leave.
    fn doubt(&self, end: &[Local], config: &HedgeConfig) -> Doubt {
        let most = end.len();
        let [per_weight, per_along] = [1.0 / self.weight, 1.0 / self.along];
        // Points that scatter more than their sensor should show a step no better than they do.
        let [per_scatter, step_variance] = [1.0 / self.scatter(), config.step_sd * config.step_sd];
        let share = config.foreign_share / most as f64;
        let (mut h, mut kk, mut ke) = ([0.0; 2], 0.0, 0.0);
        // Those that are all its own weigh the rest.
        let mut total = 1.0 - config.foreign_share;
        let (mut mean, mut second) = ([0.0; 2], [0.0; 3]);
        let (mut asked, mut next) = (0, 1);
        for (i, point) in end.iter().enumerate() {
            let Local { weight: w, place: t, off: e, towards: k } = *point;
            let wk = w * k;
            h[0] += wk;
            h[1] += wk * t;
            kk += wk * k;
            ke += wk * e;
            let m = i + 1;
            // Beyond a few, one more or less makes no difference worth its price.
            if m < next && m < most {
                continue;
            }
            let prior = share * (m - asked) as f64;
            (asked, next) = (m, 2 * m);
            let g = [h[0] * per_weight, h[1] * per_along];
            let known = (kk - h[0] * g[0] - h[1] * g[1]) * per_scatter;
            if known <= 0.0 {
                continue;
            }
            // 1 / (1 + a), and s / V.
            let rest = 1.0 / (1.0 + known * step_variance);
            let variance = step_variance * rest;
            let told = ke * per_scatter;
            let step = variance * told;
            let p = prior * (0.5 * step * told).exp() * rest.sqrt();
            let [offset, slope] = g.map(|g| p * g);
            let step_sq = step * step + variance;
            total += p;
            mean = [mean[0] - offset * step, mean[1] - slope * step];
            second[0] += offset * g[0] * step_sq;
            second[1] += offset * g[1] * step_sq;
            second[2] += slope * g[1] * step_sq;
        }
        // No more than numbers hold: a line that is so wrong has long been refused.
        if !total.is_finite() {
            return Doubt::default();
        }
        let mean = mean.map(|sum| sum / total);
        let about = |sum: f64, a: f64, b: f64| sum / total - a * b;
        Doubt {
            mean,
            spread: [
                about(second[0], mean[0], mean[0]),
                about(second[1], mean[0], mean[1]),
                about(second[2], mean[1], mean[1]),
            ],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::perception::fit::{FitConfig, fit_line};
    use crate::perception::points::{NoiseConfig, ScanPoint};
    use mapfold_map::geometry::Point;

    const FIT: FitConfig = FitConfig { systematic_sd: 0.0, linearity_min: 0.8 };

    /// Points on x = 2 from y = -1.5 to 1.5 with an alternating error of one deviation, of which the last
    /// six stand out by `step`; and the line that the first of them show.
    fn wall(range_sd: f64, step: f64) -> (Vec<ScanPoint>, LineFit, LineFit) {
        let noise = NoiseConfig { range_sd, range_sd_per_metre: 0.0, bearing_sd: 1e-6 };
        let points: Vec<ScanPoint> = (0..40)
            .map(|i| {
                let error = if i % 2 == 0 { range_sd } else { -range_sd };
                let p = Point::new(2.0, -1.5 + 3.0 * f64::from(i) / 39.0);
                let range = p.norm() + error + if i >= 34 { step } else { 0.0 };
                ScanPoint::new(i as usize, range, p / p.norm(), &noise)
            })
            .collect();
        let fit = fit_line(points.iter(), &FIT).unwrap();
        let own = fit_line(points[..34].iter(), &FIT).unwrap();
        (points, fit, own)
    }

    fn hedged(points: &[ScanPoint], fit: LineFit) -> LineFit {
        let most = HedgeConfig::STANDARD.points_max.min(points.len() / 3);
        let first: Vec<_> = points.iter().take(most).map(|p| fit.local(p)).collect();
        let last: Vec<_> = points.iter().rev().take(most).map(|p| fit.local(p)).collect();
        fit.hedged([&first, &last], &HedgeConfig::STANDARD)
    }

    fn sd_of_angle(fit: &LineFit) -> f64 {
        fit.line.covariance.matrix()[(1, 1)].sqrt()
    }

    #[test]
    fn a_doubtful_end_turns_the_line_to_the_rest_of_its_points_and_makes_it_less_sure() {
        let (points, fit, own) = wall(0.08, 0.2);
        let hedged = hedged(&points, fit);
        let alpha = |fit: &LineFit| fit.line.line.alpha();
        let (before, after) = (alpha(&fit) - alpha(&own), alpha(&hedged) - alpha(&own));
        assert!(before.abs() > 0.02 && after.abs() < 0.8 * before.abs(), "{before} {after}");
        assert!(sd_of_angle(&hedged) > 1.3 * sd_of_angle(&fit));
        // It is still a line whose normal leaves the sensor.
        assert!((hedged.normal.norm() - 1.0).abs() < 1e-12 && hedged.line.line.rho() > 0.0);
        assert!((hedged.tangent.dot(&hedged.normal)).abs() < 1e-12);
    }

    #[test]
    fn precise_ranges_leave_little_doubt() {
        let (points, fit, _) = wall(0.005, 0.0);
        let hedged = hedged(&points, fit);
        assert!((hedged.line.line.alpha() - fit.line.line.alpha()).abs() < 0.1 * sd_of_angle(&fit));
        let grown = sd_of_angle(&hedged) / sd_of_angle(&fit);
        assert!((1.0..1.05).contains(&grown), "{grown}");
    }

    #[test]
    fn a_point_whose_step_is_sure_and_free_tells_nothing() {
        let (points, fit, _) = wall(0.02, 0.1);
        let config = HedgeConfig { foreign_share: 1.0, step_sd: 1e3, points_max: 1 };
        let doubt = fit.doubt(&[fit.local(&points[39])], &config);
        let without = fit_line(points[..39].iter(), &FIT).unwrap();
        let hedged = fit.moved(&doubt);
        let (a, b) = (&hedged.line, &without.line);
        let sd = sd_of_angle(&without);
        let turned = (a.line.alpha() - fit.line.line.alpha()).abs();
        assert!(turned > 0.1 * sd, "{turned} {sd}");
        assert!((a.line.alpha() - b.line.alpha()).abs() < 0.01 * sd);
        assert!((a.line.rho() - b.line.rho()).abs() < 0.01 * b.covariance.matrix()[(0, 0)].sqrt());
        // As sure as the others are, but for the scatter, which is that of all.
        let ratio = fit.scatter() / without.scatter();
        let surer = b.covariance.matrix()[(1, 1)] * ratio / a.covariance.matrix()[(1, 1)];
        assert!((surer - 1.0).abs() < 0.02, "{surer}");
    }
}
