//! A copy of the whole database, also while it is written to.

use std::path::Path;

use crate::store::{Store, StoreError};

/// Writes a copy of the database to `file`, which must not exist yet: all of one moment, compact,
/// without a write-ahead log beside it. SQLite only.
///
/// # Errors
/// [`StoreError::Unsupported`] on PostgreSQL, with the command to use; a file that exists or
/// cannot be written.
pub async fn backup(store: &Store, file: &Path) -> Result<(), StoreError> {
    store.copy_to(file).await
}
