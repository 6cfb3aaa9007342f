//! Where the lines of two walls meet: what one map can be laid onto another by.

use super::AlignmentConfig;
use crate::geometry::{Point, difference};

/// Walls that meet under less than this are taken for one: sine.
const SINE_MIN: f64 = 0.35;
/// Angles are the same if they differ by less, radians.
const SAME_ANGLE: f64 = 0.05;

/// Two walls, not parallel, and the place where their lines meet, whether there is a corner or not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Structure {
    pub(super) at: Point,
    /// Direction of that wall from which the other turns left, free space on its left.
    pub(super) direction: f64,
    /// How far it turns, radians, more than 0.
    angle: f64,
    /// Length of the shorter wall, metres.
    length: f64,
}

impl Structure {
    /// How the robot's map is turned if two structures are the same; `None` if they cannot be.
    pub(super) fn heading_onto(&self, level: &Self) -> Option<f64> {
        let gap = level.angle - self.angle;
        // Half of what the angles differ by is either wall's.
        let heading = difference(level.direction, self.direction) + 0.5 * gap;
        (gap.abs() < SAME_ANGLE).then_some(heading)
    }
}

/// Of walls with free space on the left: those of the longest ones.
pub(super) fn structures(walls: &[(Point, Point)], config: &AlignmentConfig) -> Vec<Structure> {
    let long = |(from, to): &&(Point, Point)| (to - from).norm() >= config.wall_min;
    let walls: Vec<(Point, Point)> = walls.iter().filter(long).copied().collect();
    let mut found: Vec<Structure> = Vec::new();
    for (index, one) in walls.iter().enumerate() {
        for other in &walls[index + 1..] {
            found.extend(meet(one, other, config));
        }
        // Bounded memory, whatever the map.
        if found.len() > 8 * config.structures_max {
            keep_longest(&mut found, config.structures_max);
        }
    }
    keep_longest(&mut found, config.structures_max);
    found
}

fn keep_longest(found: &mut Vec<Structure>, most: usize) {
    found.sort_by(|a, b| b.length.total_cmp(&a.length));
    found.truncate(most);
}

fn meet(
    one: &(Point, Point),
    other: &(Point, Point),
    config: &AlignmentConfig,
) -> Option<Structure> {
    let (way, other_way) = (one.1 - one.0, other.1 - other.0);
    let (length, other_length) = (way.norm(), other_way.norm());
    let reach = config.structure_reach;
    if (one.0 - other.0).norm() > length + other_length + 2.0 * reach {
        return None;
    }
    let sine = way.perp(&other_way) / (length * other_length);
    if sine.abs() < SINE_MIN {
        return None;
    }
    let along = (other.0 - one.0).perp(&other_way) / way.perp(&other_way);
    let at = one.0 + way * along;
    let off = |(from, to): &(Point, Point)| {
        let (way, arm) = (to - from, at - from);
        let share = (arm.dot(&way) / way.norm_squared()).clamp(0.0, 1.0);
        (arm - way * share).norm()
    };
    if off(one) > reach || off(other) > reach {
        return None;
    }
    let (first, second) = if sine > 0.0 { (way, other_way) } else { (other_way, way) };
    let direction = first.y.atan2(first.x);
    let angle = difference(second.y.atan2(second.x), direction);
    Some(Structure { at, direction, angle, length: length.min(other_length) })
}
