//! Checking and copying a database.

use mapfold_server::level::{LevelHandle, Levels};
use mapfold_server::maintenance::{Report, backup, verify};
use mapfold_server::store::{Store, StoreError, sqlite_url};

use crate::engines::{Database, Engine};
use crate::levels_in_memory::{open, still, submit_all};
use crate::synthetic::{LEVEL, SITE, folded, furnish, looks, new_level};

on_each_engine!(
    a_sound_level_is_found_sound,
    equal_maps_have_equal_digests,
    what_was_spoilt_is_found,
    a_backup_is_a_whole_database_of_one_moment,
);

async fn report(store: &Store) -> Report {
    verify(store, SITE, LEVEL).await.unwrap().unwrap()
}

/// A level with `count` looks, the first `stored` of them in its rows too. It goes on running, so
/// that nothing more is written.
async fn furnished(
    database: &Database,
    count: usize,
    stored: usize,
) -> (Store, (Levels, LevelHandle)) {
    let store = database.store().await;
    furnish(&store).await;
    let (levels, level) = open(&store, still()).await;
    submit_all(&level, &looks(41, stored)).await;
    drop(level);
    levels.shutdown().await;
    let running = open(&store, still()).await;
    submit_all(&running.1, &looks(41, count)).await;
    (store, running)
}

async fn a_sound_level_is_found_sound(database: Database) {
    let (store, _running) = furnished(&database, 70, 50).await;
    assert_eq!(verify(&store, SITE, "attic").await.unwrap(), None);
    store.create_level(SITE, &new_level("attic")).await.unwrap();
    let empty = verify(&store, SITE, "attic").await.unwrap().unwrap();
    assert!(empty.is_sound() && empty.contributions == 0, "{empty:?}");
    let report = report(&store).await;
    assert_eq!(report.faults, Vec::<String>::new());
    assert_eq!((report.revision, report.folded_revision, report.contributions), (70, 50, 70));
    let map = folded(&looks(41, 70)).map().clone();
    assert_eq!(
        (report.segments, report.clusters, report.chains, report.tiles),
        (map.segments.len(), map.clusters.len(), map.chains.len(), map.tiles.len())
    );
}

async fn equal_maps_have_equal_digests(database: Database) {
    let (store, _running) = furnished(&database, 30, 10).await;
    let here = report(&store).await.map_digest;
    // In another database, in another order, and never written behind.
    let folder = tempfile::tempdir().unwrap();
    let url = sqlite_url(&folder.path().join("other.db"));
    let other = Database { engine: Engine::Sqlite, url }.store().await;
    furnish(&other).await;
    let (_levels, level) = open(&other, still()).await;
    let mut reversed = looks(41, 30);
    reversed.reverse();
    submit_all(&level, &reversed[..29]).await;
    let before = report(&other).await.map_digest;
    submit_all(&level, &reversed).await;
    assert_eq!(here, report(&other).await.map_digest);
    assert_ne!(here, before);
}

async fn what_was_spoilt_is_found(database: Database) {
    let (store, _running) = furnished(&database, 40, 40).await;
    assert!(report(&store).await.is_sound());
    let spoils = [
        ("update tiles set revision = revision + 1 where x = 0", "but changed at"),
        ("update slices set slice = slice + 1000 where x = 0", "evidence SliceKey"),
        ("delete from segments where revision > 10", "is not stored"),
        ("update levels set revision = 41", "the log ends at revision 40, not 41"),
        ("update contributions set digest = '00' where revision = 9", "revision 9: its digest"),
        ("update contributions set features = evidence where revision = 8", "revision 8: "),
        (
            "update contributions set revision = 1000 where revision = 7",
            "the log has no revision 7 ",
        ),
    ];
    for (statement, sign) in spoils {
        assert!(database.meddle(statement).await > 0, "{statement}");
        let faults = report(&store).await.faults;
        assert!(faults.iter().any(|fault| fault.contains(sign)), "{statement}: {faults:?}");
    }
}

async fn a_backup_is_a_whole_database_of_one_moment(database: Database) {
    let (store, _running) = furnished(&database, 25, 20).await;
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("copy of it.db");
    let outcome = backup(&store, &file).await;
    if database.engine == Engine::Postgres {
        let Err(StoreError::Unsupported(advice)) = outcome else { panic!("{outcome:?}") };
        assert!(advice.contains("pg_dump"));
        return;
    }
    outcome.unwrap();
    assert!(backup(&store, &file).await.is_err(), "a backup never overwrites");
    let copy = Database { engine: Engine::Sqlite, url: sqlite_url(&file) }.store().await;
    assert_eq!(report(&copy).await, report(&store).await);
    let (_levels, level) = open(&copy, still()).await;
    assert_eq!(&*level.snapshot().map(), folded(&looks(41, 25)).map());
}
