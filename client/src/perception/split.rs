//! Iterative End Point Fit (Duda and Hart) as a proposer, least squares as the judge.
//!
//! The chord between a run's end points leans on two noisy points: of a hundred points on one
//! straight wall it would split two thirds of the runs at three standard deviations. So the chord
//! only proposes where to split; the run is split only if its least-squares line fails as well.
//! All tests are normalised by each point's own deviation across the line, never a fixed width.
//! A merge pass then joins neighbours that one line explains, points at the seams go to the
//! closer line, and what is too short or too curved to be a wall is let go.

use std::ops::Range;

use mapfold_map::geometry::{Covariance, Point, difference, mahalanobis_sq};
use nalgebra::{Matrix2, Vector2};

use super::Config;
use super::fit::{FitConfig, LineFit, fit_line};
use super::points::ScanPoint;

/// When a run of points is a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SplitConfig {
    /// Deviations off the chord from which a split is proposed.
    pub chord_sds: f64,
    /// Deviations off the least-squares line up to which a point belongs to it.
    pub residual_sds: f64,
    /// Standard normal quantile at which the sum of squared residuals convicts (3.09: 99.9 %).
    pub chi_sq_z: f64,
    /// Fewest points of a line.
    pub points_min: usize,
    /// The same for scanners with less than half a degree from beam to beam.
    pub points_min_fine: usize,
    /// Shortest line, metres.
    pub length_min: f64,
    /// Largest root mean square of the normalised residuals: more is a curve.
    pub rms_max: f64,
    /// Gate for joining two lines, chi-square with two degrees of freedom. 23.0 (one in a hundred
    /// thousand) and not the usual 9.21: pieces were cut where the noise was worst, which bends
    /// each of them, and a gate that does not know that leaves one wall in 300 in pieces.
    pub merge_gate: f64,
    /// Deviations off the joint line up to which two lines are joined. Wider than
    /// `residual_sds`: among the hundred points of a long wall one lies beyond four deviations
    /// every other hundred scans, and such a split must be healed.
    pub merge_sds: f64,
    /// The same for the sum of squares (4.75: one in a million).
    pub merge_chi_sq_z: f64,
    /// What walls deviate from straight: added to the gate's covariance, metres and radians.
    pub model_sd: (f64, f64),
    /// Stray points between two lines that still may be one.
    pub stray_points: usize,
}

impl Default for SplitConfig {
    fn default() -> Self {
        Self {
            chord_sds: 3.0,
            residual_sds: 4.0,
            chi_sq_z: 3.09,
            points_min: 5,
            points_min_fine: 8,
            length_min: 0.20,
            rms_max: 2.0,
            merge_gate: 23.0,
            merge_sds: 5.0,
            merge_chi_sq_z: 4.75,
            model_sd: (0.005, 0.2 * std::f64::consts::PI / 180.0),
            stray_points: 2,
        }
    }
}

impl SplitConfig {
    /// Fewest points of a line for beams `increment` apart.
    pub fn fewest(&self, increment: f64) -> usize {
        // Half a degree itself is coarse; the margin is for its rounding.
        if increment < 0.49_f64.to_radians() { self.points_min_fine } else { self.points_min }
    }

    fn confirms(&self, fit: &LineFit) -> bool {
        fit.worst <= self.residual_sds && chi_sq_below(fit, self.chi_sq_z)
    }

    fn confirms_union(&self, fit: &LineFit) -> bool {
        fit.worst <= self.merge_sds && chi_sq_below(fit, self.merge_chi_sq_z)
    }
}

/// A line and the points that support it.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundLine {
    /// Indices of its points, ascending.
    pub members: Vec<usize>,
    /// The line.
    pub fit: LineFit,
}

impl FoundLine {
    fn new(points: &[ScanPoint], members: Vec<usize>, config: &FitConfig) -> Option<Self> {
        let fit = fit_line(members.iter().map(|&i| &points[i]), config).ok()?;
        Some(Self { members, fit })
    }

    /// Index of its first point.
    pub fn first(&self) -> usize {
        self.members.first().copied().unwrap_or(usize::MAX)
    }

    /// Index of its last point.
    pub fn last(&self) -> usize {
        self.members.last().copied().unwrap_or(usize::MAX)
    }

    fn refit(&mut self, points: &[ScanPoint], config: &FitConfig) {
        if let Ok(fit) = fit_line(self.members.iter().map(|&i| &points[i]), config) {
            self.fit = fit;
        }
    }
}

