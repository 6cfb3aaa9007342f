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
//! * [`geometry`]: angles, covariances, poses, supporting lines, intervals, hulls.
//! * [`vector`]: observed segments and clusters, and the walls they fuse into.
//! * [`raster`]: integer log-odds evidence and the tiles it adds up in.
//! * [`level`]: contributions, the fold, and patches between two revisions.

pub mod geometry;
pub mod level;
pub mod raster;
pub mod vector;
