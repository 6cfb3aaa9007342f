//! Judges one sonar's reading by its own figure, by those of the sonars beside it, and by what is known of
//! the place.

use mapfold_map::geometry::{Level, Point, Pose, Sensor, difference, unit_normal};
use mapfold_map::raster::Cell;

use super::{SonarEvidenceConfig, SonarRule, SonarVerdicts};
use crate::evidence::walk::walk;
use crate::sensor::{Ring, Sonar, SonarProfile};

/// Walls that are known before a look, such as those of a robot's mirror of the shared map.
pub trait KnownWalls {
    /// Whether a cell is all but surely occupied: with a probability above 0.9.
    fn is_wall(&self, cell: Cell) -> bool;
}

impl<F: Fn(Cell) -> bool> KnownWalls for F {
    fn is_wall(&self, cell: Cell) -> bool {
        self(cell)
    }
}

/// What one sonar's reading comes to.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Echo {
    /// Free up to here, metres.
    pub(super) free_to: f64,
    /// Weight of the free evidence.
    pub(super) free_weight: f64,
    /// Distance of the arc, if there is one, and its weight.
    pub(super) arc: Option<(f64, f64)>,
}

/// What a reading comes to; `None` if it is refused altogether.
#[expect(clippy::too_many_arguments, reason = "a verdict hears all witnesses")]
pub(super) fn judge(
    ring: &Ring,
    index: usize,
    level_from_sensor: &Pose<Level, Sensor>,
    walls: Option<&dyn KnownWalls>,
    resolution: f64,
    profile: &SonarProfile,
    config: &SonarEvidenceConfig,
    verdicts: &mut SonarVerdicts,
) -> Option<Echo> {
    let sonar = ring.sonars.get(index)?;
    let applies = |rule: SonarRule| !config.off.contains(&Some(rule));
    let near = |r: f64| r < profile.range_min_m;
    let told = sonar.range.filter(|range| *range < profile.range_max_m);
    if told.is_some_and(near) {
        verdicts.note(Some(SonarRule::TooNear));
        return None;
    }
    let beside = neighbours(ring, index, config);
    let heard = beside.map(|neighbour| {
        let range = neighbour.and_then(|sonar| sonar.range);
        range.filter(|r| !near(*r) && *r < profile.range_max_m)
    });
    let nearest = heard.into_iter().flatten().fold(f64::INFINITY, f64::min);
    let limit = if applies(SonarRule::Specular) {
        config.specular_ratio * nearest + config.specular_margin
    } else {
        f64::INFINITY
    };
    let Some(range) = told else {
        verdicts.note(Some(SonarRule::Silent));
        let free_weight = if applies(SonarRule::Silent) { config.silent_free } else { 1.0 };
        return Some(Echo { free_to: profile.range_max_m.min(limit), free_weight, arc: None });
    };
    if !sonar.is_steady && applies(SonarRule::Crosstalk) {
        verdicts.note(Some(SonarRule::Crosstalk));
        let arc = (range <= limit).then_some((range, config.unsteady));
        return Some(Echo { free_to: range.min(limit), free_weight: 1.0, arc });
    }
    let sure = range - config.ghost_sds * profile.range_sd(range);
    let wall = walls
        .filter(|_| applies(SonarRule::Ghost))
        .and_then(|walls| wall_before(walls, level_from_sensor, sure, resolution));
    if let Some(wall) = wall {
        verdicts.note(Some(SonarRule::Ghost));
        return Some(Echo { free_to: wall.min(limit), free_weight: 1.0, arc: None });
    }
    let close = config.support_gap + config.support_ratio * range;
    let supported = heard.into_iter().flatten().any(|other| (other - range).abs() < close);
    if range > limit && !supported {
        verdicts.note(Some(SonarRule::Specular));
        return Some(Echo { free_to: limit, free_weight: 1.0, arc: None });
    }
    // Who has no neighbours cannot be supported, and is none the worse for it.
    let is_doubtful = !supported && beside.iter().any(Option::is_some);
    let doubt = (is_doubtful && applies(SonarRule::NoSupport)).then_some(SonarRule::NoSupport);
    verdicts.note(doubt);
    let weight = if doubt.is_some() { config.unsupported } else { 1.0 };
    Some(Echo { free_to: range, free_weight: 1.0, arc: Some((range, weight)) })
}

/// The sonars before and after one, if they look about the same way.
fn neighbours<'a>(
    ring: &'a Ring,
    index: usize,
    config: &SonarEvidenceConfig,
) -> [Option<&'a Sonar>; 2] {
    let count = ring.sonars.len();
    let heading = |sonar: &Sonar| sonar.robot_from_sensor.heading();
    let own = ring.sonars.get(index).map_or(0.0, heading);
    [(index + count).checked_sub(1), Some(index + 1)].map(|other| {
        let other = other? % count;
        let sonar = ring.sonars.get(other).filter(|_| other != index)?;
        let apart = difference(heading(sonar), own).abs();
        (apart <= config.neighbour_cones * ring.cone).then_some(sonar)
    })
}

/// How far along its axis a sonar meets the first known wall, if that is before `sure` metres.
fn wall_before(
    walls: &dyn KnownWalls,
    level_from_sensor: &Pose<Level, Sensor>,
    sure: f64,
    resolution: f64,
) -> Option<f64> {
    let start: Point = level_from_sensor.position() / resolution;
    let direction = unit_normal(level_from_sensor.heading());
    let mut found = None;
    walk(&start, &direction, sure / resolution, |cell, from, _| {
        if found.is_none() && walls.is_wall(cell) {
            found = Some(from * resolution);
        }
    });
    found
}
