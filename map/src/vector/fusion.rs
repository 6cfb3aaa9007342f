//! Fusing the looks at one wall without counting shared errors twice.
//!
//! Split covariance intersection of N looks (Julier and Uhlmann): look g contributes `z_g` with an
//! independent part `R_g` and a part `P_g` that it may share with the others. For weights `w_g > 0`
//! that sum to 1, with `B_g = R_g + P_g / w_g`, the estimate `C sum(B_g^-1 z_g)`, where
//! `C = (sum B_g^-1)^-1`, has a true covariance of at most `C`, whatever the correlations of the
//! shared parts are.

use nalgebra::{Matrix2, Vector2};

use super::VectorConfig;
use super::sighting::{Sighting, about, scaled_trace};
use crate::geometry::{Point, difference, wrap};
use crate::level::{ContributionId, FeatureId};

/// A fused line about an anchor.
#[derive(Debug, Clone, Copy)]
pub(super) struct FusedLine {
    /// The point that the offset is counted from.
    pub(super) anchor: Point,
    /// Offset along the normal.
    pub(super) offset: f64,
    /// Angle of the normal, which points to free space.
    pub(super) alpha: f64,
    /// Covariance of (offset, alpha) that averages out.
    pub(super) independent: Matrix2<f64>,
    /// Covariance of (offset, alpha) that does not.
    pub(super) dependent: Matrix2<f64>,
}

/// One look's estimate of (offset, alpha) about a common anchor.
#[derive(Debug, Clone, Copy)]
struct Estimate {
    look: ContributionId,
    z: Vector2<f64>,
    /// What only this line of this look errs by.
    own: Matrix2<f64>,
    /// What all lines of this look err by, and no other look.
    fix: Matrix2<f64>,
    /// What other looks may err by as well.
    shared: Matrix2<f64>,
}

/// The inverse of a symmetric 2x2 matrix; `None` unless it is positive definite.
fn inverse(m: &Matrix2<f64>) -> Option<Matrix2<f64>> {
    let determinant = m[(0, 0)] * m[(1, 1)] - m[(0, 1)] * m[(1, 0)];
    (determinant > 0.0 && m[(0, 0)] > 0.0)
        .then(|| Matrix2::new(m[(1, 1)], -m[(0, 1)], -m[(1, 0)], m[(0, 0)]) / determinant)
}

/// Fuses sightings of one wall (canonical order), angles being counted from `reference`.
/// `None` if no sighting carries information.
pub(super) fn fuse<'a>(
    sightings: impl Iterator<Item = (FeatureId, &'a Sighting)> + Clone,
    reference: &Sighting,
    config: &VectorConfig,
) -> Option<FusedLine> {
    let anchor = reference.middle;
    // Once somebody has localized on the map, the error of a fix on surveyed landmarks that is in it
    // may be in other poses too.
    let fixes_are_own = sightings.clone().all(|(_, s)| s.is_datum);
    let mut looks = one_per_look(sightings.map(|(id, s)| {
        let (offset, lever) = s.offset_about(&anchor);
        Estimate {
            look: id.contribution,
            z: Vector2::new(offset, difference(s.alpha, reference.alpha)),
            own: about(&s.independent, lever),
            fix: about(&s.own_fix, lever),
            shared: about(&s.dependent, lever),
        }
    }));
    if !fixes_are_own {
        let fed_back = fed_back(looks.len(), config.fed_back);
        for Estimate { own, fix, shared, .. } in &mut looks {
            *shared += *fix + *own * fed_back;
            *own *= 1.0 - fed_back;
            *fix = Matrix2::zeros();
        }
    }
    let weights: Vec<f64> =
        looks.iter().map(|e| 1.0 / scaled_trace(&(e.own + e.fix + e.shared), config)).collect();
    let total: f64 = weights.iter().sum();
    let mut information = Matrix2::zeros();
    let mut weighted = Vector2::zeros();
    let mut parts = Vec::with_capacity(looks.len());
    for (estimate, weight) in looks.iter().zip(&weights) {
        let shared = estimate.shared * (total / weight);
        let Some(b_inverse) = inverse(&(estimate.own + estimate.fix + shared)) else { continue };
        information += b_inverse;
        weighted += b_inverse * estimate.z;
        // Looks do not share their fixes, but a look's lines do.
        parts.push((b_inverse, estimate.own, estimate.fix + shared));
    }
    let c = inverse(&information)?;
    let fused = c * weighted;
    let (mut independent, mut dependent) = (Matrix2::zeros(), Matrix2::zeros());
    for (b_inverse, own, common) in parts {
        let k = c * b_inverse;
        independent += k * own * k.transpose();
        dependent += k * common * k.transpose();
    }
    let symmetric = |m: Matrix2<f64>| (m + m.transpose()) * 0.5;
    Some(FusedLine {
        anchor,
        offset: fused.x,
        alpha: wrap(reference.alpha + fused.y),
        independent: symmetric(independent),
        dependent: symmetric(dependent),
    })
}

