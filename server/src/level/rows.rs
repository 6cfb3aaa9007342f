//! From a level's history to the rows of the store.

use std::sync::Arc;

use mapfold_map::level::FeatureId;
use mapfold_map::raster::{Tile, TileKey};
use mapfold_map::vector::{Chain, ChainId, Cluster, Segment};
use mapfold_schema::border::{chain_id, feature_id, wire_chain, wire_cluster, wire_segment};
use mapfold_schema::codec;

use super::history::{History, Least, MapHistory};
use crate::store::map_rows::{FeatureRow, MapRows, SliceRow, TileRow};
use crate::store::{StoreError, tile_cells};

/// The rows of all that changed after `since` and not after `until`, in the order of their keys:
/// two replicas that write the same rows then wait for each other instead of locking crosswise.
pub(crate) fn changed(history: &MapHistory, since: i64, until: i64) -> Result<MapRows, StoreError> {
    let unfit = |table, detail: String| StoreError::Corrupt { table, key: "a row".into(), detail };
    let mut slices = Vec::new();
    for (revision, at, sums) in history.slices.changed(since, until) {
        let content = sums.map(|sums| tile_cells::encode(&sums.tile())).transpose();
        let content = content.map_err(|e| unfit("slices", e.to_string()))?;
        slices.push(SliceRow { at, revision, content });
    }
    slices.sort_unstable_by_key(|row| row.at);
    let tile = |(revision, key, tile): (i64, TileKey, Option<&Arc<Tile>>)| TileRow {
        key,
        revision,
        is_gone: tile.is_none(),
    };
    let mut tiles: Vec<TileRow> = history.tiles.changed(since, until).map(tile).collect();
    tiles.sort_unstable_by_key(|row| row.key);
    Ok(MapRows {
        segments: features(&history.segments, since, until, feature_id, segment)
            .map_err(|e| unfit("segments", e))?,
        clusters: features(&history.clusters, since, until, feature_id, cluster)
            .map_err(|e| unfit("clusters", e))?,
        chains: features(&history.chains, since, until, chain_id, chain)
            .map_err(|e| unfit("chains", e))?,
        tiles,
        slices,
    })
}

/// The column of a segment.
pub(super) fn segment(id: &FeatureId, segment: &Segment) -> Result<Vec<u8>, String> {
    codec::to_cbor(&wire_segment(id, segment)).map_err(|e| e.to_string())
}

/// The column of a cluster.
pub(super) fn cluster(id: &FeatureId, cluster: &Cluster) -> Result<Vec<u8>, String> {
    codec::to_cbor(&wire_cluster(id, cluster)).map_err(|e| e.to_string())
}

/// The column of a chain.
pub(super) fn chain(id: &ChainId, chain: &Chain) -> Result<Vec<u8>, String> {
    codec::to_cbor(&wire_chain(id, chain)).map_err(|e| e.to_string())
}

fn features<K: Least, V: PartialEq>(
    history: &History<K, V>,
    since: i64,
    until: i64,
    text: fn(&K) -> String,
    content: fn(&K, &V) -> Result<Vec<u8>, String>,
) -> Result<Vec<FeatureRow>, String> {
    let mut rows = Vec::new();
    for (revision, id, value) in history.changed(since, until) {
        let content = value.map(|value| content(&id, value)).transpose()?;
        rows.push(FeatureRow { feature: text(&id), revision, content });
    }
    rows.sort_unstable_by(|a, b| a.feature.cmp(&b.feature));
    Ok(rows)
}
