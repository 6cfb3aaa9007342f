//! Which walls, clusters or joints depend on the evidence of which tiles.

use std::collections::{BTreeMap, BTreeSet};

use crate::level::FeatureId;
use crate::raster::TileIndex;

/// Identities by the tiles that they depend on.
#[derive(Debug, Clone)]
pub(super) struct ByTile<K = FeatureId> {
    tiles: BTreeMap<TileIndex, BTreeSet<K>>,
}

impl<K> Default for ByTile<K> {
    fn default() -> Self {
        Self { tiles: BTreeMap::new() }
    }
}

impl<K: Ord + Copy> ByTile<K> {
    pub(super) fn insert<'a>(&mut self, id: K, tiles: impl IntoIterator<Item = &'a TileIndex>) {
        for tile in tiles {
            self.tiles.entry(*tile).or_default().insert(id);
        }
    }

    pub(super) fn remove<'a>(&mut self, id: K, tiles: impl IntoIterator<Item = &'a TileIndex>) {
        for tile in tiles {
            if let Some(ids) = self.tiles.get_mut(tile) {
                ids.remove(&id);
                if ids.is_empty() {
                    self.tiles.remove(tile);
                }
            }
        }
    }

    /// All that depend on `tile`, ascending.
    pub(super) fn of(&self, tile: TileIndex) -> impl Iterator<Item = K> + '_ {
        self.tiles.get(&tile).into_iter().flatten().copied()
    }
}
