//! What changed between two states of a map. `apply` copies and never computes.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{FeatureId, LevelMap};
use crate::raster::{Tile, TileIndex, TileKey};
use crate::vector::{Chain, ChainId, Cluster, Segment};

/// New and changed things whole, removed things by their identity.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Patch {
    /// New or changed segments.
    pub segments: BTreeMap<FeatureId, Arc<Segment>>,
    /// New or changed clusters.
    pub clusters: BTreeMap<FeatureId, Arc<Cluster>>,
    /// New or changed chains.
    pub chains: BTreeMap<ChainId, Arc<Chain>>,
    /// New or changed tiles.
    pub tiles: BTreeMap<TileKey, Arc<Tile>>,
    /// New or changed tiles of the prior.
    pub prior: BTreeMap<TileIndex, Arc<Tile>>,
    /// Segments that are no more.
    pub removed_segments: Vec<FeatureId>,
    /// Clusters that are no more.
    pub removed_clusters: Vec<FeatureId>,
    /// Chains that are no more.
    pub removed_chains: Vec<ChainId>,
    /// Tiles that hold no evidence any more.
    pub removed_tiles: Vec<TileKey>,
    /// Tiles of which the prior says nothing any more.
    pub removed_prior: Vec<TileIndex>,
}

impl Patch {
    /// Whether it changes nothing.
    pub fn is_empty(&self) -> bool {
        self.change_count() == 0
    }

    /// How many things it changes or removes.
    pub fn change_count(&self) -> usize {
        let changed = [self.segments.len(), self.clusters.len(), self.chains.len()];
        let removed =
            [self.removed_segments.len(), self.removed_clusters.len(), self.removed_chains.len()];
        let tiles = [self.tiles.len(), self.removed_tiles.len()];
        let prior = [self.prior.len(), self.removed_prior.len()];
        changed.into_iter().chain(removed).chain(tiles).chain(prior).sum()
    }
}

type Changed<K, V> = (BTreeMap<K, Arc<V>>, Vec<K>);

fn diff_kind<K: Ord + Copy, V: PartialEq>(
    a: &BTreeMap<K, Arc<V>>,
    b: &BTreeMap<K, Arc<V>>,
) -> Changed<K, V> {
    let changed = b
        .iter()
        .filter(|(key, new)| a.get(key).is_none_or(|old| !Arc::ptr_eq(old, new) && old != *new))
        .map(|(key, new)| (*key, Arc::clone(new)))
        .collect();
    let removed = a.keys().filter(|key| !b.contains_key(key)).copied().collect();
    (changed, removed)
}

/// What leads from `a` to `b`: `apply(diff(a, b), a) == b`.
pub fn diff(a: &LevelMap, b: &LevelMap) -> Patch {
    let (segments, removed_segments) = diff_kind(&a.segments, &b.segments);
    let (clusters, removed_clusters) = diff_kind(&a.clusters, &b.clusters);
    let (chains, removed_chains) = diff_kind(&a.chains, &b.chains);
    let (tiles, removed_tiles) = diff_kind(&a.tiles, &b.tiles);
    let (prior, removed_prior) = diff_kind(&a.prior, &b.prior);
    Patch {
        segments,
        clusters,
        chains,
        tiles,
        prior,
        removed_segments,
        removed_clusters,
        removed_chains,
        removed_tiles,
        removed_prior,
    }
}

fn apply_kind<K: Ord + Copy, V>(
    changed: &BTreeMap<K, Arc<V>>,
    removed: &[K],
    to: &mut BTreeMap<K, Arc<V>>,
) {
    for key in removed {
        to.remove(key);
    }
    for (key, new) in changed {
        to.insert(*key, Arc::clone(new));
    }
}

/// Brings `map` up to date. Removing what is not there, or applying twice, does no harm.
pub fn apply(patch: &Patch, map: &mut LevelMap) {
    apply_kind(&patch.segments, &patch.removed_segments, &mut map.segments);
    apply_kind(&patch.clusters, &patch.removed_clusters, &mut map.clusters);
    apply_kind(&patch.chains, &patch.removed_chains, &mut map.chains);
    apply_kind(&patch.tiles, &patch.removed_tiles, &mut map.tiles);
    apply_kind(&patch.prior, &patch.removed_prior, &mut map.prior);
}
