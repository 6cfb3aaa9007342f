//! What changed in a published map after a revision: whole, in a rectangle, or in pages.

use std::sync::Arc;

use mapfold_map::level::Patch;
use mapfold_map::raster::{TileIndex, TileKey};
use mapfold_schema::border::{
    chain_id, feature_id, wire_chain, wire_cluster, wire_patch, wire_segment, wire_tile_address,
};
use mapfold_schema::v1;

use super::history::{History, Least};
use super::snapshot::{Snapshot, chain_bounds, hull_bounds, segment_bounds, tile_bounds};

/// A revision was named that this map has not reached.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("revision {since} is ahead of the map's, {folded_revision} (the log's is {revision})")]
pub struct SinceError {
    /// What was asked for.
    pub since: i64,
    /// What the map has reached.
    pub folded_revision: i64,
    /// Newest revision of the log that is known here. If `since` is ahead of that too, either
    /// another replica is, or the reader knows a log that this server has lost.
    pub revision: i64,
}

impl Snapshot {
    /// All that changed after `since`, as map types. After 0 there is nothing to remove: whoever
    /// asks so has nothing yet.
    ///
    /// # Errors
    /// A revision that this map has not reached.
    pub fn since(&self, since: i64) -> Result<Patch, SinceError> {
        self.check(since)?;
        Ok(self.patch(since, self.folded_revision()))
    }

    /// Segments, clusters and chains that changed after `since`. With a `bbox`, what touches it (by its own
    /// bounding box); what changed and lies outside is then among the removed, because it may have
    /// lain inside.
    ///
    /// # Errors
    /// A revision that this map has not reached.
    pub fn vector_since(
        &self,
        since: i64,
        bbox: Option<&v1::Bounds>,
    ) -> Result<v1::VectorPatch, SinceError> {
        self.check(since)?;
        let mut answer = v1::VectorPatch {
            since,
            revision: self.folded_revision(),
            segments: Vec::new(),
            clusters: Vec::new(),
            chains: Vec::new(),
            removed: v1::Removed::default(),
        };
        for (_, id, segment) in self.history().segments.changed(since, i64::MAX) {
            match segment.filter(|s| touches(segment_bounds(s), bbox)) {
                Some(segment) => answer.segments.push(wire_segment(&id, segment)),
                None if since > 0 => answer.removed.segments.push(feature_id(&id)),
                None => {}
            }
        }
        for (_, id, cluster) in self.history().clusters.changed(since, i64::MAX) {
            match cluster.filter(|c| touches(hull_bounds(&c.hull), bbox)) {
                Some(cluster) => answer.clusters.push(wire_cluster(&id, cluster)),
                None if since > 0 => answer.removed.clusters.push(feature_id(&id)),
                None => {}
            }
        }
        for (_, id, chain) in self.history().chains.changed(since, i64::MAX) {
            match chain.filter(|c| touches(chain_bounds(c), bbox)) {
                Some(chain) => answer.chains.push(wire_chain(&id, chain)),
                None if since > 0 => answer.removed.chains.push(chain_id(&id)),
                None => {}
            }
        }
        Ok(answer)
    }

    /// Which tiles changed after `since`; with a `bbox`, those that touch it.
    ///
    /// # Errors
    /// A revision that this map has not reached.
    pub fn raster_since(
        &self,
        since: i64,
        bbox: Option<&v1::Bounds>,
    ) -> Result<v1::RasterChanges, SinceError> {
        self.check(since)?;
        let mut answer = v1::RasterChanges {
            since,
            revision: self.folded_revision(),
            resolution_m: self.resolution_m(),
            tiles: Vec::new(),
            removed: Vec::new(),
            prior: Vec::new(),
            removed_prior: Vec::new(),
            walls: Vec::new(),
            removed_walls: Vec::new(),
        };
        for (layer, there, removed) in [
            (&self.history().prior, &mut answer.prior, &mut answer.removed_prior),
            (&self.history().walls, &mut answer.walls, &mut answer.removed_walls),
        ] {
            for (_, at, tile) in layer.changed(since, i64::MAX) {
                if !touches(Some(tile_bounds(at, self.resolution_m())), bbox) {
                    continue;
                }
                let place = v1::TilePlace { x: at.x, y: at.y };
                match tile {
                    Some(_) => there.push(place),
                    None if since > 0 => removed.push(place),
                    None => {}
                }
            }
        }
        for (_, key, tile) in self.history().tiles.changed(since, i64::MAX) {
            if !touches(Some(tile_bounds(key.tile, self.resolution_m())), bbox) {
                continue;
            }
            match tile {
                Some(_) => answer.tiles.push(wire_tile_address(&key)),
                None if since > 0 => answer.removed.push(wire_tile_address(&key)),
                None => {}
            }
        }
        Ok(answer)
    }

