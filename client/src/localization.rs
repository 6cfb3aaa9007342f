//! Where the robot is: found from nothing, kept while it drives, and said to be lost when it is.
//!
//! [`Localizer`] is the whole of it: a [`Seeker`] holds whole looks against the raster until one place is certain
//! (`mapfold_map::places`), a [`Tracker`] goes on from there until it is not.
//!
//! The tracker: its pose carried on by the wheels and held against walls and landmarks
//! that are known, those of the shared map or of the plan of the a-priori model.
//!
//! [`ReferenceWalls`] are what looks are held against, found by place. [`Tracker`] is an extended Kalman filter on
//! the pose that starts from a fix (`mapfold_map::landmarks::locate`, say) and says when it no longer knows:
//! [`Tracking::Lost`]. Who drives it:
//!
//! ```
//! use mapfold_client::localization::{ReferenceWalls, Tracker, TrackerConfig, Tracking};
//! use mapfold_map::geometry::{Covariance, Pose, UncertainPose};
//! use mapfold_map::level::LevelMap;
//! # let (map, segments) = (LevelMap::default(), Vec::new());
//!
//! let walls = ReferenceWalls::of_map(&map);
//! let fix = UncertainPose {
//!     pose: Pose::new(3.0, 2.0, 0.1),
//!     covariance: Covariance::from_variances([4e-4, 4e-4, 1e-4]),
//! };
//! let mut tracker = Tracker::new(fix, TrackerConfig::STANDARD);
//! tracker.moved(&Pose::new(0.4, 0.0, 0.02)); // what the wheels counted since, in the robot's own frame
//! let report = tracker.seen(&segments, &walls, None); // what perception made of a scan
//! match tracker.state() {
//!     Tracking::Tracked(level_from_robot) => println!("{level_from_robot:?}, {} walls", report.walls.len()),
//!     Tracking::Lost(why) => println!("lost: {why:?}"), // find a fix anew, and start a new tracker from it
//! }
//! ```
//!
//! Knows no server.

mod drift;
mod filter;
mod landmarks;
mod lines;
mod localizer;
mod look;
mod reference_walls;
mod seeker;
mod slips;
mod sonar;
#[cfg(test)]
mod tests;
mod tracker;
mod view;
mod watchdog;

pub use drift::DriftConfig;
pub use filter::WallName;
pub use localizer::{
    CheckConfig, KnownLevel, Localized, Localizer, LocalizerConfig, NOTHING_KNOWN,
};
pub use look::TrackReport;
pub use reference_walls::{ReferenceWalls, ReferenceWallsConfig};
pub use seeker::{Candidate, Fix, Seeker, SeekerConfig};
pub use slips::SlipConfig;
pub use tracker::{Tracker, TrackerConfig};
pub use view::view;
pub use watchdog::{Lost, Tracking, WatchdogConfig};
