//! Everything that is on disk, in SQLite or PostgreSQL: one text of SQL for both.
//!
//! One file per family of tables; the few words in which the engines differ stand in `dialect`.
//! Knows wire types and map types, and neither HTTP nor how levels are kept in memory.
//!
//! * [`sites`], [`levels`], [`robots`], [`tokens`]: what people set up.
//! * [`contributions`]: the append to a level's log, the one path to an acknowledgement.
//! * [`acts`]: what operators did to a log; [`revision_list`]: the columns that say to what.
//! * [`alignments`]: where robots' own frames lie, in a log.
//! * [`imports`]: maps of other programs in a log, and what they say.
//! * [`gdb`]: the a-priori model in a log; [`library`]: the prototypes of a site.
//! * [`dismissals`]: what operators do not want to be told of any more.
//! * [`log`]: reading the log; [`payload`]: the two columns that hold a contribution.
//! * [`map_rows`]: the folded map, written behind; [`tile_cells`]: the column that holds a tile.

pub mod acts;
pub mod alignments;
pub mod contributions;
pub mod dismissals;
pub mod gdb;
pub mod imports;
pub mod levels;
pub mod library;
pub mod log;
pub mod map_rows;
pub mod payload;
pub mod revision_list;
pub mod robots;
pub mod sites;
pub mod tile_cells;
pub mod tokens;

mod dialect;
mod engine;
mod error;
mod pages;
mod row;
mod transaction;
mod values;

use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use sqlx::AnyPool;

use dialect::Dialect;
use engine::Pools;
use transaction::Tx;

pub use engine::sqlite_url;
pub use error::StoreError;

/// Attempts at a transaction that others are in the way of.
const ATTEMPTS_MAX: u32 = 5;
/// Pause after the first of them; doubled after each further one.
const FIRST_PAUSE: Duration = Duration::from_millis(10);

/// A database, open. Clones share its connections.
#[derive(Debug, Clone)]
pub struct Store {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    dialect: &'static Dialect,
    pools: Pools,
}

impl Store {
    /// Opens the database at `url`: `sqlite:///path/to/file.db` (made if it is not there) or
    /// `postgres://user:password@host/name`. Refuses an engine that could lose or spoil what was
    /// acknowledged: an SQLite older than 3.51.3, or without write-ahead log and full
    /// synchronisation; a PostgreSQL that answers commits before they are on disk.
    ///
    /// # Errors
    /// What cannot be opened, or not be trusted.
    pub async fn connect(url: &str) -> Result<Self, StoreError> {
        let (dialect, pools) = engine::open(url).await?;
        Ok(Self { inner: Arc::new(Inner { dialect, pools }) })
    }

    /// Brings the tables up to date.
    ///
    /// # Errors
    /// A migration that fails, or a database that a newer server has migrated.
    pub async fn migrate(&self) -> Result<(), StoreError> {
        engine::migrate(self.inner.dialect, &self.inner.pools.migrators).await
    }

    /// Whether the database answers: for `/readyz`.
    ///
    /// # Errors
    /// The reason why it does not.
    pub async fn ping(&self) -> Result<(), StoreError> {
        sqlx::query("select 1").execute(&self.inner.pools.readers).await?;
        Ok(())
    }

    /// Waits for running statements and closes all connections.
    pub async fn close(&self) {
        self.inner.pools.migrators.close().await;
        self.inner.pools.writers.close().await;
        self.inner.pools.readers.close().await;
    }

    /// The engine's name, for people.
    pub fn engine(&self) -> &'static str {
        self.inner.dialect.name
    }

    /// Copies the whole database to `file`, at one moment, while it is in use.
    ///
    /// # Errors
    /// [`StoreError::Unsupported`] on PostgreSQL; a file that exists or cannot be written.
    pub async fn copy_to(&self, file: &Path) -> Result<(), StoreError> {
        engine::copy_to(self.inner.dialect, &self.inner.pools.readers, file).await
    }

    /// Whether the engine finds its own file sound; what it found otherwise. PostgreSQL checks its
    /// pages as it reads them, so nothing is asked of it.
    ///
    /// # Errors
    /// The store cannot be read at all.
    pub async fn check_file(&self) -> Result<Vec<String>, StoreError> {
        engine::check_file(self.inner.dialect, &self.inner.pools.readers).await
    }

    /// Where plain reads go.
    fn reads(&self) -> &AnyPool {
        &self.inner.pools.readers
    }

    /// Where single statements that write go.
    fn writes(&self) -> &AnyPool {
        &self.inner.pools.writers
    }

    /// A transaction that writes.
    async fn begin_write(&self) -> Result<Tx, StoreError> {
        Tx::begin(&self.inner.pools.writers, self.inner.dialect.begin_write).await
    }

    /// A transaction whose reads all see the same state.
    async fn begin_read(&self) -> Result<Tx, StoreError> {
        Tx::begin(&self.inner.pools.readers, self.inner.dialect.begin_read).await
    }
}

/// Runs a whole transaction again while others are in its way, a few times. It may so run more
/// than once and must not have effects outside the store.
async fn retried<T, F>(name: &'static str, mut attempt: impl FnMut() -> F) -> Result<T, StoreError>
where
    F: Future<Output = Result<T, StoreError>>,
{
    let mut pause = FIRST_PAUSE;
    let mut number = 1;
    loop {
        match attempt().await {
            Err(StoreError::Busy(error)) if number < ATTEMPTS_MAX => {
                tracing::debug!(name, number, %error, "transaction runs again");
                metrics::counter!("mapfold_store_retries_total", "transaction" => name)
                    .increment(1);
                tokio::time::sleep(pause).await;
                pause *= 2;
                number += 1;
            }
            outcome => return outcome,
        }
    }
}
