//! What travels between robots, server and operators, and the checks at the border.
//!
//! Wire types are plain data with public fields; JSON and CBOR come from the same types. Nothing
//! gets from here into [`mapfold_map`] but through a check that names what it refuses by JSON
//! pointer: whatever gets in is finite, in range and positive semi-definite.
//!
//! Compatibility: within `v1` fields are only ever added; readers of answers ignore what they do
//! not know, and the server refuses what it does not know in uploads, so that nothing a robot
//! meant is silently dropped.
//!
//! * [`v1`]: the types of `/api/v1`.
//! * [`border`]: limits, violations, and the way into `mapfold_map` types.
//! * [`codec`]: JSON and CBOR.
//! * [`digest`]: by what a contribution's content is known.
//! * [`geojson`]: the published map for other programs, as the server exports and mirrors write it.
//! * [`instant`]: RFC 3339 and microseconds.
//! * `malformed` (with the feature of that name): a catalogue of contributions to refuse.
//! * [`problem`]: RFC 9457 problems.
//! * [`route`]: every path, once.

pub mod border;
pub mod codec;
pub mod digest;
pub mod geojson;
pub mod instant;
#[cfg(feature = "malformed")]
pub mod malformed;
pub mod problem;
pub mod route;
pub mod slug;
pub mod v1;
