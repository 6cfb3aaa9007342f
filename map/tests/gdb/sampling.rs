//! Cuts of random unions against a point-in-solid test that knows nothing of meshes.

use mapfold_map::gdb::{
    Face, Kind, Object, Outline, Placement, Plan, PlanPoint, Point3, Polygon, Polyhedron, Shape,
    Solid, Structure,
};
use mapfold_map::geometry::Point;
use nalgebra::UnitQuaternion;
use proptest::prelude::*;

use super::world::{block, model};

/// A prism over a star about a centre, upright but turned.
#[derive(Debug, Clone)]
struct Star {
    at: [f64; 3],
    yaw: f64,
    radii: Vec<f64>,
    height: f64,
    doorway: bool,
}

fn star() -> impl Strategy<Value = Star> {
    // Heights on a coarse grid, so that faces coincide with each other and with the cut.
    let at = (-3.0..3.0, -3.0..3.0, 0..4_u8).prop_map(|(x, y, z)| [x, y, f64::from(z) / 4.0]);
    let radii = prop::collection::vec(0.3..2.0_f64, 3..9);
    (at, 0.0..6.0_f64, radii, 1..4_u8, prop::bool::weighted(0.2)).prop_map(
        |(at, yaw, radii, height, doorway)| Star {
            at,
            yaw,
            radii,
            height: f64::from(height) / 4.0,
            doorway,
        },
    )
}

impl Star {
    fn corners(&self) -> Vec<Point> {
        let step = std::f64::consts::TAU / self.radii.len() as f64;
        let corner = |(k, r): (usize, &f64)| {
            let (s, c) = (k as f64 * step).sin_cos();
            Point::new(c, s) * *r
        };
        self.radii.iter().enumerate().map(corner).collect()
    }

    fn object(&self) -> Object {
        let base = Polygon { outer: self.corners(), holes: Vec::new() };
        let prism = Solid::Prism { base, lower: 0.0, upper: self.height };
        let kind = if self.doorway { Kind::Doorway } else { Kind::Wall };
        let placement = Placement::upright(Point3::from(self.at), self.yaw);
        Object { placement, ..Object::of(kind, vec![prism]) }
    }

    /// Whether it holds a point, and how near its border is in the plane.
    fn holds(&self, p: Point, z: f64) -> (bool, f64) {
        let (s, c) = self.yaw.sin_cos();
        let d = p - Point::new(self.at[0], self.at[1]);
        let q = Point::new(c * d.x + s * d.y, c * d.y - s * d.x);
        let ring = self.corners();
        let (inside, distance) = in_ring(&ring, q);
        let at_height = self.at[2] <= z && z < self.at[2] + self.height;
        (inside && at_height, distance)
    }
}

