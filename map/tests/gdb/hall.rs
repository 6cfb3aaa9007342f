//! A hall with tables, shelves and a conveyor, cut at heights at which the result is known.

use std::f64::consts::FRAC_PI_2;

use mapfold_map::gdb::{
    Face, Kind, Model, Object, Placement, Point3, Polygon, Polyhedron, Prototype, Shape, Solid,
    Structure, findings,
};

use super::world::{doorway, id, island, model, outlines, room, wall};

/// A table of 1.6 m x 0.8 m with a top from 0.70 m to 0.75 m on four legs of 5 cm.
fn table() -> Prototype {
    let leg = |x: f64, y: f64| Solid::cuboid([x, y, 0.0], [x + 0.05, y + 0.05, 0.70]);
    let mut solids = vec![Solid::cuboid([0.0, 0.0, 0.70], [1.6, 0.8, 0.75])];
    solids.extend([leg(0.0, 0.0), leg(1.55, 0.0), leg(0.0, 0.75), leg(1.55, 0.75)]);
    Prototype { solids }
}

/// A shelf of 2 m x 0.5 m, 2 m high: two cheeks of 2 cm, and boards of 3 cm at 0.1 m, 0.7 m and 1.4 m.
fn shelf() -> Prototype {
    let board = |z: f64| Solid::cuboid([0.02, 0.0, z], [1.98, 0.5, z + 0.03]);
    let cheek = |x: f64| Solid::cuboid([x, 0.0, 0.0], [x + 0.02, 0.5, 2.0]);
    Prototype { solids: vec![cheek(0.0), cheek(1.98), board(0.1), board(0.7), board(1.4)] }
}

/// A conveyor: a frame, open in the middle, from 0.5 m to 0.9 m, and a chute that falls from its end to the floor
/// over 1.8 m.
fn conveyor() -> Object {
    let ring = |x: f64, y: f64, to_x: f64, to_y: f64| {
        Polygon::simple([[x, y], [to_x, y], [to_x, to_y], [x, to_y]])
    };
    let frame = Polygon {
        outer: ring(8.0, 6.0, 14.0, 7.0).outer,
        holes: vec![ring(8.25, 6.25, 13.75, 6.75).outer],
    };
    let chute = Polyhedron {
        vertices: [
            [14.0, 6.0, 0.0],
            [15.8, 6.0, 0.0],
            [15.8, 7.0, 0.0],
            [14.0, 7.0, 0.0],
            [14.0, 6.0, 0.9],
            [14.0, 7.0, 0.9],
        ]
        .map(Point3::from)
        .to_vec(),
        faces: vec![
            Face::simple([0, 3, 2, 1]),
            Face::simple([0, 1, 4]),
            Face::simple([3, 5, 2]),
            Face::simple([0, 4, 5, 3]),
            Face::simple([1, 2, 5, 4]),
        ],
    };
    let frame = Solid::Prism { base: frame, lower: 0.5, upper: 0.9 };
    Object::of(Kind::Machine, vec![frame, Solid::Polyhedron(chute)])
}

fn instance(prototype: &str, x: f64, y: f64, yaw: f64) -> Object {
    Object {
        shape: Shape::Instance(prototype.into()),
        placement: Placement::upright(Point3::new(x, y, 0.0), yaw),
        ..Object::of(Kind::Furniture, Vec::new())
    }
}

fn hall() -> Model {
    let mut hall = model([
        // Walls meet in the corners in three ways: overlapping, flush and in a seam.
        wall([0.0, 0.0], [20.0, 0.2]),
        wall([0.0, 11.8], [20.0, 12.0]),
        wall([0.0, 0.0], [0.2, 12.0]),
        wall([19.8, 0.2], [20.0, 11.8]),
        doorway([4.0, -0.1], [5.2, 0.3]),
        instance("table", 2.0, 3.0, 0.0),
        instance("table", 6.0, 3.0, FRAC_PI_2),
        // With its back to the north wall.
        instance("shelf", 10.0, 11.3, 0.0),
        conveyor(),
    ]);
    hall.prototypes.insert("table".into(), table());
    hall.prototypes.insert("shelf".into(), shelf());
    hall
}

/// The hall's walls below the lintel, with the shelf's parts that touch the north wall between the two given runs of
/// corners.
fn walls_with_door(north: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let mut outline = vec![
        [0.0, 0.0],
        [0.0, 12.0],
        [20.0, 12.0],
        [20.0, 0.0],
        [5.2, 0.0],
        [5.2, 0.2],
        [19.8, 0.2],
        [19.8, 11.8],
    ];
    outline.extend(north);
    outline.extend([[0.2, 11.8], [0.2, 0.2], [4.0, 0.2], [4.0, 0.0]]);
    outline
}

fn sorted(mut outlines: Vec<Vec<[f64; 2]>>) -> Vec<Vec<[f64; 2]>> {
    outlines.sort_by(|a, b| a.partial_cmp(b).unwrap());
    outlines
}

