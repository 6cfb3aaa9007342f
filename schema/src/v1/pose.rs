//! Poses on a level.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Where something is on a level, or may be, with its covariance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct UncertainPose {
    /// Position, x.
    pub x_m: f64,
    /// Position, y.
    pub y_m: f64,
    /// Heading, counter-clockwise from x.
    pub heading_rad: f64,
    /// Covariance of (x, y, heading), row by row.
    pub covariance: [[f64; 3]; 3],
}
