//! The JSON of a glTF, as far as solids need it. Lists are bounded while they are read.

use serde_json::value::RawValue;

use super::super::few::Few;

/// A file.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Gltf {
    pub(super) scene: Option<usize>,
    pub(super) scenes: Few<Scene>,
    pub(super) nodes: Few<Node>,
    pub(super) meshes: Few<Mesh>,
    pub(super) accessors: Few<Accessor>,
    pub(super) buffer_views: Few<View>,
    pub(super) buffers: Few<Buffer>,
    pub(super) extensions_required: Few<String>,
}

/// Nodes that are shown together.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(default)]
pub(super) struct Scene {
    pub(super) nodes: Few<usize>,
}

/// A place, perhaps with a mesh.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(default)]
pub(super) struct Node {
    pub(super) name: Option<String>,
    pub(super) children: Few<usize>,
    pub(super) mesh: Option<usize>,
    pub(super) matrix: Option<[f64; 16]>,
    pub(super) translation: Option<[f64; 3]>,
    /// `[x, y, z, w]`.
    pub(super) rotation: Option<[f64; 4]>,
    pub(super) scale: Option<[f64; 3]>,
    pub(super) extras: Option<Box<RawValue>>,
}

/// Triangles.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(default)]
pub(super) struct Mesh {
    pub(super) name: Option<String>,
    pub(super) primitives: Few<Primitive>,
    pub(super) extras: Option<Box<RawValue>>,
}

/// Some of them.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(default)]
pub(super) struct Primitive {
    pub(super) attributes: Attributes,
    pub(super) indices: Option<usize>,
    pub(super) mode: Option<u32>,
}

/// What is known of vertices.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(default)]
pub(super) struct Attributes {
    #[serde(rename = "POSITION")]
    pub(super) position: Option<usize>,
}

/// Numbers in a stretch of the binary part.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Accessor {
    pub(super) buffer_view: Option<usize>,
    pub(super) byte_offset: usize,
    pub(super) component_type: u32,
    pub(super) count: usize,
    #[serde(rename = "type")]
    pub(super) kind: String,
    pub(super) sparse: Option<serde::de::IgnoredAny>,
}

/// A stretch of the binary part.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct View {
    pub(super) buffer: usize,
    pub(super) byte_offset: usize,
    pub(super) byte_length: usize,
    pub(super) byte_stride: Option<usize>,
}

/// The binary part.
#[derive(Debug, Default, serde::Deserialize)]
#[serde(rename_all = "camelCase", default)]
pub(super) struct Buffer {
    pub(super) uri: Option<serde::de::IgnoredAny>,
}
