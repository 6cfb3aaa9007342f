//! Imports: maps of other programs as the prior of a level.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use super::Bounds;

/// What was found in a map that was handed in.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ImportReport {
    /// Name of the image's file, as the description has it.
    pub image: String,
    /// Pixels across.
    pub columns: u32,
    /// Pixels down.
    pub rows: u32,
    /// Edge of a pixel.
    pub resolution_m: f64,
    /// Where the lower left corner of the image lies in the level.
    pub origin_m: [f64; 2],
    /// By how much the image is turned about that corner, counter-clockwise.
    pub yaw_rad: f64,
    /// `trinary`, `scale` or `raw`.
    pub mode: String,
    /// From this darkness on a pixel is occupied, 0 to 1; absent in imports that are older than this.
    #[serde(default)]
    pub occupied_thresh: Option<f64>,
    /// Up to this darkness it is free.
    #[serde(default)]
    pub free_thresh: Option<f64>,
    /// Whether brightness counts instead of darkness.
    #[serde(default)]
    pub negate: Option<bool>,
    /// How much it is trusted, 0 to 1.
    pub trust: f64,
    /// Pixels that speak for an obstacle.
    pub occupied: u64,
    /// Pixels that speak for free space.
    pub free: u64,
    /// Pixels that say nothing.
    pub unknown: u64,
    /// Tiles of the level in which it says something.
    pub tiles: u32,
    /// What these tiles cover.
    #[serde(default)]
    pub bounds: Option<Bounds>,
    /// What is doubtful about it, in words.
    pub warnings: Vec<String>,
}

/// An import as the log has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Import {
    /// Its identity.
    pub id: Uuid,
    /// Its place in the level's log.
    pub revision: i64,
    /// When the server took it.
    pub at: String,
    /// Public id of the token that asked for it.
    pub author: String,
    /// SHA-256 of the description, the image and the trust, lower-case hexadecimal; empty for a
    /// removal.
    pub digest: String,
    /// What was found in the map; absent if this took the prior away.
    #[serde(default)]
    pub report: Option<ImportReport>,
}

/// `GET L/imports`: imports, newest first.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ImportPage {
    /// The imports; the first one of the first page is the prior, unless it took it away.
    pub imports: Vec<Import>,
    /// `cursor` of the next page; absent on the last one.
    #[serde(default)]
    pub next: Option<String>,
}
