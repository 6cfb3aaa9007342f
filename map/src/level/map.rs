//! The published content of a level at one revision.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::FeatureId;
use crate::raster::{Tile, TileIndex, TileKey};
use crate::vector::{Chain, ChainId, Cluster, Segment};

/// What robots and operators see of a level: what [`super::diff`] compares and
/// [`super::apply`] brings up to date. A tile without evidence is not in it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LevelMap {
    /// Straight pieces of wall.
    pub segments: BTreeMap<FeatureId, Arc<Segment>>,
    /// What no line explains.
    pub clusters: BTreeMap<FeatureId, Arc<Cluster>>,
    /// Polylines and polygons of walls that meet.
    pub chains: BTreeMap<ChainId, Arc<Chain>>,
    /// Evidence, tile by tile and layer by layer.
    pub tiles: BTreeMap<TileKey, Arc<Tile>>,
    /// What was known before any robot came, tile by tile. No fold makes or reads it: it comes from
    /// whoever imported it.
    pub prior: BTreeMap<TileIndex, Arc<Tile>>,
}