    /// Places and layers of the tiles that changed after `since`, removed ones included.
    pub fn tiles_changed_after(&self, since: i64) -> impl Iterator<Item = TileKey> {
        self.history().tiles.changed(since, i64::MAX).map(|(_, key, _)| key)
    }

    /// Places where the prior changed after `since`, removed tiles included.
    pub fn prior_changed_after(&self, since: i64) -> impl Iterator<Item = TileIndex> {
        self.history().prior.changed(since, i64::MAX).map(|(_, at, _)| at)
    }

    /// Places where what confirmed walls say changed after `since`, removed tiles included.
    pub fn walls_changed_after(&self, since: i64) -> impl Iterator<Item = TileIndex> {
        self.history().walls.changed(since, i64::MAX).map(|(_, at, _)| at)
    }

    /// A page of all that changed after `since`: up to `limit` things, or all those of one
    /// revision (which is never cut in two). Applying page after page, each with the last one's
    /// `revision` as `since`, until there is no `more`, gives the same as a full fetch, also if
    /// the map goes on meanwhile.
    ///
    /// # Errors
    /// A revision that this map has not reached.
    pub fn patches_since(&self, since: i64, limit: usize) -> Result<v1::Patch, SinceError> {
        self.check(since)?;
        let folded = self.folded_revision();
        // A cut at the newest revision leaves nothing to ask for.
        let until = self.history().cut(since, limit).unwrap_or(folded);
        Ok(wire_patch(&self.patch(since, until), since, until, until < folded))
    }

    fn check(&self, since: i64) -> Result<(), SinceError> {
        if since <= self.folded_revision() {
            Ok(())
        } else {
            Err(SinceError {
                since,
                folded_revision: self.folded_revision(),
                revision: self.revision(),
            })
        }
    }

    fn patch(&self, since: i64, until: i64) -> Patch {
        let mut patch = Patch::default();
        let history = self.history();
        let (segments, removed_segments) = changed(&history.segments, since, until);
        let (clusters, removed_clusters) = changed(&history.clusters, since, until);
        let (chains, removed_chains) = changed(&history.chains, since, until);
        let (tiles, removed_tiles) = changed(&history.tiles, since, until);
        let (prior, removed_prior) = changed(&history.prior, since, until);
        patch.segments.extend(segments);
        patch.clusters.extend(clusters);
        patch.chains.extend(chains);
        patch.tiles.extend(tiles);
        patch.prior.extend(prior);
        patch.removed_segments = removed_segments;
        patch.removed_clusters = removed_clusters;
        patch.removed_chains = removed_chains;
        patch.removed_tiles = removed_tiles;
        patch.removed_prior = removed_prior;
        patch
    }
}

/// New and changed things whole, removed ones (ascending) by key.
fn changed<K: Least, V: PartialEq>(
    history: &History<K, V>,
    since: i64,
    until: i64,
) -> (Vec<(K, Arc<V>)>, Vec<K>) {
    let (mut whole, mut removed) = (Vec::new(), Vec::new());
    for (_, key, value) in history.changed(since, until) {
        match value {
            Some(value) => whole.push((key, Arc::clone(value))),
            None if since > 0 => removed.push(key),
            None => {}
        }
    }
    removed.sort_unstable();
    (whole, removed)
}

/// Whether a thing that covers `bounds` has a point in `bbox`; without one, everything has.
fn touches(bounds: Option<v1::Bounds>, bbox: Option<&v1::Bounds>) -> bool {
    match (bounds, bbox) {
        (_, None) => true,
        (None, Some(_)) => false,
        (Some(a), Some(b)) => {
            a.min_x_m <= b.max_x_m
                && b.min_x_m <= a.max_x_m
                && a.min_y_m <= b.max_y_m
                && b.min_y_m <= a.max_y_m
        }
    }
}
