//! What a level's map is, and how contributions change it.
//!
//! A map is the fold of a *set* of contributions: the same set gives the same bits, in whatever
//! order it arrived. This crate is pure: it knows no file, socket, clock, randomness, thread or
//! wire format, and nothing in it depends on hash order.
//!
//! Units are metres, radians and (for instants) microseconds since 1970, everywhere and without
//! suffix except where a bare number crosses the crate's border. Frames are `Level`, `Odom`, `Robot` and `Sensor`,
//! right-handed, x ahead (east), y left (north), headings counter-clockwise. A pose is named
//! `level_from_robot` and reads like the product `a_from_c = a_from_b * b_from_c`; the state
//! order is (x, y, heading).
//!
//! Two robots see one wall, from two places; the map has one segment that both support, and taking
//! one of them out again leaves the map that the other would have made alone:
//!
//! ```
//! use mapfold_map::geometry::{Covariance, Line, Pose, UncertainLine, UncertainPose};
//! use mapfold_map::level::{Contribution, ContributionId, Level, LevelConfig, Provenance};
//! use mapfold_map::vector::{EndKind, Facing, ObservedEnd, ObservedSegment};
//!
//! let look = |number: u8, robot: &str, x: f64| Contribution {
//!     id: ContributionId([number; 16]),
//!     robot: robot.into(),
//!     observed_at_us: 0,
//!     level_from_robot: UncertainPose {
//!         pose: Pose::new(x, 1.0, 0.0),
//!         covariance: Covariance::from_variances([4e-4, 4e-4, 1e-5]),
//!     },
//!     provenance: Provenance::SharedMap,
//!     segments: vec![ObservedSegment {
//!         // The wall y = 3 is 2 m to the left of a robot at y = 1 that looks along x.
//!         line: UncertainLine {
//!             line: Line::normal_form(2.0, std::f64::consts::FRAC_PI_2).0,
//!             covariance: Covariance::from_variances([1e-4, 1e-5]),
//!         },
//!         from: -1.5,
//!         to: 1.5,
//!         facing: Facing::Origin,
//!         ends: [ObservedEnd { kind: EndKind::Occluded, sd: 0.02 }; 2],
//!         points: 60,
//!         seen_through: vec![],
//!     }],
//!     clusters: vec![],
//!     evidence: vec![],
//! };
//! let (ada, bob) = (look(1, "ada", 4.0), look(2, "bob", 5.0));
//!
//! let mut level = Level::new(LevelConfig::standard(0.05));
//! level.fold([&bob, &ada]);
//! let segment = level.map().segments.values().next().expect("one wall");
//! assert_eq!(segment.looks, 2);
//! assert!((segment.line.rho() - 3.0).abs() < 1e-9);
//! // 4 m between the outermost ends, each drawn in by what its look does not vouch for.
//! assert!((3850..4000).contains(&segment.solid[0].span.length()));
//!
//! level.unfold([&ada]);
//! let mut alone = Level::new(LevelConfig::standard(0.05));
//! alone.fold([&bob]);
//! assert_eq!(level.map(), alone.map());
//! ```
//!
//! * [`geometry`]: angles, covariances, poses, supporting lines, intervals, hulls.
//! * [`vector`]: observed segments and clusters, and the walls they fuse into.
//! * [`raster`]: integer log-odds evidence and the tiles it adds up in.
//! * [`gdb`]: the building as it was meant to be, cut to what a sensor would see of it.
//! * [`changes`]: what a level's map says against a plan of the GDB.
//! * [`places`]: where on a map a whole look fits, and nowhere else.
//! * [`alignment`]: where on a level a whole map lies that a robot made in a frame of its own.
//! * [`level`]: contributions, the fold, and patches between two revisions.

pub mod alignment;
#[cfg(test)]
mod chance;
pub mod changes;
pub mod gdb;
pub mod geometry;
pub mod landmarks;
pub mod level;
pub mod places;
pub mod raster;
pub mod vector;
