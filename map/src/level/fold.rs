//! The fold: from a set of contributions to a map, one contribution at a time or many.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::{Batch, Contribution, ContributionId, FeatureId, LevelMap, Misplaced};
use crate::raster::{
    Blocks, SensorClass, Slice, SliceConfig, SliceKey, Stack, Sums, Tile, TileKey, TilePatch,
    Touched,
};
use crate::vector::{ChainId, Chains, Evidence, Things, VectorConfig, Walls, Work};

/// What a level's fold depends on besides its contributions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LevelConfig {
    /// Edge of a cell, metres.
    pub resolution: f64,
    /// How evidence yields to newer evidence.
    pub slices: SliceConfig,
    /// The vector fold's thresholds.
    pub vector: VectorConfig,
}

impl LevelConfig {
    /// Standard thresholds on a grid of `resolution` metres a cell.
    pub fn standard(resolution: f64) -> Self {
        Self { resolution, slices: SliceConfig::STANDARD, vector: VectorConfig::STANDARD }
    }
}

/// What a fold changed: these things are new, different or gone; [`Level::map`] tells which.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Changes {
    /// Segments.
    pub segments: BTreeSet<FeatureId>,
    /// Clusters.
    pub clusters: BTreeSet<FeatureId>,
    /// Chains.
    pub chains: BTreeSet<ChainId>,
    /// Tiles.
    pub tiles: BTreeSet<TileKey>,
    /// The sums that tiles are read from; not published, see [`Level::sums`]. Also those that are only held in another
    /// way.
    pub slices: BTreeSet<SliceKey>,
}

/// A level's map together with what the fold must remember to change it.
#[derive(Debug, Clone)]
pub struct Level {
    config: LevelConfig,
    map: LevelMap,
    in_force: BTreeSet<ContributionId>,
    stacks: BTreeMap<TileKey, Stack>,
    walls: Walls,
    things: Things,
    chains: Chains,
}

/// What evidence has touched.
#[derive(Debug, Default)]
struct Evident {
    slices: BTreeSet<SliceKey>,
    tiles: BTreeMap<TileKey, Blocks>,
}

impl Evident {
    fn add(&mut self, at: SliceKey, blocks: Blocks) {
        self.slices.insert(at);
        self.tiles.entry(at.key).or_default().add(blocks);
    }

    fn held_anew(&mut self, key: TileKey, slices: Vec<Slice>) {
        self.slices.extend(slices.into_iter().map(|slice| SliceKey { key, slice }));
    }
}

/// The grid as the vector fold reads it.
struct Grid<'a> {
    tiles: &'a BTreeMap<TileKey, Arc<Tile>>,
    resolution: f64,
}

impl Evidence for Grid<'_> {
    fn tile(&self, key: TileKey) -> Option<&Tile> {
        self.tiles.get(&key).map(AsRef::as_ref)
    }

    fn resolution(&self) -> f64 {
        self.resolution
    }
}

impl Level {
    /// A level without contributions.
    pub fn new(config: LevelConfig) -> Self {
        Self {
            config,
            map: LevelMap::default(),
            in_force: BTreeSet::new(),
            stacks: BTreeMap::new(),
            walls: Walls::default(),
            things: Things::default(),
            chains: Chains::default(),
        }
    }

