//! Landmarks of floors drawn by hand: all of them, and no other.

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use mapfold_map::gdb::{
    Kind, LandmarkConfig, Object, Placement, Plan, PlannedLandmark, Point3, Polygon, Shape, Solid,
    landmarks,
};
use mapfold_map::geometry::wrap;

use super::world::{block, doorway, id, metres, plan, wall};
use LandmarkKind::{ConcaveCorner, ConvexCorner, Doorway, WallEnd};
use mapfold_map::landmarks::LandmarkKind;

fn of(plan: &Plan) -> Vec<PlannedLandmark> {
    landmarks(plan, &LandmarkConfig::STANDARD)
}

/// Kind, place and heading in degrees.
fn seen(plan: &Plan) -> Vec<(LandmarkKind, [f64; 2], i32)> {
    let mut seen: Vec<_> = of(plan)
        .iter()
        .map(|l| (l.id.kind, metres(l.id.at), l.landmark.direction.to_degrees().round() as i32))
        .collect();
    seen.sort_by(|a, b| a.partial_cmp(b).unwrap());
    seen
}

/// Two rooms side by side with a doorway between them; the partition stands flush on the north wall, has a joint in
/// its middle, and in the right-hand room a spur of wall ends free. A cupboard stands against the east wall.
fn two_rooms() -> Vec<Object> {
    vec![
        wall([0.0, 0.0], [10.0, 0.2]),
        // The north wall is made of two in one line: no landmark at the joint.
        wall([0.0, 5.8], [4.0, 6.0]),
        wall([4.0, 5.8], [10.0, 6.0]),
        wall([0.0, 0.2], [0.2, 5.8]),
        wall([9.8, 0.2], [10.0, 5.8]),
        // The partition, in two pieces one upon the other.
        wall([5.0, 0.2], [5.1, 3.0]),
        wall([5.0, 3.0], [5.1, 5.8]),
        doorway([4.9, 1.0], [5.2, 2.0]),
        // The spur.
        wall([7.0, 4.0], [7.1, 5.8]),
        block(Kind::Furniture, [9.3, 2.0], [9.8, 3.0], [0.0, 2.0]),
        // A table leg is too small for corners.
        block(Kind::Furniture, [2.0, 2.0], [2.05, 2.05], [0.0, 0.7]),
    ]
}

#[test]
fn every_corner_end_and_doorway_is_found_and_none_invented() {
    let mut want = vec![
        // The building from outside.
        (ConvexCorner, [0.0, 0.0], -135),
        (ConvexCorner, [10.0, 0.0], -45),
        (ConvexCorner, [10.0, 6.0], 45),
        (ConvexCorner, [0.0, 6.0], 135),
        // The left-hand room.
        (ConcaveCorner, [0.2, 0.2], 45),
        (ConcaveCorner, [5.0, 0.2], 135),
        (ConcaveCorner, [5.0, 5.8], -135),
        (ConcaveCorner, [0.2, 5.8], -45),
        // The right-hand one, with the spur and the cupboard.
        (ConcaveCorner, [5.1, 0.2], 45),
        (ConcaveCorner, [9.8, 0.2], 135),
        (ConcaveCorner, [9.8, 2.0], -135),
        (ConvexCorner, [9.3, 2.0], -135),
        (ConvexCorner, [9.3, 3.0], 135),
        (ConcaveCorner, [9.8, 3.0], 135),
        (ConcaveCorner, [9.8, 5.8], -135),
        (ConcaveCorner, [7.1, 5.8], -45),
        (ConcaveCorner, [7.0, 5.8], -135),
        (ConcaveCorner, [5.1, 5.8], -45),
        (WallEnd, [7.05, 4.0], -90),
        (Doorway, [5.05, 1.5], 0),
    ];
    want.sort_by(|a, b| a.partial_cmp(b).unwrap());
    assert_eq!(seen(&plan(two_rooms(), 0.5)), want);
}

#[test]
fn a_doorway_knows_its_width_and_its_wall() {
    let found = of(&plan(two_rooms(), 0.5));
    let doorway = found.iter().find(|l| l.id.kind == Doorway).unwrap();
    assert_eq!(doorway.id.objects, [id(5), id(7)]);
    assert!((doorway.extent - 1.0).abs() < 1e-12);
}

