//! Numbers, instants, points and covariances from the wire.

use std::f64::consts::TAU;

use mapfold_map::geometry::{Covariance, CovarianceError, Point};

use super::Limits;
use super::violations::{Place, Violations};
use crate::instant::parse_rfc3339;

/// A finite number, with -0 and subnormal numbers (which no sensor means) made 0.
pub(super) fn finite(value: f64, place: &Place<'_>, wrong: &mut Violations) -> Option<f64> {
    if value.is_finite() {
        return Some(if value.is_normal() { value } else { 0.0 });
    }
    wrong.add(place, "not_finite", "this must be a finite number");
    None
}

/// A matrix from the wire as a covariance: finite, symmetric, positive semi-definite.
pub(super) fn covariance<const N: usize>(
    rows: &[[f64; N]; N],
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Covariance<N>> {
    match Covariance::from_rows(rows.map(|row| row.map(normal_or_zero))) {
        Ok(covariance) => Some(covariance),
        Err(error) => {
            match error {
                CovarianceError::NotFinite { row, column } => {
                    let row = place.index(row);
                    wrong.add(&row.index(column), "not_finite", "this must be a finite number");
                }
                CovarianceError::NotSymmetric { row, column } => {
                    let row = place.index(row);
                    wrong.add(&row.index(column), "not_symmetric", error);
                }
                CovarianceError::NotPositive => {
                    wrong.add(place, "not_positive_semidefinite", error);
                }
            }
            None
        }
    }
}

fn normal_or_zero(value: f64) -> f64 {
    if value.is_normal() || !value.is_finite() { value } else { 0.0 }
}

/// A covariance with standard deviations of at most `sd_max`.
pub(super) fn bounded_covariance<const N: usize>(
    rows: &[[f64; N]; N],
    sd_max: &[f64; N],
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Covariance<N>> {
    for (i, row) in rows.iter().enumerate() {
        for (j, entry) in row.iter().enumerate() {
            let max = sd_max[i] * sd_max[j];
            if entry.is_finite() && entry.abs() > max {
                wrong.add(
                    &place.index(i).index(j),
                    "covariance_too_large",
                    format_args!("{entry} is more than {max}: such an estimate says nothing"),
                );
                return None;
            }
        }
    }
    covariance(rows, place, wrong)
}

/// A coordinate in metres within the limits.
pub(super) fn coordinate(
    metres: f64,
    limits: &Limits,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<f64> {
    let metres = finite(metres, place, wrong)?;
    let max = limits.coordinate_max_m;
    if metres.abs() <= max {
        return Some(metres);
    }
    wrong.add(place, "out_of_range", format_args!("{metres} m: {max} m is the most"));
    None
}

/// A point of the level frame within the limits.
pub(super) fn in_level(
    p: &Point,
    limits: &Limits,
    place: &Place<'_>,
    wrong: &mut Violations,
) -> Option<()> {
    let max = limits.coordinate_max_m;
    if p.x.abs() <= max && p.y.abs() <= max {
        return Some(());
    }
    wrong.add(
        place,
        "out_of_range",
        format_args!("this is ({}, {}) m in the level: {max} m is the most", p.x, p.y),
    );
    None
}

/// An angle in radians, at most a full turn either way; degrees rarely pass.
pub(super) fn angle(radians: f64, place: &Place<'_>, wrong: &mut Violations) -> Option<f64> {
    let radians = finite(radians, place, wrong)?;
    if radians.abs() <= TAU {
        return Some(radians);
    }
    wrong.add(
        place,
        "out_of_range",
        format_args!("{radians} rad is more than a full turn: are these degrees?"),
    );
    None
}

/// A number that must not be negative.
pub(super) fn not_negative(value: f64, place: &Place<'_>, wrong: &mut Violations) -> Option<f64> {
    let value = finite(value, place, wrong)?;
    if value >= 0.0 {
        return Some(value);
    }
    wrong.add(place, "negative", format_args!("{value} must not be negative"));
    None
}

/// The member `points` of the feature at `place`: at least one.
pub(super) fn some_points(points: u32, place: &Place<'_>, wrong: &mut Violations) -> Option<u32> {
    if points > 0 {
        return Some(points);
    }
    wrong.add(&place.field("points"), "no_points", "what was seen was seen by at least one beam");
    None
}

/// An instant in microseconds since 1970.
pub(super) fn read_instant(text: &str, place: &Place<'_>, wrong: &mut Violations) -> Option<i64> {
    let instant = parse_rfc3339(text);
    if instant.is_none() {
        wrong.add(
            place,
            "bad_instant",
            "this must be an instant as in 2026-11-22T04:00:00.123456Z",
        );
    }
    instant
}
