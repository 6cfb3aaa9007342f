//! What an operator does to a database from the command line: check it, copy it.

pub mod backup;
pub mod verify;

pub use backup::backup;
pub use verify::{Report, verify};
