//! Live events of a level.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// `event: revision` of `GET L/events`: the published map has reached a revision. Several
/// revisions may come as one event.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct LevelEvent {
    /// The revision that the published map has reached.
    pub revision: i64,
    /// Robots whose contributions are new in it.
    pub robots: Vec<String>,
    /// Number of changed or removed segments, clusters and chains.
    pub features: u32,
    /// Number of changed or removed tiles.
    pub tiles: u32,
    /// Number of acts of operators (reverts, and their undoing) among the revisions.
    #[serde(default)]
    pub acts: u32,
}
