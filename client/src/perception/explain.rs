//! Whether a line explains points.

use std::ops::Range;

use mapfold_map::geometry::chi_square_quantile;

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
