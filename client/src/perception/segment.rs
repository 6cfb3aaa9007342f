//! From the sensor's frame to the robot's.

use mapfold_map::geometry::{Interval, Pose, Robot, Sensor, UncertainLine};
use mapfold_map::vector::{Facing, ObservedCluster, ObservedSegment};
use nalgebra::Matrix2;

use super::Config;
use super::clusters::FoundCluster;
use super::ends::Ended;
use super::seen_through::{self, Sweep};
use super::split::FoundLine;
use crate::sensor::Scan;

/// A line with its ends as the robot hands it in.
pub(super) fn in_robot_frame(
    line: &FoundLine,
    ended: &Ended,
    sweep: &Sweep<'_>,
    scan: &Scan,
    config: &Config,
) -> ObservedSegment {
    let robot_from_sensor: &Pose<Robot, Sensor> = &scan.robot_from_sensor;
    let moved = robot_from_sensor.act_on_line(&line.fit.line.line);
    let covariance = line.fit.line.covariance.transformed(&moved.j_line_line);
    let (uncertain, turned) =
        UncertainLine::<Robot>::normal_form(moved.rho, moved.alpha, covariance);
    // Along the moved tangent, coordinates shift by the sensor's own: that is `j_line_line`'s tau.
    let shift = moved.j_line_line[(0, 1)];
    let (from, to) = (ended.from + shift, ended.to + shift);
    let [lower, upper] = ended.ends;
    let outermost = (line.first(), line.last());
    let span = (ended.from, ended.to);
    let mut seen_through =
        seen_through::stretches(sweep, &line.fit, outermost, span, shift, &config.seen_through);
    if turned {
        seen_through.reverse();
        for stretch in &mut seen_through {
            *stretch = Interval { from: -stretch.to, to: -stretch.from };
        }
    }
    let (from, to, ends) =
        if turned { (-to, -from, [upper, lower]) } else { (from, to, [lower, upper]) };
    // A wall is seen from where the sensor is, which need not be the robot's centre's side.
    let across = uncertain.line.across(&robot_from_sensor.position());
    let facing =
        if across < 0.0 || (across == 0.0 && !turned) { Facing::Origin } else { Facing::Away };
    ObservedSegment {
        line: uncertain,
        from,
        to,
        facing,
        ends,
        points: line.members.len() as u32,
        seen_through,
    }
}

/// A cluster as the robot hands it in.
pub(super) fn cluster_in_robot_frame(cluster: &FoundCluster, scan: &Scan) -> ObservedCluster {
    let pose = &scan.robot_from_sensor;
    let (s, c) = pose.heading().sin_cos();
    ObservedCluster {
        hull: cluster.hull.iter().map(|p| pose.act(p)).collect(),
        centroid: pose.act(&cluster.centroid),
        covariance: cluster.covariance.transformed(&Matrix2::new(c, -s, s, c)),
        points: cluster.members.len() as u32,
    }
}