/// The share of each look's sensor covariance that counts as shared among `looks` looks, so that
/// their fusion claims what is left of it when every pose takes over `weight` of the error that the
/// wall has by then: the mean of n looks then errs by
/// `x_n = x_(n-1) (1 - (1 - weight) / n) + e_n / n`.
fn fed_back(looks: usize, weight: f64) -> f64 {
    if looks < 2 {
        return 1.0;
    }
    let mut variance = 1.0;
    for n in (2..=looks).map(|n| n as f64) {
        variance = variance * (1.0 - (1.0 - weight) / n).powi(2) + 1.0 / (n * n);
    }
    // Averaging what is not shared leaves 1 / n of it.
    let averaged = 1.0 / looks as f64;
    ((variance - averaged) / (1.0 - averaged)).clamp(0.0, 1.0)
}

/// Pieces of one look share one pose error: they count as one estimate, averaged by their own
/// errors, with the shared part of the most precise of them.
fn one_per_look(estimates: impl Iterator<Item = Estimate>) -> Vec<Estimate> {
    let mut looks: Vec<Estimate> = Vec::new();
    for next in estimates {
        match looks.last_mut() {
            Some(last) if last.look == next.look => {
                let (Some(a), Some(b)) = (inverse(&last.own), inverse(&next.own)) else { continue };
                let Some(own) = inverse(&(a + b)) else { continue };
                let z = own * (a * last.z + b * next.z);
                let best = if b.trace() > a.trace() { next } else { *last };
                *last = Estimate { z, own, ..best };
            }
            _ => looks.push(next),
        }
    }
    looks
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::Chance;

    #[test]
    fn what_comes_back_is_all_or_nothing_at_the_ends() {
        for looks in [2, 3, 10, 100] {
            assert!(fed_back(looks, 0.0).abs() < 1e-12, "poses that owe nothing to the map");
            assert!(fed_back(looks, 1.0) >= 1.0, "poses that repeat what the wall is said to be");
            let more = [0.2, 0.4, 0.6].map(|weight| fed_back(looks, weight));
            assert!(more[0] < more[1] && more[1] < more[2], "{more:?}");
        }
        assert!((fed_back(2, 0.5) - 0.625).abs() < 1e-12);
        assert!((1..100).all(|n| fed_back(n + 1, 0.5) < fed_back(n, 0.5)));
    }

    #[test]
    fn the_mean_of_looks_that_repeat_half_of_what_they_find_errs_as_claimed() {
        let (mut chance, runs) = (Chance(9), 20_000);
        for looks in [2, 5, 20] {
            let mut square = 0.0;
            for _ in 0..runs {
                let mut mean = chance.normal();
                for n in (2..=looks).map(|n| n as f64) {
                    let seen = 0.5 * mean + chance.normal();
                    mean += (seen - mean) / n;
                }
                square += mean * mean / f64::from(runs);
            }
            let shared = fed_back(looks, 0.5);
            let claimed = shared + (1.0 - shared) / looks as f64;
            assert!((square / claimed - 1.0).abs() < 0.04, "{looks}: {square} for {claimed}");
        }
    }
}
