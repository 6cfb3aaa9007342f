//! A fresh database for one server.

use sqlx::{AssertSqlSafe, Connection, Executor, PgConnection};

use crate::Error;

/// Where a server keeps its levels.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Database {
    /// The embedded file in the server's own data folder.
    Sqlite,
    /// A PostgreSQL database of its own, by URL.
    Postgres(String),
}

/// Names the PostgreSQL server on which databases may be made; `scripts/with-postgres.sh` sets it.
pub const POSTGRES_VARIABLE: &str = "MAPFOLD_TEST_POSTGRES";

impl Database {
    /// A new, empty PostgreSQL database with a name that nobody else uses.
    ///
    /// # Errors
    /// No server is named in the environment, or it refuses.
    #[expect(
        clippy::disallowed_methods,
        reason = "the name need only be new, nothing depends on it"
    )]
    pub async fn new_postgres() -> Result<Self, Error> {
        let server = std::env::var(POSTGRES_VARIABLE).map_err(|e| {
            Error::Database(format!(
                "{POSTGRES_VARIABLE}: {e}: run this under scripts/with-postgres.sh"
            ))
        })?;
        let fault = |e: sqlx::Error| Error::Database(format!("{server}: {e}"));
        let name = format!("mapfold_{}", rand::random::<u64>());
        let mut connection = PgConnection::connect(&server).await.map_err(fault)?;
        let statement = AssertSqlSafe(format!("create database {name}"));
        connection.execute(statement).await.map_err(fault)?;
        connection.close().await.map_err(fault)?;
        let (host, _) = server.rsplit_once('/').unwrap_or((&server, ""));
        Ok(Self::Postgres(format!("{host}/{name}")))
    }

    /// Its engine, as a word.
    pub fn engine(&self) -> &'static str {
        match self {
            Self::Sqlite => "SQLite",
            Self::Postgres(_) => "PostgreSQL",
        }
    }
}