/// Finds the lines of a run and appends them to `lines`; stretches of points in no line go to
/// `loose`.
pub fn lines(
    points: &[ScanPoint],
    run: Range<usize>,
    increment: f64,
    config: &Config,
    lines: &mut Vec<FoundLine>,
    loose: &mut Vec<Range<usize>>,
) {
    let split = &config.split;
    let fewest = split.fewest(increment);
    let mut found = propose(points, run.clone(), fewest, config);
    share_out(points, &mut found, &config.fit);
    extend(points, &run, &mut found, config);
    merge(points, &mut found, config);
    contest(points, &mut found, &config.fit);
    found.retain(|line| {
        line.members.len() >= fewest
            && line.fit.length() >= split.length_min
            && line.fit.rms() <= split.rms_max
    });
    let mut free_from = run.start;
    for &member in found.iter().flat_map(|l| &l.members) {
        if member > free_from {
            loose.push(free_from..member);
        }
        free_from = member + 1;
    }
    if free_from < run.end {
        loose.push(free_from..run.end);
    }
    lines.append(&mut found);
}

/// Iterative End Point Fit: ascending candidates; neighbours share the point they were split at.
fn propose(
    points: &[ScanPoint],
    run: Range<usize>,
    fewest: usize,
    config: &Config,
) -> Vec<FoundLine> {
    let mut found = Vec::new();
    let mut waiting = vec![run];
    while let Some(range) = waiting.pop() {
        if range.len() < fewest {
            continue;
        }
        let (farthest, sds) = farthest_from_chord(&points[range.clone()]);
        let candidate = FoundLine::new(points, range.clone().collect(), &config.fit);
        let straight = sds <= config.split.chord_sds;
        match candidate {
            Some(line) if straight || config.split.confirms(&line.fit) => found.push(line),
            _ if straight => {}
            _ => {
                let at = range.start + farthest;
                waiting.push(at..range.end);
                waiting.push(range.start..at + 1);
            }
        }
    }
    found
}

/// The inner point farthest from the chord, in its own deviations; of a run that ends where it
/// began, the one farthest from there.
fn farthest_from_chord(run: &[ScanPoint]) -> (usize, f64) {
    let (a, b) = (run[0].at, run[run.len() - 1].at);
    let chord = b - a;
    let length = chord.norm();
    let mut best = (run.len() / 2, 0.0);
    // A chord shorter than a hand has no direction worth the name.
    let n = (length > 0.1).then(|| Point::new(-chord.y, chord.x) / length);
    for (i, p) in run.iter().enumerate().take(run.len() - 1).skip(1) {
        let d = p.at - a;
        let sds = match n {
            Some(n) => n.dot(&d).abs() / p.variance(&n).sqrt(),
            None => d.norm() / (p.variance_along + p.variance_across).sqrt(),
        };
        if sds > best.1 {
            best = (i, sds);
        }
    }
    best
}

/// Gives the point that two neighbours share to the closer one.
fn share_out(points: &[ScanPoint], found: &mut [FoundLine], config: &FitConfig) {
    for i in 1..found.len() {
        let (left, right) = found.split_at_mut(i);
        let (a, b) = (&mut left[i - 1], &mut right[0]);
        if a.last() == b.first() {
            let shared = &points[a.last()];
            let loser = if a.fit.normalised(shared) <= b.fit.normalised(shared) { b } else { a };
            loser.members.retain(|&m| points[m].beam != shared.beam);
            loser.refit(points, config);
        }
    }
}

/// Lets every line take the free points next to its ends that lie on it.
fn extend(points: &[ScanPoint], run: &Range<usize>, found: &mut [FoundLine], config: &Config) {
    let near =
        |line: &FoundLine, i: usize| line.fit.normalised(&points[i]) <= config.split.chord_sds;
    for i in 0..found.len() {
        let from = if i == 0 { run.start } else { found[i - 1].last() + 1 };
        let to = found.get(i + 1).map_or(run.end, FoundLine::first);
        let line = &mut found[i];
        let count = line.members.len();
        while line.first() > from && near(line, line.first() - 1) {
            line.members.insert(0, line.first() - 1);
        }
        while line.last() + 1 < to && near(line, line.last() + 1) {
            line.members.push(line.last() + 1);
        }
        if line.members.len() > count {
            line.refit(points, &config.fit);
        }
    }
}

