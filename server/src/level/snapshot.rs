//! What a level publishes: its map at one revision, and since when each thing is as it is.

use std::fmt;
use std::sync::{Arc, OnceLock};

use mapfold_map::geometry::Point;
use mapfold_map::level::{FeatureId, LevelMap};
use mapfold_map::raster::{TILE_SIDE, Tile, TileIndex, TileKey};
use mapfold_map::vector::{Chain, ChainId, Cluster, Segment};
use mapfold_schema::v1;

use super::folding::Folding;
use super::history::MapHistory;

/// A level's map at one revision; immutable. Shares with other revisions what they have in common.
pub struct Snapshot {
    resolution_m: f64,
    revision: i64,
    folded_revision: i64,
    contributions: i64,
    in_force: i64,
    history: MapHistory,
    map: OnceLock<Arc<LevelMap>>,
    bounds: OnceLock<Option<v1::Bounds>>,
}

impl fmt::Debug for Snapshot {
    /// Which one it is and how much it holds: nobody wants a whole map in a message.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Snapshot")
            .field("folded_revision", &self.folded_revision)
            .field("revision", &self.revision)
            .field("counts", &self.counts())
            .finish_non_exhaustive()
    }
}

impl Snapshot {
    /// What `folding` has reached, knowing that the log has reached `revision`.
    pub(super) fn of(folding: &Folding, revision: i64) -> Self {
        Self {
            resolution_m: folding.level().config().resolution,
            revision: revision.max(folding.revision()),
            folded_revision: folding.revision(),
            contributions: folding.contributions(),
            in_force: folding.level().in_force().len() as i64,
            history: folding.history().clone(),
            map: OnceLock::new(),
            bounds: OnceLock::new(),
        }
    }

    /// Newest revision of the log that was known when this was published; never less than
    /// [`Self::folded_revision`].
    pub fn revision(&self) -> i64 {
        self.revision
    }

    /// The revision that this map has reached.
    pub fn folded_revision(&self) -> i64 {
        self.folded_revision
    }

    /// Edge of a cell, metres.
    pub fn resolution_m(&self) -> f64 {
        self.resolution_m
    }

    /// How much there is.
    pub fn counts(&self) -> v1::Counts {
        v1::Counts {
            contributions: self.contributions,
            in_force: self.in_force,
            segments: self.history.segments.live_count() as i64,
            clusters: self.history.clusters.live_count() as i64,
            chains: self.history.chains.live_count() as i64,
            tiles: self.history.tiles.live_count() as i64,
            prior_tiles: self.history.prior.live_count() as i64,
        }
    }

    /// What the map and the prior cover; `None` while both are empty.
    pub fn bounds(&self) -> Option<v1::Bounds> {
        *self.bounds.get_or_init(|| {
            let tiles = self.tiles().map(|(key, _)| tile_bounds(key.tile, self.resolution_m));
            let prior = self.history.prior.live();
            let prior = prior.map(|(at, _)| tile_bounds(*at, self.resolution_m));
            let segments = self.segments().map(|(_, segment)| segment_bounds(segment));
            let clusters = self.clusters().map(|(_, cluster)| hull_bounds(&cluster.hull));
            tiles.chain(prior).chain(segments.chain(clusters).flatten()).reduce(union)
        })
    }

    /// The whole map, for exports. Built at the first call and shared from then on.
    pub fn map(&self) -> Arc<LevelMap> {
        Arc::clone(self.map.get_or_init(|| {
            Arc::new(LevelMap {
                segments: self.segments().map(|(id, s)| (*id, Arc::clone(s))).collect(),
                clusters: self.clusters().map(|(id, c)| (*id, Arc::clone(c))).collect(),
                chains: self.chains().map(|(id, c)| (*id, Arc::clone(c))).collect(),
                tiles: self.tiles().map(|(key, t)| (*key, Arc::clone(t))).collect(),
                prior: self.history.prior.live().map(|(at, t)| (*at, Arc::clone(t))).collect(),
            })
        }))
    }

    /// The segments, by identity.
    pub fn segments(&self) -> impl Iterator<Item = (&FeatureId, &Arc<Segment>)> {
        self.history.segments.live()
    }

