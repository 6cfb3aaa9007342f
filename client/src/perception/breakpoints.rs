//! Which neighbouring beams may have hit one surface (adaptive breakpoints after Borges and
//! Aldon, 2004).
//!
//! Two neighbours are apart if their points are farther from each other than a surface at the
//! worst incidence `lambda` would put them: `D = r sin(dphi) / sin(lambda - dphi) + 3 s_r`. With
//! beams a degree apart that is half a metre at 4 m and would jump a door frame, so beyond a cap
//! the gap must be bridged: the points on one side lie on a line that goes through the first
//! point of the other. (A door that stands open shows a point behind it and is no gap between
//! neighbours.)

use std::ops::Range;

use mapfold_map::geometry::Point;

use super::fit::{FitConfig, fit_line};
use super::points::ScanPoint;

/// When neighbours are apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BreakpointConfig {
    /// Worst angle between beam and surface at which points still count as one surface, radians
    /// (8 to 15 degrees in the literature).
    pub worst_incidence: f64,
    /// Gaps up to this need no confirmation, metres: less than any door's width, more than a
    /// door frame's step.
    pub gap_cap: f64,
    /// Points on one side whose line must bridge a wider gap, at least 3.
    pub confirming_points: usize,
    /// How many standard deviations they, and the point across, may lie off that line.
    pub confirming_sds: f64,
    /// So many beams without a point always break.
    pub missing_beams: usize,
}

impl Default for BreakpointConfig {
    fn default() -> Self {
        Self {
            worst_incidence: 10f64.to_radians(),
            gap_cap: 0.30,
            confirming_points: 4,
            confirming_sds: 3.0,
            missing_beams: 3,
        }
    }
}

/// How a scan's beams follow each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Ring {
    /// Whether the last beam is the first one's neighbour.
    pub closed: bool,
    /// Number of beams.
    pub beams: usize,
}

impl Ring {
    /// Beams from `a` to `b` in the order of the scan, round the seam if it is closed; `None` if
    /// `b` does not come after `a`.
    pub fn steps(&self, a: usize, b: usize) -> Option<usize> {
        if b > a {
            Some(b - a)
        } else if self.closed {
            Some(b + self.beams - a)
        } else {
            None
        }
    }
}

/// The points, and the runs of them that may each lie on one surface. The points of a closed scan
/// are turned so that no run straddles their end; a run that has neither beginning nor end begins
/// at its outermost point, which is never within a wall.
pub fn runs(
    mut points: Vec<ScanPoint>,
    ring: Ring,
    increment: f64,
    config: &BreakpointConfig,
    fit: &FitConfig,
) -> (Vec<ScanPoint>, Vec<Range<usize>>) {
    let count = points.len();
    if count == 0 {
        return (points, Vec::new());
    }
    let apart: Vec<bool> = (0..count)
        .map(|i| {
            let j = (i + 1) % count;
            count == 1
                || ring.steps(points[i].beam, points[j].beam).is_none_or(|steps| {
                    steps > config.missing_beams
                        || distance(&points, i, j)
                            > surface_gap(&points[i], steps, increment, config)
                })
        })
        .collect();
    // `apart` now holds for gaps that no surface can explain; wide ones need confirmation.
    let apart: Vec<bool> = (0..count)
        .map(|i| {
            let j = (i + 1) % count;
            apart[i]
                || (distance(&points, i, j) > config.gap_cap
                    && !confirmed(&points, &apart, i, config, fit))
        })
        .collect();
    let start = if ring.closed {
        apart.iter().rposition(|a| *a).map_or_else(|| outermost(&points), |last| (last + 1) % count)
    } else {
        0
    };
    points.rotate_left(start);
    let mut runs = Vec::new();
    let mut from = 0;
    for i in 0..count {
        if apart[(start + i) % count] || i + 1 == count {
            runs.push(from..i + 1);
            from = i + 1;
        }
    }
    (points, runs)
}

fn distance(points: &[ScanPoint], i: usize, j: usize) -> f64 {
    (points[j].at - points[i].at).norm()
}

/// How far apart the points of one surface can be, `steps` beams on.
fn surface_gap(a: &ScanPoint, steps: usize, increment: f64, config: &BreakpointConfig) -> f64 {
    let turn = increment * steps as f64;
    let noise = 3.0 * a.variance_along.sqrt();
    if turn >= config.worst_incidence {
        return config.gap_cap + noise;
    }
    a.range * turn.sin() / (config.worst_incidence - turn).sin() + noise
}

/// Whether the gap after point `i` is bridged by a line: several points on one side of it, none
/// apart from its neighbour, lie on a line on which the first point of the other side lies too.
fn confirmed(
    points: &[ScanPoint],
    apart: &[bool],
    i: usize,
    config: &BreakpointConfig,
    fit: &FitConfig,
) -> bool {
    let (count, k) = (points.len(), config.confirming_points);
    if k >= count {
        return false;
    }
    // The k points from `first` on, in order, and the point across the gap.
    let agrees = |first: usize, across: usize| {
        let at = |offset: usize| (first + offset) % count;
        if (0..k - 1).any(|offset| apart[at(offset)]) {
            return false;
        }
        let side = (0..k).map(|offset| &points[at(offset)]);
        fit_line(side, fit).is_ok_and(|line| {
            let point = &points[across];
            let variance = point.variance(&line.normal) + line.variance_at(&point.at);
            line.worst <= config.confirming_sds
                && line.residual(&point.at).abs() <= config.confirming_sds * variance.sqrt()
        })
    };
    agrees((i + count + 1 - k) % count, (i + 1) % count) || agrees((i + 1) % count, i)
}

