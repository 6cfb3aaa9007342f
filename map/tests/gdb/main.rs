//! The Geometrical Data Base against what is known otherwise: by hand, by sampling, by counting.
#![expect(clippy::unwrap_used, reason = "tests may stop at the first surprise")]

mod doorways;
mod faults;
mod footprints;
mod growth;
mod hall;
mod hostile;
mod landmarks;
mod order;
mod priors;
mod sampling;
mod sheets;
mod world;
