//! The fold as a function of the set: order, batches, removal and restoring do not matter.
#![expect(clippy::unwrap_used, reason = "a test stops at the first surprise")]

mod chains;
mod clusters;
mod confirmed;
mod existence;
mod honesty;
mod raster;
mod set_function;
mod walls;
mod work;
mod world;
