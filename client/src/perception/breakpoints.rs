//! Which neighbouring beams may have hit one surface (adaptive breakpoints after Borges and
//! Aldon, 2004).
//!
//! Two neighbours are apart if their points are farther from each other than a surface at the
//! worst incidence `lambda` would put them: `D = r sin(dphi) / sin(lambda - dphi) + 3 s_r`; as both
//! ranges err, and a scan has a thousand pairs, we add four deviations of their difference. With
//! beams a degree apart that is half a metre at 4 m and would jump a door frame, so beyond a cap
//! the gap must be bridged: the points on one side lie on a line that goes through the first
//! point of the other. (A door that stands open shows a point behind it and is no gap between
//! neighbours.)

use std::ops::Range;

use mapfold_map::geometry::Point;

use super::cloud::{Cloud, Columns};
use super::points::ScanPoint;

/// How many beams without a point break a surface: both so many, and so wide a turn of them. The finer a
/// scanner's beams, the more of them a pane or a lost packet takes, and the smaller is the gap.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Missing {
    /// Beams from one point to the next.
    pub beams: usize,
    /// Radians.
    pub turn: f64,
}

impl Missing {
    /// The default.
    pub const STANDARD: Self = Self { beams: 3, turn: 3.0 * std::f64::consts::PI / 180.0 };

    /// Most beams from one point of a surface to the next.
    pub(super) fn steps_max(&self, increment: f64) -> usize {
        self.beams.max((self.turn / increment) as usize)
    }
}

/// When neighbours are apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BreakpointConfig {
    /// Worst angle between beam and surface at which points still count as one surface, radians
    /// (8 to 15 degrees in the literature).
    pub worst_incidence: f64,
    /// The same where a line bridges the gap: a wall along which one looks.
    pub worst_incidence_of_line: f64,
    /// Deviations of the difference of two ranges that are no gap: among a thousand neighbours, one
    /// pair errs by four every other dozen of scans.
    pub gap_sds: f64,
    /// Gaps up to this need no confirmation, metres: less than any door's width, more than a
    /// door frame's step.
    pub gap_cap: f64,
    /// Wider gaps are not bridged, metres: somebody may pass through.
    pub gap_max: f64,
    /// Points on one side whose line must bridge a wider gap, at least 3.
    pub confirming_points: usize,
    /// How many standard deviations they, and the point across, may lie off that line.
    pub confirming_sds: f64,
    /// Beams without a point that break.
    pub missing: Missing,
}

