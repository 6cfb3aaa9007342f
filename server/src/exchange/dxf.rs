//! Drawings (ASCII DXF) as models: walls, doorways, furniture and machines in, and models out as named layers and blocks.
//!
//! * `groups`: lines in pairs, a code and a value, with their places.
//! * `document`: header, blocks and entities.
//! * `layers`: which layer is what, by a table that a request may extend.
//! * `placing`: where entities stand: units, blocks in blocks, coordinate systems of objects.
//! * `doors`: swings as doorways. Walls are of pairs of parallel lines, like those of maps (`paired`).
//! * `reading`: blocks laid out. `prototypes`: blocks as prototypes. `objects`: what is laid out, as objects.
//! * `writing`: the other way. `tagged`: what is written beside entities, so that a model comes back as what it was.
//!
//! Read by ourselves and not by a crate: a refusal names the line, what a small file may swell to is counted before it is
//! laid out, and of the hundreds of entities of the format ten are of a building.

mod document;
mod doors;
mod groups;
mod layers;
mod objects;
mod placing;
mod prototypes;
mod reading;
mod tagged;
mod writing;

pub use layers::LayerTable;
pub(super) use objects::upright_box;
pub(super) use prototypes::{area, corners, heights, prism};
pub use reading::{Options, read};
pub use writing::write;

/// What it is sent as.
pub const MEDIA_TYPE: &str = "image/vnd.dxf";
/// What else it is sent as.
pub const MEDIA_TYPES: [&str; 4] =
    [MEDIA_TYPE, "application/dxf", "image/x-dxf", "application/x-dxf"];
/// The name under which entities bear what DXF has no place for.
const APPLICATION: &str = "MAPFOLD";

#[cfg(test)]
mod tests;
