//! Where beams of this very scan went through a wall's supporting line: open doors, seen as such.
//!
//! A wall says only where something is. That there is nothing beside it, and not merely nothing
//! known, is what beams say that cross its line beyond its ends and end well behind it. Only beams
//! with a return count: one that came back from nowhere may have met a dark or a shining wall.

use std::ops::Range;

use mapfold_map::geometry::{Interval, Point};

use super::breakpoints::Ring;
use super::cloud::Cloud;
use super::fit::LineFit;
use super::split::FoundLine;

/// When a beam went through a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenThroughConfig {
    /// How far beyond a wall's ends its line is looked at, metres: wider than any door.
    pub reach: f64,
    /// How far behind the line a beam must have ended, along itself, metres, before three standard
    /// deviations of its range and of the line there are added; and half as far across the line.
    pub depth_min: f64,
    /// Shortest stretch worth telling, metres: nothing passes through less.
    pub length_min: f64,
    /// Most stretches on either side; the nearest count.
    pub stretches_max: usize,
}

impl Default for SeenThroughConfig {
    fn default() -> Self {
        Self { reach: 3.0, depth_min: 0.15, length_min: 0.10, stretches_max: 8 }
    }
}

/// A stretch of points.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Block {
    /// The points.
    pub(super) points: Range<usize>,
    /// Whether they lie on one line, so that all are on this side of another if its ends are.
    pub(super) straight: bool,
    /// Corners of the box around them, if they are straight around the first and the last.
    min: Point,
    max: Point,
}

impl Block {
    fn straight(cloud: &Cloud, points: &Range<usize>) -> Self {
        let [a, b] = [points.start, points.end - 1].map(|i| cloud.columns.at(i));
        Self { points: points.clone(), straight: true, min: a.inf(&b), max: a.sup(&b) }
    }

    fn loose(cloud: &Cloud, points: &Range<usize>) -> Self {
        let [x, y] = [&cloud.columns.x, &cloud.columns.y].map(|c| &c[points.clone()]);
        let least = |values: &[f64]| values.iter().copied().fold(f64::INFINITY, f64::min);
        let most = |values: &[f64]| values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let (min, max) = (Point::new(least(x), least(y)), Point::new(most(x), most(y)));
        Self { points: points.clone(), straight: false, min, max }
    }

    /// How far its box reaches in a direction.
    fn reaches(&self, n: &Point) -> f64 {
        let farther = |n: f64, min: f64, max: f64| if n > 0.0 { n * max } else { n * min };
        farther(n.x, self.min.x, self.max.x) + farther(n.y, self.min.y, self.max.y)
    }
}

/// The stretches of lines and of what no line explains, each ascending, as one sequence.
pub(super) fn blocks(
    cloud: &Cloud,
    lines: &[FoundLine],
    loose: &[Range<usize>],
    blocks: &mut Vec<Block>,
) {
    blocks.clear();
    let mut loose = loose.iter().peekable();
    for line in lines {
        while let Some(stretch) = loose.next_if(|stretch| stretch.start < line.points.start) {
            blocks.push(Block::loose(cloud, stretch));
        }
        blocks.push(Block::straight(cloud, &line.points));
        // Strays among its points.
        while loose.next_if(|stretch| stretch.end <= line.points.end).is_some() {}
    }
    blocks.extend(loose.map(|stretch| Block::loose(cloud, stretch)));
}

/// The points of a scan in the order of the beams.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sweep<'a> {
    /// The points.
    pub(super) cloud: &'a Cloud,
    /// The stretches that the points fall into, ascending.
    pub(super) blocks: &'a [Block],
    /// How the beams follow each other.
    pub(super) ring: Ring,
    /// Angle from one to the next, radians.
    pub(super) increment: f64,
}

/// The stretches of `fit`'s line beyond its ends at `from` and `to` that beams went through, in
/// millimetres along it from the sensor's foot point, `shift` metres added, ascending. `own` is the wall's
/// own stretch among the blocks. `found` is empty before.
pub(super) fn stretches(
    sweep: &Sweep<'_>,
    fit: &LineFit,
    own: usize,
    (from, to): (f64, f64),
    shift: f64,
    config: &SeenThroughConfig,
    found: &mut Vec<Interval>,
) {
    let blocks = sweep.blocks;
    let next = own + 1;
    // Round the end of the points if the scan is closed, but not round to the wall itself.
    let (below, above) =
        if sweep.ring.closed { (next..blocks.len(), 0..own) } else { (0..0, 0..0) };
    let mut walk = Walk { sweep, fit, config, outwards: -1.0, end: -from, told: 0, open: None };
    // Both walks count outwards from their end; the lower one then looks the other way.
    let mut tell = |a, b| found.push(Interval::from_metres(shift - b, shift - a));
    walk.along((0..own).rev().chain(below.rev()), &mut tell);
    found.reverse();
    let mut walk = Walk { sweep, fit, config, outwards: 1.0, end: to, told: 0, open: None };
    let mut tell = |a, b| found.push(Interval::from_metres(shift + a, shift + b));
    walk.along((next..blocks.len()).chain(above), &mut tell);
}

