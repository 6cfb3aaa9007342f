//! From a stretch of points that may be a line to the line, if it is one: fitted clear of where it
//! meets its neighbours, rid of what strays from it at either end, and neither too short nor round.

use std::ops::Range;

use super::Config;
use super::cloud::Cloud;
use super::fit::{LineFit, Local, fit_from};
use super::points::ScanPoint;
use super::split::{FoundLine, Piece, SplitConfig, Splitter, guess_without};
use super::tally::{Frame, Held};

/// Most fits of one line, each with fewer points than the one before.
const TRIMS_MAX: usize = 4;

impl Splitter {
    /// The line of a piece, if it is one; `ends` is room to work in.
    pub(super) fn settled(
        &self,
        cloud: &Cloud,
        piece: &Piece,
        mut clear: Range<usize>,
        fewest: usize,
        config: &Config,
        ends: &mut [Vec<Local>; 2],
    ) -> Option<FoundLine> {
        let split = &config.split;
        let (mut points, strays) = (piece.points.clone(), piece.strays);
        // What is fitted: the points that are clear of the seams. Of a piece that has changed little since it
        // was proposed, the sums are nearly there.
        let mut held = match &piece.held {
            Some(held) if strays == 0 => held.over(cloud, &clear),
            _ => self.summed(cloud, &clear, strays),
        };
        for trims_left in (0..TRIMS_MAX).rev() {
            if points.len() < fewest + strays || clear.len() < 3 + strays {
                return None;
            }
            let fit = self.fitted(cloud, &mut held, strays, config)?;
            // Up to a third of the points at either end may be another surface's.
            let third = clear.len() / 3;
            let looked_at = third.min(split.astray_points_max);
            let hedged = third.min(config.hedge.points_max);
            let own = || cloud.points[clear.clone()].iter();
            let at_end = looked_at.max(hedged);
            list(&mut ends[0], &fit, own().take(at_end));
            list(&mut ends[1], &fit, own().rev().take(at_end));
            let first = fit.astray(&ends[0][..looked_at], split.astray_sds);
            let last = fit.astray(&ends[1][..looked_at], split.astray_sds);
            if (first == 0 && last == 0) || trims_left == 0 {
                let (from, to) = (cloud.columns.at(points.start), cloud.columns.at(points.end - 1));
                let spanning = fit.spanning(&from, &to);
                let good = spanning.length() >= split.length_min
                    && fit.rms() <= split.rms_max
                    && is_direction_known(&fit, &cloud.points[clear.clone()], split)
                    && !is_round(&spanning, own(), split);
                if !good {
                    return None;
                }
                let mut hedged = hedged;
                if strays > 0 {
                    hedged = ((clear.len() - strays) / 3).min(config.hedge.points_max);
                    let own = || cloud.without(&clear, &self.stray);
                    list(&mut ends[0], &fit, own().take(hedged));
                    list(&mut ends[1], &fit, own().rev().take(hedged));
                }
                let fit = fit.hedged(ends.each_ref().map(|end| &end[..hedged]), &config.hedge);
                let fit = fit.spanning(&from, &to);
                return Some(FoundLine { fit, points, has_strays: strays > 0 });
            }
            clear = clear.start + first..clear.end - last;
            // What lies beyond what strays from the line does not return to it.
            if first > 0 {
                points.start = clear.start;
            }
            if last > 0 {
                points.end = clear.end;
            }
            held = match strays {
                0 => held.over(cloud, &clear),
                _ => self.summed(cloud, &clear, strays),
            };
        }
        None
    }

    /// A stretch, but for its strays, about what a guess makes of it.
    fn summed(&self, cloud: &Cloud, range: &Range<usize>, strays: usize) -> Held {
        let frame = guess_without(cloud, range, &self.stray, strays).frame();
        if strays == 0 {
            return Held::of(cloud, frame, range);
        }
        let tally = frame.tally(cloud.without(range, &self.stray));
        Held { frame, points: range.clone(), tally }
    }

    /// The line of what is held, which is held about that line from then on.
    fn fitted(
        &self,
        cloud: &Cloud,
        held: &mut Held,
        strays: usize,
        config: &Config,
    ) -> Option<LineFit> {
        let Held { frame, points, tally } = held;
        let ends = [cloud.columns.at(points.start), cloud.columns.at(points.end - 1)];
        let again = |frame: &Frame| match strays {
            0 => frame.tally_of(&cloud.columns, points),
            _ => frame.tally(cloud.without(points, &self.stray)),
        };
        let shared = cloud.shared(points);
        let summed = (*frame, *tally);
        let found = fit_from(summed, ends.each_ref(), shared, again, &config.fit).ok()?;
        let (fit, found_in, summed) = found;
        (*frame, *tally) = (found_in, summed);
        Some(fit)
    }
}

/// Lists points as a line sees them.
fn list<'a>(into: &mut Vec<Local>, fit: &LineFit, points: impl Iterator<Item = &'a ScanPoint>) {
    into.clear();
    into.extend(points.map(|point| fit.local(point)));
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
    let along = |at: usize| piece.guess.tangent.dot(&cloud.columns.at(at));
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
