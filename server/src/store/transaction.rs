//! Transactions whose connection is thrown away unless they end well.
//!
//! sqlx's own count how deep they are. When an engine rolls back by itself (SQLite does on a full
//! disk), that count is wrong from then on, and a pool would hand the connection out for ever
//! although nothing can begin on it. A new connection costs a millisecond.

use std::ops::{Deref, DerefMut};

use sqlx::pool::PoolConnection;
use sqlx::{Any, AnyConnection, AnyPool, Executor};

use super::StoreError;

/// A transaction. Dropped before its end, also by a caller that has lost patience, it takes its
/// connection with it, and the engine rolls back.
#[derive(Debug)]
pub(super) struct Tx {
    connection: PoolConnection<Any>,
    open: bool,
}

impl Tx {
    /// Begins one with the words `begin`.
    pub(super) async fn begin(pool: &AnyPool, begin: &'static str) -> Result<Self, StoreError> {
        let connection = pool.acquire().await?;
        // From here on, in doubt, it is open.
        let mut tx = Self { connection, open: true };
        tx.connection.execute(begin).await?;
        Ok(tx)
    }

    /// Ends it. An error leaves open whether it has happened.
    pub(super) async fn commit(mut self) -> Result<(), StoreError> {
        self.connection.execute("commit").await?;
        self.open = false;
        Ok(())
    }

    /// Takes everything back.
    pub(super) async fn rollback(mut self) -> Result<(), StoreError> {
        self.connection.execute("rollback").await?;
        self.open = false;
        Ok(())
    }
}

impl Deref for Tx {
    type Target = AnyConnection;

    fn deref(&self) -> &AnyConnection {
        &self.connection
    }
}

impl DerefMut for Tx {
    fn deref_mut(&mut self) -> &mut AnyConnection {
        &mut self.connection
    }
}

impl Drop for Tx {
    fn drop(&mut self) {
        if self.open {
            self.connection.close_on_drop();
        }
    }
}
