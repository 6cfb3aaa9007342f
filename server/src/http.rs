//! The HTTP side: who asks for what, and in which words the answer goes out. The only part that
//! knows statuses, headers and media types; it decides nothing about maps.
//!
//! * `router`: the whole API on one screen, and `openapi`, its description.
//! * `layers`: what every request passes before and after its handler, in an order that matters.
//! * `listen`: the accept loop.
//! * `problem`: every error and the problem that it becomes.
//! * `access`, `body`, `cap`, `query`, `preconditions`, `answer`: what handlers take in and give out.
//! * One file per resource, with thin handlers.

mod access;
mod alignments;
mod answer;
mod batch;
mod body;
mod cap;
mod check;
mod layers;
mod listen;
mod model_exports;
mod model_imports;
mod observe;
mod openapi;
mod preconditions;
mod problem;
mod query;
mod router;
mod state;

mod buildings;
mod changes;
mod contributions;
mod docs;
mod drawing;
mod events;
mod exports;
#[cfg(test)]
mod fixture;
mod gdb;
mod health;
mod imports;
mod landmarks;
mod levels;
mod page;
mod patches;
mod plan;
mod prototypes;
mod raster;
mod reverts;
mod robots;
mod session;
mod sites;
mod tiles;
mod vector;

pub use listen::serve;
pub use openapi::openapi;
pub use router::router;
pub use state::{App, Parts};
