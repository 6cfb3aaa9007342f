//! What confirmed walls say of the raster: a layer of its own that is told from the segments.
//!
//! The sum of what each published segment says ([`confirmed`]), kept tile by tile with the revision of
//! the last change, so that pictures know when they are stale. Nothing of it is stored: a start tells
//! it anew.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use mapfold_map::level::{FeatureId, LevelMap};
use mapfold_map::raster::{SensorClass, Tile, TileIndex, TilePatch};
use mapfold_map::vector::{ConfirmedConfig, Segment, confirmed};

use super::history::{History, MapHistory};

/// Since when each tile of what walls say is as it is.
pub(super) type WallHistory = History<TileIndex, Tile>;

/// Notes what became of some segments; `history` still has them as they were.
pub(super) fn follow(
    history: &mut MapHistory,
    changed: &BTreeSet<FeatureId>,
    map: &LevelMap,
    resolution: f64,
    revision: i64,
) {
    let mut moved: BTreeMap<TileIndex, [Vec<TilePatch>; 2]> = BTreeMap::new();
    for id in changed {
        let before = said(history.segments.get(id).and_then(|(_, segment)| segment), resolution);
        let after = said(map.segments.get(id), resolution);
        for (one, other, what) in [(&before, &after, 0), (&after, &before, 1)] {
            for (tile, patch) in one.iter().filter(|(tile, patch)| other.get(tile) != Some(patch)) {
                moved.entry(*tile).or_default()[what].push(patch.clone());
            }
        }
    }
    for (at, [gone, come]) in moved {
        let known = history.walls.get(&at).and_then(|(_, tile)| tile);
        let mut tile = known.map_or_else(Tile::default, |tile| Tile::clone(tile));
        for patch in &gone {
            tile.subtract(patch);
        }
        for patch in &come {
            tile.add(patch);
        }
        history.walls.record(at, revision, (!tile.is_empty()).then(|| Arc::new(tile)));
    }
}

/// Tells all of it anew from the segments, and counts it as changed at `revision` wherever walls are or
/// scanners saw anything: what it was before is not known any more, and readers may have been told.
pub(super) fn tell(history: &mut MapHistory, resolution: f64, revision: i64) {
    let mut tiles: BTreeMap<TileIndex, Tile> = BTreeMap::new();
    for (_, segment) in history.segments.live() {
        for (at, patch) in said(Some(segment), resolution) {
            tiles.entry(at).or_default().add(&patch);
        }
    }
    let seen = history.tiles.changed(0, i64::MAX).map(|(_, key, _)| key);
    let seen: Vec<TileIndex> =
        seen.filter(|key| key.class == SensorClass::Scanner).map(|key| key.tile).collect();
    history.walls = WallHistory::default();
    for at in seen {
        history.walls.put(at, revision, None);
    }
    for (at, tile) in tiles {
        history.walls.put(at, revision, Some(Arc::new(tile)));
    }
}

fn said(segment: Option<&Arc<Segment>>, resolution: f64) -> BTreeMap<TileIndex, TilePatch> {
    let said = segment.map(|segment| confirmed(segment, resolution, &ConfirmedConfig::STANDARD));
    said.unwrap_or_default()
}
