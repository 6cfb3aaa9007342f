//! Contributions of robots that never were: looks at the walls of one hall, from a seed.

use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use mapfold_map::level::{Contribution, Level, LevelConfig};
use mapfold_schema::border::{DEFAULT_LIMITS, Target, check_contribution};
use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::v1;
use mapfold_server::level::Accepted;
use mapfold_server::store::Store;
use mapfold_server::store::levels::NewLevelRow;
use uuid::Uuid;

/// The level of all tests.
pub(crate) const SITE: &str = "plant";
pub(crate) const LEVEL: &str = "ground";
pub(crate) const FRAME: Uuid = Uuid::from_u128(0x0190_0000_0000_7000_8000_0000_0000_0001);
pub(crate) const RESOLUTION_M: f64 = 0.05;
/// When the first look is taken, microseconds since 1970.
pub(crate) const START_US: i64 = 1_790_000_000_000_000;
/// When the server takes whatever it takes.
pub(crate) const RECEIVED_US: i64 = START_US + 100 * 86_400_000_000;

pub(crate) const TARGET: Target =
    Target { frame: FRAME, resolution_m: RESOLUTION_M, limits: DEFAULT_LIMITS };

/// A hall with two inner walls, metres.
const WALLS: [[[f64; 2]; 2]; 6] = [
    [[-12.0, -8.0], [12.0, -8.0]],
    [[12.0, -8.0], [12.0, 8.0]],
    [[12.0, 8.0], [-12.0, 8.0]],
    [[-12.0, 8.0], [-12.0, -8.0]],
    [[-3.0, -2.0], [4.0, -2.0]],
    [[4.0, 2.0], [4.0, 6.0]],
];

/// Numbers from a seed (`SplitMix64`, Steele, Lea and Flood 2014).
#[derive(Debug, Clone)]
pub(crate) struct Numbers(u64);

impl Numbers {
    pub(crate) fn seeded(seed: u64) -> Self {
        Self(seed)
    }

    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// From `low` to `high`.
    pub(crate) fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * ((self.next() >> 11) as f64 / (1_u64 << 53) as f64)
    }

    /// Below `end`.
    pub(crate) fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    /// Roughly normal, standard deviation `sd`.
    fn normal(&mut self, sd: f64) -> f64 {
        let sum: f64 = (0..12).map(|_| self.between(-0.5, 0.5)).sum();
        sum * sd
    }
}

/// `count` looks of three robots; the third has only sonar.
pub(crate) fn looks(seed: u64, count: usize) -> Vec<v1::Contribution> {
    let mut numbers = Numbers::seeded(seed);
    (0..count).map(|i| look(&mut numbers, i)).collect()
}

pub(crate) const ROBOTS: [&str; 3] = ["anna", "bert", "sonja"];

fn look(numbers: &mut Numbers, i: usize) -> v1::Contribution {
    let sonar = i % 3 == 2;
    // Some looks a day: the evidence of most tests is of several slices.
    let observed_at_us = START_US + i as i64 * 7_200_000_000;
    let mut random = [0; 10];
    random.fill_with(|| numbers.next() as u8);
    let millis = observed_at_us.unsigned_abs() / 1000;
    let id = uuid::Builder::from_unix_timestamp_millis(millis, &random).into_uuid();
    let at = [numbers.between(-11.0, 11.0), numbers.between(-7.0, 7.0)];
    let heading = numbers.between(-PI, PI);
    let said = [at[0] + numbers.normal(0.02), at[1] + numbers.normal(0.02)];
    v1::Contribution {
        id,
        robot: ROBOTS[i % 3].to_owned(),
        frame: FRAME,
        observed_at: to_rfc3339(observed_at_us),
        emulated: sonar,
        pose: v1::PoseEstimate {
            x_m: said[0],
            y_m: said[1],
            heading_rad: heading,
            covariance: [[4e-4, 1e-5, 0.0], [1e-5, 4e-4, 0.0], [0.0, 0.0, 1e-5]],
            provenance: [v1::Provenance::Datum, v1::Provenance::SharedMap][i % 2],
            basis: None,
        },
        segments: if sonar { Vec::new() } else { segments(numbers, at, heading) },
        clusters: if i.is_multiple_of(4) { vec![cluster(numbers)] } else { Vec::new() },
        evidence: vec![evidence(numbers, at, sonar)],
    }
}

