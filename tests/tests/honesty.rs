//! Maps stay honest although robots localize on the very map that they write.

use mapfold_tests::honesty::{LOOKS, measure, upper_bound};

#[test]
fn claims_hold_after_two_ten_and_fifty_looks() {
    const RUNS: u64 = 150;
    let upper = upper_bound(RUNS);
    for (looks, honesty) in LOOKS.into_iter().zip(measure(RUNS, 1)) {
        println!("{looks} looks: {honesty:?}");
        assert!(honesty.lines > 2 * RUNS, "{looks} looks: {} lines", honesty.lines);
        assert!(honesty.nees < upper, "{looks} looks: {} against {upper}", honesty.nees);
        // A fleet's walls share one error, so that 150 fleets tell a ratio to some six percent.
        for ratio in [honesty.offset_ratio, honesty.angle_ratio] {
            assert!((0.94..1.7).contains(&ratio), "{looks} looks: {ratio}");
        }
        if looks > 2 {
            assert!(honesty.classical_nees > 100.0, "{looks} looks: {}", honesty.classical_nees);
        }
    }
}
