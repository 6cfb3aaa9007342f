//! Doorways in walls of all kinds.

use mapfold_map::gdb::{Kind, Object, Placement, Point3, Shape, Solid};

use super::world::{block, doorway, id, island, metres, outlines, plan, wall};

#[test]
fn a_doorway_opens_both_faces_of_its_wall_by_its_width() {
    let plan = plan([wall([0.0, 0.0], [6.0, 0.2]), doorway([2.0, -0.5], [3.0, 0.5])], 0.5);
    assert_eq!(outlines(&plan), [island([0.0, 0.0], [2.0, 0.2]), island([3.0, 0.0], [6.0, 0.2])]);
    let [opening] = plan.openings() else { panic!("{:?}", plan.openings()) };
    assert_eq!(opening.doorway, id(1));
    assert!((opening.width() - 1.0).abs() < 1e-12);
    let sides: Vec<_> =
        opening.sides.iter().map(|s| (s.wall, metres(s.from), metres(s.to))).collect();
    assert_eq!(sides, [(id(0), [2.0, 0.2], [3.0, 0.2]), (id(0), [3.0, 0.0], [2.0, 0.0])]);
}

#[test]
fn a_doorway_as_deep_as_its_wall_opens_it_too() {
    let deep = plan([wall([0.0, 0.0], [6.0, 0.2]), doorway([2.0, -0.5], [3.0, 0.5])], 0.5);
    let flush = plan([wall([0.0, 0.0], [6.0, 0.2]), doorway([2.0, 0.0], [3.0, 0.2])], 0.5);
    assert_eq!(flush.openings(), deep.openings());
    assert_eq!(outlines(&flush), outlines(&deep));
}

/// Walls back to back: the inner faces vanish, and the opening has the two outer ones.
#[test]
fn a_doorway_through_two_walls_is_one_opening() {
    let walls = [wall([0.0, 0.0], [6.0, 0.2]), wall([0.0, 0.2], [6.0, 0.3])];
    let plan = plan(walls.into_iter().chain([doorway([2.0, -0.5], [3.0, 0.5])]), 0.5);
    let [opening] = plan.openings() else { panic!("{:?}", plan.openings()) };
    let walls: Vec<_> = opening.sides.iter().map(|s| (s.wall, metres(s.from)[1])).collect();
    assert_eq!(walls, [(id(0), 0.0), (id(1), 0.3)]);
}

#[test]
fn what_stands_in_a_doorway_is_not_taken_out() {
    let things = [
        wall([0.0, 0.0], [6.0, 0.2]),
        doorway([2.0, -0.5], [3.0, 0.5]),
        block(Kind::Furniture, [2.4, 0.05], [2.6, 0.15], [0.0, 1.0]),
    ];
    let plan = plan(things, 0.5);
    assert!(outlines(&plan).contains(&island([2.4, 0.05], [2.6, 0.15])));
    assert_eq!(plan.openings()[0].sides.len(), 2);
}

#[test]
fn neighbouring_doorways_stay_two() {
    let objects = [
        wall([0.0, 0.0], [6.0, 0.2]),
        doorway([3.0, 0.0], [4.0, 0.2]),
        doorway([2.0, 0.0], [3.0, 0.2]),
    ];
    let plan = plan(objects, 0.5);
    let ids: Vec<_> =
        plan.openings().iter().map(|o| (o.doorway, o.sides.len(), o.width())).collect();
    assert_eq!(ids, [(id(1), 2, 1.0), (id(2), 2, 1.0)]);
    assert_eq!(outlines(&plan).len(), 2);
}

#[test]
fn a_doorway_in_a_slanting_wall_is_as_wide_as_it_was_drawn() {
    let slanting = |kind, from: [f64; 3], to: [f64; 3]| Object {
        placement: Placement::upright(Point3::new(3.0, 4.0, 0.0), 0.7),
        shape: Shape::Own(vec![Solid::cuboid(from, to)]),
        ..Object::of(kind, Vec::new())
    };
    let objects = [
        slanting(Kind::Wall, [0.0, 0.0, 0.0], [6.0, 0.2, 3.0]),
        slanting(Kind::Doorway, [2.0, -0.1, 0.0], [2.9, 0.3, 2.1]),
    ];
    let plan = plan(objects, 0.5);
    let [opening] = plan.openings() else { panic!("{:?}", plan.openings()) };
    assert_eq!(opening.sides.len(), 2);
    assert!((opening.width() - 0.9).abs() < 3e-6);
    // Snapping left no vertex in what is straight.
    assert_eq!(plan.outlines().iter().map(|o| o.vertices().count()).collect::<Vec<_>>(), [4, 4]);
}
