//! A server that is killed at some moment, and started again.

use std::time::Duration;

use mapfold_map::level::LevelMap;
use mapfold_server::level::LevelOptions;
use mapfold_server::store::map_rows::MapRows;

use crate::engines::{Database, killed_after};
use crate::levels_in_memory::{Mirror, bits, open, reached, still, submit_all};
use crate::synthetic::{LEVEL, SITE, accepted, folded, furnish, looks};

on_each_engine!(
    a_killed_level_comes_back_bit_for_bit_from_its_log_alone,
    a_killed_level_comes_back_bit_for_bit_from_rows_and_the_rest_of_its_log,
    readers_of_every_revision_before_the_kill_come_up_to_date_after_it,
    a_stored_map_that_is_not_its_logs_is_folded_again_and_put_right,
    a_map_from_before_chains_were_kept_has_them_once_it_is_opened,
);

const LOOKS: usize = 200;

/// The revisions since which readers are compared.
fn sinces() -> impl Iterator<Item = i64> {
    (0..=LOOKS as i64).step_by(8)
}

/// Submits all looks, then dies as soon as rows of revision `written` are stored; what readers were told last.
async fn live_and_die(database: &Database, options: LevelOptions, written: i64) -> Vec<Vec<u8>> {
    let database = database.clone();
    let (told, _held) = killed_after(move || async move {
        let store = database.store().await;
        furnish(&store).await;
        let (levels, level) = open(&store, options).await;
        let snapshot = submit_all(&level, &looks(21, LOOKS)).await;
        // Rows are written behind the answers, whenever the machine finds the time.
        while store.revisions(SITE, LEVEL).await.unwrap().unwrap().folded < written {
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        let told = sinces().map(|since| bits(&snapshot, since)).collect();
        // Who lets go of a level in time closes it, with its rows written: the killed do not.
        (told, (levels, level))
    })
    .await;
    told
}

async fn comes_back(database: &Database, before: &[Vec<u8>]) {
    let store = database.store().await;
    let (_levels, level) = open(&store, still()).await;
    let snapshot = reached(&level, LOOKS as i64).await;
    assert_eq!(&*snapshot.map(), folded(&looks(21, LOOKS)).map());
    for (since, before) in sinces().zip(before) {
        assert!(bits(&snapshot, since) == *before, "the patch since {since} differs");
    }
}

async fn a_killed_level_comes_back_bit_for_bit_from_its_log_alone(database: Database) {
    let before = live_and_die(&database, still(), 0).await;
    let store = database.store().await;
    assert_eq!(store.revisions(SITE, LEVEL).await.unwrap().unwrap().folded, 0);
    comes_back(&database, &before).await;
}

async fn a_killed_level_comes_back_bit_for_bit_from_rows_and_the_rest_of_its_log(
    database: Database,
) {
    let options = LevelOptions { write_behind_revisions: 70, ..still() };
    let before = live_and_die(&database, options, 70).await;
    let stored = database.store().await.revisions(SITE, LEVEL).await.unwrap().unwrap();
    assert!(stored.folded >= 70 && stored.log == LOOKS as i64, "{stored:?}");
    comes_back(&database, &before).await;
}

async fn readers_of_every_revision_before_the_kill_come_up_to_date_after_it(database: Database) {
    const READ: usize = 40;
    let dying = database.clone();
    let mirrors: Vec<Mirror> = killed_after(move || async move {
        let store = dying.store().await;
        furnish(&store).await;
        let options = LevelOptions { write_behind_revisions: 11, ..still() };
        let (_levels, level) = open(&store, options).await;
        let mut mirrors = vec![Mirror::default()];
        for look in &looks(22, READ) {
            let receipt = level.submit(accepted(look)).await.unwrap();
            let mut mirror = Mirror::default();
            mirror.follow(&*reached(&level, receipt.revision).await, 1000);
            mirrors.push(mirror);
        }
        mirrors
    })
    .await;
    let store = database.store().await;
    let (_levels, level) = open(&store, still()).await;
    let snapshot = submit_all(&level, &looks(22, READ + 20)).await;
    assert_eq!(mirrors.len(), READ + 1);
    for mut mirror in mirrors {
        let from = mirror.revision;
        mirror.follow(&snapshot, 3);
        assert_eq!(&mirror.map, &*snapshot.map(), "a reader of revision {from}");
    }
}

async fn a_stored_map_that_is_not_its_logs_is_folded_again_and_put_right(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let (levels, level) = open(&store, still()).await;
    let all = looks(23, 60);
    let true_map = submit_all(&level, &all).await.map();
    let mut mirror = Mirror::default();
    mirror.follow(&level.snapshot(), 1000);
    drop(level);
    levels.shutdown().await;
    let sound = store.stored_map(SITE, LEVEL).await.unwrap().unwrap();

    let spoilt = database
        .meddle("update segments set content = null where feature in (select min(feature) from segments where content is not null)")
        .await;
    assert_eq!(spoilt, 1);
    let invented = database
        .meddle(
            "insert into clusters (site, level, feature, revision, content) values \
             ('plant', 'ground', '01900000-0000-7000-8000-00000000000a-0', 3, null)",
        )
        .await;
    assert_eq!(invented, 1);
    let (levels, level) = open(&store, still()).await;
    let snapshot = level.snapshot();
    assert_eq!(&*snapshot.map(), &*true_map);
    let mended = store.stored_map(SITE, LEVEL).await.unwrap().unwrap();
    let live = |rows: &MapRows| rows.segments.iter().filter(|r| r.content.is_some()).count();
    assert_eq!(live(&mended.rows), live(&sound.rows));
    assert_eq!(mended.folded_revision, 60);

    // A reader who was told otherwise before learns the truth.
    let mut misled = Mirror { map: LevelMap::default(), revision: 59 };
    misled.follow(&snapshot, 1000);
    let mended_segment = sound
        .rows
        .segments
        .iter()
        .filter(|row| row.content.is_some())
        .map(|row| row.feature.as_str())
        .min()
        .unwrap();
    let told: Vec<String> =
        misled.map.segments.keys().map(mapfold_schema::border::feature_id).collect();
    assert!(told.iter().any(|id| id == mended_segment), "{mended_segment} in {told:?}");
    let more = submit_all(&level, &looks(23, 80)).await;
    assert_eq!(&*more.map(), folded(&looks(23, 80)).map());
    drop(level);
    tokio::time::timeout(Duration::from_mins(1), levels.shutdown()).await.unwrap();
}

async fn a_map_from_before_chains_were_kept_has_them_once_it_is_opened(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let (levels, level) = open(&store, still()).await;
    let before = submit_all(&level, &looks(24, 80)).await;
    assert!(before.chains().count() > 0);
    drop(level);
    levels.shutdown().await;
    let sound = store.stored_map(SITE, LEVEL).await.unwrap().unwrap();
    // As it is after the migration: the table is there and empty.
    assert_eq!(database.meddle("delete from chains").await, sound.rows.chains.len() as u64);
    let (levels, level) = open(&store, still()).await;
    let snapshot = level.snapshot();
    assert_eq!(&*snapshot.map(), &*before.map());
    for since in 0..=80 {
        assert!(bits(&snapshot, since) == bits(&before, since), "the patch since {since} differs");
    }
    let mended = store.stored_map(SITE, LEVEL).await.unwrap().unwrap();
    assert_eq!(mended.rows.chains.len(), sound.rows.chains.len());
    drop(level);
    levels.shutdown().await;
}
