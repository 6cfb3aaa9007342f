//! Contributions that go into a map, or come out of it, all at once.
//!
//! What they add to the grid is summed up as they come, so that a batch needs memory for the tiles
//! that they touch and for their features, however much evidence each of them brought.

use std::collections::BTreeMap;

use super::{Contribution, ContributionId, LevelConfig};
use crate::raster::{SliceConfig, SliceKey, Tile, TileKey};

/// Contributions, each once, with their evidence summed up.
#[derive(Debug, Clone)]
pub struct Batch {
    slices: SliceConfig,
    /// Without their evidence.
    pub(super) contributions: BTreeMap<ContributionId, Contribution>,
    /// The sum of their evidence; what they touch is in it, also with nothing but zeros.
    pub(super) evidence: BTreeMap<SliceKey, Tile>,
}

/// A contribution of a batch is in force and should not be, or the other way round.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Misplaced(pub ContributionId);

impl Batch {
    /// None yet, for a level of this configuration.
    pub fn new(config: &LevelConfig) -> Self {
        Self { slices: config.slices, contributions: BTreeMap::new(), evidence: BTreeMap::new() }
    }

    /// Adds a contribution; one that it holds already changes nothing.
    pub fn add(&mut self, mut contribution: Contribution) {
        if self.contributions.contains_key(&contribution.id) {
            return;
        }
        let slice = self.slices.slice(contribution.observed_at_us);
        for patch in std::mem::take(&mut contribution.evidence) {
            for (tile, cells) in &patch.tiles {
                let key = TileKey { class: patch.class, tile: *tile };
                self.evidence.entry(SliceKey { key, slice }).or_default().add(cells);
            }
        }
        self.contributions.insert(contribution.id, contribution);
    }

    /// Number of contributions.
    pub fn len(&self) -> usize {
        self.contributions.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.contributions.is_empty()
    }
}
