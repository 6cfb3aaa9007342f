//! Where a wall ends, and what that end is.
//!
//! A *corner* is where the neighbouring wall of the same run meets it: the end is the
//! intersection. At a *jump* the view goes on behind, be it past a stray reading or two: the wall
//! ends somewhere between its last point and where the next beam would have met it, so the end is
//! taken half-way and is uncertain by that spacing over the square root of 12. Everything else is
//! *occluded*: something stands in front, the scan ends, nothing came back, or clutter adjoins. There
//! only the last point is known, and the wall may go on.

use std::ops::Range;

use mapfold_map::geometry::Point;
use mapfold_map::vector::{EndKind, ObservedEnd};

use super::breakpoints::Ring;
use super::fit::LineFit;
use super::points::ScanPoint;
use super::split::FoundLine;

/// What the ends of a wall are.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct EndsConfig {
    /// Least sine of the angle between two walls that make a corner (20 degrees).
    pub corner_sine_min: f64,
    /// Farthest that the intersection may lie from the walls' last points, metres, before three
    /// standard deviations are added.
    pub corner_reach: f64,
    /// Points of neither wall that may lie between them at a corner, and off a wall between its last
    /// point and the first beam that goes on behind it: readings at edges are mixed.
    pub corner_strays: usize,
    /// Longest stretch between the last point and the next beam's at which an end still counts as
    /// seen, metres.
    pub jump_spacing_max: f64,
    /// How much farther than the wall the next beam must have gone, metres, before three standard
    /// deviations are added.
    pub jump_depth_min: f64,
    /// So many beams without a point hide what is there.
    pub missing_beams: usize,
    /// Shortest segment that its corners may leave, metres: half the shortest line.
    pub length_min: f64,
}

impl Default for EndsConfig {
    fn default() -> Self {
        Self {
            corner_sine_min: 0.35,
            corner_reach: 0.15,
            corner_strays: 2,
            jump_spacing_max: 0.5,
            jump_depth_min: 0.15,
            missing_beams: 3,
            length_min: 0.1,
        }
    }
}

/// A line with its ends, along its own tangent from the foot point of the sensor.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ended {
    /// Coordinate of the lower end, metres.
    pub(super) from: f64,
    /// Coordinate of the upper end, metres.
    pub(super) to: f64,
    /// The lower and the upper end.
    pub(super) ends: [ObservedEnd; 2],
}

/// The side of a line towards lower or higher bearings: along its tangent, bearings grow.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Lower,
    Upper,
}

/// What surrounds a scan's lines.
#[derive(Debug, Clone, Copy)]
pub(super) struct View<'a> {
    /// All points.
    pub(super) points: &'a [ScanPoint],
    /// Where the beams point.
    pub(super) directions: &'a [Point],
    /// The runs that the points fall into, ascending.
    pub(super) runs: &'a [Range<usize>],
    /// How the beams follow each other.
    pub(super) ring: Ring,
    /// The settings.
    pub(super) config: &'a EndsConfig,
}

