//! All clusters of a level: observations in, published clusters out, as a function of the set.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use nalgebra::Matrix2;

use super::by_block::ByBlock;
use super::explained::Explained;
use super::leaders::{Groupable, Leaders, Member};
use super::seen_through::{Evidence, all_free};
use super::{Cluster, ObservedCluster, Segment, VectorConfig, Work};
use crate::geometry::{Covariance, Point, convex_hull, distance_to_hull};
use crate::level::{Contribution, FeatureId, RobotName};
use crate::raster::{Blocks, TileIndex, Touched};

/// A cluster as one look saw it, in the level frame.
#[derive(Debug, Clone)]
struct Sight {
    hull: Vec<Point>,
    centroid: Point,
    covariance: Matrix2<f64>,
    points: u32,
    robot: RobotName,
    observed_at_us: i64,
}

impl Sight {
    fn new(cluster: &ObservedCluster, look: &Contribution) -> Self {
        let pose = &look.level_from_robot.pose;
        let (s, c) = pose.heading().sin_cos();
        let rotation = Matrix2::new(c, -s, s, c);
        let j_pose = pose.j_point_pose(&cluster.centroid);
        let covariance = cluster.covariance.transformed(&rotation)
            + look.level_from_robot.covariance.transformed(&j_pose);
        Self {
            hull: cluster.hull.iter().map(|p| pose.act(p)).collect(),
            centroid: pose.act(&cluster.centroid),
            covariance: *covariance.matrix(),
            points: cluster.points,
            robot: look.robot.clone(),
            observed_at_us: look.observed_at_us,
        }
    }

    fn extent(&self) -> (Point, Point) {
        self.hull
            .iter()
            .fold((self.centroid, self.centroid), |(low, high), p| (low.inf(p), high.sup(p)))
    }
}

impl Groupable for Sight {
    type Config = VectorConfig;

    fn reach(&self) -> (Point, Point) {
        // Half of the largest gap across which two clusters pair.
        const MARGIN: f64 = 0.15;
        let (low, high) = self.extent();
        let margin = Point::new(MARGIN, MARGIN);
        (low - margin, high + margin)
    }

    fn merit(&self) -> f64 {
        f64::from(self.points)
    }

    /// The distance of the hulls (nearest vertex of either to the other), against the uncertainty
    /// of their places.
    fn pairing(&self, follower: &Self, config: &VectorConfig) -> Option<f64> {
        let to = |hull: &[Point], from: &[Point]| {
            from.iter().map(|p| distance_to_hull(p, hull)).fold(f64::INFINITY, f64::min)
        };
        let gap = to(&self.hull, &follower.hull).min(to(&follower.hull, &self.hull));
        let variance = (self.covariance + follower.covariance).trace() * 0.5;
        let allowed = (config.cluster_gap + 3.0 * variance.sqrt()).min(config.cluster_gap_max);
        (gap <= allowed).then(|| (self.centroid - follower.centroid).norm())
    }
}

/// The state of the fold of clusters.
#[derive(Debug, Clone, Default)]
pub(crate) struct Things {
    sights: Leaders<Sight>,
    /// Every cluster, published or not.
    clusters: BTreeMap<FeatureId, Arc<Cluster>>,
    by_block: ByBlock<FeatureId>,
    explained: Explained,
}

