//! Models in three dimensions as binary glTF 2.0 (GLB), out and in.
//!
//! * `container`: the chunks of the file. `document`: the JSON in it, bounded. `accessors`: numbers in the binary part.
//! * `meshes`: triangles as solids. `reading`: nodes as objects. `writing`: the other way.
//!
//! glTF has y up and looks along -z; a level has z up. The root node turns one into the other, `(x, y, z)` to `(x, z, -y)`: below
//! it, coordinates are those of the level. Positions are single floats, so that solids are also written beside their
//! mesh, with a digest of its numbers: what nobody has touched comes back as what it was, and what somebody has, as it is.
//!
//! Read by ourselves and not by a crate: coordinates of nodes stay double, what a file may swell to is counted before it is
//! laid out, and nothing outside of the file is ever fetched.

mod accessors;
mod container;
mod document;
mod meshes;
mod reading;
mod writing;

pub use reading::read;
pub use writing::write;

/// What it is sent as.
pub const MEDIA_TYPE: &str = "model/gltf-binary";

#[cfg(test)]
mod tests;