impl Default for BreakpointConfig {
    fn default() -> Self {
        Self {
            worst_incidence: 10f64.to_radians(),
            worst_incidence_of_line: 2f64.to_radians(),
            gap_sds: 4.0,
            gap_cap: 0.30,
            gap_max: 0.65,
            confirming_points: 4,
            confirming_sds: 3.0,
            missing: Missing::STANDARD,
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

/// What lies between a point and the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Gap {
    /// They may lie on one surface.
    Near,
    /// They may if a line bridges the gap.
    Wide,
    /// They may, for a line does.
    Bridged,
    /// They may not, for no line bridges a wide gap.
    Open,
    /// They may not.
    Apart,
}

/// Finds the runs of points that may each lie on one surface. The points of a closed scan are
/// turned so that no run straddles their end; a run that has neither beginning nor end begins
/// at its outermost point, which is never within a wall. `gaps` is room to work in: the points whose next
/// one is not near, and why.
pub(super) fn find_runs(
    cloud: &mut Cloud,
    ring: Ring,
    increment: f64,
    config: &BreakpointConfig,
    gaps: &mut Vec<(usize, Gap)>,
    runs: &mut Vec<Range<usize>>,
) {
    gaps.clear();
    // Room for any other scan: how many gaps there are is chance.
    gaps.reserve(ring.beams);
    runs.clear();
    let points = &cloud.points;
    let count = points.len();
    if count == 0 {
        return;
    }
    let reach = Reach::new(increment, config);
    reach.ask(cloud, config, |i| {
        let gap = reach.gap(&points[i], &points[i + 1], ring, config);
        if gap != Gap::Near {
            gaps.push((i, gap));
        }
    });
    let last = match count {
        1 => Gap::Apart,
        _ => reach.gap(&points[count - 1], &points[0], ring, config),
    };
    if last != Gap::Near {
        gaps.push((count - 1, last));
    }
    for at in 0..gaps.len() {
        if gaps[at].1 == Gap::Wide {
            let bridged = is_bridged(points, gaps, gaps[at].0, config);
            gaps[at].1 = if bridged { Gap::Bridged } else { Gap::Open };
        }
    }
    let ends = |gap: &&(usize, Gap)| matches!(gap.1, Gap::Open | Gap::Apart);
    let start = if ring.closed {
        gaps.iter().rfind(ends).map_or_else(|| outermost(points), |last| (last.0 + 1) % count)
    } else {
        0
    };
    if start > 0 {
        cloud.turn(start);
        let turned = gaps.partition_point(|gap| gap.0 < start);
        gaps.rotate_left(turned);
        for gap in &mut *gaps {
            gap.0 = (gap.0 + count - start) % count;
        }
    }
    let mut from = 0;
    for (last, _) in gaps.iter().filter(ends) {
        runs.push(from..last + 1);
        from = last + 1;
    }
    if from < count {
        runs.push(from..count);
    }
}

/// How far apart the points of one surface can be from one beam to the next.
struct Reach {
    increment: f64,
    /// Most beams from one point to the next.
    steps_max: usize,
    /// Growth with range, for neighbours.
    surface: f64,
    /// The same where a line bridges the gap.
    line: f64,
}

impl Reach {
    fn new(increment: f64, config: &BreakpointConfig) -> Self {
        Self {
            increment,
            steps_max: config.missing.steps_max(increment),
            surface: growth(increment, config.worst_incidence),
            line: growth(increment, config.worst_incidence_of_line),
        }
    }

    /// Asks of every point but those whose next one is surely near: of the next beam, and so close that nothing
    /// else need be asked. Most are. Several are looked at together, without a branch for each.
    fn ask(&self, cloud: &Cloud, config: &BreakpointConfig, mut ask: impl FnMut(usize)) {
        const TOGETHER: usize = 8;
        let Columns { x, y, along, .. } = &cloud.columns;
        // A square of a sum is no less than the sum of the squares, which needs no root.
        let surface_sq = self.surface * self.surface;
        let noise_sq = config.gap_sds * config.gap_sds;
        let cap_sq = config.gap_cap * config.gap_cap;
        let mut skips = cloud.skips.iter().copied().peekable();
        let mut from = 0;
        while from + TOGETHER < x.len() {
            let [x, y, along] = [x, y, along].map(|column| &column[from..=from + TOGETHER]);
            let far: [bool; TOGETHER] = std::array::from_fn(|k| {
                let (dx, dy) = (x[k + 1] - x[k], y[k + 1] - y[k]);
                let range_sq = x[k] * x[k] + y[k] * y[k];
                let near = surface_sq * range_sq + noise_sq * (along[k] + along[k + 1]);
                let near = if near < cap_sq { near } else { cap_sq };
                dx * dx + dy * dy > near
            });
            let skipped = skips.peek().is_some_and(|skip| *skip < from + TOGETHER);
            if far.iter().fold(skipped, |any, far| any | far) {
                for (k, far) in far.into_iter().enumerate() {
                    if skips.next_if_eq(&(from + k)).is_some() || far {
                        ask(from + k);
                    }
                }
            }
            from += TOGETHER;
        }
        for i in from..x.len().saturating_sub(1) {
            ask(i);
        }
    }

    fn gap(&self, a: &ScanPoint, b: &ScanPoint, ring: Ring, config: &BreakpointConfig) -> Gap {
        let distance_sq = (b.at - a.at).norm_squared();
        let Some(steps) = ring.steps(a.beam, b.beam).filter(|s| *s <= self.steps_max) else {
            return Gap::Apart;
        };
        let (surface, line) = if steps == 1 {
            (self.surface, self.line)
        } else {
            let turn = self.increment * steps as f64;
            let of = |worst| growth(turn, worst);
            (of(config.worst_incidence), of(config.worst_incidence_of_line))
        };
        // Both ranges err.
        let noise = config.gap_sds * (a.variance_along + b.variance_along).sqrt();
        let within = |growth: f64| {
            // Beams as far apart as the worst incidence tell nothing.
            let reach = if growth.is_finite() { growth * a.range } else { config.gap_cap };
            distance_sq <= (reach + noise).powi(2)
        };
        if within(surface) && distance_sq <= config.gap_cap * config.gap_cap {
            Gap::Near
        } else if distance_sq <= config.gap_max * config.gap_max && within(line) {
            Gap::Wide
        } else {
            Gap::Apart
        }
    }
}

/// Distance over range of two points on a surface at the worst incidence, `turn` apart.
fn growth(turn: f64, worst_incidence: f64) -> f64 {
    if turn < worst_incidence { turn.sin() / (worst_incidence - turn).sin() } else { f64::INFINITY }
}

/// Whether the gap after point `i` is bridged by a line: several points on one side of it, none
/// apart from its neighbour, lie on a line on which the first point of the other side lies too.
fn is_bridged(
    points: &[ScanPoint],
    gaps: &[(usize, Gap)],
    i: usize,
    config: &BreakpointConfig,
) -> bool {
    let (count, k) = (points.len(), config.confirming_points);
    if k >= count {
        return false;
    }
    let limit = config.confirming_sds * config.confirming_sds;
    let is_apart = |i: usize| {
        gaps.binary_search_by_key(&i, |gap| gap.0).is_ok_and(|at| gaps[at].1 == Gap::Apart)
    };
    // The k points from `first` on, in order; the nearer of their ends; and the point across.
    let agrees = |first: usize, near: usize, across: usize| {
        let at = |offset: usize| (first + offset) % count;
        if (0..k - 1).any(|offset| is_apart(at(offset))) {
            return false;
        }
        let far = if near == first { at(k - 1) } else { first };
        let (far, near, across) = (&points[far], &points[near], &points[across]);
        let chord = near.at - far.at;
        let length = chord.norm();
        let n = Point::new(-chord.y, chord.x) / length;
        let (near_variance, far_variance) = (near.variance(&n), far.variance(&n));
        // Off the chord, whose ends err too: at `share` of its length beyond its far end.
        let off = |point: &ScanPoint| {
            let d = point.at - far.at;
            let share = d.dot(&chord) / (length * length);
            let variance = point.variance(&n)
                + share * share * near_variance
                + (1.0 - share).powi(2) * far_variance;
            n.dot(&d).powi(2) <= limit * variance
        };
        length > 0.0 && off(across) && (1..k - 1).all(|offset| off(&points[at(offset)]))
    };
    let (before, after) = ((i + count + 1 - k) % count, (i + 1) % count);
    agrees(before, i, after) || agrees(after, after, i)
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
        runs_in(points_of(ranges), ring)
    }

    fn runs_in(points: Vec<ScanPoint>, ring: Ring) -> (Vec<ScanPoint>, Vec<Range<usize>>) {
        runs_with(points, ring, 1f64.to_radians())
    }

    fn runs_with(
        points: Vec<ScanPoint>,
        ring: Ring,
        increment: f64,
    ) -> (Vec<ScanPoint>, Vec<Range<usize>>) {
        let (mut gaps, mut runs) = (Vec::new(), Vec::new());
        let mut cloud = Cloud::default();
        cloud.points.extend(points);
        cloud.index(false);
        let config = BreakpointConfig::default();
        find_runs(&mut cloud, ring, increment, &config, &mut gaps, &mut runs);
        (cloud.points, runs)
    }

    fn distance(points: &[ScanPoint], i: usize, j: usize) -> f64 {
        (points[j].at - points[i].at).norm()
    }

    #[test]
    fn the_law_of_sines_gives_the_published_distances() {
        let at = |r, degrees: f64, lambda: f64| {
            // What is published adds three deviations of the range, here of 2 cm.
            r * growth(degrees.to_radians(), lambda.to_radians()) + 0.06
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
    fn a_few_missing_beams_of_a_fine_scanner_break_no_wall() {
        // A quarter of a degree from beam to beam, ten of forty lost, at 2 m: gaps of 9 cm.
        let fine = |lost: usize| {
            let points: Vec<ScanPoint> = (0..400_usize)
                .filter(|beam| beam % 40 >= lost)
                .map(|beam| {
                    let direction = unit_normal(0.25_f64.to_radians() * beam as f64);
                    ScanPoint::new(beam, 2.0, direction, &NOISE)
                })
                .collect();
            let ring = Ring { closed: false, beams: 400 };
            runs_with(points, ring, 0.25_f64.to_radians()).1.len()
        };
        assert_eq!((fine(3), fine(10), fine(13)), (1, 1, 10));
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
        let ring = Ring { closed: false, beams: 8 };
        assert_eq!(runs_in(wall, ring).1.first(), Some(&(0..8)));
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
