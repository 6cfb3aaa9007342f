//! Several servers on one database.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use mapfold_server::level::LevelOptions;
use mapfold_server::store::contributions::{Appended, NewContribution};

use crate::engines::Database;
use crate::levels_in_memory::{bits, open, still};
use crate::log::rows;
use crate::synthetic::{LEVEL, Numbers, SITE, accepted, folded, furnish, looks};

on_each_engine!(
    appends_from_two_stores_leave_no_gap_and_a_reader_misses_nothing,
    two_replicas_that_get_the_same_ids_append_each_once,
    replicas_fold_each_others_contributions_to_the_same_bits,
);

const WRITERS: usize = 4;
const EACH: usize = 120;

async fn appends_from_two_stores_leave_no_gap_and_a_reader_misses_nothing(database: Database) {
    let stores = [database.store().await, database.store().await];
    furnish(&stores[0]).await;
    let done = Arc::new(AtomicBool::new(false));
    let reader = tokio::spawn({
        let (store, done) = (database.store().await, Arc::clone(&done));
        async move {
            // As every reader does: what comes after the last that was seen, and never again
            // what lies before it.
            let (mut last, mut seen, mut polls) = (0, Vec::new(), 0);
            loop {
                let finished = done.load(Ordering::SeqCst);
                let page = store.log_after(SITE, LEVEL, last, 50).await.unwrap();
                polls += 1;
                if let Some(newest) = page.last() {
                    last = newest.revision;
                    seen.extend(page.into_iter().map(|row| row.revision));
                } else if finished {
                    return (seen, polls);
                }
            }
        }
    });
    let writers: Vec<_> = (0..WRITERS)
        .map(|writer| {
            let store = stores[writer % 2].clone();
            tokio::spawn(async move {
                let mut numbers = Numbers::seeded(writer as u64);
                let mut rest = &rows(100 + writer as u64, EACH)[..];
                let mut revisions = Vec::new();
                while !rest.is_empty() {
                    let count = (1 + numbers.below(9) as usize).min(rest.len());
                    for answer in store.append(SITE, LEVEL, &rest[..count]).await.unwrap() {
                        let Appended::New(place) = answer else { panic!("{answer:?}") };
                        revisions.push(place.revision);
                    }
                    rest = &rest[count..];
                }
                revisions
            })
        })
        .collect();
    let mut given = Vec::new();
    for writer in writers {
        given.extend(writer.await.unwrap());
    }
    done.store(true, Ordering::SeqCst);
    given.sort_unstable();
    let all: Vec<i64> = (1..=(WRITERS * EACH) as i64).collect();
    assert_eq!(given, all, "each revision is given once, without gaps");
    let (seen, polls) = reader.await.unwrap();
    assert_eq!(seen, all, "the reader saw each once, in order, in {polls} polls");
    let counts: i64 =
        stores[0].robots(SITE).await.unwrap().iter().map(|robot| robot.contributions).sum();
    assert_eq!(counts, all.len() as i64);
}

async fn two_replicas_that_get_the_same_ids_append_each_once(database: Database) {
    let stores = [database.store().await, database.store().await];
    furnish(&stores[0]).await;
    let batch: Arc<Vec<NewContribution>> = Arc::new(rows(31, 96));
    let racers = stores.map(|store| {
        let batch = Arc::clone(&batch);
        tokio::spawn(async move {
            let mut answers = Vec::new();
            for piece in batch.chunks(8) {
                answers.extend(store.append(SITE, LEVEL, piece).await.unwrap());
            }
            answers
        })
    });
    let [one, two] = racers;
    let (one, two) = (one.await.unwrap(), two.await.unwrap());
    let mut new = 0;
    for (a, b) in one.into_iter().zip(two) {
        let places = [a, b].map(|answer| match answer {
            Appended::New(place) => {
                new += 1;
                place
            }
            Appended::Known(place) => place,
            other => panic!("{other:?}"),
        });
        assert_eq!(places[0], places[1], "both got the same receipt");
    }
    assert_eq!(new, 96);
    let store = database.store().await;
    let log = store.log_after(SITE, LEVEL, 0, 1000).await.unwrap();
    let revisions: Vec<i64> = log.iter().map(|row| row.revision).collect();
    assert_eq!(revisions, (1..=96).collect::<Vec<i64>>());
}

async fn replicas_fold_each_others_contributions_to_the_same_bits(database: Database) {
    let stores = [database.store().await, database.store().await];
    furnish(&stores[0]).await;
    let options = LevelOptions {
        poll_interval: Duration::from_millis(20),
        write_behind_interval: Duration::from_millis(50),
        ..still()
    };
    let all = looks(32, 120);
    let mut replicas = Vec::new();
    for store in &stores {
        replicas.push(open(store, options).await);
    }
    let submitters: Vec<_> = (0..2)
        .map(|replica| {
            let level = replicas[replica].1.clone();
            let mine: Vec<_> = all.iter().skip(replica).step_by(2).map(accepted).collect();
            tokio::spawn(async move {
                for piece in mine.chunks(5) {
                    for receipt in level.submit_many(piece.to_vec()).await {
                        receipt.unwrap();
                    }
                }
            })
        })
        .collect();
    for submitter in submitters {
        submitter.await.unwrap();
    }
    let mut published = Vec::new();
    for (_, level) in &replicas {
        let snapshot = level.snapshot_at(120, Duration::from_mins(1)).await;
        assert_eq!(snapshot.folded_revision(), 120);
        published.push(snapshot);
    }
    assert_eq!(&*published[0].map(), folded(&all).map());
    for since in (0..=120).step_by(5) {
        assert!(
            bits(&published[0], since) == bits(&published[1], since),
            "the replicas tell different things since {since}"
        );
    }
    for (levels, level) in replicas {
        drop(level);
        levels.shutdown().await;
    }
    let report = mapfold_server::maintenance::verify(&stores[0], SITE, LEVEL).await.unwrap();
    let report = report.unwrap();
    assert_eq!(report.faults, Vec::<String>::new());
    assert_eq!(report.folded_revision, 120);
}