    /// The revision at which a segment changed last; 0 if none ever was.
    pub(super) fn segments_changed_at(&self) -> i64 {
        self.history.segments.changed_at()
    }

    /// The clusters, by identity.
    pub fn clusters(&self) -> impl Iterator<Item = (&FeatureId, &Arc<Cluster>)> {
        self.history.clusters.live()
    }

    /// The chains, by identity.
    pub fn chains(&self) -> impl Iterator<Item = (&ChainId, &Arc<Chain>)> {
        self.history.chains.live()
    }

    /// The tiles, by layer and place.
    pub fn tiles(&self) -> impl Iterator<Item = (&TileKey, &Arc<Tile>)> {
        self.history.tiles.live()
    }

    /// The tiles from `first` to `last`, by layer and place.
    pub fn tiles_between(
        &self,
        first: TileKey,
        last: TileKey,
    ) -> impl Iterator<Item = (&TileKey, &Arc<Tile>)> {
        self.history.tiles.live_between(first, last)
    }

    /// The tiles of the prior from `first` to `last`, by place.
    pub fn prior_between(
        &self,
        first: TileIndex,
        last: TileIndex,
    ) -> impl Iterator<Item = (&TileIndex, &Arc<Tile>)> {
        self.history.prior.live_between(first, last)
    }

    /// The tiles of what confirmed walls say from `first` to `last`, by place.
    pub fn walls_between(
        &self,
        first: TileIndex,
        last: TileIndex,
    ) -> impl Iterator<Item = (&TileIndex, &Arc<Tile>)> {
        self.history.walls.live_between(first, last)
    }

    /// One tile of the prior.
    pub fn prior_tile(&self, at: TileIndex) -> Option<&Arc<Tile>> {
        self.history.prior.get(&at)?.1
    }

    /// One tile and the revision at which it last changed; a tile that is no more (or never was)
    /// is `None`.
    pub fn tile(&self, key: &TileKey) -> Option<(i64, &Arc<Tile>)> {
        let (revision, tile) = self.history.tiles.get(key)?;
        Some((revision, tile?))
    }

    /// Since when each thing is as it is.
    pub(super) fn history(&self) -> &MapHistory {
        &self.history
    }
}

/// What a tile covers.
pub(super) fn tile_bounds(tile: TileIndex, resolution_m: f64) -> v1::Bounds {
    let side_m = TILE_SIDE as f64 * resolution_m;
    v1::Bounds {
        min_x_m: f64::from(tile.x) * side_m,
        min_y_m: f64::from(tile.y) * side_m,
        max_x_m: (f64::from(tile.x) + 1.0) * side_m,
        max_y_m: (f64::from(tile.y) + 1.0) * side_m,
    }
}

/// What a segment's solid parts cover, the gaps between them included.
pub(super) fn segment_bounds(segment: &Segment) -> Option<v1::Bounds> {
    let ends = segment.solid.iter().flat_map(|part| [part.span.from_m(), part.span.to_m()]);
    points_bounds(ends.map(|along| segment.line.at(along)))
}

/// What a chain's edges cover.
pub(super) fn chain_bounds(chain: &Chain) -> Option<v1::Bounds> {
    points_bounds(chain.vertices.iter().map(|vertex| vertex.at))
}

/// What a hull covers.
pub(super) fn hull_bounds(hull: &[Point]) -> Option<v1::Bounds> {
    points_bounds(hull.iter().copied())
}

fn points_bounds(points: impl Iterator<Item = Point>) -> Option<v1::Bounds> {
    points
        .map(|p| v1::Bounds { min_x_m: p.x, min_y_m: p.y, max_x_m: p.x, max_y_m: p.y })
        .reduce(union)
}

/// The least rectangle that covers both.
pub(super) fn union(a: v1::Bounds, b: v1::Bounds) -> v1::Bounds {
    v1::Bounds {
        min_x_m: a.min_x_m.min(b.min_x_m),
        min_y_m: a.min_y_m.min(b.min_y_m),
        max_x_m: a.max_x_m.max(b.max_x_m),
        max_y_m: a.max_y_m.max(b.max_y_m),
    }
}