/// A piece of each wall that is not too far, in the robot frame.
fn segments(numbers: &mut Numbers, at: [f64; 2], heading: f64) -> Vec<v1::ObservedSegment> {
    let mut seen = Vec::new();
    for [p, q] in WALLS {
        let (a, b) = (numbers.between(0.0, 0.5), numbers.between(0.55, 1.0));
        // Now and then a look reaches as far as the corner.
        let (a, low) =
            if a < 0.1 { (0.0, v1::EndKind::Corner) } else { (a, v1::EndKind::Occluded) };
        let (b, high) = if b > 0.9 { (1.0, v1::EndKind::Corner) } else { (b, v1::EndKind::Jump) };
        let point = |t: f64| [p[0] + (q[0] - p[0]) * t - at[0], p[1] + (q[1] - p[1]) * t - at[1]];
        let turn = |d: [f64; 2]| {
            let (s, c) = heading.sin_cos();
            [c * d[0] + s * d[1], c * d[1] - s * d[0]]
        };
        let (from, to) = (turn(point(a)), turn(point(b)));
        let along = [to[0] - from[0], to[1] - from[1]];
        let mut alpha = along[1].atan2(along[0]) + PI / 2.0 + numbers.normal(0.001);
        let mut rho = alpha.cos() * from[0] + alpha.sin() * from[1] + numbers.normal(0.005);
        if rho < 0.0 {
            (rho, alpha) = (-rho, alpha + PI);
        }
        if !(0.2..=9.0).contains(&rho) {
            continue;
        }
        let coordinate = |d: [f64; 2]| alpha.cos() * d[1] - alpha.sin() * d[0];
        let (t, u) = (coordinate(from), coordinate(to));
        seen.push(v1::ObservedSegment {
            rho_m: rho,
            alpha_rad: (alpha + PI).rem_euclid(TAU) - PI,
            covariance: [[2.5e-5, 1e-7], [1e-7, 1e-6]],
            from_m: t.min(u),
            to_m: t.max(u),
            facing: v1::Facing::Origin,
            ends: if t < u { [low, high] } else { [high, low] }
                .map(|kind| v1::ObservedEnd { kind, sd_m: 0.02 }),
            points: 10 + numbers.below(90) as u32,
            seen_through_m: Vec::new(),
        });
    }
    seen
}

fn cluster(numbers: &mut Numbers) -> v1::ObservedCluster {
    let (x, y) = (numbers.between(1.0, 3.0), numbers.between(-1.0, 1.0));
    v1::ObservedCluster {
        hull_m: vec![
            [x - 0.1, y - 0.1],
            [x + 0.1, y - 0.1],
            [x + 0.1, y + 0.1],
            [x - 0.1, y + 0.1],
        ],
        centroid_m: [x, y],
        covariance: [[1e-4, 0.0], [0.0, 1e-4]],
        points: 4 + numbers.below(20) as u32,
    }
}

/// Free cells along a few rays, an occupied one at the end of each.
fn evidence(numbers: &mut Numbers, at: [f64; 2], sonar: bool) -> v1::EvidencePatch {
    let side = 64;
    let mut cells: BTreeMap<(i32, i32), BTreeMap<i32, i32>> = BTreeMap::new();
    for _ in 0..12 {
        let (bearing, range) = (numbers.between(-PI, PI), numbers.between(1.0, 4.0));
        let steps = (range / RESOLUTION_M) as i32;
        for step in 0..=steps {
            let reach = f64::from(step) * RESOLUTION_M;
            let column = ((at[0] + reach * bearing.cos()) / RESOLUTION_M).floor() as i32;
            let row = ((at[1] + reach * bearing.sin()) / RESOLUTION_M).floor() as i32;
            let tile = (column.div_euclid(side), row.div_euclid(side));
            let offset = row.rem_euclid(side) * side + column.rem_euclid(side);
            let value = if step == steps { 85 } else { -40 };
            cells.entry(tile).or_default().insert(offset, value);
        }
    }
    let tiles = cells.into_iter().map(|((x, y), cells)| {
        let mut runs: Vec<i32> = Vec::new();
        for (offset, value) in cells {
            match runs.as_chunks_mut::<3>().0.last_mut() {
                Some([start, length, same]) if *start + *length == offset && *same == value => {
                    *length += 1;
                }
                _ => runs.extend([offset, 1, value]),
            }
        }
        v1::TilePatch { x, y, runs }
    });
    v1::EvidencePatch {
        sensor: if sonar { v1::SensorClass::Sonar } else { v1::SensorClass::Scanner },
        tiles: tiles.collect(),
    }
}

/// As the border makes it.
pub(crate) fn checked(look: &v1::Contribution) -> Contribution {
    check_contribution(look, &TARGET).unwrap()
}

/// As a handler hands it in.
pub(crate) fn accepted(look: &v1::Contribution) -> Accepted {
    Accepted::new(look.clone(), checked(look), RECEIVED_US).unwrap()
}

/// All of them folded at once, by no path of the server's.
pub(crate) fn folded(looks: &[v1::Contribution]) -> Level {
    let contributions: Vec<Contribution> = looks.iter().map(checked).collect();
    let mut level = Level::new(LevelConfig::standard(RESOLUTION_M));
    level.fold(&contributions);
    level
}

/// Makes the site, the level and the robots.
pub(crate) async fn furnish(store: &Store) {
    store.create_site(SITE, "Plant", START_US).await.unwrap();
    store.create_level(SITE, &new_level(LEVEL)).await.unwrap();
    for robot in ROBOTS {
        store.create_robot(SITE, &new_robot(robot), START_US).await.unwrap();
    }
}

pub(crate) fn new_level(level: &str) -> NewLevelRow<'_> {
    NewLevelRow {
        level,
        name: "Ground floor",
        frame: FRAME,
        resolution_m: RESOLUTION_M,
        elevation_m: -1.5,
        slice_s: 86_400,
        created_at_us: START_US,
    }
}

pub(crate) fn new_robot(robot: &str) -> v1::NewRobot {
    let kind = if robot == "sonja" { v1::SensorKind::Sonar } else { v1::SensorKind::Scanner };
    v1::NewRobot {
        robot: robot.to_owned(),
        name: None,
        sensors: vec![v1::SensorProfile {
            model: "of no make".to_owned(),
            emulated: robot == "sonja",
            ..v1::SensorProfile::new(kind, 8.0, 0.01, 0.01)
        }],
    }
}
