//! Robots are tracked as well as the paper's was, and notice when they are carried away.

use mapfold_tests::localization::{SETTINGS, Sensor, kidnap, run};
use mapfold_tests::statistics::{mean, quantile};

#[test]
fn tracked_robots_are_where_they_say_that_they_are() {
    for setting in SETTINGS.iter().filter(|s| s.in_passing) {
        let outcome = run(setting, 0..8).unwrap();
        println!("{}: {:?}", setting.name, outcome.stops);
        // Of eight runs one may have slipped badly just before a stop.
        let (most, nees) = match setting.sensor {
            Sensor::Infrared => (0.06, 6.0),
            Sensor::Modern => (0.02, 6.0),
            Sensor::Sonar => (0.1, 12.0),
        };
        assert!(quantile(&outcome.stops, 0.8) < most, "{}: {:?}", setting.name, outcome.stops);
        assert!(mean(&outcome.nees) < nees, "{}: {}", setting.name, mean(&outcome.nees));
    }
}

#[test]
fn robots_that_are_carried_away_notice_it_within_three_metres_and_find_themselves() {
    let tracked = SETTINGS.iter().filter(|s| s.in_passing && s.sensor == Sensor::Modern);
    for setting in tracked {
        let outcome = kidnap(setting, 0..8).unwrap();
        assert_eq!((outcome.never_noticed, outcome.never_found, outcome.wrong), (0, 0, 0));
        assert!(quantile(&outcome.noticed, 1.0) <= 3.0, "{outcome:?}");
    }
}
