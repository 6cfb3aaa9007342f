//! A landmark that was seen against one that is known.

use mapfold_map::geometry::{Level, Pose, Robot};
use mapfold_map::landmarks::{Landmark, ObservedLandmark};
use mapfold_map::vector::ObservedSegment;
use nalgebra::{Matrix2, Matrix3, Vector2, Vector3};

use super::filter::{MapError, Measurement};

/// What a landmark seen says of the pose if it is this one: place and direction, in the robot frame. `shared` are
/// the deviations of what it has in common with all of the map, metres and radians.
pub(super) fn measure(
    known: &Landmark,
    seen: &ObservedLandmark,
    pose: &Pose<Level, Robot>,
    shared: (f64, f64),
    direction_sd_min: f64,
) -> Measurement<3> {
    let expected = pose.inverse().act(&known.at);
    let (sin, cos) = pose.heading().sin_cos();
    let turned = Matrix2::new(cos, sin, -sin, cos);
    let off = seen.at - expected;
    let turn = -known.kind.turn(known.direction, seen.direction + pose.heading());
    let direction_sd = seen.direction_sd.max(direction_sd_min);
    let with_place = |place: &Matrix2<f64>, direction: f64| {
        let mut all = Matrix3::zeros();
        all.fixed_view_mut::<2, 2>(0, 0).copy_from(place);
        all[(2, 2)] = direction;
        all
    };
    Measurement {
        innovation: Vector3::new(off.x, off.y, turn),
        j_pose: Matrix3::new(
            -cos,
            -sin,
            expected.y, //
            sin,
            -cos,
            -expected.x, //
            0.0,
            0.0,
            -1.0,
        ),
        j_errors: vec![
            (name(known), with_place(&(turned * root(known)), known.direction_sd)),
            (MapError::Shared, with_place(&(turned * shared.0), shared.1)),
        ],
        noise: with_place(seen.covariance.matrix(), direction_sd * direction_sd),
    }
}

pub(super) fn name(known: &Landmark) -> MapError {
    let millimetres = |metres: f64| (metres * 1e3).round() as i64;
    MapError::Landmark(known.kind, [millimetres(known.at.x), millimetres(known.at.y)])
}

/// A square root of the covariance of a landmark's place.
pub(super) fn root(known: &Landmark) -> Matrix2<f64> {
    let c = known.covariance.matrix();
    let x = c[(0, 0)].max(0.0).sqrt();
    let both = if x > 0.0 { c[(0, 1)] / x } else { 0.0 };
    Matrix2::new(x, 0.0, both, (c[(1, 1)] - both * both).max(0.0).sqrt())
}

/// How much of a landmark is news after some lines of the same look have been used.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum News {
    /// All of it: place and direction.
    All,
    /// Where along a line it is: the unit vector of that in the robot frame.
    Along(Vector2<f64>),
    /// Nothing: two lines that were used cross there.
    Nothing,
}

/// A landmark lies on lines within this, metres.
const ON_LINE: f64 = 0.05;
/// And from their ends no farther than this: half a doorway.
const FROM_ENDS: f64 = 1.0;

/// What a landmark adds to the lines that it was made of: a corner of two lines tells nothing that they do not.
pub(super) fn news(seen: &ObservedLandmark, used: &[&ObservedSegment]) -> News {
    let mut along: Option<Vector2<f64>> = None;
    for segment in used {
        let line = &segment.line.line;
        let t = line.along(&seen.at);
        if line.across(&seen.at).abs() > ON_LINE
            || t < segment.from - FROM_ENDS
            || t > segment.to + FROM_ENDS
        {
            continue;
        }
        let direction = mapfold_map::geometry::tangent(line.alpha());
        match along {
            None => along = Some(direction),
            Some(first) if first.perp(&direction).abs() > 0.2 => return News::Nothing,
            Some(_) => {}
        }
    }
    along.map_or(News::All, News::Along)
}
