//! A database of its own for each test, on either engine.

use std::future::Future;
use std::pin::Pin;
use std::sync::atomic::{AtomicU32, Ordering};

use mapfold_server::store::{Store, sqlite_url};
use sqlx::{AnyConnection, AssertSqlSafe, Connection, Executor};

/// The two engines.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Engine {
    Sqlite,
    Postgres,
}

/// An empty database.
#[derive(Debug, Clone)]
pub(crate) struct Database {
    pub(crate) engine: Engine,
    pub(crate) url: String,
}

impl Database {
    /// The database opened once more, its tables up to date.
    pub(crate) async fn store(&self) -> Store {
        let store = Store::connect(&self.url).await.unwrap();
        store.migrate().await.unwrap();
        store
    }

    /// Runs a statement past the store, as a spoiler would.
    pub(crate) async fn meddle(&self, statement: &'static str) -> u64 {
        let mut connection = AnyConnection::connect(&self.url).await.unwrap();
        connection.execute(statement).await.unwrap().rows_affected()
    }
}

/// Defines each named `async fn(Database)` of the module as two tests.
macro_rules! on_each_engine {
    ($($name:ident),* $(,)?) => {
        mod on_sqlite {
            $(#[test]
            fn $name() {
                $crate::engines::run($crate::engines::Engine::Sqlite, super::$name);
            })*
        }
        mod on_postgres {
            $(#[test]
            fn $name() {
                $crate::engines::run($crate::engines::Engine::Postgres, super::$name);
            })*
        }
    };
}

/// Runs a test in a database of its own.
pub(crate) fn run<F: Future<Output = ()>>(engine: Engine, test: fn(Database) -> F) {
    let runtime = runtime();
    let folder = tempfile::tempdir().unwrap();
    match engine {
        Engine::Sqlite => {
            let url = sqlite_url(&folder.path().join("a store.db"));
            runtime.block_on(test(Database { engine, url }));
        }
        Engine::Postgres => {
            let (server, name) = (server(), fresh_name());
            runtime.block_on(administer(&server, format!("create database {name}")));
            let url = format!("{}/{name}", server.rsplit_once('/').unwrap().0);
            runtime.block_on(test(Database { engine, url }));
            runtime.block_on(administer(&server, format!("drop database {name} with (force)")));
        }
    }
    runtime.shutdown_background();
}

/// Runs `life` in a runtime of its own that then ends as if the process had been killed: its
/// tasks get no further, nothing is flushed.
pub(crate) async fn killed_after<T, F>(life: impl FnOnce() -> F + Send + 'static) -> T
where
    T: Send + 'static,
    F: Future<Output = T> + Send + 'static,
{
    let life = std::thread::spawn(move || {
        let runtime = runtime();
        let outcome = runtime.block_on(async { tokio::spawn(life()).await.unwrap() });
        runtime.shutdown_background();
        outcome
    });
    tokio::task::spawn_blocking(move || life.join().unwrap()).await.unwrap()
}

fn runtime() -> tokio::runtime::Runtime {
    sqlx::any::install_default_drivers();
    tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build().unwrap()
}

fn server() -> String {
    std::env::var("MAPFOLD_TEST_POSTGRES").expect(
        "MAPFOLD_TEST_POSTGRES must hold the URL of a PostgreSQL database in which this test may \
         create others; `make test` starts one and sets it",
    )
}

fn fresh_name() -> String {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let count = COUNT.fetch_add(1, Ordering::Relaxed);
    format!("mapfold_story_{}_{count}", std::process::id())
}

fn administer(server: &str, statement: String) -> Pin<Box<dyn Future<Output = ()> + Send + '_>> {
    Box::pin(async move {
        let mut connection = AnyConnection::connect(server).await.unwrap();
        // The name is ours, and no parameter can stand there.
        connection.execute(AssertSqlSafe(statement)).await.unwrap();
        connection.close().await.unwrap();
    })
}