impl Things {
    /// As [`super::walls::Walls::update`], for clusters; `changed` are the `segments` that it
    /// changed. A cluster that scanners look through, or that a wall explains, is not published.
    #[expect(clippy::too_many_arguments, reason = "the map's layers and what changed in them")]
    pub(crate) fn update<E: Evidence>(
        &mut self,
        inserted: &[&Contribution],
        removed: &[&Contribution],
        touched: &Touched,
        changed: &BTreeSet<FeatureId>,
        segments: &BTreeMap<FeatureId, Arc<Segment>>,
        grid: &E,
        published: &mut BTreeMap<FeatureId, Arc<Cluster>>,
        config: &VectorConfig,
    ) -> BTreeSet<FeatureId> {
        let id = |look: &Contribution, index| FeatureId { contribution: look.id, index };
        let sights = inserted.iter().flat_map(|look| {
            (0_u16..)
                .zip(&look.clusters)
                .map(|(i, cluster)| (id(look, i), Sight::new(cluster, look)))
        });
        let gone: Vec<FeatureId> = removed
            .iter()
            .flat_map(|look| (0_u16..).zip(&look.clusters).map(|(i, _)| id(look, i)))
            .collect();
        let regrouped = self.sights.update(sights, &gone, config);
        for leader in &regrouped {
            self.fuse(*leader, grid.resolution());
        }
        let mut unpublished: BTreeSet<FeatureId> = regrouped.iter().map(|m| m.id).collect();
        unpublished.extend(self.by_block.touched(touched));
        unpublished.extend(self.explained.follow(changed, segments));
        let mut changed = BTreeSet::new();
        for id in unpublished {
            let cluster = self.clusters.get(&id).filter(|cluster| {
                let points = cluster.hull.iter().chain([&cluster.centroid]);
                !all_free(points, grid, config)
                    && !self.explained.is_explained(cluster, segments, config)
            });
            if published.get(&id).map(AsRef::as_ref) == cluster.map(AsRef::as_ref) {
                continue;
            }
            match cluster {
                Some(cluster) => published.insert(id, Arc::clone(cluster)),
                None => published.remove(&id),
            };
            changed.insert(id);
        }
        changed
    }

    /// What this has done so far.
    pub(crate) fn work(&self) -> Work {
        Work { pairings: self.sights.pairings(), ..Work::default() }
    }

    /// Makes the cluster of a group anew, or ends it with its group.
    fn fuse(&mut self, leader: Member, resolution: f64) {
        let id = leader.id;
        if let Some(old) = self.clusters.remove(&id) {
            self.by_block.remove(id, &blocks_of(&old, resolution));
            self.explained.forget(id, &old);
        }
        let Some(group) = self.sights.group(leader) else { return };
        if let Some(cluster) = fuse_group(group) {
            self.by_block.insert(id, &blocks_of(&cluster, resolution));
            self.explained.note(id, &cluster);
            self.clusters.insert(id, Arc::new(cluster));
        }
    }
}

/// The blocks under a hull's corners and centre.
fn blocks_of(cluster: &Cluster, resolution: f64) -> Vec<(TileIndex, Blocks)> {
    let points = cluster.hull.iter().chain([&cluster.centroid]);
    Blocks::under(points.copied(), resolution)
}

/// Hull of all hulls, centroid averaged by points. Looks at one thing see different sides of it, and
/// their pose errors may be shared: the covariance is the looks' own, averaged by points as well, which
/// is no less than that of such a mean whatever they share (Jensen).
fn fuse_group<'a>(group: impl Iterator<Item = (FeatureId, &'a Sight)>) -> Option<Cluster> {
    let mut corners = Vec::new();
    let mut sum = Point::zeros();
    let mut points: u64 = 0;
    let mut spread = Matrix2::zeros();
    let mut robots = Vec::new();
    let (mut looks, mut last_look) = (0, None);
    let (mut first_seen_us, mut last_seen_us) = (i64::MAX, i64::MIN);
    for (id, sight) in group {
        corners.extend_from_slice(&sight.hull);
        sum += sight.centroid * f64::from(sight.points);
        points += u64::from(sight.points);
        spread += sight.covariance * f64::from(sight.points);
        if last_look != Some(id.contribution) {
            looks += 1;
            last_look = Some(id.contribution);
        }
        robots.push(sight.robot.clone());
        first_seen_us = first_seen_us.min(sight.observed_at_us);
        last_seen_us = last_seen_us.max(sight.observed_at_us);
    }
    robots.sort_unstable();
    robots.dedup();
    if points == 0 {
        return None;
    }
    Some(Cluster {
        hull: convex_hull(&corners),
        centroid: sum / points as f64,
        covariance: Covariance::symmetrised(spread / points as f64),
        points,
        looks,
        robots,
        first_seen_us,
        last_seen_us,
    })
}
