//! How sure the map is that a wall is there, and walls that fade.

use mapfold_map::geometry::Point;
use mapfold_map::level::{Contribution, Level, LevelConfig};
use mapfold_map::raster::SensorClass;

use crate::walls::{EXACT, area, folded, look};

/// What a look that sees a wall adds, and one that misses it: ln(0.9 / 0.05), ln(0.1 / 0.95).
const SEEN: f64 = 2.890_371_757_896_165;
const MISSED: f64 = -2.251_291_798_606_495;

/// Looks at a wall along y = 3, four metres long.
fn seen(looks: u64) -> impl Iterator<Item = Contribution> {
    let wall = (Point::new(1.0, 3.0), Point::new(5.0, 3.0));
    (0..looks).map(move |i| look(i, &[wall], Point::new(3.0, 1.0), EXACT))
}

/// Looks that went on behind that wall from x = 1 to `to`.
fn through(looks: u64, to: f64) -> impl Iterator<Item = Contribution> {
    let behind = move |i| area(i, [0.9, to], [3.05, 3.5], -40, SensorClass::Scanner);
    (100..100 + looks).map(behind)
}

/// The log-odds of the only piece, in nats.
fn existence(looks: &[Contribution]) -> Option<f64> {
    let level = folded(looks);
    let pieces: Vec<_> = level.map().segments.values().flat_map(|s| &s.solid).collect();
    assert!(pieces.len() < 2, "{pieces:?}");
    Some(pieces.first()?.existence.nat())
}

#[test]
fn every_look_that_sees_a_wall_adds_the_same() {
    for looks in [1, 2, 7] {
        let sure = existence(&seen(looks).collect::<Vec<_>>()).unwrap();
        // Ends are drawn in differently look by look.
        assert!((sure - SEEN * looks as f64).abs() < 0.1 * looks as f64, "{looks}: {sure}");
    }
}

#[test]
fn looks_through_a_wall_count_against_it_along_the_part_that_they_cross() {
    let all: Vec<_> = seen(20).chain(through(1, 5.1)).collect();
    let sure = existence(&all).unwrap();
    assert!((sure - (20.0 * SEEN + MISSED)).abs() < 2.0, "{sure}");
    let without = existence(&seen(20).collect::<Vec<_>>()).unwrap();
    assert!((sure - without - MISSED).abs() < 0.02, "{sure} after {without}");
    let half: Vec<_> = seen(20).chain(through(1, 3.0)).collect();
    let sure = existence(&half).unwrap();
    assert!((sure - without - 0.5 * MISSED).abs() < 0.05, "{sure} after {without}");
}

#[test]
fn a_wall_that_is_more_probably_gone_fades_and_comes_back() {
    let (wall, gone) = (seen(1).collect::<Vec<_>>(), through(1, 5.1).collect::<Vec<_>>());
    let mut level = Level::new(LevelConfig::standard(0.05));
    level.fold(&wall);
    let fresh = level.map().segments.clone();
    assert_eq!(fresh.len(), 1);
    level.fold(&gone);
    assert!(level.map().segments.is_empty(), "one look for it, one against it");
    level.fold(&look_again());
    assert_eq!(level.map().segments.len(), 1, "two for it, one against it");
    let mut again = folded(&wall);
    again.fold(&gone);
    again.unfold(&gone);
    assert_eq!(again.map().segments, fresh, "a look that is taken out no longer speaks");
}

fn look_again() -> Vec<Contribution> {
    seen(2).skip(1).collect()
}
