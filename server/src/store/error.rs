//! What can go wrong with the store, by cause.

use sqlx::error::{DatabaseError, ErrorKind};

/// Why the store did not do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// A name that is taken.
    #[error("{kind} {name:?} exists already")]
    AlreadyExists {
        /// What it is: `site`, `level`, `robot` or `token`.
        kind: &'static str,
        /// Its name.
        name: String,
    },
    /// A thing that another one needs is not there.
    #[error("there is no {kind} {name:?}")]
    Missing {
        /// What it is: `site`, `level` or `robot`.
        kind: &'static str,
        /// Its name.
        name: String,
    },
    /// A database URL that means nothing.
    #[error("{0}; use sqlite:///path/to/file.db or postgres://user@host/name")]
    BadUrl(String),
    /// An engine that could lose or spoil what was acknowledged.
    #[error("the database cannot be trusted: {0}")]
    Untrusted(String),
    /// No space is left for the database.
    #[error("the disk of the database is full")]
    DiskFull,
    /// The database may not be written to.
    #[error("the database is read-only")]
    ReadOnly,
    /// The disk failed to read or to keep what was written: what is on it is uncertain, and trying
    /// again on the same file would only hide that. The program should stop; a restart reads back
    /// what is there.
    #[error("the disk of the database failed: {0}")]
    DiskFailed(String),
    /// A row that this server did not write, or that has been spoilt since.
    #[error("{table}, {key}: {detail}")]
    Corrupt {
        /// Table of the row.
        table: &'static str,
        /// Which row.
        key: String,
        /// What is wrong with it.
        detail: String,
    },
    /// What was asked for exists on the other engine only.
    #[error("{0}")]
    Unsupported(&'static str),
    /// The migrations did not run.
    #[error("the tables could not be brought up to date: {0}")]
    Migrate(#[from] sqlx::migrate::MigrateError),
    /// Another transaction was in the way until patience ran out; the same call may succeed later.
    #[error("the database is busy: {0}")]
    Busy(#[source] sqlx::Error),
    /// The database refused a statement.
    #[error("the database refused: {0}")]
    Refused(#[source] sqlx::Error),
    /// The database did not answer; the same call may succeed later. Whether a commit that ended
    /// so has happened is unknown.
    #[error("the database did not answer: {0}")]
    Unavailable(#[source] sqlx::Error),
}

impl From<sqlx::Error> for StoreError {
    fn from(error: sqlx::Error) -> Self {
        let cause = error.as_database_error().map(|e| {
            let code = e.code().unwrap_or_default();
            // SQLite's codes are numbers, PostgreSQL's have five characters.
            match code.parse::<i64>() {
                Ok(number) if code.len() < 5 => sqlite_cause(number),
                _ => postgres_cause(&code),
            }
        });
        match cause {
            None | Some(Cause::Away) => Self::Unavailable(error),
            Some(Cause::DiskFull) => Self::DiskFull,
            Some(Cause::ReadOnly) => Self::ReadOnly,
            Some(Cause::DiskFailed) => Self::DiskFailed(error.to_string()),
            Some(Cause::Busy) => Self::Busy(error),
            Some(Cause::Spoilt) => Self::Corrupt {
                table: "database file",
                key: "a page".to_owned(),
                detail: error.to_string(),
            },
            Some(Cause::Statement) => Self::Refused(error),
        }
    }
}

impl StoreError {
    /// Whether the error is that a row which another one refers to is not there.
    pub(super) fn is_missing_reference(error: &sqlx::Error) -> bool {
        error.as_database_error().map(DatabaseError::kind) == Some(ErrorKind::ForeignKeyViolation)
    }
}

enum Cause {
    DiskFull,
    ReadOnly,
    DiskFailed,
    Busy,
    Away,
    Spoilt,
    Statement,
}

/// Extended result codes, <https://sqlite.org/rescode.html>.
fn sqlite_cause(code: i64) -> Cause {
    const IOERR_WRITE: i64 = 778;
    match (code, code & 0xff) {
        // The write did not happen and SQLite has rolled back; the file is as it was.
        (IOERR_WRITE, _) | (_, 13) => Cause::DiskFull,
        (_, 10) => Cause::DiskFailed,
        (_, 5 | 6) => Cause::Busy,
        (_, 8) => Cause::ReadOnly,
        (_, 11 | 26) => Cause::Spoilt,
        (_, 14) => Cause::Away,
        _ => Cause::Statement,
    }
}

/// SQLSTATE, PostgreSQL's appendix A.
fn postgres_cause(code: &str) -> Cause {
    match code {
        "53100" => Cause::DiskFull,
        "25006" => Cause::ReadOnly,
        // Serialization failure, deadlock, lock timeout.
        "40001" | "40P01" | "55P03" => Cause::Busy,
        // Shutdown, crash, start-up, cancelled by a timeout, too many connections, I/O of theirs.
        "57P01" | "57P02" | "57P03" | "57P05" | "57014" | "53300" | "58030" => Cause::Away,
        _ if code.starts_with("08") => Cause::Away,
        "XX001" | "XX002" => Cause::Spoilt,
        _ => Cause::Statement,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_synchronisation_is_told_from_a_full_disk() {
        const IOERR_FSYNC: i64 = 1034;
        assert!(matches!(sqlite_cause(IOERR_FSYNC), Cause::DiskFailed));
        assert!(matches!(sqlite_cause(13), Cause::DiskFull));
        assert!(matches!(sqlite_cause(5), Cause::Busy));
        assert!(matches!(sqlite_cause(2067), Cause::Statement));
    }
}
