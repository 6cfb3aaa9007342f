//! An echo against what may have sent it back.
//!
//! A wall sends sound back from the foot of the perpendicular on it: the arc of the reading is tangent to it. If
//! that lies within the cone, the reading is the distance to the wall's line, wherever in the cone it is. A
//! corner sends it back from itself.

use mapfold_map::geometry::{Level, Point, Pose, Robot, Sensor, UncertainPose, difference};
use mapfold_map::landmarks::{LandmarkKind, LandmarkTable};
use nalgebra::{Matrix1, Matrix1x3, RowVector2, Vector1};

use super::filter::{MapError, Measurement, WallName};
use super::landmarks;
use super::reference_walls::ReferenceWalls;
use crate::sensor::{Ring, SonarProfile};

/// Corners echo only well within a cone.
const CORNERS_WITHIN: f64 = 0.8;

/// One reading.
pub(super) struct Echo {
    range: f64,
    variance: f64,
    half_cone: f64,
    robot_from_sensor: Pose<Robot, Sensor>,
}

/// What may have sent it back.
pub(super) struct Source {
    pub(super) measurement: Measurement<1>,
    /// The wall, if it is one.
    pub(super) wall: Option<WallName>,
}

/// The reading of a sonar, if it heard something that is no crosstalk.
pub(super) fn echo(ring: &Ring, index: usize, profile: &SonarProfile, sd_min: f64) -> Option<Echo> {
    let sonar = ring.sonars.get(index).filter(|sonar| sonar.is_steady)?;
    let range = sonar.range?;
    (range > profile.range_min_m && range < profile.range_max_m).then(|| Echo {
        range,
        variance: profile.range_sd(range).powi(2) + sd_min * sd_min,
        half_cone: 0.5 * ring.cone,
        robot_from_sensor: sonar.robot_from_sensor,
    })
}

/// All that could have sent it back from where the robot is thought to be.
pub(super) fn sources(
    echo: &Echo,
    pose: &UncertainPose<Level, Robot>,
    walls: &ReferenceWalls,
    table: Option<&LandmarkTable>,
) -> Vec<Source> {
    let level_from_sensor = pose.pose.compose(&echo.robot_from_sensor);
    let (from, axis) = (level_from_sensor.position(), level_from_sensor.heading());
    let arm = echo.robot_from_sensor.position();
    // Of the point that hears by (x, y, heading).
    let j_sensor = pose.pose.j_point_pose(&arm);
    let slack = 2.0 * pose.covariance.sd(2);
    let end = from + mapfold_map::geometry::unit_normal(axis) * echo.range;
    let reach = echo.range * echo.half_cone + 0.5;
    let mut found = Vec::new();
    for wall in walls.near(&from, &end, reach) {
        let distance = wall.across(&from);
        let foot = from - wall.normal * distance;
        let t = wall.along(&foot);
        let off = difference(wall.angle + std::f64::consts::PI, axis).abs();
        let is_met = distance > 0.0
            && off <= echo.half_cone + slack
            && wall.parts.iter().any(|(low, high)| (*low..=*high).contains(&t));
        if is_met {
            let normal = RowVector2::new(wall.normal.x, wall.normal.y);
            found.push(Source {
                measurement: Measurement {
                    innovation: Vector1::new(echo.range - distance),
                    j_pose: normal * j_sensor,
                    // A wall that is farther out along its normal is nearer.
                    j_errors: wall
                        .errors_at(&foot)
                        .map(|(error, j)| (error, Matrix1x3::from(-j.row(0))))
                        .collect(),
                    noise: Matrix1::new(echo.variance),
                },
                wall: Some(wall.name),
            });
        }
    }
    for (_, corner) in table.into_iter().flat_map(|table| table.near(from, echo.range + 0.5)) {
        let arm = corner.at - from;
        let distance = arm.norm();
        let off = difference(arm.y.atan2(arm.x), axis).abs();
        let echoes =
            matches!(corner.kind, LandmarkKind::ConcaveCorner | LandmarkKind::ConvexCorner);
        if !echoes || distance < 0.1 || off > CORNERS_WITHIN * echo.half_cone {
            continue;
        }
        let towards = arm / distance;
        found.push(Source {
            measurement: of_corner(echo, &towards, distance, &j_sensor, corner, walls),
            wall: None,
        });
    }
    found
}

fn of_corner(
    echo: &Echo,
    towards: &Point,
    distance: f64,
    j_sensor: &nalgebra::Matrix2x3<f64>,
    corner: &mapfold_map::landmarks::Landmark,
    walls: &ReferenceWalls,
) -> Measurement<1> {
    let towards = RowVector2::new(towards.x, towards.y);
    let (shared, _) = walls.shared_near(&corner.at);
    let flat = |j: RowVector2<f64>| Matrix1x3::new(j.x, j.y, 0.0);
    Measurement {
        innovation: Vector1::new(echo.range - distance),
        j_pose: -towards * j_sensor,
        j_errors: vec![
            (landmarks::name(corner), flat(towards * landmarks::root(corner))),
            (MapError::Shared, flat(towards * shared)),
        ],
        noise: Matrix1::new(echo.variance),
    }
}
