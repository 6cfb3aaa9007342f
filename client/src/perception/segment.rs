//! From the sensor's frame to the robot's.

use mapfold_map::geometry::{Interval, Point, Pose, Robot, Sensor, UncertainLine};
use mapfold_map::vector::{Facing, ObservedCluster, ObservedSegment};
use nalgebra::Matrix2;

use super::clusters::{ClusterConfig, FoundCluster};
use super::ends::Ended;
use super::seen_through::{self, SeenThroughConfig, Sweep};
use super::split::FoundLine;
use crate::sensor::Scan;

/// Where the sensor sits on the robot, its trigonometry done once a scan.
#[derive(Debug, Clone, Copy)]
pub(super) struct Mount {
    heading: f64,
    turn: Matrix2<f64>,
    position: Point,
}

impl Mount {
    /// The mount of a scan.
    pub(super) fn of(scan: &Scan) -> Self {
        let robot_from_sensor: &Pose<Robot, Sensor> = &scan.robot_from_sensor;
        let heading = robot_from_sensor.heading();
        let (s, c) = heading.sin_cos();
        Self { heading, turn: Matrix2::new(c, -s, s, c), position: robot_from_sensor.position() }
    }

    fn act(&self, p: &Point) -> Point {
        self.position + self.turn * p
    }
}

/// A line with its ends as the robot hands it in, with its place among the sweep's blocks and the number of its
/// points. `seen_through` is an empty buffer to fill.
pub(super) fn in_robot_frame(
    line: &FoundLine,
    (own, count): (usize, usize),
    ended: &Ended,
    mount: &Mount,
    sweep: &Sweep<'_>,
    config: &SeenThroughConfig,
    mut seen_through: Vec<Interval>,
) -> ObservedSegment {
    let fit = &line.fit;
    // `alpha' = alpha + heading`, `rho' = rho + n'.p`: as `Pose::act_on_line`, without its angles.
    let rho = fit.line.line.rho() + (mount.turn * fit.normal).dot(&mount.position);
    // Along the moved tangent, coordinates shift by the sensor's own.
    let shift = (mount.turn * fit.tangent).dot(&mount.position);
    let covariance = fit.line.covariance.transformed(&Matrix2::new(1.0, shift, 0.0, 1.0));
    let alpha = fit.line.line.alpha() + mount.heading;
    let (uncertain, turned) = UncertainLine::<Robot>::normal_form(rho, alpha, covariance);
    let (from, to) = (ended.from + shift, ended.to + shift);
    let [lower, upper] = ended.ends;
    let span = (ended.from, ended.to);
    seen_through::stretches(sweep, fit, own, span, shift, config, &mut seen_through);
    if turned {
        seen_through.reverse();
        for stretch in &mut seen_through {
            *stretch = Interval { from: -stretch.to, to: -stretch.from };
        }
    }
    let (from, to, ends) =
        if turned { (-to, -from, [upper, lower]) } else { (from, to, [lower, upper]) };
    // A wall is seen from where the sensor is, which need not be the robot's centre's side: normals
    // point away from the sensor, until the robot's centre turns them round.
    let facing = if turned { Facing::Away } else { Facing::Origin };
    ObservedSegment { line: uncertain, from, to, facing, ends, points: count as u32, seen_through }
}

/// A cluster as the robot hands it in.
pub(super) fn cluster_in_robot_frame(
    cluster: &mut FoundCluster,
    mount: &Mount,
    config: &ClusterConfig,
) -> ObservedCluster {
    let mut hull = std::mem::take(&mut cluster.hull);
    for p in &mut hull {
        *p = mount.act(p);
    }
    ObservedCluster {
        hull,
        centroid: mount.act(&cluster.centroid()),
        covariance: cluster.covariance(config).transformed(&mount.turn),
        points: cluster.count as u32,
    }
}
