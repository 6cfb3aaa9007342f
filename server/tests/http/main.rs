//! What the HTTP side promises, asked of a real server in this process, on a free port.
//!
//! On SQLite, in a folder of its own for each test; what could differ on PostgreSQL (found by
//! `MAPFOLD_TEST_POSTGRES`, which `make test` sets) is asked there too.

#![expect(
    clippy::unwrap_used,
    clippy::expect_used,
    clippy::panic,
    reason = "a test stops at the first surprise"
)]

mod client;
mod server;
mod world;

mod access;
mod alignments;
mod changes;
mod conditional;
mod description;
mod engines;
mod events;
mod exports;
mod gdb;
mod hand_checked;
mod imports;
mod landmarks;
mod layers;
mod life;
mod models;
mod page;
mod reverts;
mod sessions;
mod setup;
mod uploads;
