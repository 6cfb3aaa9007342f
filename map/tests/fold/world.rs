//! A little building and looks at it, from a seed. Shares no formula with the fold: segments are
//! seen by moving end points, evidence by sampling along rays.

use std::collections::BTreeMap;
use std::sync::Arc;

use mapfold_map::geometry::{Covariance, Point, Pose, UncertainLine, UncertainPose, convex_hull};
use mapfold_map::level::{Contribution, ContributionId, Provenance};
use mapfold_map::raster::{Cell, EvidencePatch, SensorClass, TILE_CELLS, TilePatch};
use mapfold_map::vector::{EndKind, Facing, ObservedCluster, ObservedEnd, ObservedSegment};

/// A seeded source of chance (the `SplitMix64` generator).
pub(crate) struct Chance(pub(crate) u64);

impl Chance {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.bits() >> 11) as f64 / (1_u64 << 53) as f64)
    }

    pub(crate) fn normal(&mut self, sd: f64) -> f64 {
        let (a, b) = (self.uniform(1e-12, 1.0), self.uniform(0.0, std::f64::consts::TAU));
        sd * (-2.0 * a.ln()).sqrt() * b.cos()
    }

    pub(crate) fn shuffled<T>(&mut self, mut items: Vec<T>) -> Vec<T> {
        for i in (1..items.len()).rev() {
            items.swap(i, (self.bits() % (i as u64 + 1)) as usize);
        }
        items
    }
}

/// Standard deviations of a look.
#[derive(Clone, Copy)]
pub(crate) struct Noise {
    pub(crate) position: f64,
    pub(crate) heading: f64,
    pub(crate) offset: f64,
    pub(crate) angle: f64,
}

pub(crate) const NOISE: Noise =
    Noise { position: 0.02, heading: 0.004, offset: 0.004, angle: 0.002 };

/// A segment of the true line through `a` and `b` (level frame) as a robot at the true pose sees
/// it, with errors drawn about its middle.
pub(crate) fn observe(
    a: Point,
    b: Point,
    robot: &Pose<mapfold_map::geometry::Level, mapfold_map::geometry::Robot>,
    noise: Noise,
    chance: &mut Chance,
) -> ObservedSegment {
    let inverse = robot.inverse();
    let (a, b) = (inverse.act(&a), inverse.act(&b));
    let middle = (a + b) * 0.5;
    let direction = (b - a).normalize();
    let angle = chance.normal(noise.angle);
    let (s, c) = angle.sin_cos();
    let direction =
        Point::new(c * direction.x - s * direction.y, s * direction.x + c * direction.y);
    let normal = Point::new(direction.y, -direction.x);
    let middle = middle + normal * chance.normal(noise.offset);
    let alpha = normal.y.atan2(normal.x);
    let rho = normal.dot(&middle);
    let along = Point::new(-alpha.sin(), alpha.cos()).dot(&middle);
    let (r, q) = (noise.offset.powi(2), noise.angle.powi(2));
    // rho = offset + n(alpha).middle: d(rho)/d(alpha) = u.middle = along
    let covariance =
        Covariance::new(nalgebra::Matrix2::new(r + along * along * q, along * q, along * q, q))
            .unwrap();
    let (line, turned) = UncertainLine::normal_form(rho, alpha, covariance);
    let along = if turned { -along } else { along };
    let half = (b - a).norm() * 0.5;
    let end = ObservedEnd { kind: EndKind::Jump, sd: 0.01 };
    ObservedSegment {
        line,
        from: along - half,
        to: along + half,
        facing: Facing::Origin,
        ends: [end, end],
        points: (half * 40.0) as u32 + 5,
        seen_through: Vec::new(),
    }
}

pub(crate) fn id(seed: u64, number: u64) -> ContributionId {
    let mut bytes = [0; 16];
    bytes[..8].copy_from_slice(&Chance(seed ^ (number << 20)).bits().to_be_bytes());
    bytes[8..].copy_from_slice(&number.to_be_bytes());
    ContributionId(bytes)
}

/// The rooms' corners: two rooms side by side with a wall of 12 cm between them.
const ROOMS: [[f64; 4]; 2] = [[0.3, 0.2, 6.1, 5.0], [6.22, 0.2, 11.0, 5.0]];