/// Above the lintel it is gone, and everything else keeps its name.
#[test]
fn plans_of_different_heights_agree_on_names() {
    let ids = |height: f64| of(&plan(two_rooms(), height)).iter().map(|l| l.id).collect::<Vec<_>>();
    let (low, high) = (ids(0.5), ids(2.5));
    let cupboard = |l: &mapfold_map::gdb::LandmarkId| l.objects.contains(&id(9));
    let stays: Vec<_> = low.iter().copied().filter(|l| l.kind != Doorway && !cupboard(l)).collect();
    assert_eq!(high, stays);
}

#[test]
fn news_elsewhere_rename_nothing() {
    let before = of(&plan(two_rooms(), 0.5));
    let mut more = two_rooms();
    more.push(wall([20.0, 0.0], [24.0, 0.2]));
    let after = of(&plan(more, 0.5));
    assert!(before.iter().all(|landmark| after.contains(landmark)));
    assert_eq!(after.len(), before.len() + 2);
}

#[test]
fn landmarks_turn_with_the_building() {
    let turned = |yaw: f64| -> Vec<Object> {
        two_rooms()
            .into_iter()
            .map(|object| Object {
                placement: Placement::upright(Point3::new(3.0, -2.0, 0.0), yaw),
                ..object
            })
            .collect()
    };
    let yaw = 0.6;
    let (s, c) = f64::sin_cos(yaw);
    let straight = of(&plan(turned(0.0), 0.5));
    let slanting = of(&plan(turned(yaw), 0.5));
    assert_eq!(straight.len(), slanting.len());
    for landmark in straight {
        let d = landmark.landmark.at - mapfold_map::geometry::Point::new(3.0, -2.0);
        let at =
            mapfold_map::geometry::Point::new(3.0 + c * d.x - s * d.y, -2.0 + s * d.x + c * d.y);
        let twin = slanting.iter().find(|l| (l.landmark.at - at).norm() < 5e-6).unwrap();
        assert_eq!(twin.id.kind, landmark.id.kind);
        assert_eq!(twin.id.objects, landmark.id.objects);
        let turn = wrap(twin.landmark.direction - landmark.landmark.direction - yaw).abs();
        let turn = if landmark.id.kind == Doorway { turn.min(PI - turn) } else { turn };
        assert!(turn < 1e-4, "{landmark:?} {twin:?}");
        let rotation = nalgebra::Matrix2::new(c, -s, s, c);
        let difference = landmark.landmark.covariance.transformed(&rotation).matrix()
            - twin.landmark.covariance.matrix();
        assert!(difference.amax() < 1e-7, "{difference}");
        let sds = [&landmark, twin].map(|l| l.landmark.direction_sd);
        assert!((sds[0] - sds[1]).abs() < 1e-6, "{sds:?}");
    }
}

/// Two faces of one object move together: the corner is as uncertain as the object. Of two walls, each moves the
/// corner along the other: at 45 degrees, twice the variance across.
#[test]
fn a_corner_is_as_uncertain_as_what_makes_it() {
    let exact = |object: Object, sd: f64| Object { tolerance: sd, ..object };
    let cupboard = [exact(block(Kind::Furniture, [0.0, 0.0], [1.0, 0.5], [0.0, 1.0]), 0.05)];
    for landmark in of(&plan(cupboard, 0.5)) {
        let m = *landmark.landmark.covariance.matrix();
        assert!((m[(0, 0)] - 0.0025).abs() < 1e-12 && (m[(1, 1)] - 0.0025).abs() < 1e-12);
        assert!(m[(0, 1)].abs() < 1e-12);
    }
    let walls = [
        exact(wall([-5.0, -0.2], [5.0, 0.0]), 0.02),
        exact(
            Object {
                placement: Placement::upright(Point3::zeros(), FRAC_PI_4),
                shape: Shape::Own(vec![Solid::cuboid([-0.1, -0.2, 0.0], [3.0, 0.0, 3.0])]),
                ..wall([0.0; 2], [1.0; 2])
            },
            0.04,
        ),
    ];
    let found = of(&plan(walls, 0.5));
    let corner =
        found.iter().find(|l| l.id.kind == ConcaveCorner && l.landmark.at.norm() < 1e-5).unwrap();
    let m = *corner.landmark.covariance.matrix();
    // y from the first wall, and x = y - sqrt(2) d of the second.
    assert!((m[(1, 1)] - 4e-4).abs() < 1e-8);
    assert!((m[(0, 1)] - 4e-4).abs() < 1e-8);
    assert!((m[(0, 0)] - (4e-4 + 2.0 * 16e-4)).abs() < 1e-8);
    assert!((corner.extent - 3.0 * FRAC_PI_4).abs() < 1e-5);
    assert!((wrap(corner.landmark.direction) - (PI - 3.0 * FRAC_PI_4 / 2.0)).abs() < 1e-4);
}

