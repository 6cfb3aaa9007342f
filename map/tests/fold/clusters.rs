//! What becomes of clusters: fused, explained by walls, looked through.

use std::sync::Arc;

use mapfold_map::geometry::{Covariance, Point, convex_hull};
use mapfold_map::level::Contribution;
use mapfold_map::raster::SensorClass;
use mapfold_map::vector::{Cluster, ObservedCluster};

use crate::walls::{EXACT, area, folded, look};

/// A look that saw a cluster with these corners in the level.
fn thing(number: u64, corners: &[(f64, f64)]) -> Contribution {
    let bare = look(number, &[], Point::new(3.0, 1.0), EXACT);
    let inverse = bare.level_from_robot.pose.inverse();
    let corners: Vec<Point> =
        corners.iter().map(|(x, y)| inverse.act(&Point::new(*x, *y))).collect();
    let cluster = ObservedCluster {
        hull: convex_hull(&corners),
        centroid: corners.iter().sum::<Point>() / corners.len() as f64,
        covariance: Covariance::from_variances([1e-4, 1e-4]),
        points: corners.len() as u32,
    };
    Contribution { clusters: vec![cluster], ..bare }
}

fn clusters(looks: &[Contribution]) -> Vec<Arc<Cluster>> {
    folded(looks).map().clusters.values().cloned().collect()
}

const NEAR: [(f64, f64); 3] = [(2.0, 2.0), (2.2, 2.0), (2.1, 2.2)];

#[test]
fn looks_at_one_thing_are_fused_and_those_at_two_are_not() {
    let beside = NEAR.map(|(x, y)| (x + 0.25, y));
    let apart = NEAR.map(|(x, y)| (x + 1.5, y));
    let fused = clusters(&[thing(0, &NEAR), thing(1, &beside)]);
    assert_eq!(fused.len(), 1);
    assert_eq!((fused[0].looks, fused[0].points), (2, 6));
    assert!((fused[0].centroid - Point::new(2.225, 2.0667)).norm() < 1e-3);
    assert_eq!(clusters(&[thing(0, &NEAR), thing(1, &apart)]).len(), 2);
}

#[test]
fn a_thing_is_known_no_better_than_the_looks_that_its_place_comes_from() {
    // Sure of a few points, vague about many: the many decide where the thing is.
    let sure = thing(0, &NEAR);
    let mut vague = thing(1, &NEAR);
    vague.clusters[0].points = 60;
    vague.clusters[0].covariance = Covariance::from_variances([0.0064, 0.0064]);
    let fused = clusters(&[sure, vague]);
    assert_eq!(fused.len(), 1);
    let sd = fused[0].covariance.sd(0);
    // The poses' 5 mm come on top: sqrt((3 x 0.01^2 + 60 x 0.08^2) / 63 + 0.005^2 + ...).
    assert!((0.078..0.085).contains(&sd), "{sd}");
}

/// Hits on the wall y = 3 and just before it.
const ON_THE_WALL: [(f64, f64); 4] = [(2.0, 3.01), (2.5, 2.99), (2.3, 2.95), (2.1, 3.03)];

#[test]
fn a_cluster_that_a_wall_explains_is_not_published_until_the_wall_is_taken_out() {
    let wall =
        look(9, &[(Point::new(1.0, 3.0), Point::new(5.0, 3.0))], Point::new(3.0, 1.0), EXACT);
    let alone = folded(&[thing(0, &ON_THE_WALL)]);
    assert_eq!(alone.map().clusters.len(), 1);
    let mut level = alone.clone();
    let changes = level.fold([&wall]);
    assert!(level.map().clusters.is_empty());
    assert_eq!(changes.clusters.len(), 1);
    level.unfold([&wall]);
    assert_eq!(level.map(), alone.map());
    // The other way round, and beside a wall or past its end: that is something else.
    assert!(clusters(&[wall.clone(), thing(0, &ON_THE_WALL)]).is_empty());
    assert_eq!(
        clusters(&[wall.clone(), thing(0, &ON_THE_WALL.map(|(x, y)| (x, y - 0.4)))]).len(),
        1
    );
    assert_eq!(
        clusters(&[wall.clone(), thing(0, &ON_THE_WALL.map(|(x, y)| (x + 2.8, y)))]).len(),
        1
    );
    assert_eq!(clusters(&[wall, thing(0, &[(2.0, 3.0), (2.2, 2.8), (2.4, 3.0)])]).len(), 1);
}

#[test]
fn a_cluster_in_a_doorway_is_explained_only_by_what_is_solid() {
    let wall =
        look(9, &[(Point::new(1.0, 3.0), Point::new(5.0, 3.0))], Point::new(3.0, 1.0), EXACT);
    let door = area(10, [1.9, 2.9], [2.5, 3.5], -200, SensorClass::Scanner);
    // Something stood in the doorway, marked by hits that outweigh the looks through it.
    let marked = area(11, [1.9, 2.7], [2.9, 3.1], 150, SensorClass::Scanner);
    let looks = [wall, door, marked, thing(0, &ON_THE_WALL)];
    assert_eq!(clusters(&looks[2..]).len(), 1);
    let level = folded(&looks);
    assert_eq!(level.map().segments.values().next().unwrap().solid.len(), 2);
    assert_eq!(level.map().clusters.len(), 1);
}

#[test]
fn a_cluster_that_scanners_look_through_is_gone_until_the_evidence_is_taken_out() {
    let free = area(5, [1.5, 2.7], [1.5, 2.7], -200, SensorClass::Scanner);
    let sonar = area(6, [1.5, 2.7], [1.5, 2.7], -200, SensorClass::Sonar);
    let looks = [thing(0, &NEAR), free];
    let mut level = folded(&looks);
    assert!(level.map().clusters.is_empty());
    level.unfold(&looks[1..]);
    assert_eq!(level.map().clusters.len(), 1);
    level.fold([&sonar]);
    assert_eq!(level.map().clusters.len(), 1, "sonar hears too wide to say so");
}
