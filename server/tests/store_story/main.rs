//! What the store and the levels in memory promise, on each engine.
//!
//! Every test runs on SQLite and on PostgreSQL, in a database of its own. PostgreSQL is found by
//! `MAPFOLD_TEST_POSTGRES` (`make test` sets it); a test that does not find it fails.

#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test stops at the first surprise"
)]

#[macro_use]
mod engines;
mod synthetic;

mod faults;
mod gdb;
mod imports;
mod levels_in_memory;
mod log;
mod maintenance;
mod replicas;
mod restarts;
mod reverted_maps;
mod reverts;
mod setup;
mod trust;
mod walls;
