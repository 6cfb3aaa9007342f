//! What a level's map says against a plan of its model, on maps that are painted by hand.

#![expect(clippy::unwrap_used, reason = "a test that cannot go on fails")]

mod world;

use std::f64::consts::FRAC_PI_2;

use mapfold_map::changes::{Change, ChangeConfig, ChangeId, What, changes};
use mapfold_map::gdb::{Kind, Object, Structure};
use mapfold_map::geometry::Point;
use mapfold_map::level::LevelMap;

use world::{Thing, door, id, model, painted, room, solid};

/// What is told of a model, cut at 30 cm, by a map of what is there.
fn told(objects: Vec<Object>, map: &LevelMap) -> Vec<Change> {
    let plan = Structure::of(&model(objects)).plan(0.3);
    changes(&plan, map, &ChangeConfig::standard(0.05)).unwrap().into_values().collect()
}

/// The walls of a room, and one more object with number 4.
fn with(object: Object) -> Vec<Object> {
    let mut objects = room();
    objects.push(object);
    objects
}

/// A partition of 10 cm across the room, from one place to another.
fn wall(from: f64, to: f64) -> Thing {
    let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
    Thing { middle: Point::new(middle, 3.0), half: Point::new(half, 0.05), turn: 0.0 }
}

fn box_at(x: f64, y: f64, turn: f64) -> Thing {
    Thing { middle: Point::new(x, y), half: Point::new(0.5, 0.3), turn }
}

#[test]
fn what_has_no_end_of_surface_is_not_probed() {
    let far = |number: i32| Thing {
        middle: Point::new(0.0, 10.0 * f64::from(number)),
        half: Point::new(9000.0, 0.05),
        turn: 0.0,
    };
    let plan = |walls: i32| {
        let walls = (0..walls).map(|number| solid(Kind::Wall, &far(number)));
        Structure::of(&model(walls.collect())).plan(0.3)
    };
    let config = ChangeConfig::standard(0.05);
    assert!(changes(&plan(2), &LevelMap::default(), &config).is_ok());
    let refused = changes(&plan(30), &LevelMap::default(), &config).unwrap_err();
    assert!((refused.surface - 30.0 * 36_000.2).abs() < 1.0, "{refused}");
}

#[test]
fn of_what_nobody_has_looked_at_nothing_is_told() {
    assert_eq!(told(with(solid(Kind::Machine, &box_at(4.0, 3.0, 0.0))), &LevelMap::default()), []);
}

#[test]
fn what_stands_where_it_should_is_no_change() {
    let machine = box_at(4.0, 3.0, 0.3);
    assert_eq!(told(with(solid(Kind::Machine, &machine)), &painted(&[machine], 5)), []);
    // Nor is what stands off by a tolerance or two: 3 cm each if nobody says better.
    let off = box_at(4.04, 2.96, 0.3);
    assert_eq!(told(with(solid(Kind::Machine, &machine)), &painted(&[off], 5)), []);
}

#[test]
fn what_is_looked_through_is_missing() {
    let machine = box_at(4.0, 3.0, 0.3);
    let told = told(with(solid(Kind::Machine, &machine)), &painted(&[], 5));
    let [change] = told.as_slice() else { panic!("{told:?}") };
    assert_eq!((change.id, &change.what), (ChangeId::Missing(id(4)), &What::Missing));
    assert!((change.probed - 3.2).abs() < 0.1 && change.through >= change.probed, "{change:?}");
    assert_eq!(change.hull.len(), 4);
}

#[test]
fn what_the_model_does_not_know_is_new() {
    let told = told(room(), &painted(&[box_at(4.0, 3.0, 0.3)], 5));
    let [change] = told.as_slice() else { panic!("{told:?}") };
    assert!(matches!(change.id, ChangeId::New(_)) && change.what == What::New);
    assert_eq!((change.features.len(), change.looks), (4, 5));
    assert_eq!(change.robots, ["ada".into()]);
}

#[test]
fn what_few_looks_show_is_not_told() {
    assert_eq!(told(room(), &painted(&[box_at(4.0, 3.0, 0.3)], 1)), []);
}

/// Where a motion takes the middle and the direction of the model's box.
fn moved(objects: Vec<Object>, map: &LevelMap, from: &Thing) -> (Point, f64) {
    let told = told(objects, map);
    let [change] = told.as_slice() else { panic!("{told:?}") };
    assert_eq!(change.id, ChangeId::Moved(id(4)));
    let What::Moved { motion, .. } = &change.what else { panic!("{change:?}") };
    (motion.act(&from.middle), from.turn + motion.heading())
}

#[test]
fn what_stands_a_little_aside_has_moved() {
    let machine = box_at(4.0, 3.0, 0.0);
    for (x, y, turn) in [(4.2, 3.0, 0.0), (4.0, 2.8, 0.0), (4.15, 3.2, 0.1)] {
        let there = box_at(x, y, turn);
        let map = painted(&[there], 5);
        let (middle, heading) = moved(with(solid(Kind::Machine, &machine)), &map, &machine);
        assert!((middle - there.middle).norm() < 0.01, "{middle} for {}", there.middle);
        assert!((heading - turn).abs() < 0.01, "{heading} for {turn}");
    }
}

