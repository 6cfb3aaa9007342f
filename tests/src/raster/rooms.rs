//! Rooms of smooth walls, and drives through them with a ring of sonars or a scanner.

use mapfold_client::robot::at_rest::{AtRestConfig, steady};
use mapfold_client::sensor::{
    MountedAt, Ring, Scan, ScanGeometry, ScannerProfile, Sonar, SonarProfile,
};
use mapfold_map::geometry::{Covariance, Level, Pose, Robot, UncertainPose};

use crate::plane::{Piece, Point};
use crate::simulation::{Noise, Scanner, SonarRing, World};

/// Nearer to a wall no robot stops, metres.
const CLEARANCE_M: f64 = 0.35;

/// A room by chance: four walls, a box, and a thin piece of wall that juts out.
pub(super) fn room(noise: &mut Noise) -> World {
    let mut between = |from: f64, to: f64| from + noise.share() * (to - from);
    let (wide, high) = (between(7.0, 9.0), between(5.0, 7.0));
    let mut walls = rectangle(0.0, 0.0, wide, high);
    let (x, y) = (between(2.2, 3.6), between(1.6, high - 3.0));
    walls.extend(rectangle(x, y, x + between(0.6, 1.2), y + between(0.6, 1.2)));
    let (x, length) = (between(5.0, wide - 1.2), between(1.0, 1.8));
    let jut = [(x, high), (x, high - length), (x + 0.2, high - length), (x + 0.2, high)];
    walls.extend(chain(&jut));
    World { name: "room", walls, way: vec![Point::new(0.8, 0.8)] }
}

fn chain(corners: &[(f64, f64)]) -> Vec<Piece> {
    let point = |(x, y): (f64, f64)| Point::new(x, y);
    corners.windows(2).map(|ends| Piece { a: point(ends[0]), b: point(ends[1]) }).collect()
}

fn rectangle(left: f64, low: f64, right: f64, high: f64) -> Vec<Piece> {
    chain(&[(left, low), (right, low), (right, high), (left, high), (left, low)])
}

/// Places in the first four walls where a robot can stand, and where it looks there.
pub(super) fn stops(world: &World, count: usize, noise: &mut Noise) -> Vec<(Point, f64)> {
    let (low, high) = (world.walls[0].a, world.walls[1].b);
    let mut stops = Vec::new();
    let is_clear = |at: Point| world.walls.iter().all(|wall| wall.distance(at) > CLEARANCE_M);
    // From inside of a box, the first wall to the left is near.
    let is_inside = |at: Point| {
        let to_left = Piece { a: at, b: Point::new(low.x - 1.0, at.y + 1e-4) };
        world.walls.iter().filter(|wall| to_left.crossing(wall).is_some()).count() % 2 == 1
    };
    while stops.len() < count {
        let at = Point::new(
            low.x + noise.share() * (high.x - low.x),
            low.y + noise.share() * (high.y - low.y),
        );
        if is_clear(at) && is_inside(at) {
            stops.push((at, noise.share() * std::f64::consts::TAU));
        }
    }
    stops
}

/// A pose as a robot would claim it, with so much uncertainty.
pub(super) fn claimed(
    (at, heading): (Point, f64),
    sd_m: f64,
    sd_rad: f64,
) -> UncertainPose<Level, Robot> {
    let (p, h) = (sd_m * sd_m, sd_rad * sd_rad);
    UncertainPose {
        pose: Pose::new(at.x, at.y, heading),
        covariance: Covariance::from_variances([p, p, h]),
    }
}

/// What a ring's maker says of it.
pub(super) fn sonar_profile(ring: &SonarRing) -> SonarProfile {
    SonarProfile {
        model: String::new(),
        range_min_m: 0.15,
        range_max_m: ring.range_max_m,
        range_sd_m: 0.03,
        range_sd_per_m: 0.01,
        cone_rad: ring.cone_rad,
        transducers: Vec::new(),
    }
}

/// What a robot with this ring hears at a stop, in so many rounds.
pub(super) fn hear(
    ring: &SonarRing,
    world: &World,
    stop: (Point, f64),
    rounds: usize,
    noise: &mut Noise,
) -> Ring {
    let told = ring.ping_rounds(world, stop, rounds, noise).into_iter().map(|ranges| Ring {
        cone: ring.cone_rad,
        sonars: ring
            .bearings_rad
            .iter()
            .zip(ranges)
            .map(|(bearing, range)| Sonar {
                robot_from_sensor: Pose::new(0.0, 0.0, *bearing),
                range: (range > 0.0).then_some(range),
                is_steady: true,
            })
            .collect(),
    });
    let told: Vec<Ring> = told.collect();
    steady(&told.iter().collect::<Vec<_>>(), &AtRestConfig::STANDARD)
        .or_else(|| told.into_iter().next())
        .unwrap_or(Ring { cone: ring.cone_rad, sonars: Vec::new() })
}

/// What a scanner's maker says of it.
pub(super) fn scanner_profile(scanner: &Scanner) -> ScannerProfile {
    ScannerProfile {
        model: String::new(),
        range_min_m: 0.05,
        range_max_m: scanner.cap_m,
        range_sd_m: scanner.range_sd_m,
        range_sd_per_m: 0.0,
        bearing_sd_rad: 1e-3,
        systematic_sd_m: 0.005,
        mount: MountedAt::default(),
        correction: None,
    }
}

/// What a robot with this scanner sees at a stop.
pub(super) fn see(scanner: &Scanner, world: &World, stop: (Point, f64), noise: &mut Noise) -> Scan {
    Scan {
        geometry: ScanGeometry {
            first_bearing: (-90_f64).to_radians(),
            increment: 1_f64.to_radians(),
        },
        ranges: scanner.scan(world, stop, noise),
        range_max: scanner.cap_m,
        robot_from_sensor: Pose::identity(),
        repeats: Vec::new(),
    }
}
