//! Open shells: surfaces without thickness.

use mapfold_map::gdb::{Face, Free, Kind, Object, Point3, Polyhedron, Solid};

use super::world::{doorway, island, metres, outlines, plan, wall};

/// An upright sheet through points, from the floor up to 2 m.
fn sheet(points: &[[f64; 2]]) -> Object {
    let vertices =
        points.iter().flat_map(|[x, y]| [Point3::new(*x, *y, 0.0), Point3::new(*x, *y, 2.0)]);
    let faces = (0..points.len() as u32 - 1)
        .map(|k| Face::simple([2 * k, 2 * k + 2, 2 * k + 3, 2 * k + 1]));
    let polyhedron = Polyhedron { vertices: vertices.collect(), faces: faces.collect() };
    Object::of(Kind::Wall, vec![Solid::Polyhedron(polyhedron)])
}

fn edges(objects: Vec<Object>) -> Vec<([f64; 2], [f64; 2])> {
    let plan = plan(objects, 0.5);
    let thin = plan.edges().filter(|edge| edge.free == Free::Both);
    thin.map(|edge| (metres(edge.from), metres(edge.to))).collect()
}

#[test]
fn an_open_shell_is_seen_from_both_sides() {
    let edges = edges(vec![sheet(&[[0.0, 0.0], [2.0, 0.0], [2.0, 1.0]])]);
    assert_eq!(edges, [([0.0, 0.0], [2.0, 0.0]), ([2.0, 0.0], [2.0, 1.0])]);
}

#[test]
fn what_of_a_sheet_is_inside_something_solid_or_a_doorway_is_not_seen() {
    let objects = vec![
        sheet(&[[0.0, 0.0], [10.0, 0.0]]),
        wall([2.0, -1.0], [3.0, 1.0]),
        doorway([6.0, -0.1], [7.0, 0.1]),
    ];
    let plan = plan(objects.clone(), 0.5);
    assert_eq!(outlines(&plan).iter().map(Vec::len).collect::<Vec<_>>(), [4]);
    let want = [([0.0, 0.0], [2.0, 0.0]), ([3.0, 0.0], [6.0, 0.0]), ([7.0, 0.0], [10.0, 0.0])];
    assert_eq!(edges(objects), want);
}

#[test]
fn a_sheet_on_the_face_of_a_wall_is_the_wall() {
    let objects = vec![sheet(&[[0.0, 0.2], [1.0, 0.2]]), wall([0.0, 0.0], [1.0, 0.2])];
    assert_eq!(outlines(&plan(objects.clone(), 0.5)), [island([0.0, 0.0], [1.0, 0.2])]);
    assert_eq!(edges(objects), []);
}
