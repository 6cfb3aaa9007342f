//! Where beams of this very scan went through a wall's supporting line: open doors, seen as such.
//!
//! A wall says only where something is. That there is nothing beside it, and not merely nothing
//! known, is what beams say that cross its line beyond its ends and end well behind it. Only beams
//! with a return count: one that came back from nowhere may have met a dark or a shining wall.

use mapfold_map::geometry::Interval;

use super::breakpoints::Ring;
use super::fit::LineFit;
use super::points::ScanPoint;

/// When a beam went through a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SeenThroughConfig {
    /// How far beyond a wall's ends its line is looked at, metres: wider than any door.
    pub reach: f64,
    /// How far behind the line a beam must have ended, along itself, metres, before three standard
    /// deviations of its range and of the line there are added.
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

/// The points of a scan in the order of the beams.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sweep<'a> {
    pub(super) points: &'a [ScanPoint],
    pub(super) ring: Ring,
    pub(super) increment: f64,
}

/// The stretches of `fit`'s line beyond its ends at `from` and `to` that beams went through, in
/// millimetres along it from the sensor's foot point, `shift` metres added, ascending. `first` and
/// `last` are the wall's own outermost points.
pub(super) fn stretches(
    sweep: &Sweep<'_>,
    fit: &LineFit,
    (first, last): (usize, usize),
    (from, to): (f64, f64),
    shift: f64,
    config: &SeenThroughConfig,
) -> Vec<Interval> {
    let count = sweep.points.len();
    let below = if sweep.ring.closed { count } else { first };
    let above = if sweep.ring.closed { count } else { count - last };
    let down = (1..below).map(|k| &sweep.points[(first + count - k) % count]);
    let up = (1..above).map(|k| &sweep.points[(last + k) % count]);
    let mut found = Vec::new();
    // Both walks count outwards from their end; the lower one then looks the other way.
    walk(down, fit, sweep, -1.0, -from, config, |a, b| {
        found.push(Interval::from_metres(shift - b, shift - a));
    });
    found.reverse();
    walk(up, fit, sweep, 1.0, to, config, |a, b| {
        found.push(Interval::from_metres(shift + a, shift + b));
    });
    found
}

/// Follows the beams outwards from an end at `end` until they leave the reach or turn away.
fn walk<'a>(
    points: impl Iterator<Item = &'a ScanPoint>,
    fit: &LineFit,
    sweep: &Sweep<'_>,
    outwards: f64,
    end: f64,
    config: &SeenThroughConfig,
    mut tell: impl FnMut(f64, f64),
) {
    let rho = fit.line.line.rho();
    let mut told = 0;
    // The stretch being followed: its two ends and the beam that went through last.
    let mut open: Option<(f64, f64, usize)> = None;
    let mut close = |open: Option<(f64, f64, usize)>| {
        if let Some((a, b, _)) = open {
            let (a, b) = (a.max(end), b.min(end + config.reach));
            if b - a >= config.length_min && told < config.stretches_max {
                told += 1;
                tell(a, b);
            }
        }
    };
    for point in points {
        let towards = fit.normal.dot(&point.direction);
        let along = outwards * fit.tangent.dot(&point.direction);
        // Beams that are parallel to the wall or turn away from it meet it nowhere.
        if towards <= 0.0 || along * rho > (end + config.reach) * towards {
            break;
        }
        if (point.range - config.depth_min) * towards <= rho
            || !went_through(point, fit, rho / towards, towards, config)
        {
            close(open.take());
            continue;
        }
        let at = along * rho / towards;
        let half = 0.5 * sweep.increment * rho / (towards * towards);
        let follows = |before: usize| {
            let apart = point.beam.abs_diff(before);
            apart.min(sweep.ring.beams - apart.min(sweep.ring.beams)) <= 2
        };
        open = match open {
            // One lost reading between two that went through does not part them.
            Some((a, _, before)) if follows(before) => Some((a, at + half, point.beam)),
            other => {
                close(other);
                Some((at - half, at + half, point.beam))
            }
        };
    }
    close(open);
}

/// Whether the beam ended behind the line by more than the margin and the errors of both.
fn went_through(
    point: &ScanPoint,
    fit: &LineFit,
    range_on_line: f64,
    towards: f64,
    config: &SeenThroughConfig,
) -> bool {
    let crossing = point.direction * range_on_line;
    let variance = point.variance_along + fit.variance_at(&crossing) / (towards * towards);
    point.range - range_on_line > config.depth_min + 3.0 * variance.sqrt()
}