/// Whether a ring holds a point (even-odd), and the distance of its border.
fn in_ring(ring: &[Point], p: Point) -> (bool, f64) {
    let (mut odd, mut nearest) = (false, f64::INFINITY);
    for (k, a) in ring.iter().enumerate() {
        let b = &ring[(k + 1) % ring.len()];
        let t = ((p - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
        nearest = nearest.min((a + (b - a) * t - p).norm());
        if (a.y <= p.y) != (b.y <= p.y) && p.x < a.x + (b.x - a.x) * (p.y - a.y) / (b.y - a.y) {
            odd = !odd;
        }
    }
    (odd, nearest)
}

/// Whether a plan is solid at a point: its outlines have solid on their right.
fn solid(plan: &Plan, p: Point) -> bool {
    let rings = plan
        .outlines()
        .iter()
        .map(|outline| outline.vertices().map(PlanPoint::metres).collect::<Vec<_>>());
    rings.filter(|ring| in_ring(ring, p).0).count() % 2 == 1
}

/// What snapping may move, metres, with a margin.
const NEAR: f64 = 5e-6;

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn a_cut_of_a_union_of_prisms_is_what_sampling_says(
        stars in prop::collection::vec(star(), 1..8),
        height in prop_oneof![(0..8_u8).prop_map(|z| f64::from(z) / 4.0), 0.0..2.0_f64],
        samples in prop::collection::vec((-5.0..5.0_f64, -5.0..5.0_f64), 60),
    ) {
        let plan = Structure::of(&model(stars.iter().map(Star::object))).plan(height);
        for (x, y) in samples {
            let p = Point::new(x, y);
            let held: Vec<_> = stars.iter().map(|star| (star.doorway, star.holds(p, height))).collect();
            if held.iter().any(|(_, (_, distance))| *distance < NEAR) {
                continue;
            }
            let any = |doorway: bool| held.iter().any(|(is, (holds, _))| *is == doorway && *holds);
            prop_assert_eq!(solid(&plan, p), any(false) && !any(true), "{} {}", x, y);
        }
    }

    /// Free polyhedra that lie on any side, cut anywhere: an octahedron's inside is known in closed form.
    #[test]
    fn a_cut_of_tumbled_octahedra_is_what_sampling_says(
        bodies in prop::collection::vec((prop::array::uniform3(-1.0..1.0_f64), prop::array::uniform3(-3.0..3.0_f64)), 1..5),
        height in -1.5..1.5_f64,
        samples in prop::collection::vec((-2.5..2.5_f64, -2.5..2.5_f64), 60),
    ) {
        let vertices = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]];
        let faces = (0..4).flat_map(|k| [Face::simple([k, (k + 1) % 4, 4]), Face::simple([(k + 1) % 4, k, 5])]);
        let octahedron = Polyhedron { vertices: vertices.map(Point3::from).to_vec(), faces: faces.collect() };
        let placements: Vec<Placement> = bodies
            .iter()
            .map(|(at, turn)| Placement {
                position: Point3::from(*at),
                rotation: UnitQuaternion::from_euler_angles(turn[0], turn[1], turn[2]),
            })
            .collect();
        let object = |placement: &Placement| Object {
            placement: *placement,
            ..Object::of(Kind::Machine, vec![Solid::Polyhedron(octahedron.clone())])
        };
        let plan = Structure::of(&model(placements.iter().map(object))).plan(height);
        for (x, y) in samples {
            // Inside of an octahedron: |x| + |y| + |z| < 1.
            let depth = |placement: &Placement| {
                let q = placement.rotation.inverse() * (Point3::new(x, y, height) - placement.position);
                1.0 - q.abs().sum()
            };
            let depths: Vec<f64> = placements.iter().map(depth).collect();
            // Flat cuts move far for a small change of depth: keep well away.
            if depths.iter().all(|d| d.abs() > 1e-3) {
                prop_assert_eq!(solid(&plan, Point::new(x, y)), depths.iter().any(|d| *d > 0.0));
            }
        }
    }

    /// Boxes on a coarse grid: faces coincide, corners touch, walls end on walls. Cell by cell, and by area.
    #[test]
    fn a_plan_of_boxes_on_a_grid_is_right_in_every_cell(
        boxes in prop::collection::vec((0..6_u8, 0..6_u8, 1..4_u8, 1..4_u8, 0..3_u8), 1..12),
    ) {
        let kinds = [Kind::Wall, Kind::Doorway, Kind::Machine];
        let object = |(x, y, width, depth, kind): &(u8, u8, u8, u8, u8)| {
            let from = [*x, *y].map(f64::from);
            let to = [x + width, y + depth].map(f64::from);
            block(kinds[usize::from(*kind)], from, to, [0.0, 1.0])
        };
        let plan = Structure::of(&model(boxes.iter().map(object))).plan(0.0);
        let mut area = 0.0;
        for (column, row) in (0..9_u8).flat_map(|column| (0..9_u8).map(move |row| (column, row))) {
            let any = |wanted: u8| boxes.iter().any(|(x, y, width, depth, kind)| {
                *kind == wanted && (*x..x + width).contains(&column) && (*y..y + depth).contains(&row)
            });
            let want = any(2) || (any(0) && !any(1));
            prop_assert_eq!(solid(&plan, Point::new(f64::from(column) + 0.5, f64::from(row) + 0.5)), want);
            area += if want { 1.0 } else { 0.0 };
        }
        let enclosed: f64 = plan.outlines().iter().map(Outline::area).sum();
        prop_assert!((enclosed + area).abs() < 1e-9);
        // Openings lie on faces of walls in doorways, with the wall on the right: a cell there is a wall's and a
        // doorway's, and the one opposite has no wall.
        for side in plan.openings().iter().flat_map(|opening| &opening.sides) {
            let (from, to) = (side.from.metres(), side.to.metres());
            let step = (to - from).normalize();
            let count = (to - from).norm().round() as usize;
            for k in 0..count {
                let middle = from + step * (k as f64 + 0.5);
                let right = middle + Point::new(step.y, -step.x) * 0.5;
                let left = middle - Point::new(step.y, -step.x) * 0.5;
                let any = |p: Point, wanted: u8| boxes.iter().any(|(x, y, width, depth, kind)| {
                    let within = |v: f64, low: u8, size: u8| f64::from(low) < v && v < f64::from(low + size);
                    *kind == wanted && within(p.x, *x, *width) && within(p.y, *y, *depth)
                });
                prop_assert!(any(right, 0) && any(right, 1) && !any(left, 0), "{:?}", side);
            }
        }
    }

    /// Every outline is simple in the way it promises, and the area is that of the parts.
    #[test]
    fn outlines_pass_no_vertex_twice_and_start_at_their_smallest(
        stars in prop::collection::vec(star(), 1..8),
    ) {
        let plan = Structure::of(&model(stars.iter().map(Star::object))).plan(0.5);
        for outline in plan.outlines() {
            let vertices: Vec<_> = outline.vertices().collect();
            let mut sorted = vertices.clone();
            sorted.sort_unstable();
            sorted.dedup();
            prop_assert_eq!(sorted.len(), vertices.len());
            prop_assert_eq!(sorted[0], vertices[0]);
        }
    }
}

#[test]
fn a_cut_through_the_tip_or_an_edge_of_a_solid_meets_what_lies_above_it() {
    // A pyramid on its tip: nothing of it is below the tip, and just above it is still less than a micrometre wide.
    let vertices =
        [[0.0, 0.0, 0.5], [1.0, 1.0, 1.0], [-1.0, 1.0, 1.0], [-1.0, -1.0, 1.0], [1.0, -1.0, 1.0]];
    let faces = vec![
        Face::simple([1, 2, 3, 4]),
        Face::simple([0, 2, 1]),
        Face::simple([0, 3, 2]),
        Face::simple([0, 4, 3]),
        Face::simple([0, 1, 4]),
    ];
    let pyramid = Polyhedron { vertices: vertices.map(Point3::from).to_vec(), faces };
    let object = Object {
        shape: Shape::Own(vec![Solid::Polyhedron(pyramid)]),
        ..Object::of(Kind::Other, Vec::new())
    };
    let structure = Structure::of(&model([object]));
    assert!(structure.plan(0.5).outlines().is_empty());
    let area = |height: f64| structure.plan(height).outlines()[0].area();
    assert!((area(0.75) + 1.0).abs() < 1e-9);
    assert!((area(0.999_999) + 4.0).abs() < 1e-4);
    assert!(structure.plan(1.0).outlines().is_empty());
}
