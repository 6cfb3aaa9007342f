//! The pose of a contribution.

use std::f64::consts::TAU;

use mapfold_map::geometry::{Level, Pose, Robot, UncertainPose};

use crate::border::Limits;
use crate::border::features::parse_feature_id;
use crate::border::number::{angle, bounded_covariance, coordinate};
use crate::border::violations::{Place, Violations};
use crate::v1;

/// Largest standard deviations of (x, y, heading), metres and radians: a pose that is less
/// certain says nothing.
const SD_MAX: [f64; 3] = [1000.0, 1000.0, TAU];
/// Smallest standard deviations of (x, y, heading): 5 mm and 0.05 degrees. No robot knows better
/// where it is, and none buys authority over the others by saying so.
const SD_FLOOR: [f64; 3] = [0.005, 0.005, 0.000_872_664_625_997_164_8];
/// Most segments, and most landmarks, that a fix names.
const BASIS_MAX: usize = 1024;

pub(super) fn check(
    pose: &v1::PoseEstimate,
    limits: &Limits,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<UncertainPose<Level, Robot>> {
    let x = coordinate(pose.x_m, limits, &place.field("x_m"), wrong);
    let y = coordinate(pose.y_m, limits, &place.field("y_m"), wrong);
    let heading = angle(pose.heading_rad, &place.field("heading_rad"), wrong);
    if let Some(basis) = &pose.basis {
        check_basis(basis, limits, &place.field("basis"), wrong);
    }
    let covariance =
        bounded_covariance(&pose.covariance, &SD_MAX, &place.field("covariance"), wrong);
    Some(UncertainPose {
        pose: Pose::new(x?, y?, heading?),
        covariance: covariance?.floored(&SD_FLOOR),
    })
}

/// What a fix was told by is kept as it is told, if it can be such a thing at all.
fn check_basis(basis: &v1::FixBasis, limits: &Limits, place: &Place<'_>, wrong: &mut Violations) {
    if basis.revision < 0 {
        wrong.add(&place.field("revision"), "out_of_range", "a revision is 0 or more");
    }
    if !(basis.way_m.is_finite() && basis.way_m >= 0.0) {
        wrong.add(&place.field("way_m"), "out_of_range", "a way is 0 or more metres");
    }
    for (name, count) in
        [("segments", basis.segments.len()), ("landmarks_m", basis.landmarks_m.len())]
    {
        if count > BASIS_MAX {
            let told = format_args!("{count} of them: a fix names at most {BASIS_MAX}");
            wrong.add(&place.field(name), "too_many", told);
            return;
        }
    }
    let segments = place.field("segments");
    for (i, id) in basis.segments.iter().enumerate() {
        if parse_feature_id(id).is_none() {
            wrong.add(&segments.index(i), "bad_id", "this is no id of a segment");
        }
    }
    let landmarks = place.field("landmarks_m");
    for (i, at) in basis.landmarks_m.iter().enumerate() {
        for (j, number) in at.iter().enumerate() {
            coordinate(*number, limits, &landmarks.index(i).index(j), wrong);
        }
    }
}
