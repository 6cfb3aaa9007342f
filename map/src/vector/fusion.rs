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
    r: Matrix2<f64>,
    p: Matrix2<f64>,
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
    let looks = one_per_look(sightings.map(|(id, s)| {
        let (offset, lever) = s.offset_about(&anchor);
        let (r, p) = if fixes_are_own {
            (s.independent + s.own_fix, s.dependent)
        } else {
            (
                s.independent * (1.0 - config.fed_back),
                s.dependent + s.own_fix + s.independent * config.fed_back,
            )
        };
        Estimate {
            look: id.contribution,
            z: Vector2::new(offset, difference(s.alpha, reference.alpha)),
            r: about(&r, lever),
            p: about(&p, lever),
        }
    }));
    let weights: Vec<f64> =
        looks.iter().map(|e| 1.0 / scaled_trace(&(e.r + e.p), config)).collect();
    let total: f64 = weights.iter().sum();
    let mut information = Matrix2::zeros();
    let mut weighted = Vector2::zeros();
    let mut parts = Vec::with_capacity(looks.len());
    for (estimate, weight) in looks.iter().zip(&weights) {
        let shared = estimate.p * (total / weight);
        let Some(b_inverse) = inverse(&(estimate.r + shared)) else { continue };
        information += b_inverse;
        weighted += b_inverse * estimate.z;
        parts.push((b_inverse, estimate.r, shared));
    }
    let c = inverse(&information)?;
    let fused = c * weighted;
    let (mut independent, mut dependent) = (Matrix2::zeros(), Matrix2::zeros());
    for (b_inverse, r, shared) in parts {
        let k = c * b_inverse;
        independent += k * r * k.transpose();
        dependent += k * shared * k.transpose();
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

/// Pieces of one look share one pose error: they count as one estimate, averaged by their own
/// errors, with the shared part of the most precise of them.
fn one_per_look(estimates: impl Iterator<Item = Estimate>) -> Vec<Estimate> {
    let mut looks: Vec<Estimate> = Vec::new();
    for next in estimates {
        match looks.last_mut() {
            Some(last) if last.look == next.look => {
                let (Some(a), Some(b)) = (inverse(&last.r), inverse(&next.r)) else { continue };
                let Some(r) = inverse(&(a + b)) else { continue };
                let z = r * (a * last.z + b * next.z);
                let p = if b.trace() > a.trace() { next.p } else { last.p };
                *last = Estimate { look: next.look, z, r, p };
            }
            _ => looks.push(next),
        }
    }
    looks
}