    /// A level from its stored sums (at some revision) and the contributions then in force. Their
    /// evidence is in the sums already and is not looked at, so it may be left out of them. The same
    /// bits as folding them.
    pub fn restore<'a>(
        config: LevelConfig,
        sums: impl IntoIterator<Item = (SliceKey, Sums)>,
        contributions: impl IntoIterator<Item = &'a Contribution>,
    ) -> Self {
        let mut level = Self::new(config);
        let mut stacks: BTreeMap<TileKey, BTreeMap<Slice, Sums>> = BTreeMap::new();
        for (SliceKey { key, slice }, sums) in sums {
            stacks.entry(key).or_default().insert(slice, sums);
        }
        let stacks = stacks.into_iter();
        level.stacks = stacks.map(|(key, sums)| (key, Stack::new(sums, config.slices))).collect();
        let readings = level.stacks.iter();
        level.map.tiles = readings
            .filter_map(|(key, stack)| Some((*key, stack.reading(config.slices)?)))
            .collect();
        let mut inserted: Vec<&Contribution> = contributions.into_iter().collect();
        inserted.retain(|c| level.in_force.insert(c.id));
        level.fold_features(&inserted, &[], Evident::default());
        level
    }

    /// Its configuration.
    pub fn config(&self) -> &LevelConfig {
        &self.config
    }

    /// What is published.
    pub fn map(&self) -> &LevelMap {
        &self.map
    }

    /// The summed evidence of one layer's tile in one slice, if there is any: what must be kept, with
    /// the contributions, to [`Self::restore`] the level.
    pub fn sums(&self, at: &SliceKey) -> Option<&Sums> {
        self.stacks.get(&at.key)?.sums(at.slice)
    }

    /// The contributions in force.
    pub fn in_force(&self) -> &BTreeSet<ContributionId> {
        &self.in_force
    }

    /// How much has been done to get here, by all folds and unfolds.
    pub fn work(&self) -> Work {
        self.walls.work() + self.things.work() + self.chains.work()
    }

    /// Folds contributions in. One that is in force already changes nothing.
    pub fn fold<'a>(
        &mut self,
        contributions: impl IntoIterator<Item = &'a Contribution>,
    ) -> Changes {
        let mut inserted: Vec<&Contribution> = contributions.into_iter().collect();
        inserted.retain(|c| self.in_force.insert(c.id));
        let evident = self.fold_evidence(&inserted, Tile::add);
        self.fold_features(&inserted, &[], evident)
    }

    /// Takes contributions out again: the map is then bit for bit what it would have been without
    /// them. One that is not in force changes nothing. A contribution must be the very one that
    /// was folded in.
    pub fn unfold<'a>(
        &mut self,
        contributions: impl IntoIterator<Item = &'a Contribution>,
    ) -> Changes {
        let mut removed: Vec<&Contribution> = contributions.into_iter().collect();
        removed.retain(|c| self.in_force.remove(&c.id));
        let evident = self.fold_evidence(&removed, Tile::subtract);
        self.fold_features(&[], &removed, evident)
    }

    /// Folds a batch in, at once: the same bits as [`Self::fold`] with its contributions.
    ///
    /// # Errors
    /// One of them is in force already; nothing has changed then.
    pub fn fold_batch(&mut self, batch: &Batch) -> Result<Changes, Misplaced> {
        if let Some(id) = batch.contributions.keys().find(|id| self.in_force.contains(id)) {
            return Err(Misplaced(*id));
        }
        self.in_force.extend(batch.contributions.keys());
        let evident = self.fold_sums(batch, Tile::add_tile);
        let inserted: Vec<&Contribution> = batch.contributions.values().collect();
        Ok(self.fold_features(&inserted, &[], evident))
    }

    /// Takes a batch out, at once: the same bits as [`Self::unfold`] with its contributions.
    ///
    /// # Errors
    /// One of them is not in force; nothing has changed then.
    pub fn unfold_batch(&mut self, batch: &Batch) -> Result<Changes, Misplaced> {
        if let Some(id) = batch.contributions.keys().find(|id| !self.in_force.contains(id)) {
            return Err(Misplaced(*id));
        }
        for id in batch.contributions.keys() {
            self.in_force.remove(id);
        }
        let evident = self.fold_sums(batch, Tile::subtract_tile);
        let removed: Vec<&Contribution> = batch.contributions.values().collect();
        Ok(self.fold_features(&[], &removed, evident))
    }

    /// Applies the summed evidence of a batch by `change`; returns what is touched.
    fn fold_sums(&mut self, batch: &Batch, change: fn(&mut Tile, &Tile)) -> Evident {
        let mut evident = Evident::default();
        for (at, sums) in &batch.evidence {
            let stack = self.stacks.entry(at.key).or_default();
            let held_anew = stack.change(at.slice, self.config.slices, |tile| change(tile, sums));
            evident.add(*at, Blocks::of_tile(sums));
            evident.held_anew(at.key, held_anew);
        }
        self.read_again(&evident);
        evident
    }

    /// Applies the evidence of `contributions` by `change`; returns what is touched.
    fn fold_evidence(
        &mut self,
        contributions: &[&Contribution],
        change: fn(&mut Tile, &TilePatch),
    ) -> Evident {
        let mut evident = Evident::default();
        for contribution in contributions {
            let slice = self.config.slices.slice(contribution.observed_at_us);
            for patch in &contribution.evidence {
                for (tile, cells) in &patch.tiles {
                    let key = TileKey { class: patch.class, tile: *tile };
                    let stack = self.stacks.entry(key).or_default();
                    let config = self.config.slices;
                    let held_anew = stack.change(slice, config, |sums| change(sums, cells));
                    evident.add(SliceKey { key, slice }, Blocks::of_patch(cells));
                    evident.held_anew(key, held_anew);
                }
            }
        }
        self.read_again(&evident);
        evident
    }

    /// Publishes what the touched tiles read as. A tile without evidence is the same as none.
    fn read_again(&mut self, evident: &Evident) {
        for key in evident.tiles.keys() {
            let stack = self.stacks.get(key);
            if let Some(reading) = stack.and_then(|stack| stack.reading(self.config.slices)) {
                self.map.tiles.insert(*key, reading);
            } else {
                self.stacks.remove(key);
                self.map.tiles.remove(key);
            }
        }
    }

    fn fold_features(
        &mut self,
        inserted: &[&Contribution],
        removed: &[&Contribution],
        evident: Evident,
    ) -> Changes {
        let mut changes = Changes {
            tiles: evident.tiles.keys().copied().collect(),
            slices: evident.slices,
            ..Changes::default()
        };
        let touched: Touched = evident
            .tiles
            .iter()
            .filter(|(key, _)| key.class == SensorClass::Scanner)
            .map(|(key, blocks)| (key.tile, *blocks))
            .collect();
        let LevelMap { segments, clusters, chains, tiles, .. } = &mut self.map;
        let grid = Grid { tiles, resolution: self.config.resolution };
        let config = &self.config.vector;
        let walls = self.walls.update(inserted, removed, &touched, &grid, segments, config);
        changes.segments = walls.iter().map(|wall| wall.id).collect();
        let changed = &changes.segments;
        changes.clusters = self
            .things
            .update(inserted, removed, &touched, changed, segments, &grid, clusters, config);
        changes.chains = self.chains.update(&walls, &touched, &self.walls, &grid, chains, config);
        changes
    }
}
