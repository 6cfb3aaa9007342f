//! The same objects give the same bits, in whatever order their parts are listed.

use mapfold_map::gdb::{
    Kind, LandmarkConfig, Model, Object, Placement, Point3, Polyhedron, Shape, Solid, Structure,
    landmarks,
};
use proptest::prelude::*;

use super::world::{cube, id};

/// Solids of an object, each a polyhedron so that faces have an order, too.
fn object(blocks: &[([f64; 3], [f64; 3])], yaw: f64) -> Object {
    let solid = |(from, size): &([f64; 3], [f64; 3])| {
        Solid::Polyhedron(cube(*from, std::array::from_fn(|k| from[k] + size[k])))
    };
    Object {
        placement: Placement::upright(Point3::zeros(), yaw),
        ..Object::of(Kind::Wall, blocks.iter().map(solid).collect())
    }
}

/// The same polyhedron with its vertices numbered backwards, and its faces listed backwards, each from another start.
fn backwards(polyhedron: &Polyhedron, start: usize) -> Polyhedron {
    let mut other = polyhedron.clone();
    other.vertices.reverse();
    other.faces.reverse();
    for face in &mut other.faces {
        for vertex in &mut face.outer {
            *vertex = 7 - *vertex;
        }
        face.outer.rotate_left(start % 4);
    }
    other
}

proptest! {
    #[test]
    fn the_order_of_objects_solids_faces_and_vertices_does_not_matter(
        objects in prop::collection::vec(
            (
                prop::collection::vec(
                    (prop::array::uniform3(-2.0..2.0_f64), prop::array::uniform3(0.2..2.0_f64)),
                    1..4,
                ),
                0.0..6.0_f64,
            ),
            1..6,
        ),
        start in 0..4_usize,
    ) {
        let objects: Vec<Object> = objects.iter().map(|(blocks, yaw)| object(blocks, *yaw)).collect();
        let forth: Model = Model {
            objects: objects.iter().cloned().enumerate().map(|(k, o)| (id(k as u32), o)).collect(),
            ..Model::default()
        };
        let back = Model {
            objects: objects
                .into_iter()
                .enumerate()
                .rev()
                .map(|(k, mut object)| {
                    if let Shape::Own(solids) = &mut object.shape {
                        solids.reverse();
                        for solid in solids {
                            if let Solid::Polyhedron(polyhedron) = solid {
                                *polyhedron = backwards(polyhedron, start);
                            }
                        }
                    }
                    (id(k as u32), object)
                })
                .collect(),
            ..Model::default()
        };
        let (forth, back) = (Structure::of(&forth).plan(0.5), Structure::of(&back).plan(0.5));
        prop_assert_eq!(&forth, &back);
        let config = LandmarkConfig::STANDARD;
        prop_assert_eq!(landmarks(&forth, &config), landmarks(&back, &config));
    }
}
