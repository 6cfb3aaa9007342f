//! From a stretch of points that may be a line to the line, if it is one: fitted clear of where it
//! meets its neighbours, rid of what strays from it at either end, and neither too short nor round.

use std::ops::Range;

use super::Config;
use super::cloud::Cloud;
use super::fit::{LineFit, fit_from};
use super::guess::Guess;
use super::points::ScanPoint;
use super::split::{FoundLine, Piece, SplitConfig, Splitter, guess_without};

/// Most fits of one line, each with fewer points than the one before.
const TRIMS_MAX: usize = 4;

impl Splitter {
    /// The line of a piece, if it is one.
    pub(super) fn settled(
        &self,
        cloud: &Cloud,
        piece: &Piece,
        clear: Range<usize>,
        fewest: usize,
        config: &Config,
    ) -> Option<FoundLine> {
        let split = &config.split;
        let mut points = piece.points.clone();
        // What is fitted: the points that are clear of the seams.
        let mut clear = clear;
        let mut guess = if clear == points {
            piece.guess
        } else {
            guess_without(cloud, &clear, &self.stray, piece.strays)
        };
        for trims_left in (0..TRIMS_MAX).rev() {
            if points.len() < fewest + piece.strays || clear.len() < 3 + piece.strays {
                return None;
            }
            let fit = self.fitted(cloud, &clear, piece.strays, &guess, config)?;
            // Up to a third of the points at either end may be another surface's.
            let looked_at = (clear.len() / 3).min(split.astray_points_max);
            let own = || cloud.points[clear.clone()].iter();
            let first = fit.astray(own().take(looked_at), split.astray_sds);
            let last = fit.astray(own().rev().take(looked_at), split.astray_sds);
            if (first == 0 && last == 0) || trims_left == 0 {
                let (from, to) = (&cloud.at[points.start], &cloud.at[points.end - 1]);
                let spanning = fit.spanning(from, to);
                let good = spanning.length() >= split.length_min
                    && fit.rms() <= split.rms_max
                    && is_direction_known(&fit, &cloud.points[clear.clone()], split)
                    && !is_round(&spanning, own(), split);
                if !good {
                    return None;
                }
                let count = clear.len() - piece.strays;
                let fit = fit.hedged(cloud.without(&clear, &self.stray), count, &config.hedge);
                return Some(FoundLine { fit: fit.spanning(from, to), points });
            }
            clear = clear.start + first..clear.end - last;
            // What lies beyond what strays from the line does not return to it.
            if first > 0 {
                points.start = clear.start;
            }
            if last > 0 {
                points.end = clear.end;
            }
            guess = guess_without(cloud, &clear, &self.stray, piece.strays);
        }
        None
    }

    fn fitted(
        &self,
        cloud: &Cloud,
        range: &Range<usize>,
        strays: usize,
        guess: &Guess,
        config: &Config,
    ) -> Option<LineFit> {
        if strays == 0 {
            return fit_from(&cloud.points[range.clone()].iter(), guess, &config.fit).ok();
        }
        fit_from(&cloud.without(range, &self.stray), guess, &config.fit).ok()
    }
}

/// Whether the direction of a line is known: its deviation as fitted, and over all slopes across the beams that
/// its points allow. What they know of the slope `dr / (r d angle)`, the tangent of the incidence, hangs on
/// the turn of the beams and the noise of the ranges alone; what that comes to as an angle is the less,
/// the more a line lies along the beams, so that noise which turns it there hides itself.
fn is_direction_known(fit: &LineFit, points: &[ScanPoint], split: &SplitConfig) -> bool {
    let max = split.direction_sd_max;
    if fit.line.covariance.matrix()[(1, 1)] > max * max {
        return false;
    }
    let count = points.len() as f64;
    let (first, last) = (&points[0], &points[points.len() - 1]);
    let turn_sq = (last.direction - first.direction).norm_squared();
    // As if they were evenly spaced; most know it many times over, and need not be asked one by one.
    if 48.0 * first.variance_along.max(last.variance_along)
        <= count * turn_sq * first.range.min(last.range).powi(2) * max * max
    {
        return true;
    }
    // The regression of the ranges on the bearings, from the first beam.
    let ahead = first.direction;
    let (mut a, mut r, mut aa, mut ar, mut variance) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for point in points {
        let angle = ahead.perp(&point.direction);
        a += angle;
        r += point.range;
        aa += angle * angle;
        ar += angle * point.range;
        variance += point.variance_along;
    }
    let spread = aa - a * a / count;
    let sd = (variance / spread).sqrt() / r * count.sqrt();
    // An angle is never less certain than its tangent.
    sd <= max || {
        let slope = ((ar - a * r / count) / spread * count / r).abs();
        let reach = split.direction_sds * sd;
        (slope + reach).atan() - (slope - reach).atan() <= 2.0 * split.direction_sds * max
    }
}

/// Whether a short line is the side of something round.
fn is_round<'a>(
    fit: &LineFit,
    points: impl Iterator<Item = &'a ScanPoint>,
    split: &SplitConfig,
) -> bool {
    let length = fit.length();
    length <= split.bow_length_max && {
        let (bow, sd) = fit.bow(points);
        let bows = bow > split.bow_max * length && bow > split.bow_sds * sd;
        let might = length < split.plain_length && bow + 2.0 * sd > split.bow_doubt * length;
        bows || might
    }
}

/// The points of a piece that are clear of where it meets its neighbours. Near there, points
/// went to the closer line, which takes from each those that err towards the other; where along
/// the line they are does not depend on how far off it they err.
pub(super) fn clear_of_seams(
    cloud: &Cloud,
    piece: &Piece,
    [before, after]: [Option<&Piece>; 2],
    config: &Config,
) -> Range<usize> {
    let split = &config.split;
    let Range { mut start, mut end } = piece.points;
    // At least half of the points are left.
    let (start_max, end_min) = (start + piece.points.len() / 4, end - piece.points.len() / 4);
    let meet = |other: &Piece| {
        let (a, b) = (&piece.guess, &other.guess);
        let sine = a.normal.perp(&b.normal);
        // Along the own tangent from the own foot point.
        (sine.abs() > 0.2).then(|| (b.rho - a.rho * a.normal.dot(&b.normal)) / sine)
    };
    let along = |at: usize| piece.guess.tangent.dot(&cloud.at[at]);
    let margin = |at: usize| split.seam_sds * cloud.points[at].variance_along.sqrt();
    let before = before.filter(|b| b.points.end + split.stray_points >= start);
    if let Some(t) = before.and_then(meet) {
        while start < start_max && along(start) < t + margin(start) {
            start += 1;
        }
    }
    let after = after.filter(|a| a.points.start <= end + split.stray_points);
    if let Some(t) = after.and_then(meet) {
        while end > end_min && along(end - 1) > t - margin(end - 1) {
            end -= 1;
        }
    }
    start..end
}
