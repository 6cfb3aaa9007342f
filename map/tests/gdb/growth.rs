//! What a plan costs grows with the model, not with its square.

use mapfold_map::gdb::{LandmarkConfig, Model, Object, PlanWork, Structure, landmarks};
use mapfold_map::landmarks::LandmarkKind;

use super::world::{doorway, model, wall};

/// A floor of `side` x `side` rooms of 4 m: walls of 10 cm with a doorway to the right-hand neighbour of each.
fn floor(side: u32) -> Model {
    let mut objects: Vec<Object> = Vec::new();
    for (x, y) in (0..side).flat_map(|x| (0..side).map(move |y| (x, y))) {
        let (x, y) = (f64::from(x) * 4.0, f64::from(y) * 4.0);
        objects.push(wall([x, y], [x + 4.1, y + 0.1]));
        objects.push(wall([x, y], [x + 0.1, y + 4.1]));
        objects.push(doorway([x - 0.1, y + 1.5], [x + 0.2, y + 2.5]));
    }
    model(objects)
}

fn work(side: u32) -> PlanWork {
    Structure::of(&floor(side)).plan(0.5).work()
}

#[test]
fn four_times_the_walls_take_four_times_the_work() {
    let (small, large) = (work(25), work(50));
    assert_eq!(large.edges, 4 * small.edges);
    let within = |large: u64, small: u64| large as f64 / small as f64;
    assert!(within(large.pairs, small.pairs) < 4.4, "{small:?} {large:?}");
    assert!(within(large.parts, small.parts) < 4.4, "{small:?} {large:?}");
    // Locally there is little to look at, too.
    assert!(large.pairs < 30 * large.edges, "{large:?}");
}

/// Twenty thousand walls and ten thousand doorways.
#[test]
fn a_plan_of_twenty_thousand_walls_has_every_doorway_and_corner() {
    let plan = Structure::of(&floor(100)).plan(0.5);
    assert_eq!(plan.openings().len(), 10_000);
    assert!(plan.openings().iter().all(|opening| opening.sides.len() == 2));
    let found = landmarks(&plan, &LandmarkConfig::STANDARD);
    let count = |kind| found.iter().filter(|l| l.id.kind == kind).count();
    assert_eq!(count(LandmarkKind::Doorway), 10_000);
    // Each room has four corners, but for those at the far edges, where the outer walls are missing: a room there has
    // two, and the last one, one.
    let corners = 4 * 99 * 99 + 2 * 2 * 99 + 1;
    // Outside, walls go on beyond the last crossing: each is a free end, and makes a corner on either side of it.
    assert_eq!(count(LandmarkKind::ConcaveCorner), corners, "concave");
}