/// Joins neighbours that one line explains, stray points between them included if they lie on it.
fn merge(points: &[ScanPoint], found: &mut Vec<FoundLine>, config: &Config) {
    let split = &config.split;
    let mut i = 0;
    while i + 1 < found.len() {
        let (a, b) = (&found[i], &found[i + 1]);
        let strays = a.last() + 1..b.first();
        if strays.len() > split.stray_points || !may_be_one(a, b, points, split) {
            i += 1;
            continue;
        }
        let Some(mut union) = union(points, a, b, config) else {
            i += 1;
            continue;
        };
        let at = union.members.partition_point(|m| *m < strays.start);
        let on: Vec<usize> =
            strays.filter(|&s| union.fit.normalised(&points[s]) <= split.residual_sds).collect();
        union.members.splice(at..at, on);
        union.refit(points, &config.fit);
        found[i] = union;
        found.remove(i + 1);
        // The longer line may now also explain its predecessor.
        i = i.saturating_sub(1);
    }
}

/// The one line of both, if it explains them; an end point that alone stands against it (the last
/// of a run may well be another surface's first) is left out.
fn union(points: &[ScanPoint], a: &FoundLine, b: &FoundLine, config: &Config) -> Option<FoundLine> {
    let members: Vec<usize> = a.members.iter().chain(&b.members).copied().collect();
    let mut union = FoundLine::new(points, members, &config.fit)?;
    if config.split.confirms_union(&union.fit) {
        return Some(union);
    }
    let off = |m: usize| union.fit.normalised(&points[m]);
    if off(union.first()) >= off(union.last()) {
        union.members.remove(0);
    } else {
        union.members.pop();
    }
    let union = FoundLine::new(points, union.members, &config.fit)?;
    config.split.confirms_union(&union.fit).then_some(union)
}

/// The gate of two lines, compared about a point between them.
fn may_be_one(a: &FoundLine, b: &FoundLine, points: &[ScanPoint], config: &SplitConfig) -> bool {
    let anchor = (points[a.last()].at + points[b.first()].at) * 0.5;
    let anchored = |fit: &LineFit| {
        let j = Matrix2::new(1.0, -fit.tangent.dot(&anchor), 0.0, 1.0);
        (-fit.residual(&anchor), fit.line.covariance.transformed(&j))
    };
    let ((da, ca), (db, cb)) = (anchored(&a.fit), anchored(&b.fit));
    let turn = difference(a.fit.line.line.alpha(), b.fit.line.line.alpha());
    let (offset_sd, turn_sd) = config.model_sd;
    let model = Covariance::from_variances([offset_sd * offset_sd, turn_sd * turn_sd]);
    mahalanobis_sq(&Vector2::new(da - db, turn), &(ca + cb + model)) < config.merge_gate
}

/// Points at the seam of two lines go to the closer one.
fn contest(points: &[ScanPoint], found: &mut [FoundLine], config: &FitConfig) {
    for i in 1..found.len() {
        let (left, right) = found.split_at_mut(i);
        let (a, b) = (&mut left[i - 1], &mut right[0]);
        if a.last() + 1 != b.first() {
            continue;
        }
        let closer = |m: usize, this: &FoundLine, than: &FoundLine| {
            this.fit.normalised(&points[m]) < than.fit.normalised(&points[m])
        };
        let to_b = a.members.iter().rev().take_while(|m| closer(**m, b, a)).count();
        let to_b = to_b.min(a.members.len().saturating_sub(3));
        if to_b > 0 {
            let moving = a.members.split_off(a.members.len() - to_b);
            b.members.splice(0..0, moving);
        } else {
            let to_a = b.members.iter().take_while(|m| closer(**m, a, b)).count();
            let to_a = to_a.min(b.members.len().saturating_sub(3));
            a.members.extend(b.members.drain(..to_a));
        }
        a.refit(points, config);
        b.refit(points, config);
    }
}

fn chi_sq_below(fit: &LineFit, z: f64) -> bool {
    fit.chi_sq <= chi_square_quantile(fit.count.saturating_sub(2), z)
}

/// Quantile of the chi-square distribution (Wilson and Hilferty, 1931): within 2 % from three
/// degrees of freedom on.
fn chi_square_quantile(dof: usize, z: f64) -> f64 {
    let k = dof.max(1) as f64;
    let h = 2.0 / (9.0 * k);
    k * (1.0 - h + z * h.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_close_to_the_published_ones() {
        for (dof, published) in [(3, 16.266), (4, 18.467), (10, 29.588), (30, 59.703)] {
            let q = chi_square_quantile(dof, 3.0902);
            assert!((q / published - 1.0).abs() < 0.02, "{dof}: {q}");
        }
    }
}
