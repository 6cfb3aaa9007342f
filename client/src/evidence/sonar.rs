//! Evidence from a ring of sonars: free cones, and arcs on which something stands somewhere.

use mapfold_map::geometry::{Level, Point, Robot, UncertainPose, difference};
use mapfold_map::raster::{Cell, EvidencePatch, LogOdds, SensorClass};

use super::Canvas;
use crate::sensor::{Ring, SonarProfile};

/// How echoes become evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SonarEvidenceConfig {
    /// Evidence for "free" on the axis of a cone, close by, nat (negative).
    pub free_nat: f64,
    /// Evidence for "occupied" that an echo spreads over its arc, nat.
    pub occupied_nat: f64,
    /// Least share of the free evidence, at the far end of the range.
    pub free_least: f64,
    /// Share of the free evidence of a sonar that heard nothing: a smooth wall may have thrown the
    /// pulse aside.
    pub silent_free: f64,
    /// A reading is believed free only up to this many times the nearest neighbour's range (plus
    /// `specular_margin`): beyond, it has probably gone round by a smooth wall.
    pub specular_ratio: f64,
    /// Metres.
    pub specular_margin: f64,
    /// Neighbours support each other (a region of constant depth) when their ranges differ by
    /// less than this, metres, plus `support_ratio` of the range.
    pub support_gap: f64,
    /// Share of the range.
    pub support_ratio: f64,
    /// Weight of an echo that no neighbour supports.
    pub unsupported: f64,
}

impl SonarEvidenceConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        free_nat: -0.3,
        occupied_nat: 0.85,
        free_least: 0.1,
        silent_free: 0.15,
        specular_ratio: 1.5,
        specular_margin: 0.3,
        support_gap: 0.05,
        support_ratio: 0.05,
        unsupported: 0.5,
    };
}

/// Sonar evidence is rounded to this: it is no more exact, and travels in longer runs.
const STEP: LogOdds = LogOdds(5);

/// What one sonar's reading comes to after looking at its neighbours.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Echo {
    /// Free up to here, metres.
    free_to: f64,
    /// Weight of the free evidence.
    free_weight: f64,
    /// Distance of the arc, if there is one, and its weight.
    arc: Option<(f64, f64)>,
}

/// Judges a reading by those of the sonars beside it.
fn judge(
    ring: &Ring,
    index: usize,
    profile: &SonarProfile,
    config: &SonarEvidenceConfig,
) -> Option<Echo> {
    let valid = |r: &f64| *r >= profile.range_min_m && *r < profile.range_max_m;
    let neighbours: Vec<f64> = [index.checked_sub(1), Some(index + 1)]
        .into_iter()
        .flatten()
        .filter_map(|i| ring.sonars.get(i)?.range.filter(valid))
        .collect();
    let nearest = neighbours.iter().copied().fold(f64::INFINITY, f64::min);
    let limit = config.specular_ratio * nearest + config.specular_margin;
    match ring.sonars.get(index)?.range {
        None => Some(Echo {
            free_to: profile.range_max_m.min(limit),
            free_weight: config.silent_free,
            arc: None,
        }),
        Some(range) if valid(&range) => {
            let close = config.support_gap + config.support_ratio * range;
            let supported = neighbours.iter().any(|n| (n - range).abs() < close);
            let weight = if supported { 1.0 } else { config.unsupported };
            Some(Echo {
                free_to: range.min(limit),
                free_weight: 1.0,
                // An arc beyond the specular limit is where the pulse's detour ended.
                arc: (range <= limit).then_some((range, weight)),
            })
        }
        Some(range) if range >= profile.range_max_m => Some(Echo {
            free_to: profile.range_max_m.min(limit),
            free_weight: config.silent_free,
            arc: None,
        }),
        Some(_) => None,
    }
}

/// The evidence of one ring of readings.
pub fn sonar_evidence(
    ring: &Ring,
    profile: &SonarProfile,
    level_from_robot: &UncertainPose<Level, Robot>,
    resolution: f64,
    config: &SonarEvidenceConfig,
    canvas: &mut Canvas,
) -> EvidencePatch {
    let half = ring.cone * 0.5;
    for (index, sonar) in ring.sonars.iter().enumerate() {
        let Some(echo) = judge(ring, index, profile, config) else { continue };
        let pose = level_from_robot.pose.compose(&sonar.robot_from_sensor);
        let origin = pose.position();
        let place_variance = level_from_robot.covariance.matrix().fixed_view::<2, 2>(0, 0).trace();
        let deviation = |range: f64| {
            (profile.range_sd(range).powi(2) + 0.5 * place_variance + resolution.powi(2) / 12.0)
                .sqrt()
        };
        let arc = echo.arc.map(|(range, weight)| {
            // The echo came from somewhere on the arc, not from everywhere on it.
            let cells = (ring.cone * range / resolution).max(3.0);
            (range, deviation(range), weight * config.occupied_nat / (cells / 3.0).sqrt())
        });
        let reach = arc.map_or(echo.free_to, |(range, sd, _)| range + 2.0 * sd);
        for_cells_of_cone(&origin, pose.heading(), half, reach, resolution, |cell, d, angle| {
            let across = (-0.5 * (angle / (0.5 * half)).powi(2)).exp();
            let clear_to =
                arc.map_or(echo.free_to, |(range, sd, _)| echo.free_to.min(range - 2.0 * sd));
            let mut nat = 0.0;
            if d < clear_to {
                let fading = (1.0 - d / profile.range_max_m).max(config.free_least);
                nat += config.free_nat * echo.free_weight * across * fading;
            }
            if let Some((range, sd, strength)) = arc
                && (d - range).abs() <= 2.0 * sd
            {
                nat += strength * across * (-0.5 * ((d - range) / sd).powi(2)).exp();
            }
            if nat != 0.0 {
                canvas.add(cell, nat as f32);
            }
        });
    }
    canvas.take(SensorClass::Sonar, STEP)
}

