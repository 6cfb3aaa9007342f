//! What robots teach of a floor of thin walls, beside what the floor's model says: one landmark for each thing.

use mapfold_map::gdb::{
    Kind, LandmarkConfig, Model, Object, ObjectId, PlannedLandmark, Solid, Structure, landmarks,
};
use mapfold_map::landmarks::{LearnedConfig, LearnedLandmark, landmarks_of_map};
use mapfold_map::level::{Level, LevelConfig};

use crate::Error;
use crate::plane::{Piece, Point};
use crate::simulation::{Noise, World};
use crate::surveying::{Looker, RESOLUTION_M, START_S};

/// Size of the room, metres.
const ROOM_M: (f64, f64) = (9.0, 6.0);
/// A partition from the lower wall up that ends freely, with a doorway: where its middle is, its top, and the doorway, metres.
const PARTITION_M: (f64, f64, (f64, f64)) = (4.4, 4.2, (1.2, 2.1));
/// Looks from anywhere.
const LOOKS: u32 = 160;
/// Robots keep so far from walls, metres.
const AWAY_M: f64 = 0.4;

/// The landmarks of the model, and those that robots taught of the real floor.
#[derive(Debug)]
pub struct Taught {
    /// Of the model.
    pub planned: Vec<PlannedLandmark>,
    /// Of the map.
    pub learned: Vec<LearnedLandmark>,
}

/// Rectangles of solid wall: lower left and upper right corner.
fn blocks(thickness_m: f64) -> [([f64; 2], [f64; 2]); 6] {
    let ((w, h), (x, top, (low, high)), t) = (ROOM_M, PARTITION_M, 0.2);
    let (left, right) = (x - 0.5 * thickness_m, x + 0.5 * thickness_m);
    [
        ([-t, -t], [w + t, 0.0]),
        ([-t, h], [w + t, h + t]),
        ([-t, 0.0], [0.0, h]),
        ([w, 0.0], [w + t, h]),
        ([left, 0.0], [right, low]),
        ([left, high], [right, top]),
    ]
}

fn model(thickness_m: f64) -> Model {
    let mut model = Model::default();
    let mut add = |number: u8, kind, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2]| {
        let solid = Solid::cuboid([x0, y0, 0.0], [x1, y1, 2.5]);
        model.objects.insert(ObjectId([number; 16]), Object::of(kind, vec![solid]));
    };
    let blocks = blocks(thickness_m);
    for (number, (from, to)) in (1..).zip(&blocks[..4]) {
        add(number, Kind::Wall, *from, *to);
    }
    let ((below_from, below_to), (above_from, above_to)) = (blocks[4], blocks[5]);
    add(5, Kind::Wall, below_from, above_to);
    add(6, Kind::Doorway, [below_from[0], below_to[1]], [below_to[0], above_from[1]]);
    model
}

fn world(thickness_m: f64) -> World {
    let sides = |([x0, y0], [x1, y1]): ([f64; 2], [f64; 2])| {
        let ring = [(x0, y0), (x1, y0), (x1, y1), (x0, y1)].map(|(x, y)| Point::new(x, y));
        [0, 1, 2, 3].map(|k| Piece { a: ring[k], b: ring[(k + 1) % 4] })
    };
    let walls = blocks(thickness_m).into_iter().flat_map(sides).collect();
    World { name: "partition", walls, way: Vec::new() }
}

/// A floor whose partition is so thick, at which robots look from anywhere.
///
/// # Errors
/// A robot makes nothing of its sensor.
pub fn teach(seed: u64, thickness_m: f64) -> Result<Taught, Error> {
    let plan = Structure::of(&model(thickness_m)).plan(0.3);
    let world = world(thickness_m);
    let mut noise = Noise::of_seed(seed);
    let mut level = Level::new(LevelConfig::standard(RESOLUTION_M));
    let mut robots = [Looker::new("ada", 7)?, Looker::new("bob", 8)?];
    for look in 0..LOOKS {
        let at = loop {
            let at = Point::new(noise.share() * ROOM_M.0, noise.share() * ROOM_M.1);
            let is_free = |([x0, y0], [x1, y1]): &([f64; 2], [f64; 2])| {
                let off = [(x0 - at.x).max(at.x - x1), (y0 - at.y).max(at.y - y1)];
                off[0].max(0.0).hypot(off[1].max(0.0)) >= AWAY_M
            };
            if blocks(thickness_m).iter().all(is_free) {
                break at;
            }
        };
        let pose = (at, (noise.share() - 0.5) * std::f64::consts::TAU);
        let when = (look, START_S + 30.0 * f64::from(look));
        let robot = &mut robots[look as usize % 2];
        if let Some(contribution) = robot.look(&world, pose, when, &mut noise) {
            level.fold(&[contribution]);
        }
    }
    let segments = level.map().segments.iter().map(|(id, segment)| (id, &**segment));
    let learned = landmarks_of_map(segments, &LearnedConfig::STANDARD);
    // What is outside nobody sees.
    let is_inside = |at: &mapfold_map::geometry::Point| {
        at.x > -0.1 && at.x < ROOM_M.0 + 0.1 && at.y > -0.1 && at.y < ROOM_M.1 + 0.1
    };
    let mut planned = landmarks(&plan, &LandmarkConfig::STANDARD);
    planned.retain(|planned| is_inside(&planned.landmark.at));
    Ok(Taught { planned, learned: learned.into_values().collect() })
}
