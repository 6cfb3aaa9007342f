//! The pose of a contribution.

use std::f64::consts::TAU;

use mapfold_map::geometry::{Level, Pose, Robot, UncertainPose};

use crate::border::Limits;
use crate::border::number::{angle, bounded_covariance, coordinate};
use crate::border::violations::{Place, Violations};
use crate::v1;

/// Largest standard deviations of (x, y, heading), metres and radians: a pose that is less
/// certain says nothing.
const SD_MAX: [f64; 3] = [1000.0, 1000.0, TAU];
/// Smallest standard deviations of (x, y, heading): 5 mm and 0.05 degrees. No robot knows better
/// where it is, and none buys authority over the others by saying so.
const SD_FLOOR: [f64; 3] = [0.005, 0.005, 0.000_872_664_625_997_164_8];

pub(super) fn check(
    pose: &v1::PoseEstimate,
    limits: &Limits,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<UncertainPose<Level, Robot>> {
    let x = coordinate(pose.x_m, limits, &place.field("x_m"), wrong);
    let y = coordinate(pose.y_m, limits, &place.field("y_m"), wrong);
    let heading = angle(pose.heading_rad, &place.field("heading_rad"), wrong);
    let covariance =
        bounded_covariance(&pose.covariance, &SD_MAX, &place.field("covariance"), wrong);
    Some(UncertainPose {
        pose: Pose::new(x?, y?, heading?),
        covariance: covariance?.floored(&SD_FLOOR),
    })
}