/// Visits the cells whose centres lie in a cone, with their distance and their angle from its axis.
fn for_cells_of_cone(
    origin: &Point,
    heading: f64,
    half: f64,
    reach: f64,
    resolution: f64,
    mut visit: impl FnMut(Cell, f64, f64),
) {
    let margin = Point::new(reach, reach);
    let low = Cell::holding(&(origin - margin), resolution);
    let high = Cell::holding(&(origin + margin), resolution);
    for row in low.row..=high.row {
        for column in low.column..=high.column {
            let cell = Cell { column, row };
            let arm = cell.centre(resolution) - origin;
            let d = arm.norm();
            if d > reach {
                continue;
            }
            let angle = difference(arm.y.atan2(arm.x), heading);
            if angle.abs() <= half {
                visit(cell, d, angle);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use mapfold_map::geometry::{Covariance, Pose};
    use mapfold_map::raster::Tile;

    use super::*;
    use crate::sensor::{Sonar, preset};

    fn ring(ranges: &[Option<f64>]) -> Ring {
        let turn = 22.5_f64.to_radians();
        Ring {
            cone: 25_f64.to_radians(),
            sonars: ranges
                .iter()
                .enumerate()
                .map(|(i, range)| Sonar {
                    robot_from_sensor: Pose::new(0.0, 0.0, turn * i as f64),
                    range: *range,
                })
                .collect(),
        }
    }

    fn evidence(ring: &Ring) -> EvidencePatch {
        let profile = preset("sonar-ring").and_then(|s| s.sonar).unwrap();
        let pose = Pose::new(10.0, 10.0, 0.0);
        let covariance = Covariance::from_variances([1e-4, 1e-4, 1e-5]);
        sonar_evidence(
            ring,
            &profile,
            &UncertainPose { pose, covariance },
            0.05,
            &SonarEvidenceConfig::STANDARD,
            &mut Canvas::default(),
        )
    }

    fn value(patch: &EvidencePatch, x: f64, y: f64) -> i32 {
        let (index, offset) = Cell::holding(&Point::new(10.0 + x, 10.0 + y), 0.05).tile();
        let mut tile = Tile::default();
        if let Some(cells) = patch.tiles.get(&index) {
            tile.add(cells);
        }
        tile.cells()[offset]
    }

    #[test]
    fn an_echo_frees_its_cone_marks_its_arc_and_says_nothing_behind() {
        let patch = evidence(&ring(&[Some(2.0)]));
        assert!(value(&patch, 0.5, 0.0) < 0);
        assert!(value(&patch, 2.0, 0.0) > 0);
        assert_eq!(value(&patch, 2.5, 0.0), 0);
        assert_eq!(value(&patch, 0.5, 0.5), 0, "outside of the cone");
        assert!(value(&patch, 2.0, 0.0) > value(&patch, 1.97, 0.3), "less at the edge of the cone");
    }

    #[test]
    fn the_longer_the_arc_the_less_it_says_of_each_cell() {
        let near = value(&evidence(&ring(&[Some(0.8)])), 0.8, 0.0);
        let far = value(&evidence(&ring(&[Some(4.0)])), 4.0, 0.0);
        assert!(near > far && far > 0, "{near} {far}");
    }

    #[test]
    fn neighbours_of_equal_depth_support_each_other() {
        let alone = value(&evidence(&ring(&[Some(2.0), Some(3.0)])), 2.0, 0.0);
        let supported = value(&evidence(&ring(&[Some(2.0), Some(2.05)])), 2.0, 0.0);
        assert!(supported > alone, "{supported} {alone}");
    }

    #[test]
    fn a_reading_far_beyond_its_neighbour_is_a_detour_and_marks_nothing() {
        let patch = evidence(&ring(&[Some(4.5), Some(1.0)]));
        assert!(value(&patch, 4.5, 0.0) <= 0);
        assert!(value(&patch, 1.0, 0.0) < 0);
        assert_eq!(value(&patch, 3.0, 0.0), 0, "free only up to what the neighbour allows");
    }

    #[test]
    fn silence_is_weak_evidence_for_free_space() {
        let silent = evidence(&ring(&[None]));
        let heard = evidence(&ring(&[Some(4.9)]));
        let [silent, heard] = [&silent, &heard].map(|patch| value(patch, 0.5, 0.0));
        assert!(silent < 0 && heard < 3 * silent, "{silent} {heard}");
    }

    #[test]
    fn readings_below_the_least_range_say_nothing() {
        assert!(evidence(&ring(&[Some(0.05)])).tiles.is_empty());
    }
}
