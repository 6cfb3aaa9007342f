//! Lines are found as well as the bare loop finds them, and claim no more than they know: the set-up
//! of `mapfold-evaluate extraction` with fewer scans.

use mapfold_client::perception::Extractor;
use mapfold_tests::extraction::score::Score;
use mapfold_tests::extraction::verdict::faults;
use mapfold_tests::extraction::{FANS, Set, bare_found, found};
use mapfold_tests::yardstick::BareLoop;

/// What extraction and what the bare loop find.
fn scores(set: &Set) -> [Score; 2] {
    let scans = set.scans();
    let mut extractor = Extractor::new(set.config());
    let bare = BareLoop::for_noise(set.profile.range_sd_m);
    let mut lines = Vec::new();
    let ours = set.score(|i| found(extractor.extract(&scans[i])));
    let theirs = set.score(|i| {
        bare.lines(&set.fan, &scans[i].ranges, &mut lines);
        bare_found(&lines)
    });
    [ours, theirs]
}

/// Scans of each scanner; three scanners give more than a thousand lines of each noise.
const SCANS: usize = 60;

fn hold_for_noise(range_sd_m: f64) {
    let mut all = [Score::default(), Score::default()];
    for fan in FANS {
        let found = scores(&Set::plain(fan, range_sd_m, SCANS));
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
fn among_clutter_veils_and_lost_readings_lines_are_found_as_the_bare_loop_does_and_honest() {
    let set = Set::cluttered(FANS[0], 0.01, SCANS / 2);
    let [ours, bare] = scores(&set);
    assert_eq!(faults("", set.is_cluttered, &ours, &bare), [""; 0]);
}