impl View<'_> {
    /// The ends of line `i`, which lies in run `run`; `None` if its corners leave too little of it.
    pub(super) fn ends(&self, lines: &[FoundLine], i: usize, run: usize) -> Option<Ended> {
        let line = &lines[i];
        let run = &self.runs[run];
        // A room seen all round in one run has no first wall: its last one comes before it.
        let endless = self.ring.closed && self.runs.len() == 1 && lines.len() > 1;
        let neighbour = |at: Option<usize>, round: usize| {
            let at = at.filter(|at| *at < lines.len()).or(endless.then_some(round));
            at.map(|at| &lines[at]).filter(|n| run.contains(&n.first()))
        };
        let before = neighbour(i.checked_sub(1), lines.len() - 1);
        let after = neighbour(Some(i + 1), 0);
        let (from, lower) = self.end(line, run, before, Side::Lower);
        let (to, upper) = self.end(line, run, after, Side::Upper);
        (to - from >= self.config.length_min).then_some(Ended { from, to, ends: [lower, upper] })
    }

    fn end(
        &self,
        line: &FoundLine,
        run: &Range<usize>,
        next: Option<&FoundLine>,
        side: Side,
    ) -> (f64, ObservedEnd) {
        let fit = &line.fit;
        let (last, t_last, strays) = match side {
            Side::Lower => (line.first(), fit.span.0, line.first() - run.start),
            Side::Upper => (line.last(), fit.span.1, run.end - line.last() - 1),
        };
        if let Some((t, sd)) = next.and_then(|next| self.corner(line, next, side)) {
            return (t, ObservedEnd { kind: EndKind::Corner, sd });
        }
        let point = &self.points[last];
        let hit_variance = point.variance(&fit.tangent);
        if let Some(spacing) = self.jump(fit, (last, strays), t_last, side) {
            let half = match side {
                Side::Lower => -0.5 * spacing,
                Side::Upper => 0.5 * spacing,
            };
            let sd = (spacing * spacing / 12.0 + hit_variance).sqrt();
            return (t_last + half, ObservedEnd { kind: EndKind::Jump, sd });
        }
        (t_last, ObservedEnd { kind: EndKind::Occluded, sd: hit_variance.sqrt() })
    }

    /// The intersection with the neighbouring wall, as a coordinate along `line`, and its sd.
    fn corner(&self, line: &FoundLine, next: &FoundLine, side: Side) -> Option<(f64, f64)> {
        let (lower, upper) = match side {
            Side::Lower => (next, line),
            Side::Upper => (line, next),
        };
        // Round the end of the points, if need be.
        let count = self.points.len();
        let strays = (upper.first() + count - lower.last() - 1) % count;
        if strays > self.config.corner_strays {
            return None;
        }
        let (t, variance) = intersection(&line.fit, &next.fit, self.config.corner_sine_min)?;
        let (t_next, variance_next) =
            intersection(&next.fit, &line.fit, self.config.corner_sine_min)?;
        let (own, other) = match side {
            Side::Lower => (line.fit.span.0, next.fit.span.1),
            Side::Upper => (line.fit.span.1, next.fit.span.0),
        };
        let reach = |variance: f64| self.config.corner_reach + 3.0 * variance.sqrt();
        let meets =
            (t - own).abs() <= reach(variance) && (t_next - other).abs() <= reach(variance_next);
        meets.then(|| (t, variance.sqrt()))
    }

    /// How far apart along the wall its last point and the first beam past it and past the strays of
    /// its run are, if that beam went on behind.
    fn jump(
        &self,
        fit: &LineFit,
        (last, strays): (usize, usize),
        t_last: f64,
        side: Side,
    ) -> Option<f64> {
        if strays > self.config.corner_strays {
            return None;
        }
        let (count, away) = (self.points.len(), strays + 1);
        if away >= count {
            return None;
        }
        let next = match side {
            Side::Lower => &self.points[(last + count - away) % count],
            Side::Upper => &self.points[(last + away) % count],
        };
        let here = &self.points[last];
        let steps = match side {
            Side::Lower => self.ring.steps(next.beam, here.beam),
            Side::Upper => self.ring.steps(here.beam, next.beam),
        }?;
        if steps > self.config.missing_beams + strays {
            return None;
        }
        // Where the next beam would have met this wall.
        let direction = self.directions[next.beam];
        let towards = fit.normal.dot(&direction);
        if towards <= 0.0 {
            return None;
        }
        let range_on_wall = fit.line.line.rho() / towards;
        let spacing = (fit.tangent.dot(&direction) * range_on_wall - t_last).abs();
        let depth = self.config.jump_depth_min + 3.0 * next.variance_along.sqrt();
        (spacing <= self.config.jump_spacing_max && next.range > range_on_wall + depth)
            .then_some(spacing)
    }
}

