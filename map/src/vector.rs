//! Walls and what is not a wall: observations and what they fuse into.
//!
//! The way of a segment: observed in the robot frame ([`ObservedSegment`]) -> moved to the level
//! with both uncertainties (`sighting`) -> grouped as a function of the set (`leaders`) -> fused
//! without counting shared errors twice (`fusion`) -> a wall and what was seen of it (`wall`) -> held
//! against free space in the grid (`seen_through`) and better walls (`walls`) -> published
//! ([`Segment`]). Clusters go the same way, shorter (`things`).

mod by_tile;
mod cluster;
mod config;
mod fusion;
mod leaders;
mod seen_through;
mod segment;
mod sighting;
mod things;
mod wall;
mod walls;

pub use cluster::{Cluster, ObservedCluster};
pub use config::VectorConfig;
pub(crate) use seen_through::Evidence;
pub use segment::{EndKind, Facing, ObservedEnd, ObservedSegment, Segment, SolidInterval};
pub(crate) use things::Things;
pub(crate) use walls::Walls;
