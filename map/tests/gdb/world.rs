//! Models for the tests.

use mapfold_map::gdb::{
    Face, Kind, Model, Object, ObjectId, Outline, Plan, PlanPoint, Point3, Polyhedron, Solid,
    Structure,
};

pub(crate) fn id(number: u32) -> ObjectId {
    let mut bytes = [0; 16];
    bytes[12..].copy_from_slice(&number.to_be_bytes());
    ObjectId(bytes)
}

/// Objects numbered from 0.
pub(crate) fn model(objects: impl IntoIterator<Item = Object>) -> Model {
    let objects = objects.into_iter().enumerate().map(|(k, object)| (id(k as u32), object));
    Model { objects: objects.collect(), ..Model::default() }
}

pub(crate) fn plan(objects: impl IntoIterator<Item = Object>, height: f64) -> Plan {
    Structure::of(&model(objects)).plan(height)
}

/// A box from (x, y) to (x, y) with its lower and upper height.
pub(crate) fn block(
    kind: Kind,
    [x, y]: [f64; 2],
    [to_x, to_y]: [f64; 2],
    [lower, upper]: [f64; 2],
) -> Object {
    Object::of(kind, vec![Solid::cuboid([x, y, lower], [to_x, to_y, upper])])
}

/// A wall from the floor up to 3 m.
pub(crate) fn wall(from: [f64; 2], to: [f64; 2]) -> Object {
    block(Kind::Wall, from, to, [0.0, 3.0])
}

/// A doorway from the floor up to 2.1 m.
pub(crate) fn doorway(from: [f64; 2], to: [f64; 2]) -> Object {
    block(Kind::Doorway, from, to, [0.0, 2.1])
}

/// The corners of a box as a free polyhedron; its faces run counter-clockwise seen from outside.
pub(crate) fn cube(from: [f64; 3], to: [f64; 3]) -> Polyhedron {
    let corner = |k: usize| {
        Point3::from([0, 1, 2].map(|axis| if k >> axis & 1 == 0 { from[axis] } else { to[axis] }))
    };
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    Polyhedron {
        vertices: (0..8).map(corner).collect(),
        faces: faces.into_iter().map(Face::simple).collect(),
    }
}

/// The vertices of an outline in metres.
pub(crate) fn corners(outline: &Outline) -> Vec<[f64; 2]> {
    outline.vertices().map(metres).collect()
}

pub(crate) fn metres(p: PlanPoint) -> [f64; 2] {
    let p = p.metres();
    [p.x, p.y]
}

/// All outlines in metres, sorted.
pub(crate) fn outlines(plan: &Plan) -> Vec<Vec<[f64; 2]>> {
    plan.outlines().iter().map(corners).collect()
}

/// The outline of something that stands in a room: clockwise from its smallest corner.
pub(crate) fn island([x, y]: [f64; 2], [to_x, to_y]: [f64; 2]) -> Vec<[f64; 2]> {
    vec![[x, y], [x, to_y], [to_x, to_y], [to_x, y]]
}

/// The outline of a room: counter-clockwise from its smallest corner.
pub(crate) fn room([x, y]: [f64; 2], [to_x, to_y]: [f64; 2]) -> Vec<[f64; 2]> {
    vec![[x, y], [to_x, y], [to_x, to_y], [x, to_y]]
}
