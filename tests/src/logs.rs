//! Which recorded logs there are.

use std::path::{Path, PathBuf};

/// Logs with corrected poses that may lie beside the repository.
const FURTHER: [&str; 6] = ["intel", "aces", "csail", "freiburg-101", "fhw", "belgioioso"];

/// The log that the repository holds.
pub(crate) fn killian() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/killian.log.gz")
}

/// Further logs with corrected poses, as far as they are in `logs/` of `data`, by their names in tables.
pub(crate) fn further(data: Option<&Path>) -> Vec<(String, PathBuf)> {
    named(data, &FURTHER)
}

/// Logs as far as they are in `logs/` of `data`, by their names in tables.
pub(crate) fn named(data: Option<&Path>, names: &[&str]) -> Vec<(String, PathBuf)> {
    let path = |name| data.map(|data| data.join(format!("logs/{name}.log.gz")));
    let there = names.iter().filter_map(|name| Some((format!("{name} *"), path(name)?)));
    there.filter(|(_, path)| path.is_file()).collect()
}
