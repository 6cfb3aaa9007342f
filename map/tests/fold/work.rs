//! What one more look makes the fold do depends on its surroundings, not on the size of the map.

use std::sync::Arc;

use mapfold_map::geometry::{Covariance, Point, Pose, UncertainPose, convex_hull};
use mapfold_map::level::{Contribution, Level, LevelConfig, Provenance};
use mapfold_map::raster::SensorClass;
use mapfold_map::vector::{ObservedCluster, Work};

use crate::world::{Chance, NOISE, evidence, id, observe};

/// From wall to wall, metres, and how far apart two rooms are.
const ROOM: f64 = 4.0;
const PITCH: f64 = 4.12;

/// A look at a room of a floor without end: all that chance decides is the room's and the look's own.
fn look(column: i32, row: i32, number: u64) -> Contribution {
    let cell = (u64::from(column.cast_unsigned()) << 32) | u64::from(row.cast_unsigned());
    let mut chance = Chance(cell ^ (number << 17));
    let low = Point::new(f64::from(column) * PITCH, f64::from(row) * PITCH);
    let corners = [(0.0, 0.0), (ROOM, 0.0), (ROOM, ROOM), (0.0, ROOM)];
    let corners = corners.map(|(x, y)| low + Point::new(x, y));
    let truth = Pose::new(
        low.x + chance.uniform(1.0, 3.0),
        low.y + chance.uniform(1.0, 3.0),
        chance.uniform(-3.0, 3.0),
    );
    let claimed = Pose::new(
        truth.x + chance.normal(NOISE.position),
        truth.y + chance.normal(NOISE.position),
        truth.heading() + chance.normal(NOISE.heading),
    );
    let segments = (0..4)
        .map(|k| observe(corners[k], corners[(k + 1) % 4], &truth, NOISE, &mut chance))
        .collect();
    let hits: Vec<Point> = (0..40)
        .map(|k| {
            let (a, b) = (corners[k % 4], corners[(k + 1) % 4]);
            a + (b - a) * chance.uniform(0.0, 1.0)
        })
        .collect();
    let seen = truth.inverse().act(&(low + Point::new(2.0, 2.0)));
    let hull: Vec<Point> =
        (0..6).map(|_| seen + Point::new(chance.normal(0.1), chance.normal(0.1))).collect();
    Contribution {
        id: id(cell, number),
        robot: Arc::from("ada"),
        observed_at_us: 0,
        level_from_robot: UncertainPose {
            pose: claimed,
            covariance: Covariance::from_variances([4e-4, 4e-4, 1.6e-5]),
        },
        provenance: Provenance::SharedMap,
        segments,
        clusters: vec![ObservedCluster {
            hull: convex_hull(&hull),
            centroid: seen,
            covariance: Covariance::from_variances([1e-4, 1e-4]),
            points: 6,
        }],
        evidence: vec![evidence(&claimed, &hits, SensorClass::Scanner)],
    }
}

/// The rooms not more than `reach` from the one in the middle, each seen twice.
fn floor(reach: i32) -> Level {
    let rooms = (-reach..=reach).flat_map(|x| (-reach..=reach).map(move |y| (x, y)));
    let looks: Vec<Contribution> =
        rooms.flat_map(|(x, y)| [look(x, y, 0), look(x, y, 1)]).collect();
    let mut level = Level::new(LevelConfig::standard(0.05));
    level.fold(&looks);
    level
}

/// The work of folding looks in and out again, one by one.
fn work_of(level: &mut Level, looks: &[Contribution]) -> Vec<Work> {
    let mut done = Vec::new();
    let mut before = level.work();
    let mut note = |level: &Level| {
        done.push(level.work() - before);
        before = level.work();
    };
    for look in looks {
        level.fold([look]);
        note(level);
    }
    for look in looks {
        level.unfold([look]);
        note(level);
    }
    done
}

#[test]
fn one_more_look_is_as_much_work_in_a_large_map_as_in_a_small_one() {
    let looks: Vec<Contribution> = (2..8).map(|number| look(0, 0, number)).collect();
    let (mut small, mut large) = (floor(2), floor(16));
    assert!(large.map().segments.len() > 40 * small.map().segments.len());
    let (in_small, in_large) = (work_of(&mut small, &looks), work_of(&mut large, &looks));
    assert_eq!(in_small, in_large);
    let all = in_large.iter().fold(Work::default(), |sum, work| sum + *work);
    let done = [
        all.pairings,
        all.walls_fused,
        all.walls_against_grid,
        all.walls_published,
        all.joints,
        all.gaps_against_grid,
        all.chain_pieces,
    ];
    assert!(done.iter().all(|count| *count > 0), "{all:?}");
}

#[test]
fn a_look_that_sees_nothing_new_concerns_only_the_walls_around_it() {
    let mut level = floor(8);
    let walls = level.map().segments.len() as u64;
    let before = level.work();
    level.fold([&look(0, 0, 2)]);
    let work = level.work() - before;
    assert!(work.walls_fused <= 4, "{work:?}");
    // At most those of this room and of the eight around it.
    assert!(work.walls_against_grid <= 36, "{work:?} of {walls}");
    assert!(work.walls_published <= 36, "{work:?} of {walls}");
}
