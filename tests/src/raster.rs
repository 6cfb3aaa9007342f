//! The raster map beside truth: how fast scans become cells, and how much the cells say.
//!
//! Rooms, readings, truth, scores and the plain models are this crate's own; what is scored is the
//! evidence that a robot makes.

mod bare;
mod cone;
pub mod exact;
pub mod fleet;
mod grid;
pub mod recorded;
mod rooms;
pub mod scanner;
pub mod sonar;
pub mod tables;

pub use bare::BareGrid;
pub use grid::{Grid, Scores, Truth};
pub use tables::raster;
