//! What changed after a revision.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{Chain, Cluster, Segment, SensorClass};

/// `GET L/vector`: segments, clusters and chains that changed after `since`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct VectorPatch {
    /// The revision that was asked for.
    pub since: i64,
    /// The revision that this leads to.
    pub revision: i64,
    /// New or changed segments.
    pub segments: Vec<Segment>,
    /// New or changed clusters.
    pub clusters: Vec<Cluster>,
    /// New or changed chains.
    #[serde(default)]
    pub chains: Vec<Chain>,
    /// What is no more.
    pub removed: Removed,
}

/// Identities of what is no more.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
pub struct Removed {
    /// Segments.
    #[serde(default)]
    pub segments: Vec<String>,
    /// Clusters.
    #[serde(default)]
    pub clusters: Vec<String>,
    /// Chains.
    #[serde(default)]
    pub chains: Vec<String>,
    /// Tiles.
    #[serde(default)]
    pub tiles: Vec<TileAddress>,
    /// Tiles of the prior.
    #[serde(default)]
    pub prior: Vec<TilePlace>,
}

/// One layer's tile.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
pub struct TileAddress {
    /// The layer.
    pub sensor: SensorClass,
    /// Tiles to the right of the level's origin.
    pub x: i32,
    /// Tiles up from the level's origin.
    pub y: i32,
}

/// `GET L/raster`: which tiles changed after `since`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RasterChanges {
    /// The revision that was asked for.
    pub since: i64,
    /// The revision that this leads to.
    pub revision: i64,
    /// Edge of a cell.
    pub resolution_m: f64,
    /// New or changed tiles.
    pub tiles: Vec<TileAddress>,
    /// Tiles that hold no evidence any more.
    pub removed: Vec<TileAddress>,
    /// New or changed tiles of the prior, which is no evidence of robots.
    #[serde(default)]
    pub prior: Vec<TilePlace>,
    /// Tiles of which the prior says nothing any more.
    #[serde(default)]
    pub removed_prior: Vec<TilePlace>,
    /// New or changed tiles of what confirmed walls say of the cells that they pass through.
    #[serde(default)]
    pub walls: Vec<TilePlace>,
    /// Tiles of which confirmed walls say nothing any more.
    #[serde(default)]
    pub removed_walls: Vec<TilePlace>,
}

/// A tile's place in a level's grid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
pub struct TilePlace {
    /// Tiles to the right of the level's origin.
    pub x: i32,
    /// Tiles up from the level's origin.
    pub y: i32,
}

/// The evidence of one layer in one tile.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct TileEvidence {
    /// The layer.
    pub sensor: SensorClass,
    /// Tiles to the right of the level's origin.
    pub x: i32,
    /// Tiles up from the level's origin.
    pub y: i32,
    /// Runs of equal evidence, flat: start, length, value, ... (64 x 64 cells, row by row from
    /// below, 0.01 nat, sums not clamped; cells in no run are 0).
    pub runs: Vec<i32>,
}

/// What the prior says in one tile, which is no evidence of robots.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct PriorTile {
    /// Tiles to the right of the level's origin.
    pub x: i32,
    /// Tiles up from the level's origin.
    pub y: i32,
    /// Runs of equal log-odds, as in [`TileEvidence`].
    pub runs: Vec<i32>,
}

/// `GET L/patches`: all that changed after `since`, in pages.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Patch {
    /// The revision that was asked for.
    pub since: i64,
    /// The revision that this leads to; ask with it as `since` for what follows.
    pub revision: i64,
    /// Whether there is more to ask for right now.
    pub more: bool,
    /// New or changed segments.
    pub segments: Vec<Segment>,
    /// New or changed clusters.
    pub clusters: Vec<Cluster>,
    /// New or changed chains.
    #[serde(default)]
    pub chains: Vec<Chain>,
    /// New or changed tiles, whole.
    pub tiles: Vec<TileEvidence>,
    /// New or changed tiles of the prior, whole.
    #[serde(default)]
    pub prior: Vec<PriorTile>,
    /// What is no more.
    pub removed: Removed,
}
