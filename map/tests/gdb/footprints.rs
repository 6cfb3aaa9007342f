//! Footprints with their heights.

use mapfold_map::gdb::{
    Cylinder, Footprint, Kind, Model, Object, Placement, Point3, Shape, Solid, Structure,
    footprints,
};
use mapfold_map::geometry::Point;
use nalgebra::UnitQuaternion;

use super::world::{corners, cube, id, island, model, room};

fn of(model: &Model) -> Vec<Footprint> {
    footprints(&Structure::of(model))
}

#[test]
fn solids_of_an_object_keep_their_own_heights() {
    let solids = vec![
        Solid::cuboid([0.0, 0.0, 0.7], [1.6, 0.8, 0.75]),
        Solid::cuboid([0.0, 0.0, 0.0], [0.05, 0.05, 0.7]),
    ];
    let footprints = of(&model([Object::of(Kind::Furniture, solids)]));
    let heights: Vec<_> =
        footprints.iter().map(|f| (f.object, f.solid, f.lower, f.upper)).collect();
    assert_eq!(heights, [(id(0), 0, 0.7, 0.75), (id(0), 1, 0.0, 0.7)]);
    assert_eq!(corners(&footprints[0].outlines[0]), island([0.0, 0.0], [1.6, 0.8]));
}

#[test]
fn a_hole_stays_a_hole() {
    let ring = |from: f64, to: f64| {
        vec![Point::new(from, from), Point::new(to, from), Point::new(to, to), Point::new(from, to)]
    };
    let base = mapfold_map::gdb::Polygon { outer: ring(0.0, 3.0), holes: vec![ring(1.0, 2.0)] };
    let prism = Solid::Prism { base, lower: 0.0, upper: 1.0 };
    let footprints = of(&model([Object::of(Kind::Machine, vec![prism])]));
    let outlines: Vec<_> = footprints[0].outlines.iter().map(corners).collect();
    assert_eq!(outlines, [island([0.0, 0.0], [3.0, 3.0]), room([1.0, 1.0], [2.0, 2.0])]);
}

/// A cube on one of its corners has a regular hexagon for a shadow, of area sqrt(3).
#[test]
fn a_cube_on_its_corner_casts_a_hexagon() {
    let up = Point3::new(1.0, 1.0, 1.0);
    let rotation = UnitQuaternion::rotation_between(&up, &Point3::z()).unwrap();
    let object = Object {
        placement: Placement { position: Point3::new(5.0, 5.0, 0.0), rotation },
        shape: Shape::Own(vec![Solid::Polyhedron(cube([0.0; 3], [1.0; 3]))]),
        ..Object::of(Kind::Other, Vec::new())
    };
    let footprints = of(&model([object]));
    let [outline] = footprints[0].outlines.as_slice() else { panic!("{footprints:?}") };
    assert_eq!(outline.vertices().count(), 6);
    assert!((outline.area() + 3.0_f64.sqrt()).abs() < 1e-5);
    assert!((footprints[0].upper - 3.0_f64.sqrt()).abs() < 1e-6);
}

/// An inscribed polygon of n sides has the area n r^2 sin(2 pi / n) / 2.
#[test]
fn a_cylinder_is_the_polygon_that_its_chord_error_asks_for() {
    let cylinder = Cylinder {
        centre: Point::new(1.0, 2.0),
        radius: 0.4,
        lower: 0.0,
        upper: 1.0,
        chord_error: 0.002,
    };
    let footprints = of(&model([Object::of(Kind::Machine, vec![Solid::Cylinder(cylinder)])]));
    let sides = cylinder.sides();
    assert_eq!(footprints[0].outlines[0].vertices().count(), sides);
    let want = sides as f64 * 0.16 * (std::f64::consts::TAU / sides as f64).sin() / 2.0;
    assert!((footprints[0].outlines[0].area() + want).abs() < 1e-5);
}
