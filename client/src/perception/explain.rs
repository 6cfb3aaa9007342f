//! Whether a line explains points.

use std::ops::Range;

use super::cloud::Cloud;
use super::guess::Guess;
use super::points::ScanPoint;

/// The guess, or a better one of the same points, that explains them: those of a stretch but for its
/// strays.
pub(super) fn explaining(
    cloud: &Cloud,
    stretch: &Range<usize>,
    stray: &[bool],
    guess: &Guess,
    sds: f64,
    z: f64,
) -> Option<Guess> {
    let own = || cloud.without(stretch, stray);
    if explains(own(), guess, sds, z) {
        return Some(*guess);
    }
    let refined = guess.refined(own())?;
    explains(own(), &refined, sds, z).then_some(refined)
}

/// Whether a line lies within so many deviations of each of its points, and within what chance
/// allows of all together.
fn explains<'a>(
    points: impl Iterator<Item = &'a ScanPoint>,
    guess: &Guess,
    sds: f64,
    z: f64,
) -> bool {
    let limit = sds * sds;
    let (mut chi_sq, mut count) = (0.0, 0_usize);
    for point in points {
        let squared = guess.normalised_sq(point);
        if squared > limit {
            return false;
        }
        // NaN goes on into the sum, which then passes no test.
        chi_sq += squared;
        count += 1;
    }
    chi_sq <= chi_square_quantile(count.saturating_sub(2), z)
}

/// Quantile of the chi-square distribution (Wilson and Hilferty, 1931): within 2 % from three
/// degrees of freedom on.
fn chi_square_quantile(dof: usize, z: f64) -> f64 {
    let k = dof.max(1) as f64;
    let h = 2.0 / (9.0 * k);
    k * (1.0 - h + z * h.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_close_to_the_published_ones() {
        for (dof, published) in [(3, 16.266), (4, 18.467), (10, 29.588), (30, 59.703)] {
            let q = chi_square_quantile(dof, 3.0902);
            assert!((q / published - 1.0).abs() < 0.02, "{dof}: {q}");
        }
    }
}
