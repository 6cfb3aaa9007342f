//! Open levels: submitting, publishing, reading what changed, closing.

use std::sync::Arc;
use std::time::Duration;

use mapfold_map::level::{LevelMap, Patch, apply};
use mapfold_schema::border::map_patch;
use mapfold_schema::codec::to_cbor;
use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::v1::{self, ContributionState, RobotState};
use mapfold_server::clock::{Clock, SystemClock};
use mapfold_server::level::{
    Accepted, LevelError, LevelHandle, LevelOptions, Levels, Snapshot, SubmitError,
};
use mapfold_server::store::Store;

use crate::engines::Database;
use crate::synthetic::{LEVEL, RECEIVED_US, RESOLUTION_M, SITE, accepted, folded, furnish, looks};

on_each_engine!(
    what_is_submitted_is_acknowledged_folded_and_told,
    each_of_a_batch_has_an_answer_of_its_own,
    what_a_held_robot_sends_stays_out_of_the_map,
    a_robot_whose_clock_is_ahead_is_not_believed_for_longer,
    a_full_queue_takes_none_of_a_batch,
    patches_from_any_revision_in_any_pages_lead_to_the_full_map,
    a_rectangle_limits_what_is_told,
    a_level_that_nobody_holds_is_written_and_closed,
    shutdown_writes_everything_and_takes_nothing_more,
    a_level_that_is_not_there_is_none,
);

pub(crate) fn clock() -> Arc<dyn Clock> {
    Arc::new(SystemClock::start())
}

/// Options under which nothing happens by itself.
pub(crate) fn still() -> LevelOptions {
    LevelOptions {
        write_behind_interval: Duration::from_hours(1),
        write_behind_revisions: i64::MAX,
        poll_interval: Duration::from_hours(1),
        idle_close: Duration::from_hours(1),
        ..LevelOptions::default()
    }
}

pub(crate) async fn open(store: &Store, options: LevelOptions) -> (Levels, LevelHandle) {
    let levels = Levels::new(store.clone(), clock(), options);
    let handle = levels.open(SITE, LEVEL).await.unwrap().unwrap();
    (levels, handle)
}

/// Submits all, a few at a time, and waits until they are published.
pub(crate) async fn submit_all(level: &LevelHandle, looks: &[v1::Contribution]) -> Arc<Snapshot> {
    let mut head = 0;
    for piece in looks.chunks(16) {
        let batch: Vec<Accepted> = piece.iter().map(accepted).collect();
        for receipt in level.submit_many(batch).await {
            head = receipt.unwrap().revision.max(head);
        }
    }
    reached(level, head).await
}

pub(crate) async fn reached(level: &LevelHandle, revision: i64) -> Arc<Snapshot> {
    let snapshot = level.snapshot_at(revision, Duration::from_mins(1)).await;
    assert_eq!(snapshot.folded_revision(), revision);
    snapshot
}

/// Everything that a reader can be told, bit for bit.
pub(crate) fn bits(snapshot: &Snapshot, since: i64) -> Vec<u8> {
    to_cbor(&snapshot.patches_since(since, usize::MAX).unwrap()).unwrap()
}

async fn what_is_submitted_is_acknowledged_folded_and_told(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let (_levels, level) = open(&store, still()).await;
    let looks = looks(11, 40);
    let mut events = level.events();
    let receipt = level.submit(accepted(&looks[0])).await.unwrap();
    assert_eq!((receipt.id, receipt.revision), (looks[0].id, 1));
    assert_eq!(receipt.state, ContributionState::Folded);
    assert_eq!(receipt.digest, mapfold_schema::digest::content_digest(&looks[0]).unwrap());
    let event = events.recv().await.unwrap();
    assert_eq!((event.revision, event.robots), (1, vec!["anna".to_owned()]));
    assert!(event.features > 0 && event.tiles > 0);
    assert_eq!(level.submit(accepted(&looks[0])).await.unwrap(), receipt);

    let snapshot = submit_all(&level, &looks).await;
    assert_eq!((snapshot.revision(), snapshot.folded_revision()), (40, 40));
    let expected = folded(&looks);
    assert_eq!(&*snapshot.map(), expected.map());
    let counts = snapshot.counts();
    assert_eq!(counts.contributions, 40);
    assert_eq!(counts.segments as usize, expected.map().segments.len());
    assert_eq!(counts.tiles as usize, expected.map().tiles.len());
    let mut last = event.revision;
    while last < 40 {
        let event = events.recv().await.unwrap();
        assert!(event.revision > last);
        last = event.revision;
    }
    let described = level.describe();
    assert_eq!((described.revision, described.folded_revision), (40, 40));
    let bounds = described.bounds.unwrap();
    assert!(bounds.min_x_m < -8.0 && bounds.max_x_m > 8.0 && bounds.max_x_m < 20.0, "{bounds:?}");
}

