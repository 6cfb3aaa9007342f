//! The fold: from a set of contributions to a map, one contribution at a time or many.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::{Batch, Contribution, ContributionId, FeatureId, LevelMap, Misplaced};
use crate::raster::{Blocks, SensorClass, Tile, TileKey, TilePatch, Touched};
use crate::vector::{ChainId, Chains, Evidence, Things, VectorConfig, Walls, Work};

/// What a level's fold depends on besides its contributions.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LevelConfig {
    /// Edge of a cell, metres.
    pub resolution: f64,
    /// The vector fold's thresholds.
    pub vector: VectorConfig,
}

impl LevelConfig {
    /// Standard thresholds on a grid of `resolution` metres a cell.
    pub fn standard(resolution: f64) -> Self {
        Self { resolution, vector: VectorConfig::STANDARD }
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
}

/// A level's map together with what the fold must remember to change it.
#[derive(Debug, Clone)]
pub struct Level {
    config: LevelConfig,
    map: LevelMap,
    in_force: BTreeSet<ContributionId>,
    walls: Walls,
    things: Things,
    chains: Chains,
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
            walls: Walls::default(),
            things: Things::default(),
            chains: Chains::default(),
        }
    }

    /// A level from its stored tiles (the sums at some revision) and the contributions then in
    /// force. Their evidence is in the tiles already and is not looked at, so it may be left out
    /// of them. The same bits as folding them.
    pub fn restore<'a>(
        config: LevelConfig,
        tiles: impl IntoIterator<Item = (TileKey, Tile)>,
        contributions: impl IntoIterator<Item = &'a Contribution>,
    ) -> Self {
        let mut level = Self::new(config);
        level.map.tiles = tiles
            .into_iter()
            .filter(|(_, tile)| !tile.is_empty())
            .map(|(key, tile)| (key, Arc::new(tile)))
            .collect();
        let mut inserted: Vec<&Contribution> = contributions.into_iter().collect();
        inserted.retain(|c| level.in_force.insert(c.id));
        level.fold_features(&inserted, &[], &BTreeMap::new());
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
        let tiles = self.fold_evidence(&inserted, Tile::add);
        self.fold_features(&inserted, &[], &tiles)
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
        let tiles = self.fold_evidence(&removed, Tile::subtract);
        self.fold_features(&[], &removed, &tiles)
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
        let tiles = self.fold_sums(batch, Tile::add_tile);
        let inserted: Vec<&Contribution> = batch.contributions.values().collect();
        Ok(self.fold_features(&inserted, &[], &tiles))
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
        let tiles = self.fold_sums(batch, Tile::subtract_tile);
        let removed: Vec<&Contribution> = batch.contributions.values().collect();
        Ok(self.fold_features(&[], &removed, &tiles))
    }

    /// Applies the summed evidence of a batch by `change`; returns what is touched.
    fn fold_sums(
        &mut self,
        batch: &Batch,
        change: fn(&mut Tile, &Tile),
    ) -> BTreeMap<TileKey, Blocks> {
        for (key, sums) in &batch.evidence {
            change(Arc::make_mut(self.map.tiles.entry(*key).or_default()), sums);
        }
        let blocks = |(key, sums): (&TileKey, &Tile)| (*key, Blocks::of_tile(sums));
        let touched = batch.evidence.iter().map(blocks).collect();
        self.drop_empty(&touched);
        touched
    }

    /// Applies the evidence of `contributions` by `change`; returns what is touched.
    fn fold_evidence(
        &mut self,
        contributions: &[&Contribution],
        change: fn(&mut Tile, &TilePatch),
    ) -> BTreeMap<TileKey, Blocks> {
        let mut touched: BTreeMap<TileKey, Blocks> = BTreeMap::new();
        for patch in contributions.iter().flat_map(|c| &c.evidence) {
            for (tile, cells) in &patch.tiles {
                let key = TileKey { class: patch.class, tile: *tile };
                let sum = self.map.tiles.entry(key).or_default();
                change(Arc::make_mut(sum), cells);
                touched.entry(key).or_default().add(Blocks::of_patch(cells));
            }
        }
        self.drop_empty(&touched);
        touched
    }

    /// A tile without evidence is the same as none.
    fn drop_empty(&mut self, touched: &BTreeMap<TileKey, Blocks>) {
        for key in touched.keys() {
            if self.map.tiles.get(key).is_some_and(|tile| tile.is_empty()) {
                self.map.tiles.remove(key);
            }
        }
    }

    fn fold_features(
        &mut self,
        inserted: &[&Contribution],
        removed: &[&Contribution],
        touched: &BTreeMap<TileKey, Blocks>,
    ) -> Changes {
        let mut changes =
            Changes { tiles: touched.keys().copied().collect(), ..Changes::default() };
        let touched: Touched = touched
            .iter()
            .filter(|(key, _)| key.class == SensorClass::Scanner)
            .map(|(key, blocks)| (key.tile, *blocks))
            .collect();
        let LevelMap { segments, clusters, chains, tiles } = &mut self.map;
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
