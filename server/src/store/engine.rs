//! Opening an engine, and refusing one that could lose or spoil what was acknowledged.

use std::fmt::Write as _;
use std::path::Path;
use std::time::Duration;

use sqlx::any::AnyPoolOptions;
use sqlx::migrate::Migrator;
use sqlx::{AnyPool, Executor, Row};

use super::StoreError;
use super::dialect::{Dialect, Engine, POSTGRES, SQLITE};

static SQLITE_MIGRATIONS: Migrator = sqlx::migrate!("../migrations/sqlite");
static POSTGRES_MIGRATIONS: Migrator = sqlx::migrate!("../migrations/postgres");

/// Connections for reading.
const READERS_MAX: u32 = 8;
/// Patience with a database that gives no connection.
const ACQUIRE_TIMEOUT: Duration = Duration::from_secs(5);
/// 3.7.0 to 3.51.2 can spoil a file when a checkpoint and a commit of two connections race.
const SQLITE_OLDEST: [u32; 3] = [3, 51, 3];

/// The URL of an SQLite file.
pub fn sqlite_url(file: &Path) -> String {
    let mut url = String::from("sqlite://");
    for byte in file.to_string_lossy().bytes() {
        // The characters that would end a path, and whatever a URL does not hold.
        if byte.is_ascii_alphanumeric() || b"/-._~".contains(&byte) {
            url.push(char::from(byte));
        } else {
            let _ = write!(url, "%{byte:02X}"); // writing to a String cannot fail
        }
    }
    url
}

/// Where statements go. The connections of each kind are made as they are needed.
#[derive(Debug)]
pub(super) struct Pools {
    /// Statements and transactions that read.
    pub(super) readers: AnyPool,
    /// Statements and transactions that write.
    pub(super) writers: AnyPool,
    /// Migrations.
    pub(super) migrators: AnyPool,
}

pub(super) async fn open(url: &str) -> Result<(&'static Dialect, Pools), StoreError> {
    sqlx::any::install_default_drivers();
    let (dialect, url) = if url.starts_with("sqlite:") {
        let separator = if url.contains('?') { '&' } else { '?' };
        (&SQLITE, format!("{url}{separator}mode=rwc"))
    } else if url.starts_with("postgres:") || url.starts_with("postgresql:") {
        (&POSTGRES, url.to_owned())
    } else {
        let scheme = url.split(':').next().unwrap_or_default();
        return Err(StoreError::BadUrl(format!("there is no engine {scheme:?}")));
    };
    let pools = Pools {
        readers: pool(dialect.session, &[], &url, READERS_MAX)?,
        writers: pool(dialect.session, &[], &url, dialect.writers_max)?,
        migrators: pool(dialect.session, dialect.migration_session, &url, 1)?,
    };
    match dialect.engine {
        Engine::Sqlite => trust_sqlite(&pools.writers).await?,
        Engine::Postgres => trust_postgres(&pools.writers).await?,
    }
    Ok((dialect, pools))
}

fn pool(
    session: &'static [&'static str],
    more: &'static [&'static str],
    url: &str,
    connections_max: u32,
) -> Result<AnyPool, StoreError> {
    AnyPoolOptions::new()
        .max_connections(connections_max)
        .acquire_timeout(ACQUIRE_TIMEOUT)
        .after_connect(move |connection, _| {
            Box::pin(async move {
                for statement in session.iter().chain(more) {
                    connection.execute(*statement).await?;
                }
                Ok(())
            })
        })
        .connect_lazy(url)
        .map_err(|error| match error {
            sqlx::Error::Configuration(e) => StoreError::BadUrl(e.to_string()),
            other => other.into(),
        })
}

