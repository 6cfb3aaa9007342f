//! Models as files: the exchange form that holds all of one, and what was found in a file of another program.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::gdb::ObjectKind;
use super::gdb_log::{GdbAnswer, GdbPreview};
use super::jsonfg::{CollectionWord, GdbFeature, PrototypeFeature};
use super::level::Bounds;

/// A model with the prototypes that its instances are of, as JSON-FG: what `exports/jsonfg` gives, and `imports` takes
/// back without loss, into any level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GdbDocument {
    /// `FeatureCollection`.
    #[serde(rename = "type")]
    pub kind: CollectionWord,
    /// Which parts of JSON-FG are used.
    #[serde(rename = "conformsTo", default, skip_serializing_if = "Vec::is_empty")]
    pub conforms_to: Vec<String>,
    /// The frame of the level that it was taken from, metres. Coordinates of another level are taken as those of this one.
    #[serde(rename = "coordRefSys", default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    pub coord_ref_sys: Option<serde_json::Value>,
    /// The draft that it was written from; not read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub revision: Option<i64>,
    /// The library that it was written from; not read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub library: Option<i64>,
    /// The prototypes that instances may name; others are those of the site.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub prototypes: Vec<PrototypeFeature>,
    /// The objects, by identity.
    pub features: Vec<GdbFeature>,
}

/// Formats that a model comes in as.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ModelFormat {
    /// JSON-FG.
    Jsonfg,
    /// A flat plan as GeoJSON.
    Geojson,
    /// A drawing (DXF).
    Dxf,
    /// Binary glTF.
    Glb,
    /// A map of `map_server`, drawn as walls.
    Nav2,
}

/// Objects of one kind.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct KindCount {
    /// What they are.
    pub kind: ObjectKind,
    /// How many there are.
    pub count: u32,
}

/// Things in a file that are not taken.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
pub struct LeftOut {
    /// What they are, and where.
    pub what: String,
    /// How many.
    pub count: u32,
    /// Why.
    pub why: String,
}

/// What was found in a file of a model.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ModelReport {
    /// The format.
    pub format: ModelFormat,
    /// Metres of one unit of the file.
    pub scale_m: f64,
    /// Objects by kind.
    pub kinds: Vec<KindCount>,
    /// Those of them that are instances of prototypes.
    pub instances: u32,
    /// Prototypes that the site's library does not have and gets, by the names that they get.
    pub prototypes: Vec<String>,
    /// What all of it covers; absent if there is nothing.
    #[serde(default)]
    pub bounds: Option<Bounds>,
    /// What is not taken, and why.
    pub left_out: Vec<LeftOut>,
    /// What is doubtful about it, in words.
    pub warnings: Vec<String>,
}

/// The answer to the import of a model: what was found, and what became of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ModelImport {
    /// What was found.
    pub report: ModelReport,
    /// What it would change, for a preview.
    #[serde(default)]
    pub preview: Option<GdbPreview>,
    /// The draft with it, unless it was a preview.
    #[serde(default)]
    pub answer: Option<GdbAnswer>,
}
