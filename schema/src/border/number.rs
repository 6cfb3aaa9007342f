//! Numbers and covariances from the wire.

use mapfold_map::geometry::{Covariance, CovarianceError};

use super::violations::{Place, Violations};

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
