//! Whether extraction finds as much as the bare loop, errs no more, and claims no more than it knows.

use super::score::Score;
use crate::statistics::{mean, quantile};

/// The 95th percentile of a thousand errors is known to some five percent, twice that is no
/// difference.
const P95_SLACK: f64 = 1.1;
/// Least share of ends within two of their standard deviations.
const ENDS_MIN: f64 = 0.88;

/// What is not as it must be.
pub fn faults(data: &str, is_cluttered: bool, ours: &Score, bare: &Score) -> Vec<String> {
    let mut faults = Vec::new();
    let mut hold = |holds: bool, what: String| {
        if !holds {
            faults.push(format!("{data}: {what}"));
        }
    };
    let missed = |score: &Score| score.visible - score.recalled;
    hold(
        is_no_more(missed(ours), missed(bare)),
        format!("{} walls missed, by the bare loop {}", missed(ours), missed(bare)),
    );
    hold(
        is_no_more(ours.false_lines, bare.false_lines),
        format!("{} false lines, of the bare loop {}", ours.false_lines, bare.false_lines),
    );
    let p95 = |angles: &[f64]| quantile(angles, 0.95).to_degrees();
    let (own, other) = ours.angles_on_same_walls(bare);
    hold(
        p95(&own) <= P95_SLACK * p95(&other),
        format!(
            "angles of the same walls err by {}, the bare loop's by {}",
            p95(&own),
            p95(&other)
        ),
    );
    // Among clutter the bare loop does not find the walls of which little is seen, whose angles are
    // the worst.
    hold(
        is_cluttered || p95(&ours.angles) <= P95_SLACK * p95(&bare.angles),
        format!("angles err by {}, the bare loop's by {}", p95(&ours.angles), p95(&bare.angles)),
    );
    let nees = mean(&ours.nees);
    hold(nees <= 2.0 + nees_band(&ours.nees), format!("lines are surer than they may be: {nees}"));
    for (kind, ends) in [("corners", &ours.corners), ("jumps", &ours.jumps)] {
        let within = within_two_sd(ends);
        hold(within > ENDS_MIN, format!("{kind} are surer than they may be: {within}"));
    }
    faults
}

/// Whether one count is no more than another but for chance: two standard deviations of a count of
/// rare things, which is the root of what is to be expected.
fn is_no_more(count: usize, than: usize) -> bool {
    count as f64 <= than as f64 + 2.0 * (than as f64 + 1.0).sqrt()
}

/// Half the width of the 95 % band of a mean of as many chi-square variables of two degrees of
/// freedom.
pub fn nees_band(nees: &[f64]) -> f64 {
    1.96 * 2.0 / (nees.len() as f64).sqrt()
}

/// Share of the errors, in standard deviations, that are less than two.
pub fn within_two_sd(errors: &[f64]) -> f64 {
    errors.iter().filter(|x| **x < 2.0).count() as f64 / errors.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whoever_misses_errs_or_boasts_more_is_told_so() {
        let fair = Score {
            visible: 1000,
            recalled: 990,
            nees: vec![2.0; 1000],
            angles: vec![0.01; 1000],
            walls: (0..1000).map(|i| ((i, 0), 0.01)).collect(),
            corners: vec![1.0; 10],
            jumps: vec![1.0; 10],
            ..Score::default()
        };
        assert_eq!(faults("", false, &fair, &fair), [""; 0]);
        let worse = [
            Score { recalled: 980, ..fair.clone() },
            Score { false_lines: 3, ..fair.clone() },
            Score { angles: vec![0.012; 1000], ..fair.clone() },
            Score { walls: (0..1000).map(|i| ((i, 0), 0.012)).collect(), ..fair.clone() },
            Score { nees: vec![2.2; 1000], ..fair.clone() },
            Score { jumps: vec![2.5; 10], ..fair.clone() },
        ];
        for score in worse {
            assert_eq!(faults("", false, &score, &fair).len(), 1, "{score:?}");
        }
    }
}
