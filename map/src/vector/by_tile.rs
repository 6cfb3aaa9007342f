//! Which walls or clusters depend on the evidence of which tiles.

use std::collections::{BTreeMap, BTreeSet};

use crate::level::FeatureId;
use crate::raster::TileIndex;

/// Identities by the tiles that they depend on.
#[derive(Debug, Clone, Default)]
pub(super) struct ByTile {
    tiles: BTreeMap<TileIndex, BTreeSet<FeatureId>>,
}

impl ByTile {
    pub(super) fn insert<'a>(
        &mut self,
        id: FeatureId,
        tiles: impl IntoIterator<Item = &'a TileIndex>,
    ) {
        for tile in tiles {
            self.tiles.entry(*tile).or_default().insert(id);
        }
    }

    pub(super) fn remove<'a>(
        &mut self,
        id: FeatureId,
        tiles: impl IntoIterator<Item = &'a TileIndex>,
    ) {
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
    pub(super) fn of(&self, tile: TileIndex) -> impl Iterator<Item = FeatureId> + '_ {
        self.tiles.get(&tile).into_iter().flatten().copied()
    }
}
