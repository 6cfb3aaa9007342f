//! Evidence of a fleet: a thousand patches of ten robots in any order, and with one robot left out.

use std::sync::Arc;

use mapfold_map::geometry::{Covariance, Pose, UncertainPose};
use mapfold_map::level::{Contribution, Level, LevelConfig, Provenance};
use mapfold_map::raster::{EvidencePatch, EvidenceRun, SensorClass, TileIndex, TilePatch};

use crate::world::{Chance, id};

const ROBOTS: u64 = 10;
const LOOKS: u64 = 1000;

/// Runs of free and occupied cells on a few of the same tiles, over some days.
fn patches(seed: u64) -> Vec<Contribution> {
    let mut chance = Chance(seed);
    let look = |number: u64| {
        let mut tiles = std::collections::BTreeMap::new();
        for _ in 0..3 {
            let index =
                TileIndex { x: (chance.bits() % 4) as i32 - 2, y: (chance.bits() % 3) as i32 };
            let mut start = (chance.bits() % 64) as u16;
            let mut runs = Vec::new();
            while start < 3900 {
                let length = (chance.bits() % 90) as u16 + 1;
                let value = [-40, -20, 85, 300, 7][(chance.bits() % 5) as usize];
                runs.push(EvidenceRun { start, length, value });
                start += length + (chance.bits() % 200) as u16;
            }
            tiles.insert(index, TilePatch::new(runs).unwrap());
        }
        let robot = number % ROBOTS;
        let class = SensorClass::ALL[usize::from(robot >= 3)];
        Contribution {
            id: id(seed, number),
            robot: Arc::from(format!("robot-{robot}")),
            observed_at_us: 300_000_000 * number as i64,
            level_from_robot: UncertainPose {
                pose: Pose::identity(),
                covariance: Covariance::from_variances([1e-4, 1e-4, 1e-5]),
            },
            provenance: Provenance::SharedMap,
            segments: Vec::new(),
            clusters: Vec::new(),
            evidence: vec![EvidencePatch { class, tiles }],
        }
    };
    (0..LOOKS).map(look).collect()
}

fn folded(looks: &[Contribution], batch: usize) -> Level {
    let mut level = Level::new(LevelConfig::standard(0.05));
    for some in looks.chunks(batch) {
        level.fold(some);
    }
    level
}

#[test]
fn a_thousand_patches_of_ten_robots_in_any_order_give_the_same_tiles() {
    let patches = patches(1);
    let in_order = folded(&patches, 1000);
    assert_eq!(in_order.map().tiles.len(), 2 * 4 * 3, "all tiles of both layers");
    let mut chance = Chance(2);
    for batch in [1, 7, 64, 1000] {
        let shuffled = folded(&chance.shuffled(patches.clone()), batch);
        assert_eq!(shuffled.map(), in_order.map(), "in batches of {batch}");
    }
}

#[test]
fn without_one_robot_is_as_if_it_had_never_been() {
    let patches = patches(3);
    let mut chance = Chance(4);
    for robot in ["robot-0", "robot-4", "robot-9"] {
        let (its, others): (Vec<_>, Vec<_>) =
            patches.iter().cloned().partition(|look| &*look.robot == robot);
        assert_eq!(its.len() as u64, LOOKS / ROBOTS);
        let mut level = folded(&chance.shuffled(patches.clone()), 50);
        for some in chance.shuffled(its.clone()).chunks(9) {
            level.unfold(some);
        }
        let never = folded(&others, 1000);
        assert_eq!(level.map(), never.map(), "{robot}");
        level.fold(&its);
        assert_eq!(level.map(), folded(&patches, 1000).map(), "{robot} back again");
    }
}
