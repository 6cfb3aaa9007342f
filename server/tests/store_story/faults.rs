//! Databases that fail or are spoilt while levels are open.

use std::time::Duration;

use mapfold_schema::v1;
use mapfold_server::level::{LevelError, LevelHandle, LevelOptions, Levels, SubmitError};
use mapfold_server::store::StoreError;

use crate::engines::{Database, Engine, run};
use crate::levels_in_memory::{clock, open, reached, still, submit_all};
use crate::synthetic::{LEVEL, SITE, accepted, folded, furnish, looks, new_level};

on_each_engine!(
    a_spoilt_row_closes_its_level_and_no_other,
    what_the_engine_refuses_harms_neither_its_neighbours_nor_what_comes_after,
);

/// PostgreSQL only: an SQLite file has no connections that could be cut.
#[test]
fn connections_that_are_cut_lose_nothing_and_come_back() {
    run(Engine::Postgres, cut_connections);
}

/// What a robot does: sends again until there is a receipt.
async fn submit_until_acknowledged(levels: &Levels, look: &v1::Contribution) -> (i64, u32) {
    let mut refusals = 0;
    loop {
        if let Ok(Some(level)) = levels.open(SITE, LEVEL).await {
            match level.submit(accepted(look)).await {
                Ok(receipt) => return (receipt.revision, refusals),
                Err(SubmitError::Unavailable(_)) => {}
                Err(other) => panic!("{other}"),
            }
        }
        refusals += 1;
        assert!(refusals < 200, "the store does not come back");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

async fn cut_connections(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let levels = Levels::new(store.clone(), clock(), LevelOptions::default());
    let all = looks(51, 60);
    let cutter = tokio::spawn({
        let database = database.clone();
        async move {
            for _ in 0..12 {
                tokio::time::sleep(Duration::from_millis(60)).await;
                database
                    .meddle(
                        "select pg_terminate_backend(pid) from pg_stat_activity \
                         where datname = current_database() and pid <> pg_backend_pid()",
                    )
                    .await;
            }
        }
    });
    let mut refusals = 0;
    let mut sent = 0;
    while !cutter.is_finished() || sent < all.len() {
        let (revision, refused) = submit_until_acknowledged(&levels, &all[sent % 60]).await;
        assert_eq!(revision, (sent % 60) as i64 + 1, "each is in the log once");
        refusals += refused;
        sent += 1;
    }
    cutter.await.unwrap();
    let level = levels.open(SITE, LEVEL).await.unwrap().unwrap();
    assert_eq!(&*reached(&level, 60).await.map(), folded(&all).map());
    drop(level);
    levels.shutdown().await;
    let report = mapfold_server::maintenance::verify(&store, SITE, LEVEL).await.unwrap().unwrap();
    assert_eq!(report.faults, Vec::<String>::new(), "after {refusals} refusals in {sent}");
    assert_eq!(report.contributions, 60);
}

async fn a_spoilt_row_closes_its_level_and_no_other(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    store.create_level(SITE, &new_level("attic")).await.unwrap();
    let options = LevelOptions { poll_interval: Duration::from_millis(20), ..still() };
    let (levels, level) = open(&store, options).await;
    let all = looks(52, 11);
    submit_all(&level, &all[..10]).await;

    // As if a broken replica had appended.
    assert_eq!(database.meddle("update levels set revision = 11 where level = 'ground'").await, 1);
    let spoilt = database
        .meddle(
            "insert into contributions select site, level, 11, 'of nobody', digest, robot, state, \
             observed_at_us, received_at_us, emulated, segment_count, cluster_count, tile_count, \
             x_m, y_m, heading_rad, evidence, features, frame from contributions where revision = 10",
        )
        .await;
    assert_eq!(spoilt, 1);
    assert!(closes(&level).await);
    assert_eq!(level.snapshot().folded_revision(), 10, "what is published is still the truth");
    let reopened = levels.open(SITE, LEVEL).await;
    assert!(
        matches!(&reopened, Err(LevelError::Store(StoreError::Corrupt { key, .. })) if key == "revision 11"),
        "{reopened:?}"
    );
    let attic = levels.open(SITE, "attic").await.unwrap().unwrap();
    assert_eq!(attic.submit(accepted(&all[10])).await.unwrap().revision, 1);

    database.meddle("delete from contributions where contribution = 'of nobody'").await;
    database.meddle("update levels set revision = 10 where level = 'ground'").await;
    let level = levels.open(SITE, LEVEL).await.unwrap().unwrap();
    assert_eq!(level.submit(accepted(&all[10])).await.unwrap().revision, 11);
    assert_eq!(&*reached(&level, 11).await.map(), folded(&all).map());
}

async fn what_the_engine_refuses_harms_neither_its_neighbours_nor_what_comes_after(
    database: Database,
) {
    let store = database.store().await;
    furnish(&store).await;
    let (_levels, level) = open(&store, still()).await;
    let all = looks(53, 9);
    submit_all(&level, &all[..3]).await;
    let (forbid, allow) = match database.engine {
        // As on a full disk, SQLite rolls back by itself.
        Engine::Sqlite => (
            "create trigger no_bert before insert on contributions when new.robot = 'bert' \
             begin select raise(rollback, 'no bert'); end",
            "drop trigger no_bert",
        ),
        Engine::Postgres => (
            "alter table contributions add constraint no_bert check (robot <> 'bert') not valid",
            "alter table contributions drop constraint no_bert",
        ),
    };
    database.meddle(forbid).await;
    let answers = level.submit_many(all[3..6].iter().map(accepted).collect()).await;
    assert_eq!(answers[0].as_ref().unwrap().revision, 4);
    assert!(matches!(answers[1], Err(SubmitError::Unavailable(_))), "{:?}", answers[1]);
    assert_eq!(answers[2].as_ref().unwrap().revision, 5);
    database.meddle(allow).await;
    let snapshot = submit_all(&level, &all).await;
    assert_eq!(snapshot.folded_revision(), 9);
    assert_eq!(&*snapshot.map(), folded(&all).map());
}

/// Whether the level is dropped from memory soon.
async fn closes(level: &LevelHandle) -> bool {
    let mut events = level.events();
    let ended = async { while events.recv().await.is_ok() {} };
    tokio::time::timeout(Duration::from_secs(30), ended).await.is_ok()
}