async fn each_of_a_batch_has_an_answer_of_its_own(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let (_levels, level) = open(&store, still()).await;
    let looks = looks(12, 4);
    let first = level.submit(accepted(&looks[0])).await.unwrap();
    let stranger = v1::Contribution { robot: "zoe".into(), ..looks[1].clone() };
    let forged = v1::Contribution { id: looks[0].id, ..looks[2].clone() };
    let batch = [&looks[3], &forged, &stranger, &looks[0]].map(accepted).to_vec();
    let answers = level.submit_many(batch).await;
    assert_eq!(answers[0].as_ref().unwrap().revision, 2);
    assert_eq!(answers[1], Err(SubmitError::Conflict { id: looks[0].id, revision: 1 }));
    assert_eq!(answers[2], Err(SubmitError::UnknownRobot { robot: "zoe".into() }));
    assert_eq!(answers[3], Ok(first));
    let snapshot = reached(&level, 2).await;
    assert_eq!(&*snapshot.map(), folded(&[looks[0].clone(), looks[3].clone()]).map());
}

async fn what_a_held_robot_sends_stays_out_of_the_map(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let (_levels, level) = open(&store, still()).await;
    let looks = looks(13, 9);
    let update = v1::RobotUpdate { state: Some(RobotState::Held), ..v1::RobotUpdate::default() };
    store.update_robot(SITE, "anna", &update).await.unwrap();
    let receipt = level.submit(accepted(&looks[0])).await.unwrap();
    assert_eq!(receipt.state, ContributionState::Held);
    assert_eq!(reached(&level, 1).await.map().tiles.len(), 0);
    let snapshot = submit_all(&level, &looks).await;
    let others: Vec<v1::Contribution> =
        looks.into_iter().filter(|look| look.robot != "anna").collect();
    assert_eq!(&*snapshot.map(), folded(&others).map());
}

/// What it says was seen at the latest when it came, also after a start: else its evidence would
/// stand above what all others see until its clock is right.
async fn a_robot_whose_clock_is_ahead_is_not_believed_for_longer(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let looks = looks(14, 12);
    let told = |at_us| {
        let at = |look: &v1::Contribution| v1::Contribution {
            observed_at: to_rfc3339(at_us),
            ..look.clone()
        };
        looks[..6].iter().map(at).chain(looks[6..].iter().cloned()).collect::<Vec<_>>()
    };
    let ahead = told(RECEIVED_US + 90 * 86_400_000_000);
    let expected = folded(&told(RECEIVED_US));
    assert_ne!(expected.map(), folded(&ahead).map());
    let (levels, level) = open(&store, still()).await;
    assert_eq!(&*submit_all(&level, &ahead).await.map(), expected.map());
    // Read back with its evidence, and without.
    let (_others, other) = open(&store, still()).await;
    assert_eq!(&*other.snapshot().map(), expected.map());
    drop(level);
    levels.shutdown().await;
    let (_again, level) = open(&store, still()).await;
    assert_eq!(&*level.snapshot().map(), expected.map());
}

async fn a_full_queue_takes_none_of_a_batch(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let (_levels, level) = open(&store, LevelOptions { queue_capacity: 4, ..still() }).await;
    let batch: Vec<Accepted> = looks(14, 5).iter().map(accepted).collect();
    let full = SubmitError::QueueFull { level: LEVEL.into(), capacity: 4 };
    assert_eq!(level.submit_many(batch.clone()).await, vec![Err(full); 5]);
    assert_eq!(store.revisions(SITE, LEVEL).await.unwrap().unwrap().log, 0);
    let taken = level.submit_many(batch[..4].to_vec()).await;
    assert!(taken.iter().all(Result::is_ok));
}

/// A reader that holds nothing but what patches told it.
#[derive(Default, Clone)]
pub(crate) struct Mirror {
    pub(crate) map: LevelMap,
    pub(crate) revision: i64,
}

impl Mirror {
    pub(crate) fn follow(&mut self, snapshot: &Snapshot, limit: usize) {
        loop {
            let page = snapshot.patches_since(self.revision, limit).unwrap();
            assert_eq!(page.since, self.revision);
            assert!(page.revision >= page.since);
            apply(&map_patch(&page).unwrap(), &mut self.map);
            self.revision = page.revision;
            if !page.more {
                return;
            }
        }
    }
}

async fn patches_from_any_revision_in_any_pages_lead_to_the_full_map(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let (_levels, level) = open(&store, still()).await;
    let looks = looks(15, 60);
    let mut snapshots = vec![level.snapshot()];
    for look in &looks {
        let receipt = level.submit(accepted(look)).await.unwrap();
        snapshots.push(reached(&level, receipt.revision).await);
    }
    let last = snapshots.last().unwrap();
    let mut removed = 0;
    for limit in [0, 1, 7, 1000] {
        for from in &snapshots {
            let mut mirror = Mirror::default();
            mirror.follow(from, 50);
            assert_eq!((&mirror.map, mirror.revision), (&*from.map(), from.revision()));
            removed += last.since(mirror.revision).unwrap().removed_segments.len();
            mirror.follow(last, limit);
            assert_eq!((&mirror.map, mirror.revision), (&*last.map(), 60));
        }
    }
    assert!(removed > 0, "the looks must merge walls that were apart, or this shows too little");
    // Half way through the pages the map goes on.
    let mut mirror = Mirror::default();
    let page = snapshots[30].patches_since(0, 5).unwrap();
    assert!(page.more);
    apply(&map_patch(&page).unwrap(), &mut mirror.map);
    mirror.revision = page.revision;
    mirror.follow(last, 5);
    assert_eq!(&mirror.map, &*last.map());

    let empty = last.patches_since(60, 10).unwrap();
    assert!(!empty.more && map_patch(&empty).unwrap() == Patch::default());
    assert_eq!(last.since(60).unwrap(), Patch::default());
    let ahead = last.since(61).unwrap_err();
    assert_eq!((ahead.since, ahead.folded_revision, ahead.revision), (61, 60, 60));
}