/// The point farthest from the mean of all: a corner of their convex hull.
fn outermost(points: &[ScanPoint]) -> usize {
    let mean = points.iter().map(|p| p.at).sum::<Point>() / points.len() as f64;
    let mut best = (0, f64::NEG_INFINITY);
    for (i, p) in points.iter().enumerate() {
        let distance_sq = (p.at - mean).norm_squared();
        if distance_sq > best.1 {
            best = (i, distance_sq);
        }
    }
    best.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::perception::points::NoiseConfig;
    use mapfold_map::geometry::unit_normal;

    const NOISE: NoiseConfig =
        NoiseConfig { range_sd: 0.02, range_sd_per_metre: 0.0, bearing_sd: 0.001 };

    /// Points of beams one degree apart; `None` for a beam without one.
    fn points_of(ranges: &[Option<f64>]) -> Vec<ScanPoint> {
        ranges
            .iter()
            .enumerate()
            .filter_map(|(beam, range)| {
                let direction = unit_normal((beam as f64).to_radians());
                range.map(|r| ScanPoint::new(beam, r, direction, &NOISE))
            })
            .collect()
    }

    fn runs_of(ranges: &[Option<f64>], closed: bool) -> (Vec<ScanPoint>, Vec<Range<usize>>) {
        let ring = Ring { closed, beams: ranges.len() };
        let fit = FitConfig { systematic_sd: 0.01, linearity_min: 0.9 };
        runs(points_of(ranges), ring, 1f64.to_radians(), &BreakpointConfig::default(), &fit)
    }

    #[test]
    fn the_law_of_sines_gives_the_published_distances() {
        let at = |r, degrees: f64, lambda: f64| {
            let config = BreakpointConfig {
                worst_incidence: lambda.to_radians(),
                ..BreakpointConfig::default()
            };
            let p = ScanPoint::new(
                0,
                r,
                Point::new(1.0, 0.0),
                &NoiseConfig { range_sd: 0.02, range_sd_per_metre: 0.0, bearing_sd: 0.0 },
            );
            surface_gap(&p, 1, degrees.to_radians(), &config)
        };
        assert!((at(4.0, 1.0, 10.0) - 0.506).abs() < 1e-3);
        assert!((at(4.0, 1.0, 15.0) - 0.349).abs() < 1e-3);
        assert!((at(4.0, 0.25, 10.0) - 0.163).abs() < 1e-3);
    }

    #[test]
    fn a_step_and_three_missing_beams_break() {
        let mut ranges = vec![Some(2.0); 10];
        ranges.extend(vec![Some(3.0); 10]);
        assert_eq!(runs_of(&ranges, false).1, [0..10, 10..20]);
        let mut ranges = vec![Some(2.0); 20];
        ranges[5] = None;
        assert_eq!(runs_of(&ranges, false).1.len(), 1);
        ranges[6] = None;
        ranges[7] = None;
        assert_eq!(runs_of(&ranges, false).1, [0..5, 5..17]);
    }

    #[test]
    fn a_wide_gap_on_one_wall_is_bridged_and_a_door_frame_is_not() {
        // A wall seen at a grazing angle: its points are up to 0.6 m apart.
        let ranges: Vec<_> =
            (10..18).map(|d| Some(1.2 / f64::from(d).to_radians().sin())).collect();
        let wall: Vec<_> = points_of(&ranges)
            .iter()
            .map(|p| {
                let direction = unit_normal((10.0 + p.beam as f64).to_radians());
                ScanPoint::new(p.beam, p.range, direction, &NOISE)
            })
            .collect();
        assert!(distance(&wall, 0, 1) > 0.6 && distance(&wall, 4, 5) > 0.3);
        let fit = FitConfig { systematic_sd: 0.01, linearity_min: 0.9 };
        let ring = Ring { closed: false, beams: 8 };
        let config = BreakpointConfig::default();
        assert_eq!(runs(wall, ring, 1f64.to_radians(), &config, &fit).1.first(), Some(&(0..8)));
        // The same gap, but the points behind it lie on another surface.
        let mut step: Vec<_> = vec![Some(4.0); 8];
        step.extend(vec![Some(4.4); 8]);
        assert_eq!(runs_of(&step, false).1.len(), 2);
    }

    #[test]
    fn the_seam_of_a_closed_scan_lies_in_no_run() {
        let mut ranges = vec![Some(2.0); 360];
        for range in &mut ranges[100..200] {
            *range = Some(5.0);
        }
        let (points, runs) = runs_of(&ranges, true);
        assert_eq!(runs, [0..260, 260..360]);
        assert_eq!((points[0].beam, points[259].beam, points[260].beam), (200, 99, 100));
        // Without any break the run begins somewhere, and is one.
        assert_eq!(runs_of(&vec![Some(2.0); 360], true).1.first(), Some(&(0..360)));
    }
}
