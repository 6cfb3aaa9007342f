//! Which walls, clusters or joints depend on the evidence in which blocks of cells.

use std::collections::BTreeMap;

use crate::raster::{Blocks, TileIndex, Touched};

/// Things by the blocks that they depend on.
#[derive(Debug, Clone)]
pub(super) struct ByBlock<K> {
    tiles: BTreeMap<TileIndex, Vec<(Blocks, K)>>,
}

impl<K> Default for ByBlock<K> {
    fn default() -> Self {
        Self { tiles: BTreeMap::new() }
    }
}

impl<K: Copy + PartialEq> ByBlock<K> {
    pub(super) fn insert(&mut self, thing: K, depends_on: &[(TileIndex, Blocks)]) {
        for (tile, blocks) in depends_on {
            self.tiles.entry(*tile).or_default().push((*blocks, thing));
        }
    }

    /// Removes a thing that was inserted with the same blocks.
    pub(super) fn remove(&mut self, thing: K, depends_on: &[(TileIndex, Blocks)]) {
        for (tile, _) in depends_on {
            if let Some(things) = self.tiles.get_mut(tile) {
                if let Some(at) = things.iter().position(|(_, other)| *other == thing) {
                    things.swap_remove(at);
                }
                if things.is_empty() {
                    self.tiles.remove(tile);
                }
            }
        }
    }

    /// All that depend on a touched block, in no order that may be relied upon; one that depends on
    /// blocks of several tiles may come more than once.
    pub(super) fn touched(&self, touched: &Touched) -> impl Iterator<Item = K> {
        touched.iter().flat_map(|(tile, blocks)| {
            let things = self.tiles.get(tile).into_iter().flatten();
            things.filter(|(on, _)| on.overlaps(*blocks)).map(|(_, thing)| *thing)
        })
    }
}
