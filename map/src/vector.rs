//! Walls and what is not a wall: observations and what they fuse into.
//!
//! The way of a segment: observed in the robot frame ([`ObservedSegment`]) -> moved to the level
//! with both uncertainties (`sighting`) -> grouped as a function of the set (`leaders`) -> fused
//! without counting shared errors twice (`fusion`) -> a wall and what was seen of it (`wall`) -> held
//! against free space in the grid (`seen_through`) and better walls (`walls`) -> published
//! ([`Segment`]) -> oriented (`piece`), joined where ends meet
//! (`joint`, `gap`, `chains`) and cut to valid outlines (`outline`, `crossing`): [`Chain`]. Clusters go
//! the same way as segments, shorter (`things`), and end where a wall explains them (`explained`).
//! What walls explain of the grid is told from what is published (`confirmed`).
//!
//! What depends on what is found in a few places of memory, however large the level is: by numbered
//! places (`slots`), by squares of the level (`squares`, `ends`), by blocks of cells (`by_block`).

mod buckets;
mod by_block;
mod chain;
mod chains;
mod cluster;
mod config;
mod confirmed;
mod crossing;
mod ends;
mod explained;
mod fusion;
mod gap;
mod joinable;
mod joint;
mod leaders;
mod outline;
mod piece;
mod seen_through;
mod segment;
mod sighting;
mod slots;
mod squares;
mod things;
mod wall;
mod walls;
mod work;

pub use chain::{Chain, ChainId, ChainKind, Vertex};
pub(crate) use chains::Chains;
pub use cluster::{Cluster, ObservedCluster};
pub use config::VectorConfig;
pub use confirmed::{ConfirmedConfig, confirmed};
pub(crate) use seen_through::Evidence;
pub use segment::{EndKind, Facing, ObservedEnd, ObservedSegment, Segment, SolidInterval};
pub(crate) use things::Things;
pub(crate) use walls::Walls;
pub use work::Work;