/// Where two lines cross, as a coordinate along the first, and its variance (first order):
/// `t = (r2 - r1 cos d) / sin d` with `d` the turn from the first normal to the second.
fn intersection(a: &LineFit, b: &LineFit, sine_min: f64) -> Option<(f64, f64)> {
    let (sine, cosine) = (a.normal.perp(&b.normal), a.normal.dot(&b.normal));
    if sine.abs() < sine_min {
        return None;
    }
    let (r1, r2) = (a.line.line.rho(), b.line.line.rho());
    let t = (r2 - r1 * cosine) / sine;
    let j_turn = (r1 - r2 * cosine) / (sine * sine);
    let (ja, jb) = ([-cosine / sine, -j_turn], [1.0 / sine, j_turn]);
    let through = |j: [f64; 2], fit: &LineFit| {
        let c = fit.line.covariance.matrix();
        j[0] * j[0] * c[(0, 0)] + 2.0 * j[0] * j[1] * c[(0, 1)] + j[1] * j[1] * c[(1, 1)]
    };
    Some((t, (through(ja, a) + through(jb, b)).max(0.0)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::perception::fit::{FitConfig, fit_line};
    use crate::perception::points::{NoiseConfig, ScanPoint};
    use mapfold_map::geometry::{tangent, unit_normal};

    const NOISE: NoiseConfig =
        NoiseConfig { range_sd: 0.02, range_sd_per_metre: 0.0, bearing_sd: 0.002 };

    fn line(rho: f64, alpha: f64, from: f64, to: f64) -> LineFit {
        let points: Vec<ScanPoint> = (0..20)
            .map(|i| {
                let t = from + (to - from) * f64::from(i) / 19.0;
                let p: Point = unit_normal(alpha) * rho + tangent(alpha) * t;
                ScanPoint::new(i as usize, p.norm(), p / p.norm(), &NOISE)
            })
            .collect();
        fit_line(points.iter(), &FitConfig { systematic_sd: 0.005, linearity_min: 0.9 }).unwrap()
    }

    #[test]
    fn a_corner_is_exact_at_any_angle() {
        for degrees in (-180..180).step_by(15) {
            let turn = f64::from(degrees).to_radians();
            // Walls x = 2 and y = 1.5, turned: they meet 1.5 m along the first.
            let a = line(2.0, turn, -1.0, 1.4);
            let b = line(1.5, turn + std::f64::consts::FRAC_PI_2, -1.9, 1.0);
            let (t, _) = intersection(&a, &b, 0.35).unwrap();
            assert!((t - 1.5).abs() < 1e-9, "{degrees}: {t}");
            let (t, _) = intersection(&b, &a, 0.35).unwrap();
            assert!((t + 2.0).abs() < 1e-9, "{degrees}: {t}");
        }
    }

    #[test]
    fn the_variance_of_a_corner_is_that_of_its_differences() {
        let (a, b) = (line(2.0, 0.2, -1.0, 1.4), line(1.6, 1.4, -1.9, 1.0));
        let t = |r1: f64, a1: f64, r2: f64, a2: f64| (r2 - r1 * (a2 - a1).cos()) / (a2 - a1).sin();
        let (r1, a1) = (a.line.line.rho(), a.line.line.alpha());
        let (r2, a2) = (b.line.line.rho(), b.line.line.alpha());
        let h = 1e-6;
        let j1 = [
            (t(r1 + h, a1, r2, a2) - t(r1 - h, a1, r2, a2)) / (2.0 * h),
            (t(r1, a1 + h, r2, a2) - t(r1, a1 - h, r2, a2)) / (2.0 * h),
        ];
        let j2 = [
            (t(r1, a1, r2 + h, a2) - t(r1, a1, r2 - h, a2)) / (2.0 * h),
            (t(r1, a1, r2, a2 + h) - t(r1, a1, r2, a2 - h)) / (2.0 * h),
        ];
        let through = |j: [f64; 2], f: &LineFit| {
            let c = f.line.covariance.matrix();
            (0..2)
                .flat_map(|i| (0..2).map(move |k| (i, k)))
                .map(|(i, k)| j[i] * c[(i, k)] * j[k])
                .sum::<f64>()
        };
        let expected = through(j1, &a) + through(j2, &b);
        let (at, variance) = intersection(&a, &b, 0.35).unwrap();
        assert!((at - t(r1, a1, r2, a2)).abs() < 1e-12);
        assert!((variance / expected - 1.0).abs() < 1e-6, "{variance} {expected}");
    }

    #[test]
    fn nearly_parallel_walls_make_no_corner() {
        assert_eq!(
            intersection(&line(2.0, 0.0, -1.0, 1.0), &line(2.0, 0.2, -1.0, 1.0), 0.35),
            None
        );
    }
}
