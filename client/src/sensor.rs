//! What a robot senses with: profiles of its sensors, the readings they give, how ranges are
//! corrected, and how a correction is measured.
//!
//! The ground of this crate: it knows neither maps nor files, only metres, radians and how far a
//! reading may be trusted.

pub mod calibration;
mod preset;
mod profile;
mod reading;
pub(crate) mod robust;
mod table;

pub use preset::{PRESETS, preset};
pub use profile::{MountedAt, ProfileError, ScannerProfile, Sensors, SonarProfile};
pub use reading::{Ring, Scan, ScanGeometry, Sonar};
pub use table::{CorrectedRange, EXTRAPOLATED_M, RangeTable};
pub(crate) use table::{Place, Spot as TableSpot};