#[test]
fn a_sheet_has_corners_on_both_sides_and_ends() {
    let vertices = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]];
    let polyhedron = mapfold_map::gdb::Polyhedron {
        vertices: vertices
            .iter()
            .flat_map(|[x, y]| [0.0, 2.0].map(|z| Point3::new(*x, *y, z)))
            .collect(),
        faces: (0..2)
            .map(|k| mapfold_map::gdb::Face::simple([2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1]))
            .collect(),
    };
    let plan = plan([Object::of(Kind::Wall, vec![Solid::Polyhedron(polyhedron)])], 0.5);
    let want = [
        (ConvexCorner, [2.0, 0.0], -45),
        (ConcaveCorner, [2.0, 0.0], 135),
        (WallEnd, [0.0, 0.0], 180),
        (WallEnd, [2.0, 2.0], 90),
    ];
    assert_eq!(seen(&plan), want);
}

#[test]
fn round_things_have_no_corners() {
    let cylinder = mapfold_map::gdb::Cylinder {
        centre: [0.0, 0.0].into(),
        radius: 3.0,
        lower: 0.0,
        upper: 1.0,
        chord_error: 0.03,
    };
    let plan = plan([Object::of(Kind::Machine, vec![Solid::Cylinder(cylinder)])], 0.5);
    assert_eq!(seen(&plan), []);
    assert!(plan.outlines()[0].vertices().count() as f64 > PI / FRAC_PI_2);
}

/// What is cut off a corner, and steps of millimetres at the end of a wall, are details of what a robot sees; more is not.
#[test]
fn a_corner_that_lacks_a_little_is_a_corner_and_an_end_with_steps_an_end() {
    let thing = |ring: &[[f64; 2]]| Object {
        shape: Shape::Own(vec![Solid::Prism {
            base: Polygon::simple(ring.iter().copied()),
            lower: 0.0,
            upper: 1.0,
        }]),
        ..block(Kind::Furniture, [0.0; 2], [1.0; 2], [0.0, 1.0])
    };
    let bevelled =
        |cut: f64| thing(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0 - cut], [2.0 - cut, 1.0], [0.0, 1.0]]);
    let corners = |object: Object| -> Vec<[f64; 2]> {
        let found = of(&plan([object], 0.5));
        assert!(found.iter().all(|l| l.id.kind == ConvexCorner));
        found.iter().map(|l| [l.landmark.at.x, l.landmark.at.y]).collect()
    };
    let square = corners(thing(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]]));
    assert_eq!(square.len(), 4);
    assert_eq!(corners(bevelled(0.03)), square);
    assert_eq!(corners(bevelled(0.1)).len(), 3, "a bevel of 14 cm is neither corner nor wall");
    let stepped = [[0.0, 0.0], [2.0, 0.0], [2.0, 0.05], [2.02, 0.05], [2.02, 0.1], [0.0, 0.1]];
    let found = of(&plan([thing(&stepped)], 0.5));
    let end = found.iter().find(|l| l.id.kind == WallEnd && l.landmark.at.x > 1.0).unwrap();
    assert!((end.landmark.at.x - 2.01).abs() < 1e-6 && end.landmark.direction.abs() < 1e-6);
}
