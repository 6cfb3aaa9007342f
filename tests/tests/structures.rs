//! Places are found among landmarks, and wrong ones are not told.

use mapfold_tests::structures::{Directions, ask};

#[test]
fn places_are_found_in_small_and_in_large_tables() {
    for (count, directions) in [(50, Directions::Any), (5000, Directions::RightAngles)] {
        let outcome = ask(count, directions, (5, 1), 100, &|| 0.0);
        assert!(outcome.right >= 97 && outcome.wrong == 0, "{outcome:?}");
    }
}
