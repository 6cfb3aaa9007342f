//! A laboratory's hallway: as it is drawn in the a-priori model, and as it stands, with cylinders that nobody drew.

use mapfold_map::gdb::{
    self, Kind, LandmarkConfig, Model, Object, ObjectId, Plan, Solid, Structure,
};
use mapfold_map::landmarks::{LandmarkTable, Obstacles};

use crate::plane::{Piece, Point};
use crate::simulation::{Noise, World, way_points};

/// Left, low, right, high, metres: walls with recesses for doors along a hallway, a wider hall to its left at the end,
/// pillars, a cupboard, a machine.
const BOXES: [[f64; 4]; 20] = [
    [-0.2, -1.6, 2.0, -1.2],
    [1.8, -1.8, 3.2, -1.6],
    [3.0, -1.6, 6.5, -1.2],
    [6.3, -1.8, 7.7, -1.6],
    [7.5, -1.6, 14.2, -1.2],
    [-0.2, -1.2, 0.0, 1.2],
    [-0.2, 1.2, 3.8, 1.6],
    [3.6, 1.6, 5.0, 1.8],
    [4.8, 1.2, 8.5, 1.6],
    [8.3, 1.6, 8.5, 6.4],
    [8.3, 6.4, 14.2, 6.6],
    [14.0, -1.2, 14.2, 6.4],
    [1.2, 0.8, 1.6, 1.2],
    [5.6, -1.2, 6.0, -0.85],
    [6.4, 0.85, 6.8, 1.2],
    [12.0, 2.5, 12.4, 2.9],
    [12.6, 4.2, 14.0, 5.2],
    [8.5, 3.0, 9.0, 4.2],
    [9.4, -1.2, 10.0, -0.8],
    [13.6, -0.2, 14.0, 0.6],
];

/// The way of the paper's length.
pub(super) const WAY: [Point; 3] =
    [Point::new(0.8, 0.0), Point::new(10.5, 0.0), Point::new(10.5, 5.3)];

/// Cylinders that stand about.
const CYLINDERS: usize = 6;
/// Nothing stands nearer to the way, metres.
const CLEAR_M: f64 = 0.4;
/// The height of the sensor, metres.
const HEIGHT_M: f64 = 0.3;

/// The a-priori model, ready for robots.
#[derive(Debug)]
pub(super) struct Drawn {
    /// Its plan.
    pub(super) plan: Plan,
    /// Its landmarks.
    pub(super) table: LandmarkTable,
    /// What hides them.
    pub(super) obstacles: Obstacles,
}

impl Drawn {
    /// The model, whose objects claim to stand within a tolerance (standard deviation, metres).
    pub(super) fn new(tolerance_m: f64) -> Self {
        let mut model = Model::default();
        for (number, [left, low, right, high]) in (0_u8..).zip(BOXES) {
            let solid = Solid::cuboid([left, low, 0.0], [right, high, 2.5]);
            let mut object = Object::of(Kind::Wall, vec![solid]);
            object.tolerance = tolerance_m;
            model.objects.insert(ObjectId([number; 16]), object);
        }
        let plan = Structure::of(&model).plan(HEIGHT_M);
        let found = gdb::landmarks(&plan, &LandmarkConfig::STANDARD);
        let table = LandmarkTable::new(found.iter().map(|of| of.landmark).collect());
        let ends = plan.edges().map(|edge| (edge.from.metres(), edge.to.metres()));
        let obstacles = Obstacles::new(ends);
        Self { plan, table, obstacles }
    }
}

/// The hallway as it stands: every object off by some deviation, and cylinders beside the way.
pub(super) fn built(tolerance_m: f64, noise: &mut Noise) -> World {
    let mut walls = Vec::new();
    for [left, low, right, high] in BOXES {
        let (dx, dy) = (noise.normal(tolerance_m), noise.normal(tolerance_m));
        let corners = [(left, low), (right, low), (right, high), (left, high)]
            .map(|(x, y)| Point::new(x + dx, y + dy));
        walls.extend((0..4).map(|i| Piece { a: corners[i], b: corners[(i + 1) % 4] }));
    }
    let way: Vec<Piece> = WAY.windows(2).map(|leg| Piece { a: leg[0], b: leg[1] }).collect();
    let mut standing = 0;
    while standing < CYLINDERS {
        let at = Point::new(14.0 * noise.share(), -1.2 + 7.6 * noise.share());
        let radius = 0.1 + 0.2 * noise.share();
        let is_clear = |piece: &Piece, by: f64| piece.distance(at) > radius + by;
        if is_inside(at)
            && way.iter().all(|leg| is_clear(leg, CLEAR_M))
            && walls[..4 * BOXES.len()].iter().all(|wall| is_clear(wall, 0.02))
        {
            walls.extend(cylinder(at, radius));
            standing += 1;
        }
    }
    World { name: "laboratory", walls, way: WAY.to_vec() }
}

/// Whether a place is floor, and not in a box.
fn is_inside(p: Point) -> bool {
    let within = |[left, low, right, high]: [f64; 4]| {
        (left..right).contains(&p.x) && (low..high).contains(&p.y)
    };
    (within([0.0, -1.2, 14.0, 1.2]) || within([8.5, -1.2, 14.0, 6.4]))
        && !BOXES.into_iter().any(within)
}

fn cylinder(middle: Point, radius: f64) -> impl Iterator<Item = Piece> {
    let corner =
        move |i: u32| middle.towards(f64::from(i % 16) / 16.0 * std::f64::consts::TAU, radius);
    (0..16).map(move |i| Piece { a: corner(i), b: corner(i + 1) })
}

/// The same to the end of the way and back to its beginning.
pub(super) fn poses_there_and_back() -> Vec<((Point, f64), f64)> {
    let [start, corner, end] = WAY;
    way_points(&[start, corner, end, corner, start], 0.1, 0.1)
}

/// True poses every few centimetres of the way, with the way driven.
pub(super) fn poses() -> Vec<((Point, f64), f64)> {
    way_points(&WAY, 0.1, 0.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_is_15_m_and_free() {
        let length: f64 = WAY.windows(2).map(|leg| leg[0].distance(leg[1])).sum();
        assert!((length - 15.0).abs() < 1e-9);
        let mut noise = Noise::of_seed(1);
        for _ in 0..20 {
            let world = built(0.01, &mut noise);
            for leg in WAY.windows(2) {
                let leg = Piece { a: leg[0], b: leg[1] };
                assert!(world.walls.iter().all(|wall| leg.crossing(wall).is_none()));
            }
        }
    }
}