/// Evidence of free rays from the robot to the walls of its room, sampled.
pub(crate) fn evidence(
    robot: &Pose<mapfold_map::geometry::Level, mapfold_map::geometry::Robot>,
    ends: &[Point],
    class: SensorClass,
) -> EvidencePatch {
    let resolution = 0.05;
    let mut cells: BTreeMap<_, Box<[i16; TILE_CELLS]>> = BTreeMap::new();
    for end in ends {
        let reach = end - robot.position();
        let steps = (reach.norm() / 0.04) as i32;
        for step in 0..=steps {
            let p = robot.position() + reach * (f64::from(step) / f64::from(steps.max(1)));
            let (tile, offset) = Cell::holding(&p, resolution).tile();
            let cell = &mut cells.entry(tile).or_insert_with(|| Box::new([0; TILE_CELLS]))[offset];
            *cell = if step == steps { 85 } else { -40 };
        }
    }
    let tiles = cells.into_iter().map(|(t, c)| (t, TilePatch::from_cells(&c))).collect();
    EvidencePatch { class, tiles }
}

/// `count` looks of three robots at the rooms, from a seed.
pub(crate) fn looks(seed: u64, count: u64, noise: Noise) -> Vec<Contribution> {
    let mut chance = Chance(seed);
    (0..count)
        .map(|number| {
            let room = ROOMS[(chance.bits() % 2) as usize];
            let truth = Pose::new(
                chance.uniform(room[0] + 0.5, room[2] - 0.5),
                chance.uniform(room[1] + 0.5, room[3] - 0.5),
                chance.uniform(-3.0, 3.0),
            );
            let claimed = Pose::new(
                truth.x + chance.normal(noise.position),
                truth.y + chance.normal(noise.position),
                truth.heading() + chance.normal(noise.heading),
            );
            let corner = |i: usize| {
                let [x0, y0, x1, y1] = room;
                [Point::new(x0, y0), Point::new(x1, y0), Point::new(x1, y1), Point::new(x0, y1)]
                    [i % 4]
            };
            let mut segments = Vec::new();
            for wall in 0..4 {
                let (a, b) = (corner(wall), corner(wall + 1));
                let (from, to) = (chance.uniform(0.0, 0.5), chance.uniform(0.6, 1.0));
                if chance.uniform(0.0, 1.0) < 0.8 {
                    let (a, b) = (a + (b - a) * from, a + (b - a) * to);
                    segments.push(observe(a, b, &truth, noise, &mut chance));
                }
            }
            let (robot_class, ends) = if number % 3 == 2 {
                segments.clear();
                (SensorClass::Sonar, 3)
            } else {
                (SensorClass::Scanner, 12)
            };
            let hits: Vec<Point> = (0..ends)
                .map(|_| {
                    let (a, b) = {
                        let wall = (chance.bits() % 4) as usize;
                        (corner(wall), corner(wall + 1))
                    };
                    a + (b - a) * chance.uniform(0.0, 1.0)
                })
                .collect();
            let seen = truth.inverse().act(&Point::new(room[0] + 2.0, room[1] + 2.0));
            let corners: Vec<Point> =
                (0..6).map(|_| seen + Point::new(chance.normal(0.1), chance.normal(0.1))).collect();
            let cluster = ObservedCluster {
                hull: convex_hull(&corners),
                centroid: corners.iter().sum::<Point>() / 6.0,
                covariance: Covariance::from_variances([1e-4, 1e-4]),
                points: 6,
            };
            Contribution {
                id: id(seed, number),
                robot: Arc::from(["ada", "bob", "cy"][(number % 3) as usize]),
                // Some ten looks a day.
                observed_at_us: 8_000_000_000 * number as i64,
                level_from_robot: UncertainPose {
                    pose: claimed,
                    covariance: Covariance::from_variances([
                        noise.position.powi(2),
                        noise.position.powi(2),
                        noise.heading.powi(2),
                    ]),
                },
                provenance: Provenance::SharedMap,
                segments,
                clusters: if number % 2 == 0 { vec![cluster] } else { Vec::new() },
                evidence: vec![evidence(&claimed, &hits, robot_class)],
            }
        })
        .collect()
}
