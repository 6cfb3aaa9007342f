//! Which walls, clusters or joints depend on the evidence in which blocks of cells.

use super::buckets::Buckets;
use crate::raster::{Blocks, TileIndex, Touched};

/// Things by the blocks that they depend on.
#[derive(Debug, Clone)]
pub(super) struct ByBlock<K> {
    tiles: Buckets<TileIndex, (Blocks, K)>,
}

impl<K> Default for ByBlock<K> {
    fn default() -> Self {
        Self { tiles: Buckets::default() }
    }
}

impl<K: Copy + PartialEq> ByBlock<K> {
    pub(super) fn insert(&mut self, thing: K, depends_on: &[(TileIndex, Blocks)]) {
        for (tile, blocks) in depends_on {
            self.tiles.insert(*tile, (*blocks, thing));
        }
    }

    /// Removes a thing that was inserted with the same blocks.
    pub(super) fn remove(&mut self, thing: K, depends_on: &[(TileIndex, Blocks)]) {
        for (tile, _) in depends_on {
            self.tiles.remove(tile, |(_, other)| *other == thing);
        }
    }

    /// All that depend on a touched block, in no order that may be relied upon; one that depends on
    /// blocks of several tiles may come more than once.
    pub(super) fn touched(&self, touched: &Touched) -> impl Iterator<Item = K> {
        touched.iter().flat_map(|(tile, blocks)| {
            let things = self.tiles.at(tile).iter();
            things.filter(|(on, _)| on.overlaps(*blocks)).map(|(_, thing)| *thing)
        })
    }
}
