//! The robot's side of Mapfold: readings in, contributions out, the shared map back.
//!
//! Knows no SQL and serves nothing. Lengths are metres, angles radians, instants seconds of a
//! log's clock or microseconds since 1970; frames as in `mapfold_map`. Libraries here read no
//! clock and no randomness of their own: `main.rs` passes both in.
//!
//! * [`sensor`]: profiles of sensors and the readings they give: the ground.
//! * [`log`]: readers of recorded robot logs.
//! * [`perception`]: from a scan to segments and clusters.
//! * [`evidence`]: from a scan or a ring of sonars to evidence for the grid.
//! * [`emulation`]: a ring of sonars out of a scanner, for demonstrations.
//! * [`geojson`]: features of scans, for looking at.
//! * `odometry`: what the wheels count, and how it loses its certainty.
//! * [`robot`]: the surveyor, which makes contributions of readings.
//! * [`localization`]: where the robot is while it drives.
//! * [`sync`]: the outbox, the upload, the mirror of the shared map.
//! * [`replay`]: a log played against a server as the robot would have lived it.

pub mod emulation;
pub mod evidence;
pub mod geojson;
pub mod localization;
pub mod log;
mod odometry;
pub mod perception;
pub mod replay;
pub mod robot;
pub mod sensor;
pub mod sync;
