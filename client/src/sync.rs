//! The robot's connection to the server: what it saw goes out, the shared map comes in.
//!
//! Built for a robot that is offline as often as not. What is to be sent lies on disk before it is
//! sent and until it is acknowledged; sending twice is harmless, because a contribution's id is
//! made before and the server knows it. Knows nothing of sensors, perception or logs.
//!
//! * [`tls`]: what a program does once, before it makes an [`Api`].
//! * [`Api`]: one function per endpoint; which errors are worth a retry.
//! * [`Backoff`]: how long to wait before it.
//! * [`Outbox`]: the durable queue of contributions.
//! * [`Uploader`]: drains the outbox, and says honestly what became of it.
//! * [`Mirror`]: a local copy of a level, kept up to date by patches.

mod api;
mod backoff;
mod durable;
mod encoded;
mod mirror;
mod outbox;
pub mod tls;
mod uploader;

pub use api::{Api, ApiError, ApiOptions, LevelAddress, Traffic};
pub use backoff::{Backoff, BackoffConfig};
pub use durable::DiskError;
pub use encoded::EncodedContribution;
pub use mirror::{Mirror, MirrorConfig, MirrorError, Refreshed, ResyncReason};
pub use outbox::{
    Acknowledgement, Outbox, OutboxConfig, OutboxContents, OutboxError, Pushed, Reconciled, Refusal,
};
pub use uploader::{UploadConfig, UploadEnd, UploadProgress, UploadSummary, Uploader};

#[cfg(test)]
mod tests;