/// At corners where the owner changes without a bend there is a vertex; it is no part of the shape.
fn shape(outline: &[[f64; 2]]) -> Vec<[f64; 2]> {
    let count = outline.len();
    let bends = |k: &usize| {
        let [a, b, c] = [k + count - 1, *k, k + 1].map(|k| outline[k % count]);
        ((b[0] - a[0]) * (c[1] - b[1]) - (b[1] - a[1]) * (c[0] - b[0])).abs() > 1e-12
    };
    (0..count).filter(bends).map(|k| outline[k]).collect()
}

fn cut(height: f64) -> Vec<Vec<[f64; 2]>> {
    let plan = Structure::of(&hall()).plan(height);
    sorted(outlines(&plan).iter().map(|outline| shape(outline)).collect())
}

#[test]
fn the_hall_has_nothing_to_find_fault_with() {
    assert_eq!(findings(&hall()), []);
}

/// Four legs each; two cheeks at the wall; the chute, cut at 0.3 m, is 1.2 m long.
#[test]
fn at_thirty_centimetres_a_table_is_four_legs() {
    let cheeks = [
        [12.0, 11.8],
        [12.0, 11.3],
        [11.98, 11.3],
        [11.98, 11.8],
        [10.02, 11.8],
        [10.02, 11.3],
        [10.0, 11.3],
        [10.0, 11.8],
    ];
    let legs = [
        [2.0, 3.0],
        [3.55, 3.0],
        [2.0, 3.75],
        [3.55, 3.75],
        // Turned by a quarter: (x, y) goes to (6 - y, 3 + x), and the corner to the left of itself.
        [5.95, 3.0],
        [5.95, 4.55],
        [5.2, 3.0],
        [5.2, 4.55],
    ];
    let mut want = vec![walls_with_door(&cheeks), island([14.0, 6.0], [15.2, 7.0])];
    want.extend(legs.map(|[x, y]| {
        let micro = |v: f64| (v * 1e6).round() / 1e6;
        island([x, y], [micro(x + 0.05), micro(y + 0.05)])
    }));
    assert_eq!(cut(0.3), sorted(want));
}

/// 0.70 m is exactly where the legs end and the tops and a board begin: the tops and the board are met, the legs are
/// not, and nothing is met twice.
#[test]
fn at_the_height_of_a_face_what_begins_there_is_met_and_what_ends_there_is_not() {
    let board = [[12.0, 11.8], [12.0, 11.3], [10.0, 11.3], [10.0, 11.8]];
    let want = vec![
        walls_with_door(&board),
        island([2.0, 3.0], [3.6, 3.8]),
        island([5.2, 3.0], [6.0, 4.6]),
        // The frame, with the chute at its end: 0.4 m long at this height.
        island([8.0, 6.0], [14.4, 7.0]),
        room([8.25, 6.25], [13.75, 6.75]),
    ];
    assert_eq!(cut(0.70), sorted(want));
}

/// Above the lintel, at the very height where doorway and shelf end, and of the furniture only the shelf's cheeks below.
#[test]
fn above_the_lintel_the_wall_is_whole() {
    let ring = |to: f64| vec![island([0.0, 0.0], [20.0, 12.0]), room([0.2, 0.2], [19.8, to])];
    assert_eq!(cut(2.1), sorted(ring(11.8)));
    let cheeks = [
        [12.0, 11.8],
        [12.0, 11.3],
        [11.98, 11.3],
        [11.98, 11.8],
        [10.02, 11.8],
        [10.02, 11.3],
        [10.0, 11.3],
        [10.0, 11.8],
    ];
    assert_eq!(cut(1.99), sorted(vec![walls_with_door(&cheeks)]));
    assert_eq!(cut(2.0), sorted(vec![walls_with_door(&[])]));
    assert!(cut(3.0).is_empty());
    assert!(cut(-0.001).is_empty());
}

#[test]
fn every_edge_knows_what_it_belongs_to() {
    let plan = Structure::of(&hall()).plan(0.3);
    let owner = |x: f64, y: f64| {
        let on = |edge: &mapfold_map::gdb::Edge<'_>| {
            let (a, b) = (edge.from.metres(), edge.to.metres());
            let p = mapfold_map::geometry::Point::new(x, y);
            ((p - a).norm() + (b - p).norm() - (b - a).norm()).abs() < 1e-9
        };
        plan.edges().find(on).map(|edge| edge.owner.id)
    };
    assert_eq!(owner(10.0, 0.2), Some(id(0)));
    assert_eq!(owner(19.8, 5.0), Some(id(3)));
    assert_eq!(owner(4.0, 0.1), Some(id(4)), "a jamb is the doorway's");
    assert_eq!(owner(2.0, 3.02), Some(id(5)));
    assert_eq!(owner(10.0, 11.5), Some(id(7)));
    assert_eq!(owner(14.0, 6.5), Some(id(8)));
    assert_eq!(owner(4.5, 0.1), None);
}
