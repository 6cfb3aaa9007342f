//! Lines are found as well as the bare loop finds them, and claim no more than they know: the set-up
//! of `mapfold-evaluate extraction` with fewer scans.

use mapfold_tests::extraction::score::Score;
use mapfold_tests::extraction::verdict::{faults, nees_band};
use mapfold_tests::extraction::{FANS, Set};
use mapfold_tests::simulation::Errors;
use mapfold_tests::statistics::mean;

/// Scans of each scanner: of three some thousand lines of each noise, of which either misses a handful.
const SCANS: usize = 120;

fn hold_for_noise(range_sd_m: f64) {
    let mut all = [Score::default(), Score::default()];
    for fan in FANS {
        let found = Set::plain(fan, range_sd_m, SCANS).scores();
        for (sum, score) in all.iter_mut().zip(found) {
            sum.append(score);
        }
    }
    let [ours, bare] = all;
    assert!(ours.nees.len() > 1000, "{} lines", ours.nees.len());
    assert_eq!(faults("", false, &ours, &bare), [""; 0]);
}

#[test]
fn lines_at_a_noise_of_1_cm_are_found_as_the_bare_loop_does_and_honest() {
    hold_for_noise(0.01);
}

#[test]
fn lines_at_a_noise_of_3_cm_are_found_as_the_bare_loop_does_and_honest() {
    hold_for_noise(0.03);
}

#[test]
fn lines_at_a_noise_of_5_cm_are_found_as_the_bare_loop_does_and_honest() {
    hold_for_noise(0.05);
}

#[test]
fn lines_at_a_noise_of_8_cm_claim_no_more_than_they_know() {
    // As wide as door frames are deep, and far wider than from one point of a near wall to the next.
    let errors = Errors { range_sd_m: 0.08, ..Errors::default() };
    for fan in FANS {
        let mut nees = Vec::new();
        for seed in 0..3 {
            let set = Set::drawn(String::new(), fan, &errors, 0, (SCANS, seed));
            nees.append(&mut set.scores()[0].nees);
        }
        assert!(nees.len() > 1000, "{} lines", nees.len());
        assert!(mean(&nees) <= 2.0 + nees_band(&nees), "{} beams: {}", fan.beams, mean(&nees));
        // No line runs along the beams, from nowhere to nowhere.
        let worst = nees.iter().copied().fold(0.0, f64::max);
        assert!(worst < 100.0, "{} beams: {worst}", fan.beams);
    }
}

#[test]
fn among_clutter_veils_and_lost_readings_lines_are_found_as_the_bare_loop_does_and_honest() {
    let set = Set::cluttered(FANS[0], 0.01, SCANS / 2);
    let [ours, bare] = set.scores();
    assert_eq!(faults("", set.is_cluttered, &ours, &bare), [""; 0]);
}
