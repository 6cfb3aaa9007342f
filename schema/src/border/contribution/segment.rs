//! The segments of a contribution.

use std::f64::consts::PI;

use mapfold_map::geometry::{Interval, Level, Pose, Robot, UncertainLine};
use mapfold_map::vector::{ObservedEnd, ObservedSegment};

use crate::border::Limits;
use crate::border::number::{
    angle, bounded_covariance, coordinate, in_level, not_negative, some_points,
};
use crate::border::violations::{Place, Violations};
use crate::v1;

/// Shortest segment, metres: below it a direction is noise.
const LENGTH_MIN_M: f64 = 0.01;
/// Longest segment, metres: no sensor sees further.
const LENGTH_MAX_M: f64 = 1000.0;
/// Largest standard deviations of (rho, alpha), metres and radians. Rho's is large where a short
/// segment lies far along its line from the foot point.
const SD_MAX: [f64; 2] = [100.0, PI];
/// Smallest standard deviations of (rho, alpha): 1 mm and 0.02 degrees. No range finder knows
/// better, and no robot buys authority over the others by saying so.
const SD_FLOOR: [f64; 2] = [0.001, 0.000_349_065_850_398_865_9];
/// Smallest standard deviation of an end along the line, metres.
const END_SD_FLOOR_M: f64 = 0.001;
/// Largest standard deviation of an end along the line, metres.
const END_SD_MAX_M: f64 = 100.0;
/// Most stretches of one line that one look can have seen through.
const SEEN_THROUGH_MAX: usize = 64;

pub(super) fn check(
    segment: &v1::ObservedSegment,
    level_from_robot: Option<&Pose<Level, Robot>>,
    limits: &Limits,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<ObservedSegment> {
    let rho_place = place.field("rho_m");
    let rho = coordinate(segment.rho_m, limits, &rho_place, wrong)
        .and_then(|rho| not_negative(rho, &rho_place, wrong));
    let alpha = angle(segment.alpha_rad, &place.field("alpha_rad"), wrong);
    let covariance =
        bounded_covariance(&segment.covariance, &SD_MAX, &place.field("covariance"), wrong);
    let span = check_span(segment, limits, place, wrong);
    let ends = check_ends(&segment.ends, &place.field("ends"), wrong);
    let points = some_points(segment.points, place, wrong);
    let seen_through_place = place.field("seen_through_m");
    let seen_through =
        check_seen_through(&segment.seen_through_m, limits, &seen_through_place, wrong);

    let (line, turned) = UncertainLine::normal_form(rho?, alpha?, covariance?.floored(&SD_FLOOR));
    debug_assert!(!turned, "rho is not negative");
    let (from, to) = span?;
    if let Some(level_from_robot) = level_from_robot {
        let inside = |t: f64, place: &Place<'_>, wrong: &mut Violations| {
            in_level(&level_from_robot.act(&line.line.at(t)), limits, place, wrong)
        };
        inside(from, &place.field("from_m"), wrong)?;
        inside(to, &place.field("to_m"), wrong)?;
        for through in seen_through.iter().flatten() {
            inside(through.from_m(), &seen_through_place, wrong)?;
            inside(through.to_m(), &seen_through_place, wrong)?;
        }
    }
    Some(ObservedSegment {
        line,
        from,
        to,
        facing: segment.facing.into(),
        ends: ends?,
        points: points?,
        seen_through: seen_through?,
    })
}

/// The stretches that were seen through, in whole millimetres; what is less vanishes.
fn check_seen_through(
    stretches: &[[f64; 2]],
    limits: &Limits,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Vec<Interval>> {
    if stretches.len() > SEEN_THROUGH_MAX {
        let n = stretches.len();
        wrong.add(
            place,
            "too_many_seen_through",
            format_args!("{n} stretches: one look sees through at most {SEEN_THROUGH_MAX}"),
        );
        return None;
    }
    let mut checked: Vec<Interval> = Vec::with_capacity(stretches.len());
    let mut before = f64::NEG_INFINITY;
    for (i, [from, to]) in stretches.iter().enumerate() {
        let place = place.index(i);
        let from = coordinate(*from, limits, &place.index(0), wrong);
        let to = coordinate(*to, limits, &place.index(1), wrong);
        let (from, to) = (from?, to?);
        if from >= to || from < before {
            wrong.add(
                &place,
                "out_of_order",
                "stretches seen through ascend, apart from each other, from before to",
            );
            return None;
        }
        before = to;
        let stretch = Interval::from_metres(from, to);
        if stretch.length() > 0 {
            checked.push(stretch);
        }
    }
    Some(checked)
}

/// The two coordinates along the line.
fn check_span(
    segment: &v1::ObservedSegment,
    limits: &Limits,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<(f64, f64)> {
    let to_place = place.field("to_m");
    let from = coordinate(segment.from_m, limits, &place.field("from_m"), wrong);
    let to = coordinate(segment.to_m, limits, &to_place, wrong);
    let (from, to) = (from?, to?);
    let length = to - from;
    if length <= 0.0 {
        wrong.add(&to_place, "out_of_order", "to_m must be more than from_m");
    } else if length < LENGTH_MIN_M {
        wrong.add(
            &to_place,
            "segment_too_short",
            format_args!(
                "a segment of {length} m is noise: leave out what is shorter than {LENGTH_MIN_M} m"
            ),
        );
    } else if length > LENGTH_MAX_M {
        wrong.add(
            &to_place,
            "segment_too_long",
            format_args!("no look sees {length} m of wall: {LENGTH_MAX_M} m is the most"),
        );
    } else {
        return Some((from, to));
    }
    None
}

fn check_ends(
    [lower, upper]: &[v1::ObservedEnd; 2],
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<[ObservedEnd; 2]> {
    let lower = check_end(lower, &place.index(0), wrong);
    let upper = check_end(upper, &place.index(1), wrong);
    Some([lower?, upper?])
}

fn check_end(
    end: &v1::ObservedEnd,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<ObservedEnd> {
    let place = place.field("sd_m");
    let sd = not_negative(end.sd_m, &place, wrong)?;
    if sd > END_SD_MAX_M {
        wrong.add(
            &place,
            "out_of_range",
            format_args!("an end with a standard deviation above {END_SD_MAX_M} m says nothing"),
        );
        return None;
    }
    Some(ObservedEnd { kind: end.kind.into(), sd: sd.max(END_SD_FLOOR_M) })
}
