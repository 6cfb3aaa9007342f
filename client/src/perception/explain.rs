//! Whether a line explains points.

use std::ops::Range;

use mapfold_map::geometry::chi_square_quantile;

use super::cloud::Cloud;
use super::guess::Guess;
use super::tally::{Frame, Held, Tally};

/// The guess, or a better one of the same points, that explains them: those of a stretch but for its
/// strays, of which there are so many; and if there are none, what was summed about it. It lies within so many
/// deviations of each of them, and within what chance allows of all together.
pub(super) fn explaining(
    cloud: &Cloud,
    stretch: &Range<usize>,
    (stray, strays): (&[bool], usize),
    guess: &Guess,
    sds: f64,
    z: f64,
) -> Option<(Guess, Option<Held>)> {
    let most = chi_square_quantile((stretch.len() - strays).saturating_sub(2), z);
    // No line is nearer to its points, by the weights that they have at most.
    if guess.off() > most * cloud.turned_max() {
        return None;
    }
    // NaN passes no test.
    let explains = |tally: &Tally| tally.worst <= sds * sds && tally.ee <= most;
    let tally = |frame: &Frame| match strays {
        0 => frame.tally_of(&cloud.columns, stretch),
        _ => frame.tally(cloud.without(stretch, stray)),
    };
    let held = |frame: Frame, tally: Tally| {
        (strays == 0).then(|| Held { frame, points: stretch.clone(), tally })
    };
    let frame = guess.frame();
    let first = tally(&frame);
    if explains(&first) {
        return Some((*guess, held(frame, first)));
    }
    let refined = guess.refined(&first)?;
    let frame = refined.frame();
    let second = tally(&frame);
    explains(&second).then(|| (refined, held(frame, second)))
}
