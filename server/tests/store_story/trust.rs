//! Databases that are refused when they are opened.

use mapfold_server::store::{Store, StoreError};

use crate::engines::{Database, Engine};

on_each_engine!(an_engine_that_could_lose_an_acknowledged_commit_is_refused);

async fn an_engine_that_could_lose_an_acknowledged_commit_is_refused(database: Database) {
    let (url, sign) = match database.engine {
        Engine::Sqlite => ("sqlite::memory:".to_owned(), "write-ahead log"),
        Engine::Postgres => (
            format!("{}?options=-c%20synchronous_commit%3Doff", database.url),
            "synchronous_commit",
        ),
    };
    match Store::connect(&url).await {
        Err(StoreError::Untrusted(why)) => assert!(why.contains(sign), "{why}"),
        other => panic!("{other:?}"),
    }
    Store::connect(&database.url).await.unwrap();
}

#[test]
fn an_unknown_scheme_is_refused_with_the_known_ones_named() {
    let runtime = tokio::runtime::Runtime::new().unwrap();
    let refused = runtime.block_on(Store::connect("mysql://somewhere/db")).unwrap_err();
    assert!(matches!(refused, StoreError::BadUrl(_)));
    assert!(refused.to_string().contains("sqlite:///"), "{refused}");
}
