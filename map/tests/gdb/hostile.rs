//! Whatever is drawn, nothing panics, and what passes for sound is cut.

use mapfold_map::gdb::{
    Cylinder, Face, Kind, LandmarkConfig, Object, Placement, Point3, Polygon, Polyhedron,
    PriorConfig, Solid, Structure, TooCrowded, findings, footprints, landmarks, prior,
};
use mapfold_map::geometry::Point;
use nalgebra::UnitQuaternion;
use proptest::prelude::*;

use super::world::model;

/// Mostly a coarse grid, on which nearly everything is degenerate; now and then what is no coordinate.
fn length() -> impl Strategy<Value = f64> {
    prop_oneof![
        30 => (-3..4_i8).prop_map(|v| f64::from(v) / 2.0),
        3 => -2.0..2.0_f64,
        1 => prop::sample::select(vec![f64::NAN, f64::INFINITY, -1e300, 1e4, -1e4, 1e-7, -0.0]),
    ]
}

fn point() -> impl Strategy<Value = Point3> {
    prop::array::uniform3(length()).prop_map(Point3::from)
}

fn ring() -> impl Strategy<Value = Vec<Point>> {
    prop::collection::vec((length(), length()).prop_map(|(x, y)| Point::new(x, y)), 0..6)
}

fn solid() -> impl Strategy<Value = Solid> {
    let face = (
        prop::collection::vec(0..6_u32, 0..5),
        prop::collection::vec(prop::collection::vec(0..6_u32, 0..4), 0..2),
    )
        .prop_map(|(outer, holes)| Face { outer, holes });
    let polyhedron = (prop::collection::vec(point(), 0..7), prop::collection::vec(face, 0..6))
        .prop_map(|(vertices, faces)| Solid::Polyhedron(Polyhedron { vertices, faces }));
    let prism = (ring(), prop::collection::vec(ring(), 0..2), length(), length()).prop_map(
        |(outer, holes, lower, upper)| Solid::Prism {
            base: Polygon { outer, holes },
            lower,
            upper,
        },
    );
    let cylinder = prop::array::uniform6(length()).prop_map(|v| {
        Solid::Cylinder(Cylinder {
            centre: Point::new(v[0], v[1]),
            radius: v[2],
            lower: v[3],
            upper: v[4],
            chord_error: v[5],
        })
    });
    let cuboid = (point(), point()).prop_map(|(from, to)| Solid::Box { from, to });
    prop_oneof![3 => polyhedron, 3 => prism, 1 => cylinder, 3 => cuboid]
}

fn object() -> impl Strategy<Value = Object> {
    let kind = prop::sample::select(Kind::ALL.to_vec());
    let solids = prop::collection::vec(solid(), 0..4);
    (kind, solids, point(), prop::array::uniform3(length()), length(), length()).prop_map(
        |(kind, solids, position, turn, tolerance, trust)| Object {
            placement: Placement {
                position,
                rotation: UnitQuaternion::from_euler_angles(turn[0], turn[1], turn[2]),
            },
            tolerance,
            trust,
            ..Object::of(kind, solids)
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1500))]

    #[test]
    fn no_model_makes_anything_panic(objects in prop::collection::vec(object(), 0..6), height in length()) {
        let model = model(objects);
        let found = findings(&model);
        prop_assert!(found.iter().all(|finding| !finding.kind.to_string().is_empty()));
        let structure = Structure::of(&model);
        for footprint in footprints(&structure) {
            prop_assert!(footprint.lower <= footprint.upper);
        }
        let plan = structure.plan(height);
        for landmark in landmarks(&plan, &LandmarkConfig::STANDARD) {
            prop_assert!(landmark.landmark.at.iter().all(|v| v.is_finite()) && landmark.landmark.direction.is_finite());
            prop_assert!(landmark.landmark.covariance.matrix().iter().all(|v| v.is_finite()));
            prop_assert!(landmark.extent.is_finite());
        }
        // Coarse and bounded: some of these stand 10 km away.
        let config = PriorConfig { cells_max: 200_000, ..PriorConfig::standard(0.25) };
        let _ = prior(&plan, &config);
    }
}

/// Half of them lie across the other half: crossings are the square of what is drawn.
#[test]
fn a_plan_with_more_crossings_than_one_may_have_is_refused_before_it_fills_the_memory() {
    let rail = |number: u32| {
        let at = f64::from(number / 2);
        let (from, to) = if number.is_multiple_of(2) {
            ([0.0, at, 0.0], [500.0, at + 0.5, 1.0])
        } else {
            ([at, 0.0, 0.0], [at + 0.5, 500.0, 1.0])
        };
        Object::of(Kind::Machine, vec![Solid::cuboid(from, to)])
    };
    let structure = Structure::of(&model((0..200).map(rail)));
    // Two edges of each cross two of each that lies across.
    assert_eq!(structure.plan_within(0.5, 40_000), Err(TooCrowded { most: 40_000 }));
    let whole = structure.plan_within(0.5, 200_000).unwrap();
    assert_eq!(whole, structure.plan(0.5));
    assert_eq!(whole.outlines().len(), 99 * 99 + 1);
    // Where nothing stands, nothing is crowded.
    assert_eq!(structure.plan_within(2.0, 1).unwrap().outlines(), []);
    // The same with walls that lie on each other: no crossings, but as many stretches.
    let pile = |number: u32| {
        let at = f64::from(number) * 0.01;
        Object::of(Kind::Machine, vec![Solid::cuboid([at, 0.0, 0.0], [at + 100.0, 1.0, 1.0])])
    };
    let structure = Structure::of(&model((0..300).map(pile)));
    assert!(structure.plan_within(0.5, 10_000).is_err());
    assert!(structure.plan_within(0.5, 1_000_000).is_ok());
}
