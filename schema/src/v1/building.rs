//! Buildings of Open-RMF as edits of the GDB.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::gdb_log::{GdbAnswer, GdbPreview};
use super::level::Bounds;

/// What was found in a `building.yaml`, of one level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BuildingReport {
    /// What the building is called.
    pub building: String,
    /// The level that is taken.
    pub building_level: String,
    /// All levels that it has.
    pub building_levels: Vec<String>,
    /// Metres of one unit of the drawing.
    pub scale_m: f64,
    /// Walls, those over doors included.
    pub walls: u32,
    /// Doorways.
    pub doorways: u32,
    /// Floors.
    pub floors: u32,
    /// Models that became instances of prototypes of the same name.
    pub instances: u32,
    /// What all of it covers; absent if there is nothing.
    #[serde(default)]
    pub bounds: Option<Bounds>,
    /// What is doubtful about it, or was not taken, in words.
    pub warnings: Vec<String>,
}

/// The answer to the import of a building: what was found, and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BuildingImport {
    /// What was found.
    pub report: BuildingReport,
    /// What it would change, for a preview.
    #[serde(default)]
    pub preview: Option<GdbPreview>,
    /// The draft with it, unless it was a preview.
    #[serde(default)]
    pub answer: Option<GdbAnswer>,
}
