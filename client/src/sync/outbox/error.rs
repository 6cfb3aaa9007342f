//! Why the outbox cannot do what it should.

use std::path::PathBuf;

use mapfold_schema::codec::EncodeError;
use uuid::Uuid;

use crate::sync::durable::DiskError;

/// Why the outbox cannot do what it should.
#[derive(Debug, thiserror::Error)]
pub enum OutboxError {
    /// Another process (or another part of this one) has it open.
    #[error("{}: this outbox is in use; two robots cannot share one", .folder.display())]
    InUse {
        /// Its folder.
        folder: PathBuf,
    },
    /// It holds as much as it may; nothing was queued. It empties when the server is reached.
    #[error(
        "the outbox is full: {used_bytes} bytes wait, {needed_bytes} more are too many for the \
         quota of {quota_bytes}"
    )]
    Full {
        /// What it may hold.
        quota_bytes: u64,
        /// What it holds.
        used_bytes: u64,
        /// What was to be pushed.
        needed_bytes: u64,
    },
    /// Another content waits under the same id: ids are for one content only.
    #[error("another content waits under the id {id}")]
    Conflict {
        /// The id.
        id: Uuid,
    },
    /// No server takes a contribution this long.
    #[error("the contribution {id} is longer than four gigabytes")]
    TooLarge {
        /// The id.
        id: Uuid,
    },
    /// CBOR cannot hold it.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// It cannot be packed.
    #[error("cannot pack a contribution: {0}")]
    Pack(std::io::Error),
    /// The disk failed.
    #[error(transparent)]
    Disk(#[from] DiskError),
}
