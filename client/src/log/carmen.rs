//! CARMEN logs: text, one message a line, plain or gzip.
//!
//! [`messages`] streams line by line; [`read`] gathers a file into a [`Log`]. A line that cannot
//! be read is counted and reported and never stops the reading; only a file from which no reading
//! comes at all is an error. A file that breaks off gives what came before, and the summary says so.
//!
//! Angles: `ROBOTLASER1` tells its own. `FLASER` does not: 180 or 181 beams are 1 degree apart,
//! 360 or 361 half a degree, other counts half a degree as MRPT assumes; the parameter
//! `laser_front_laser_resolution` (degrees) overrules that. Beams that fill a half circle begin at
//! -90 degrees, others lie symmetrically about straight ahead.
//!
//! Poses: both lines carry the log's own pose. Odometry is what `FLASER` carries, else the last
//! `ODOM` line. A `SONAR` line has no pose: it gets that of the last scan, carried on by the
//! odometry since; in a log without any scan the `ODOM` pose is the only one there is.

mod assemble;
mod line;
mod stream;

pub use line::{LineError, LineFault, Message};
pub use stream::{Messages, StreamError, messages};

use std::path::{Path, PathBuf};

use super::Log;

/// Faults kept word for word; the rest is only counted.
pub const FAULTS_KEPT: usize = 20;

/// A log that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ReadError {
    /// No such file, or no right to read it.
    #[error("cannot open {}: {source}", .path.display())]
    Open {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file broke off, or is not the gzip that it claims to be, before anything was read.
    #[error(transparent)]
    Stream(#[from] StreamError),
    /// Nothing in it is a reading.
    #[error(
        "no scan and no sonar reading in {lines} lines ({malformed} malformed{})",
        .first.as_ref().map(|e| format!(", first: {e}")).unwrap_or_default()
    )]
    NoReadings {
        /// Lines of the file.
        lines: u64,
        /// Those that could not be read.
        malformed: u64,
        /// The first of them.
        first: Option<LineError>,
    },
}

/// Reads a log file, plain or gzip.
///
/// # Errors
/// A file that cannot be opened or read, or that holds no reading.
pub fn read(path: impl AsRef<Path>) -> Result<Log, ReadError> {
    let path = path.as_ref();
    let file = std::fs::File::open(path)
        .map_err(|source| ReadError::Open { path: path.to_owned(), source })?;
    read_from(std::io::BufReader::with_capacity(1 << 16, file))
}

/// Reads a log from any source of bytes, plain or gzip.
///
/// # Errors
/// A source that fails, or that holds no reading.
pub fn read_from(source: impl std::io::BufRead + 'static) -> Result<Log, ReadError> {
    assemble::assemble(messages(source)?)
}
