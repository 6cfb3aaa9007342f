//! Clusters that a wall explains: points that a look could not fit into a line, but that the map
//! now knows for hits on a wall.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::squares::{Extent, Squares};
use super::{Cluster, Segment, VectorConfig};
use crate::geometry::{Covariance, Point, offset_variance, unit_normal};
use crate::level::FeatureId;

/// Where clusters and published segments are.
#[derive(Debug, Clone, Default)]
pub(super) struct Explained {
    clusters: Squares<FeatureId>,
    segments: Squares<FeatureId>,
    /// Of the segments in the index.
    extents: BTreeMap<FeatureId, Extent>,
}

impl Explained {
    pub(super) fn note(&mut self, id: FeatureId, cluster: &Cluster) {
        self.clusters.insert(id, cluster_extent(cluster));
    }

    pub(super) fn forget(&mut self, id: FeatureId, cluster: &Cluster) {
        self.clusters.remove(id, cluster_extent(cluster));
    }

    /// Takes note of what became of some segments; answers the clusters that it may concern.
    pub(super) fn follow(
        &mut self,
        changed: &BTreeSet<FeatureId>,
        segments: &BTreeMap<FeatureId, Arc<Segment>>,
    ) -> BTreeSet<FeatureId> {
        let mut concerned = BTreeSet::new();
        for id in changed {
            if let Some(old) = self.extents.remove(id) {
                self.segments.remove(*id, old);
                concerned.extend(self.clusters.near(old));
            }
            if let Some(new) = segments.get(id).and_then(|segment| segment_extent(segment)) {
                self.segments.insert(*id, new);
                self.extents.insert(*id, new);
                concerned.extend(self.clusters.near(new));
            }
        }
        concerned
    }

    /// Whether all of the cluster may be hits on one solid part of one wall.
    pub(super) fn is_explained(
        &self,
        cluster: &Cluster,
        segments: &BTreeMap<FeatureId, Arc<Segment>>,
        config: &VectorConfig,
    ) -> bool {
        let mut near = self.segments.near(cluster_extent(cluster));
        near.any(|id| segments.get(&id).is_some_and(|s| explains(s, cluster, config)))
    }
}

/// Whether every corner of the hull lies beside one solid part and passes the gate on its distance
/// from the wall, against the wall's and the cluster's uncertainty and the scatter of hits.
fn explains(segment: &Segment, cluster: &Cluster, config: &VectorConfig) -> bool {
    let n = unit_normal(segment.line.alpha());
    let own = (n.transpose() * cluster.covariance.matrix() * n)[(0, 0)];
    let scatter = config.hit_sd * config.hit_sd + config.offset_noise * config.offset_noise;
    let is_on_line = cluster.hull.iter().all(|p| {
        let along = segment.line.along(p);
        let line = |c: &Covariance<2>| offset_variance(c, along);
        let variance = line(&segment.independent) + line(&segment.dependent) + own + scatter;
        let across = segment.line.across(p).abs();
        across <= (config.gate * variance).sqrt().min(config.offset_max)
    });
    is_on_line
        && segment.solid.iter().any(|solid| {
            cluster.hull.iter().all(|p| {
                let along = segment.line.along(p);
                (solid.span.from_m() - config.hit_sd..=solid.span.to_m() + config.hit_sd)
                    .contains(&along)
            })
        })
}

fn cluster_extent(cluster: &Cluster) -> Extent {
    extent(cluster.hull.iter().copied()).unwrap_or((cluster.centroid, cluster.centroid))
}

/// Some more than the solid parts cover: hits scatter about them.
fn segment_extent(segment: &Segment) -> Option<Extent> {
    const MARGIN: f64 = 0.5;
    let ends = segment.solid.iter().flat_map(|part| [part.span.from_m(), part.span.to_m()]);
    let (low, high) = extent(ends.map(|along| segment.line.at(along)))?;
    let margin = Point::new(MARGIN, MARGIN);
    Some((low - margin, high + margin))
}

fn extent(points: impl Iterator<Item = Point>) -> Option<Extent> {
    points.map(|p| (p, p)).reduce(|(a, b), (c, d)| (a.inf(&c), b.sup(&d)))
}
