//! Mapfold's server: it keeps the log of what robots saw, folds it, and shares the map.
//!
//! [`start`] is the only place that knows all parts. Arrows inside: `http -> level -> store`,
//! `http -> store` for plain reads, `exchange` and `page` know neither.
//!
//! * [`store`]: what is on disk, in SQLite or PostgreSQL.
//! * [`level`]: levels in memory: queue, group commit, fold, snapshots, events.
//! * [`http`]: routes, layers, problems.
//! * [`exchange`]: the map in other programs' formats.
//! * [`auth`]: tokens and scopes. [`config`]: settings. [`page`]: the operators' page.
//! * [`maintenance`]: verify and backup. [`cli`]: the program's commands.
//! * [`clock`] and [`chance`]: time and randomness, as parameters.

pub mod auth;
pub mod chance;
pub mod cli;
pub mod clock;
pub mod config;
pub mod exchange;
pub mod http;
pub mod level;
pub mod maintenance;
pub mod page;
pub mod store;

mod running;

pub use running::{Running, StartError, open_store, start, start_with};
