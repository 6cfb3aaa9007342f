//! Moving one map onto another.

use super::Chart;
use crate::geometry::{Level, Odom, Point, Pose};

/// What is farther from a view than these is left out at first: a heading's error grows with distance. Metres.
const REACHES: [f64; 5] = [12.0, 25.0, 50.0, 100.0, f64::INFINITY];
/// Steps begin with this and are halved down to the last, metres.
const STEP: f64 = 0.08;
const STEP_MIN: f64 = 0.004;
/// Most points that are moved.
const POINTS_MAX: usize = 1500;

/// The pose near `level_from_odom` at which what is occupied on `own` fits `level` best: first about `anchor`, a
/// place on the robot's map, then farther and farther around it; downhill, coordinate by coordinate.
pub(super) fn refined(
    level: &Chart,
    own: &Chart,
    level_from_odom: &Pose<Level, Odom>,
    anchor: &Point,
) -> Pose<Level, Odom> {
    let mut at = level_from_odom.act(anchor);
    let mut heading = level_from_odom.heading();
    let mut before = 0;
    for reach in REACHES {
        let arms: Vec<Point> =
            own.occupied.iter().map(|p| p - anchor).filter(|arm| arm.norm() <= reach).collect();
        if arms.len() == before {
            continue;
        }
        before = arms.len();
        let arms: Vec<Point> = if arms.len() > POINTS_MAX {
            (0..POINTS_MAX).map(|i| arms[i * arms.len() / POINTS_MAX]).collect()
        } else {
            arms
        };
        let mean = arms.iter().map(Point::norm).sum::<f64>() / arms.len().max(1) as f64;
        downhill(level, &arms, mean.max(1.0), &mut at, &mut heading);
    }
    let turned = Pose::<Level, Odom>::new(0.0, 0.0, heading).act(anchor);
    Pose::new(at.x - turned.x, at.y - turned.y, heading)
}

fn downhill(level: &Chart, arms: &[Point], arm: f64, at: &mut Point, heading: &mut f64) {
    let fit = |at: &Point, heading: f64| -> u32 {
        let (sin, cos) = heading.sin_cos();
        let end = |p: &Point| at + Point::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y);
        arms.iter().map(|p| u32::from(level.field.fit(&end(p)))).sum()
    };
    let mut best = fit(at, *heading);
    let mut step = STEP;
    while step > STEP_MIN {
        let mut has_moved = false;
        for (x, y, turn) in [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)] {
            let [x, y, turn] = [x, y, turn].map(|way| f64::from(way) * step);
            let (tried, turned) = (*at + Point::new(x, y), *heading + turn / arm);
            let fits = fit(&tried, turned);
            if fits > best {
                (best, *at, *heading, has_moved) = (fits, tried, turned, true);
            }
        }
        if !has_moved {
            step *= 0.5;
        }
    }
}
