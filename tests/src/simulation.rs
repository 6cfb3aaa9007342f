//! Simulated robots in simulated buildings, written down as CARMEN logs: what the evaluation plays
//! where the recorded logs are not at hand, and where the truth must be known.
//!
//! What is simulated: straight walls, drives with odometry that drifts, corrected poses as good as
//! those of a good SLAM, scanners with range noise and lost returns, rings of sonars with wide
//! cones and mirroring walls, cheap infrared heads whose ranges err with distance and incidence, single
//! scans of furnished offices with the wall that each beam hit. What is not: people, slopes, motion during
//! a scan. Chance comes from the seed alone.

mod drive;
mod ir_head;
mod noise;
mod plan;
mod recorder;
mod scanner;
mod sonar;
mod sweep;
mod wheels;
mod world;

pub use drive::{Odometry, Pose, Stop, drive};
pub use ir_head::{IrBeam, IrHead, IrScanner};
pub use noise::Noise;
pub use plan::Plan;
pub use recorder::{Recording, record};
pub use scanner::Scanner;
pub use sonar::SonarRing;
pub use sweep::{Errors, Fan, REACH_M, Sweep};
pub use wheels::{Platform, way_points};
pub use world::{World, hall, office};
