//! The few words in which SQLite and PostgreSQL differ. All other SQL is one text for both.
//!
//! Of sqlx's `Any` driver, which carries that text, three things must be known: SQL has `$1`
//! parameters; columns are `bigint`, `double precision`, `text` and `blob`/`bytea` only; and a null
//! `f64` is never bound (sqlx 0.9.0 sends it as a 32-bit one, and PostgreSQL then refuses the next
//! value of that statement).

/// The engines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Engine {
    /// In this process, one file.
    Sqlite,
    /// A server of its own.
    Postgres,
}

/// What an engine says differently.
#[derive(Debug)]
pub(super) struct Dialect {
    /// Which one it is.
    pub(super) engine: Engine,
    /// For messages.
    pub(super) name: &'static str,
    /// Begins a transaction that writes. SQLite takes its write lock at once (a lock taken half
    /// way could not be waited for); PostgreSQL takes the locks of rows as it changes them.
    pub(super) begin_write: &'static str,
    /// Begins a transaction whose statements all see the same state.
    pub(super) begin_read: &'static str,
    /// Run on every new connection.
    pub(super) session: &'static [&'static str],
    /// Run besides on the connection that migrates, which may take its time.
    pub(super) migration_session: &'static [&'static str],
    /// Connections that may write at the same time. SQLite has one writer; a queue in front of
    /// it is fair, its busy handler is not.
    pub(super) writers_max: u32,
}

/// The embedded default.
pub(super) static SQLITE: Dialect = Dialect {
    engine: Engine::Sqlite,
    name: "SQLite",
    begin_write: "begin immediate",
    begin_read: "begin",
    session: &[
        "pragma journal_mode = wal",
        // NORMAL lost acknowledged commits in 4 of 5 simulated power cuts, FULL in none.
        "pragma synchronous = full",
        "pragma foreign_keys = on",
        // Another process (a backup, `verify`) may hold the write lock for a moment.
        "pragma busy_timeout = 3000",
    ],
    migration_session: &["pragma busy_timeout = 60000"],
    writers_max: 1,
};

/// For fleets that outgrow one machine.
pub(super) static POSTGRES: Dialect = Dialect {
    engine: Engine::Postgres,
    name: "PostgreSQL",
    begin_write: "begin",
    begin_read: "begin isolation level repeatable read, read only",
    session: &[
        "set application_name = 'mapfold-server'",
        "set statement_timeout = '30s'",
        "set lock_timeout = '3s'",
        // A replica that hangs must not keep the lock of a level.
        "set idle_in_transaction_session_timeout = '30s'",
    ],
    // Another replica may be at it: its advisory lock is waited for.
    migration_session: &["set statement_timeout = 0", "set lock_timeout = 0"],
    writers_max: 16,
};
