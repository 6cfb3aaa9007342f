//! What a robot senses with: profiles of its sensors, and the readings they give.
//!
//! The ground of this crate: it knows neither maps nor files, only metres, radians and how far a
//! reading may be trusted.

mod profile;
mod reading;

pub use profile::{
    MountedAt, PRESETS, ProfileError, ScannerProfile, Sensors, SonarProfile, preset,
};
pub use reading::{Ring, Scan, ScanGeometry, Sonar};