async fn a_rectangle_limits_what_is_told(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let (_levels, level) = open(&store, still()).await;
    let looks = looks(16, 30);
    let early = submit_all(&level, &looks[..15]).await;
    let late = submit_all(&level, &looks).await;
    let bbox = v1::Bounds { min_x_m: -13.0, min_y_m: 7.0, max_x_m: 13.0, max_y_m: 9.0 };
    let all = late.vector_since(0, None).unwrap();
    let near = late.vector_since(0, Some(&bbox)).unwrap();
    assert_eq!(all.segments.len(), late.map().segments.len());
    assert!(!near.segments.is_empty() && near.segments.len() < all.segments.len());
    assert_eq!(near.removed, v1::Removed::default());
    assert!(near.segments.iter().all(|s| all.segments.contains(s)));
    // Whoever follows a rectangle holds what a new reader of it is told.
    let mut held: Vec<v1::Segment> = early.vector_since(0, Some(&bbox)).unwrap().segments;
    let step = late.vector_since(15, Some(&bbox)).unwrap();
    let changed: Vec<&String> = step.segments.iter().map(|s| &s.id).collect();
    held.retain(|s| !step.removed.segments.contains(&s.id) && !changed.contains(&&s.id));
    held.extend(step.segments.clone());
    held.sort_by(|a, b| a.id.cmp(&b.id));
    let mut expected = near.segments;
    expected.sort_by(|a, b| a.id.cmp(&b.id));
    assert_eq!(held, expected);

    let tiles = late.raster_since(0, None).unwrap();
    assert_eq!(tiles.tiles.len(), late.map().tiles.len());
    let side_m = 64.0 * RESOLUTION_M;
    let near = late.raster_since(0, Some(&bbox)).unwrap().tiles;
    assert!(!near.is_empty() && near.len() < tiles.tiles.len());
    assert!(near.iter().all(|t| f64::from(t.y + 1) * side_m >= 7.0));
    assert_eq!(late.raster_since(30, None).unwrap().tiles, []);
}

async fn stored_in_full(store: &Store) -> bool {
    let revisions = store.revisions(SITE, LEVEL).await.unwrap().unwrap();
    revisions.folded == revisions.log
}

async fn a_level_that_nobody_holds_is_written_and_closed(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let idle_close = Duration::from_millis(80);
    let (levels, level) = open(&store, LevelOptions { idle_close, ..still() }).await;
    let before = bits(&*submit_all(&level, &looks(17, 20)).await, 0);
    let mut events = level.events();
    tokio::time::sleep(4 * idle_close).await;
    assert!(level.submit(accepted(&looks(17, 21)[20])).await.is_ok(), "a held level stays open");
    assert!(!stored_in_full(&store).await);
    let after = bits(&*reached(&level, 21).await, 0);
    assert_ne!(before, after);
    drop(level);
    while events.recv().await.unwrap().revision < 21 {}
    let ended = tokio::time::timeout(Duration::from_secs(30), events.recv()).await;
    assert!(ended.unwrap().is_err(), "whoever listens learns that the level was closed");
    let level = levels.open(SITE, LEVEL).await.unwrap().unwrap();
    assert!(stored_in_full(&store).await);
    assert_eq!(bits(&level.snapshot(), 0), after);
}

async fn shutdown_writes_everything_and_takes_nothing_more(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let (levels, level) = open(&store, still()).await;
    let looks = looks(18, 64);
    let batch: Vec<Accepted> = looks.iter().map(accepted).collect();
    let submitted = tokio::spawn({
        let level = level.clone();
        async move { level.submit_many(batch).await }
    });
    while level.snapshot().folded_revision() == 0 {
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    levels.shutdown().await;
    assert!(submitted.await.unwrap().iter().all(Result::is_ok), "what was taken is finished");
    assert!(stored_in_full(&store).await);
    assert_eq!(store.revisions(SITE, LEVEL).await.unwrap().unwrap().log, 64);
    let late = level.submit(accepted(&looks[0])).await;
    assert!(matches!(late, Err(SubmitError::Unavailable(_))), "{late:?}");
    assert!(matches!(levels.open(SITE, LEVEL).await, Err(LevelError::Closing)));
}

async fn a_level_that_is_not_there_is_none(database: Database) {
    let store = database.store().await;
    furnish(&store).await;
    let levels = Levels::new(store, clock(), still());
    assert!(levels.open(SITE, "attic").await.unwrap().is_none());
    assert!(levels.open("elsewhere", LEVEL).await.unwrap().is_none());
}
