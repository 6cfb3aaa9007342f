//! JSON-FG (OGC 21-045): the GDB as a feature collection that other programs read.
//!
//! What an object is made of stands in the feature's `properties`; `place` says the same in the coordinates
//! of the level, for programs that know nothing of us. `geometry`, which would be degrees on the earth, is null.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use super::gdb::{GdbObject, GdbPrototype};

/// A geometry of GeoJSON with heights, or of JSON-FG.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "type", deny_unknown_fields)]
pub enum Geometry {
    /// Rings; the last position of each repeats the first.
    Polygon {
        /// The outer ring, then holes.
        coordinates: Vec<Vec<Vec<f64>>>,
    },
    /// Several polygons; with heights: faces that enclose nothing.
    MultiPolygon {
        /// The polygons.
        coordinates: Vec<Vec<Vec<Vec<f64>>>>,
    },
    /// A solid by its faces.
    Polyhedron {
        /// Shells, the outer one first; each of polygons.
        coordinates: Vec<Vec<Vec<Vec<Vec<f64>>>>>,
    },
    /// A polygon drawn up.
    Prism {
        /// A polygon in the plane.
        #[schema(no_recursion)]
        base: Box<Geometry>,
        /// Height of the lower face.
        lower: f64,
        /// Height of the upper face.
        upper: f64,
    },
    /// Several geometries.
    GeometryCollection {
        /// They.
        #[schema(no_recursion)]
        geometries: Vec<Geometry>,
    },
}

/// An object as a feature.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GdbFeature {
    /// `Feature`.
    #[serde(rename = "type")]
    pub kind: FeatureWord,
    /// The object, made by whoever draws it.
    pub id: Uuid,
    /// The object's kind again, for programs that tell features by it.
    #[serde(rename = "featureType", default, skip_serializing_if = "Option::is_none")]
    pub feature_type: Option<String>,
    /// Null.
    #[serde(default)]
    pub geometry: Option<Geometry>,
    /// What the object is made of, in the level. With `solids` or `prototype` in the properties it may be left
    /// out, and must not differ from them; without, it says what the object is made of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<Geometry>,
    /// Null: the model is of no time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    pub time: Option<serde_json::Value>,
    /// The object.
    pub properties: GdbObject,
}

/// `Feature`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub enum FeatureWord {
    /// `Feature`.
    Feature,
}

/// `FeatureCollection`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub enum CollectionWord {
    /// `FeatureCollection`.
    FeatureCollection,
}

/// The a-priori model of a level.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GdbCollection {
    /// `FeatureCollection`.
    #[serde(rename = "type")]
    pub kind: CollectionWord,
    /// Which parts of JSON-FG are used.
    #[serde(rename = "conformsTo", default, skip_serializing_if = "Vec::is_empty")]
    pub conforms_to: Vec<String>,
    /// The level's frame, metres; may be left out of what is sent, and is refused if it is another frame.
    #[serde(rename = "coordRefSys", default, skip_serializing_if = "Option::is_none")]
    #[schema(value_type = Option<Object>)]
    pub coord_ref_sys: Option<serde_json::Value>,
    /// In answers: the revision of the level's log at which the model became what this is.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub revision: Option<i64>,
    /// In answers: the revision of the site's library that instances are taken from.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub library: Option<i64>,
    /// The objects, by identity.
    pub features: Vec<GdbFeature>,
}

/// A prototype as a feature: `id` is its name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PrototypeFeature {
    /// `Feature`.
    #[serde(rename = "type")]
    pub kind: FeatureWord,
    /// Its name: what instances name it by.
    pub id: String,
    /// `prototype`.
    #[serde(rename = "featureType", default, skip_serializing_if = "Option::is_none")]
    pub feature_type: Option<String>,
    /// Null.
    #[serde(default)]
    pub geometry: Option<Geometry>,
    /// What it is made of, in its own coordinates. As in the features of a level.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub place: Option<Geometry>,
    /// The prototype.
    pub properties: GdbPrototype,
}

/// The library of a site.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PrototypeCollection {
    /// `FeatureCollection`.
    #[serde(rename = "type")]
    pub kind: CollectionWord,
    /// Which parts of JSON-FG are used.
    #[serde(rename = "conformsTo", default, skip_serializing_if = "Vec::is_empty")]
    pub conforms_to: Vec<String>,
    /// In answers: how often the library has changed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub revision: Option<i64>,
    /// The prototypes, by name.
    pub features: Vec<PrototypeFeature>,
}
