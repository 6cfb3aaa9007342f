//! The way in: wire types are checked here, once, and become `mapfold_map` types.

pub mod alignment;
mod chains;
pub mod changes;
mod contribution;
mod features;
pub mod gdb;
mod number;
mod sensors;
mod violations;
mod words;

pub use chains::{chain_id, map_chain, parse_chain_id, wire_chain};
pub use contribution::{check_contribution, wire_contribution};
pub use features::{
    feature_id, map_cluster, map_patch, map_segment, map_tile, map_tile_address, parse_feature_id,
    wire_cluster, wire_patch, wire_segment, wire_tile, wire_tile_address,
};
pub use sensors::{check_correction, check_sensors};
pub use violations::{VIOLATIONS_MAX, Violation};

use uuid::Uuid;

/// How much one upload may hold and how far it may reach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Largest |x|, |y| of anything, metres from the level's origin.
    pub coordinate_max_m: f64,
    /// Segments in one contribution.
    pub segments_max: usize,
    /// Length of all segments of one contribution together, metres: what folding them costs grows
    /// with it, and no scanner sees more of one floor at once.
    pub segments_length_max_m: f64,
    /// Clusters in one contribution.
    pub clusters_max: usize,
    /// Width of all clusters of one contribution together, metres.
    pub clusters_width_max_m: f64,
    /// Points of one hull.
    pub hull_points_max: usize,
    /// Tiles in one contribution.
    pub tiles_max: usize,
    /// Largest |evidence| that one look may give a cell, 0.01 nat.
    pub evidence_max: i32,
    /// Contributions in one upload.
    pub batch_max: usize,
}

/// The limits of a site that sets none of its own.
pub const DEFAULT_LIMITS: Limits = Limits {
    coordinate_max_m: 100_000.0,
    segments_max: 4096,
    segments_length_max_m: 4000.0,
    clusters_max: 4096,
    clusters_width_max_m: 2000.0,
    hull_points_max: 256,
    tiles_max: 4096,
    evidence_max: 400,
    batch_max: 64,
};

/// What a contribution is checked against.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Target {
    /// The level's frame.
    pub frame: Uuid,
    /// Edge of a cell, metres.
    pub resolution_m: f64,
    /// The site's limits.
    pub limits: Limits,
}