/// Reads back what was asked for: a pragma that an engine cannot follow is no error to it.
async fn trust_sqlite(pool: &AnyPool) -> Result<(), StoreError> {
    const FULL: i64 = 2;
    let version: String = ask(pool, "select sqlite_version()").await?;
    let parts: Vec<u32> = version.split('.').filter_map(|part| part.parse().ok()).collect();
    if parts.as_slice() < SQLITE_OLDEST.as_slice() {
        return Err(StoreError::Untrusted(format!("SQLite {version} is older than 3.51.3")));
    }
    let journal: String = ask(pool, "pragma journal_mode").await?;
    if journal != "wal" {
        return Err(StoreError::Untrusted(format!(
            "SQLite keeps a journal of mode {journal:?} here, not a write-ahead log"
        )));
    }
    let synchronous = sqlx::query("pragma synchronous").fetch_one(pool).await?;
    let synchronous: i64 = synchronous.try_get(0)?;
    if synchronous != FULL {
        return Err(StoreError::Untrusted(format!(
            "SQLite synchronises at level {synchronous}, not {FULL} (full)"
        )));
    }
    Ok(())
}

async fn trust_postgres(pool: &AnyPool) -> Result<(), StoreError> {
    if ask(pool, "show synchronous_commit").await? == "off" {
        return Err(StoreError::Untrusted(
            "PostgreSQL runs with synchronous_commit = off and would acknowledge what a power cut \
             can take back; set it to on"
                .to_owned(),
        ));
    }
    if ask(pool, "show fsync").await? == "off" {
        tracing::warn!("PostgreSQL runs with fsync = off: good for tests only");
    }
    Ok(())
}

async fn ask(pool: &AnyPool, question: &'static str) -> Result<String, StoreError> {
    Ok(sqlx::query(question).fetch_one(pool).await?.try_get(0)?)
}

pub(super) async fn migrate(dialect: &Dialect, pool: &AnyPool) -> Result<(), StoreError> {
    let migrations = match dialect.engine {
        Engine::Sqlite => &SQLITE_MIGRATIONS,
        Engine::Postgres => &POSTGRES_MIGRATIONS,
    };
    Ok(migrations.run(pool).await?)
}

pub(super) async fn copy_to(
    dialect: &Dialect,
    pool: &AnyPool,
    file: &Path,
) -> Result<(), StoreError> {
    if dialect.engine != Engine::Sqlite {
        return Err(StoreError::Unsupported(
            "a PostgreSQL database is backed up with pg_dump (or pg_basebackup), not from here",
        ));
    }
    let Some(path) = file.to_str() else {
        return Err(StoreError::Unsupported("the name of the copy must be UTF-8"));
    };
    sqlx::query("vacuum into $1").bind(path).execute(pool).await?;
    Ok(())
}

pub(super) async fn check_file(
    dialect: &Dialect,
    pool: &AnyPool,
) -> Result<Vec<String>, StoreError> {
    if dialect.engine != Engine::Sqlite {
        return Ok(Vec::new());
    }
    let found = sqlx::query("pragma quick_check").fetch_all(pool).await?;
    let mut faults = Vec::new();
    for row in found {
        let fault: String = row.try_get(0)?;
        if fault != "ok" {
            faults.push(fault);
        }
    }
    Ok(faults)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_with_odd_characters_survives_the_url() {
        assert_eq!(sqlite_url(Path::new("/a b/c?d#e.db")), "sqlite:///a%20b/c%3Fd%23e.db");
    }

    #[test]
    fn both_engines_have_the_same_migrations() {
        let names = |migrator: &Migrator| -> Vec<(i64, String)> {
            migrator.iter().map(|m| (m.version, m.description.to_string())).collect()
        };
        assert_eq!(names(&SQLITE_MIGRATIONS), names(&POSTGRES_MIGRATIONS));
        for (a, b) in SQLITE_MIGRATIONS.iter().zip(POSTGRES_MIGRATIONS.iter()) {
            let [a, b] = [a, b].map(|m| {
                let words = m.sql.as_str().replace("bytea", "blob");
                words.split_whitespace().map(str::to_owned).collect::<Vec<_>>()
            });
            assert_eq!(a, b);
        }
    }
}
