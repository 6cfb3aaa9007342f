//! One floor's map as the fold of a set of contributions.

mod batch;
mod contribution;
mod fold;
mod map;
mod patch;

pub use batch::{Batch, Misplaced};
pub use contribution::{Contribution, ContributionId, FeatureId, Provenance, RobotName};
pub use fold::{Changes, Level, LevelConfig};
pub use map::LevelMap;
pub use patch::{Patch, apply, diff};
