//! Occupancy evidence: integer log-odds that add up in any order and can be taken out exactly.

mod blocks;
mod crossed;
mod evidence;
mod log_odds;
mod pen;
mod slices;
mod sums;
mod tile;
mod together;

pub(crate) use blocks::{Blocks, Touched};
pub(crate) use crossed::crossed;
pub use evidence::{EvidencePatch, EvidenceRun, RunError, TilePatch};
pub use log_odds::LogOdds;
pub use pen::{PatchPen, RowRuns};
pub(crate) use slices::Stack;
pub use slices::{Slice, SliceConfig, SliceKey};
pub use sums::{Packed, Sums};
pub use tile::{Cell, TILE_CELLS, TILE_SIDE, Tile, TileIndex, TileKey};
pub use together::{Layered, Said, together};

/// The kind of sensor that evidence comes from; each has layers of its own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum SensorClass {
    /// Laser and other scanners: narrow beams.
    Scanner,
    /// Ultrasonic range finders: wide cones.
    Sonar,
}

impl SensorClass {
    /// All classes, in their canonical order.
    pub const ALL: [Self; 2] = [Self::Scanner, Self::Sonar];
}
