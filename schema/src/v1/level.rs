//! Levels: one floor of a site each.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

/// A level to be made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NewLevel {
    /// Slug: lower-case letters, digits and hyphens.
    pub level: String,
    /// Name for people; the slug if absent.
    #[serde(default)]
    pub name: Option<String>,
    /// Edge of a cell; 0.05 if absent.
    #[serde(default)]
    pub resolution_m: Option<f64>,
    /// Height of the floor; 0 if absent.
    #[serde(default)]
    pub elevation_m: Option<f64>,
}

/// A level as it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LevelDescription {
    /// Slug of its site.
    pub site: String,
    /// Slug.
    pub level: String,
    /// Name for people.
    pub name: String,
    /// UUID of its frame: x right, y up, metres.
    pub frame: Uuid,
    /// Edge of a cell.
    pub resolution_m: f64,
    /// Cells along a tile's side.
    pub tile_cells: u32,
    /// Height of the floor.
    pub elevation_m: f64,
    /// Newest revision of the log.
    pub revision: i64,
    /// Revision that the published map has reached.
    pub folded_revision: i64,
    /// What the map covers; absent while it is empty.
    #[serde(default)]
    pub bounds: Option<Bounds>,
    /// How much there is.
    pub counts: Counts,
    /// Name of the published version, if any.
    #[serde(default)]
    pub published: Option<String>,
}

/// A rectangle of the level frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Bounds {
    /// Left edge.
    pub min_x_m: f64,
    /// Lower edge.
    pub min_y_m: f64,
    /// Right edge.
    pub max_x_m: f64,
    /// Upper edge.
    pub max_y_m: f64,
}

/// How much a level holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
pub struct Counts {
    /// Contributions in the log.
    pub contributions: i64,
    /// Those of them that are in the map: neither held nor reverted.
    #[serde(default)]
    pub in_force: i64,
    /// Published segments.
    pub segments: i64,
    /// Published clusters.
    pub clusters: i64,
    /// Published chains.
    #[serde(default)]
    pub chains: i64,
    /// Published tiles of all layers.
    pub tiles: i64,
}