#[test]
fn what_is_found_elsewhere_has_moved() {
    let machine = box_at(2.0, 2.0, 0.0);
    for (x, y, turn) in [(6.0, 4.0, 0.0), (5.0, 2.0, 0.7), (6.5, 3.0, FRAC_PI_2 - 0.2)] {
        let there = box_at(x, y, turn);
        let map = painted(&[there], 5);
        let (middle, heading) = moved(with(solid(Kind::Machine, &machine)), &map, &machine);
        assert!((middle - there.middle).norm() < 0.01, "{middle} for {}", there.middle);
        assert!((heading - turn).abs() < 0.01, "{heading} for {turn}");
    }
}

#[test]
fn another_thing_elsewhere_is_not_what_is_missing() {
    let machine = box_at(2.0, 2.0, 0.0);
    let other = Thing { half: Point::new(0.9, 0.7), ..box_at(6.0, 4.0, 0.0) };
    let told = told(with(solid(Kind::Machine, &machine)), &painted(&[other], 5));
    let kinds: Vec<bool> = told.iter().map(|c| matches!(c.id, ChangeId::New(_))).collect();
    assert_eq!((told[0].id, kinds), (ChangeId::Missing(id(4)), vec![false, true]));
}

#[test]
fn a_wall_that_is_seen_through_in_one_place_is_opened() {
    // A partition of 10 cm from 1 to 6 m, of which 2.5 to 3.5 m are not there.
    let map = painted(&[wall(1.0, 2.5), wall(3.5, 6.0)], 5);
    let told = told(with(solid(Kind::Wall, &wall(1.0, 6.0))), &map);
    let opened = told.iter().find(|change| change.id == ChangeId::Opened(id(4))).unwrap();
    let What::Opened { stretches } = &opened.what else { panic!("{opened:?}") };
    let [stretch] = stretches.as_slice() else { panic!("{stretches:?}") };
    assert!((stretch.depth - 0.1).abs() < 1e-9);
    let (low, high) = (stretch.from.x.min(stretch.to.x), stretch.from.x.max(stretch.to.x));
    assert!((2.5..2.8).contains(&low) && (3.2..=3.5).contains(&high), "{stretch:?}");
    assert!(told.iter().all(|change| !matches!(change.id, ChangeId::Missing(_))));
}

#[test]
fn a_door_is_no_new_thing_whether_open_or_closed() {
    let mut objects = with(solid(Kind::Wall, &wall(0.0, 8.0)));
    objects.push(door(3.0, 3.9, 2.9, 3.1));
    let sides = [wall(0.0, 3.0), wall(3.9, 8.0)];
    let leaf = |middle: Point, turn: f64| Thing { middle, half: Point::new(0.44, 0.02), turn };
    let closed = leaf(Point::new(3.45, 3.0), 0.0);
    let open = leaf(Point::new(3.03, 3.5), FRAC_PI_2);
    for leaf in [closed, open] {
        assert_eq!(told(objects.clone(), &painted(&[sides[0], sides[1], leaf], 5)), []);
    }
}

/// A partition of 10 cm and 5 m that stands freely, or from wall to wall, put somewhere else.
#[test]
fn a_wall_that_was_put_elsewhere_has_moved() {
    for (from, to) in [(1.0, 6.0), (0.0, 8.0)] {
        let meant = wall(from, to);
        for off in [0.2, 0.25, 0.3, 0.4, 0.5, 1.0, 2.0] {
            let there = Thing { middle: meant.middle + Point::new(0.0, off), ..meant };
            let map = painted(&[there], 5);
            let (middle, heading) = moved(with(solid(Kind::Wall, &meant)), &map, &meant);
            assert!((middle - there.middle).norm() < 0.01 && heading.abs() < 0.01, "{middle}");
        }
    }
}

#[test]
fn another_wall_elsewhere_is_not_the_one_that_is_gone() {
    let meant = wall(1.0, 6.0);
    let shorter = Thing { middle: Point::new(3.5, 4.5), half: Point::new(1.5, 0.05), turn: 0.0 };
    let turned = Thing { middle: Point::new(3.5, 3.4), half: Point::new(2.5, 0.05), turn: 0.5 };
    for there in [shorter, turned] {
        let told = told(with(solid(Kind::Wall, &meant)), &painted(&[there], 5));
        let is_moved = |change: &Change| matches!(change.id, ChangeId::Moved(_));
        assert!(!told.iter().any(is_moved), "{told:?}");
        assert!(told.iter().any(|change| matches!(change.id, ChangeId::New(_))), "{told:?}");
        let is_about = |change: &Change| {
            [ChangeId::Missing(id(4)), ChangeId::Opened(id(4))].contains(&change.id)
        };
        assert!(told.iter().any(is_about), "{told:?}");
    }
}

#[test]
fn shelves_along_a_wall_are_not_the_wall_moved_into_the_room() {
    // Before all of the lower wall, which nobody sees any more.
    let shelves = Thing { middle: Point::new(4.0, 0.2), half: Point::new(4.0, 0.2), turn: 0.0 };
    let told = told(room(), &painted(&[shelves], 5));
    assert!(told.iter().all(|change| !matches!(change.id, ChangeId::Moved(_))), "{told:?}");
}