/// A walk along the beams outwards from one end of a wall.
struct Walk<'a> {
    sweep: &'a Sweep<'a>,
    fit: &'a LineFit,
    config: &'a SeenThroughConfig,
    /// Which way the coordinate along the line grows.
    outwards: f64,
    /// Where the wall ends, in that direction.
    end: f64,
    /// Stretches told.
    told: usize,
    /// The stretch being followed: its two ends and the beam that went through last.
    open: Option<(f64, f64, usize)>,
}

impl Walk<'_> {
    /// Follows the stretches of points until they leave the reach.
    fn along(&mut self, blocks: impl Iterator<Item = usize>, tell: &mut impl FnMut(f64, f64)) {
        let (normal, rho) = (self.fit.normal, self.fit.line.line.rho());
        // What ends no farther behind the line than this ends on it.
        let on_line = rho + 0.5 * self.config.depth_min;
        // The way from the sensor to where the reach ends on the line; beams beyond meet the line
        // farther out, or nowhere. Turned so that what is beyond is on its positive side.
        let reach = self.end + self.config.reach;
        let limit = normal * rho + self.fit.tangent * (self.outwards * reach);
        let beyond = Point::new(-limit.y, limit.x) * self.outwards;
        for block in blocks {
            let block = &self.sweep.blocks[block];
            // Most ends on the line or before it, and within reach.
            if block.reaches(&normal) <= on_line && block.reaches(&beyond) <= 0.0 {
                self.close(tell);
                continue;
            }
            let Block { points, straight, .. } = block;
            let ends = [
                self.sweep.cloud.columns.at(points.start),
                self.sweep.cloud.columns.at(points.end - 1),
            ];
            if *straight && ends.iter().all(|p| normal.dot(p) <= on_line) {
                self.close(tell);
                if ends.iter().any(|p| beyond.dot(p) > 0.0) {
                    return;
                }
                continue;
            }
            let (near, far) = if self.outwards > 0.0 {
                (points.start, points.end - 1)
            } else {
                (points.end - 1, points.start)
            };
            // What is straight and behind the line at both ends is behind it all along.
            if *straight && let (Some(a), Some(b)) = (self.crossing(near), self.crossing(far)) {
                self.take(a, near, tell);
                self.open =
                    self.open.map(|(from, _, _)| (from, b.1, self.sweep.cloud.points[far].beam));
                if beyond.dot(&self.sweep.cloud.columns.at(far)) > 0.0 {
                    self.close(tell);
                    return;
                }
                continue;
            }
            for k in 0..points.len() {
                let i = if self.outwards > 0.0 { near + k } else { near - k };
                let at = &self.sweep.cloud.columns.at(i);
                if beyond.dot(at) > 0.0 {
                    self.close(tell);
                    return;
                }
                let behind = normal.dot(at) > on_line;
                match behind.then(|| self.crossing(i)).flatten() {
                    Some(crossing) => self.take(crossing, i, tell),
                    None => self.close(tell),
                }
            }
        }
        self.close(tell);
    }

    /// Where a beam crossed the line, half a beam's spacing either side, if it did so for sure.
    fn crossing(&self, i: usize) -> Option<(f64, f64)> {
        let (fit, point) = (self.fit, &self.sweep.cloud.points[i]);
        let towards = fit.normal.dot(&point.direction);
        let range_on_line = fit.line.line.rho() / towards;
        let behind = point.range - range_on_line - self.config.depth_min;
        if !(towards > 0.0 && behind > 0.0) {
            return None;
        }
        let line_variance = fit.variance_at(&(point.direction * range_on_line));
        let variance = point.variance_along + line_variance / (towards * towards);
        if behind * behind <= 9.0 * variance {
            return None;
        }
        let at = self.outwards * fit.tangent.dot(&point.direction) * range_on_line;
        let half = 0.5 * self.sweep.increment * range_on_line / towards;
        Some((at - half, at + half))
    }

    /// Takes where a beam crossed the line into the open stretch, or opens one.
    fn take(&mut self, (a, b): (f64, f64), i: usize, tell: &mut impl FnMut(f64, f64)) {
        let beam = self.sweep.cloud.points[i].beam;
        let follows = |before: usize| {
            let apart = beam.abs_diff(before);
            // One lost reading between two that went through does not part them.
            apart.min(self.sweep.ring.beams - apart) <= 2
        };
        self.open = match self.open {
            Some((from, _, before)) if follows(before) => Some((from, b, beam)),
            _ => {
                self.close(tell);
                Some((a, b, beam))
            }
        };
    }

    /// Ends the open stretch.
    fn close(&mut self, tell: &mut impl FnMut(f64, f64)) {
        if let Some((a, b, _)) = self.open.take() {
            let (a, b) = (a.max(self.end), b.min(self.end + self.config.reach));
            if b - a >= self.config.length_min && self.told < self.config.stretches_max {
                self.told += 1;
                tell(a, b);
            }
        }
    }
}
