//! Plane geometry with uncertainty. Knows nothing of maps, robots' logs or grids.

mod angle;
mod chi_square;
mod covariance;
mod frame;
mod hull;
mod interval;
mod line;
mod pose;

pub use angle::{difference, wrap};
pub use chi_square::chi_square_quantile;
pub use covariance::{Covariance, CovarianceError, mahalanobis_sq};
pub use frame::{Level, Odom, Robot, Sensor};
pub use hull::{convex_hull, convex_hull_into, convex_hull_of_sweep, distance_to_hull};
pub use interval::{Interval, subtract_intervals, union_intervals};
pub(crate) use line::{Axes, offset_variance};
pub use line::{Line, MovedLine, UncertainLine, tangent, unit_normal};
pub use pose::{Pose, UncertainPose};

/// A point or a displacement in the plane, in metres.
pub type Point = nalgebra::Vector2<f64>;
