//! Uploads to a server that misbehaves.

use std::collections::{BTreeMap, BTreeSet};
use std::time::Duration;

use proptest::prelude::*;
use rand::SeedableRng;
use rand::rngs::StdRng;
use tempfile::TempDir;
use tokio::time::Instant;
use uuid::Uuid;

use super::*;
use crate::sync::tests::stub::{Fault, Stub};
use crate::sync::tests::{api, contribution, contributions, id, level};
use crate::sync::{ApiOptions, EncodedContribution, OutboxConfig, Pushed};

/// Waits short enough for tests.
const CONFIG: UploadConfig = UploadConfig {
    backoff: BackoffConfig {
        base: Duration::from_millis(5),
        cap: Duration::from_millis(40),
        server_cap: Duration::from_secs(2),
    },
    ..UploadConfig::STANDARD
};

/// Shorter than [`SILENCE`], and long enough for a busy machine.
const IMPATIENT: ApiOptions =
    ApiOptions { request_timeout: Duration::from_secs(3), ..ApiOptions::STANDARD };
const SILENCE: Fault = Fault::Silence(4000);

struct Robot {
    outbox: Arc<Outbox>,
    _folder: TempDir,
}

impl Robot {
    fn with(pushed: &[mapfold_schema::v1::Contribution]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let outbox = Outbox::open(folder.path(), OutboxConfig::STANDARD).unwrap();
        outbox.push_many(pushed).unwrap();
        Self { outbox: Arc::new(outbox), _folder: folder }
    }

    fn uploader(&self, url: &str, options: ApiOptions, config: UploadConfig) -> Uploader {
        Uploader::new(api(url, options), Arc::clone(&self.outbox), level(), config)
    }

    async fn drain(&self, stub: &Stub, config: UploadConfig) -> UploadSummary {
        let uploader = self.uploader(&stub.url(), IMPATIENT, config);
        uploader.drain(&mut StdRng::seed_from_u64(1)).await
    }
}

fn all(range: std::ops::Range<u64>) -> BTreeSet<Uuid> {
    range.map(id).collect()
}

fn in_log(stub: &Stub) -> BTreeSet<Uuid> {
    stub.ledger().log().into_keys().collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn everything_is_acknowledged_in_few_requests_and_never_sent_again() {
    let stub = Stub::start();
    let robot = Robot::with(&contributions(0..200));
    let summary = robot.drain(&stub, CONFIG).await;
    assert!(summary.is_complete(), "{summary:?}");
    assert_eq!(in_log(&stub), all(0..200));
    let mut sizes: Vec<usize> = stub.ledger().uploads.iter().map(Vec::len).collect();
    sizes.sort_unstable(); // two are on their way at a time
    assert_eq!(sizes, [8, 64, 64, 64]);
    let progress = summary.progress;
    assert_eq!((progress.sent, progress.acknowledged, progress.retries), (200, 200, 0));
    assert_eq!(progress.revision, Some(200));
    assert_eq!((progress.traffic.requests, progress.refused), (4, 0));
    assert_eq!(progress.traffic.bytes_up, stub.ledger().bytes_in);
    assert!(progress.traffic.bytes_down > 200 * 64, "receipts bear digests");

    let again = robot.outbox.push_many(&contributions(0..200)).unwrap();
    assert!(again.iter().all(|pushed| matches!(pushed, Pushed::AlreadyAcknowledged(_))));
    assert!(robot.drain(&stub, CONFIG).await.is_complete());
    assert_eq!(stub.ledger().uploads.len(), 4);
}

#[tokio::test(flavor = "multi_thread")]
async fn whatever_goes_wrong_once_is_made_good() {
    for fault in [
        Fault::DropBefore,
        Fault::DropAfter,
        Fault::Busy(0),
        Fault::Broken,
        Fault::Portal,
        Fault::OtherContent,
        Fault::OneLess,
        Fault::Torn,
        Fault::Redirect,
        SILENCE,
    ] {
        let stub = Stub::start();
        stub.ledger().faults.push_back(fault);
        let robot = Robot::with(&contributions(0..3));
        let summary = robot.drain(&stub, CONFIG).await;
        assert!(summary.is_complete(), "{fault:?}: {summary:?}");
        assert_eq!(summary.progress.retries, 1, "{fault:?}");
        assert_eq!(summary.progress.trouble, None);
        assert_eq!(in_log(&stub), all(0..3));
        let sent: BTreeMap<Uuid, usize> =
            stub.ledger().uploads.iter().flatten().fold(BTreeMap::new(), |mut counts, id| {
                *counts.entry(*id).or_default() += 1;
                counts
            });
        assert_eq!(sent, (0..3).map(|n| (id(n), 2)).collect(), "{fault:?}: each twice");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn trouble_is_told_while_it_lasts() {
    let stub = Stub::start();
    // Several times, so that whoever looks now and then sees it.
    stub.ledger().faults.extend([Fault::Portal; 15]);
    stub.ledger().faults.push_back(Fault::Busy(1));
    let robot = Robot::with(&contributions(0..1));
    let uploader = robot.uploader(&stub.url(), IMPATIENT, CONFIG);
    let mut progress = uploader.progress();
    let told = async {
        let mut troubles = Vec::new();
        while progress.changed().await.is_ok() {
            let now = progress.borrow_and_update().clone();
            if now.trouble.is_some() && troubles.last() != Some(&now.trouble) {
                troubles.push(now.trouble);
            }
            if now.acknowledged == 1 && now.traffic.bytes_down > 0 {
                break;
            }
        }
        troubles
    };
    let mut rng = StdRng::seed_from_u64(4);
    let (summary, troubles) = tokio::join!(uploader.drain(&mut rng), told);
    assert!(summary.is_complete());
    assert_eq!(troubles.len(), 2, "{troubles:?}");
    assert!(troubles[0].as_ref().unwrap().contains("is not from a Mapfold server"));
    assert!(troubles[0].as_ref().unwrap().contains("sign in to our network"));
    assert!(troubles[1].as_ref().unwrap().contains("503"));
}

#[tokio::test(flavor = "multi_thread")]
async fn retry_after_is_obeyed() {
    let stub = Stub::start();
    stub.ledger().faults.push_back(Fault::Busy(1));
    let robot = Robot::with(&contributions(0..100));
    let begin = Instant::now();
    // With two in flight the second may be on its way when the first is told to wait.
    let one_at_a_time = UploadConfig { in_flight_max: 1, ..CONFIG };
    assert!(robot.drain(&stub, one_at_a_time).await.is_complete());
    assert!(begin.elapsed() >= Duration::from_secs(1), "{:?}", begin.elapsed());
    assert_eq!(stub.ledger().uploads.len(), 3);
}

#[tokio::test(flavor = "multi_thread")]
async fn as_many_requests_are_in_flight_as_may_be_and_one_in_trouble() {
    let stub = Stub::start();
    stub.ledger().delay = Duration::from_millis(150);
    let robot = Robot::with(&contributions(0..12));
    let config = UploadConfig { batch_max: 1, in_flight_max: 3, ..CONFIG };
    assert!(robot.drain(&stub, config).await.is_complete());
    assert_eq!(stub.ledger().busiest, 3);

    let stub = Stub::start();
    {
        let mut ledger = stub.ledger();
        ledger.delay = Duration::from_millis(100);
        ledger.faults.extend([Fault::Busy(0); 10]);
    }
    let robot = Robot::with(&contributions(0..1));
    let uploader = robot.uploader(&stub.url(), IMPATIENT, config);
    let (producer, finished) = watch::channel(false);
    let more = async {
        // Enough for several requests while the first is still being refused.
        let wait_for_trouble = uploader.progress();
        while wait_for_trouble.borrow().retries < 2 {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
        robot.outbox.push_many(&contributions(1..6)).unwrap();
        while wait_for_trouble.borrow().retries < 6 {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
        let busiest = stub.ledger().busiest;
        drop(producer);
        busiest
    };
    let mut rng = StdRng::seed_from_u64(5);
    let (summary, busiest_in_trouble) = tokio::join!(uploader.run(finished, &mut rng), more);
    assert!(summary.is_complete(), "{summary:?}");
    assert_eq!(busiest_in_trouble, 1);
    assert!(stub.ledger().busiest > 1, "and several again afterwards");
}

#[tokio::test(flavor = "multi_thread")]
async fn one_that_is_refused_is_parked_and_the_others_go_through() {
    let stub = Stub::start();
    stub.ledger().refused.insert(id(7));
    let robot = Robot::with(&contributions(0..100));
    let summary = robot.drain(&stub, CONFIG).await;
    assert!(matches!(summary.end, UploadEnd::Drained) && !summary.is_complete());
    let (progress, contents) = (&summary.progress, summary.contents);
    assert_eq!((progress.acknowledged, progress.refused, progress.retries), (99, 1, 0));
    assert_eq!((contents.waiting, contents.refused), (0, 1));
    let refusals = robot.outbox.refusals();
    assert_eq!(refusals[0].id, id(7));
    assert_eq!(refusals[0].problem.as_ref().unwrap().code, "contribution_invalid");

    assert_eq!(robot.outbox.push(&contribution(7)).unwrap(), Pushed::AlreadyRefused);
    let uploads_before = stub.ledger().uploads.len();
    assert!(!robot.drain(&stub, CONFIG).await.is_complete(), "it is still not there");
    assert_eq!(stub.ledger().uploads.len(), uploads_before, "and is not sent by itself");

    stub.ledger().refused.clear();
    robot.outbox.requeue_refused().unwrap();
    assert!(robot.drain(&stub, CONFIG).await.is_complete());
    assert_eq!(in_log(&stub), all(0..100));
}

#[tokio::test(flavor = "multi_thread")]
async fn what_spoils_a_whole_upload_is_found_by_halves_and_parked() {
    let stub = Stub::start();
    stub.ledger().unreadable.extend([id(3), id(40)]);
    let robot = Robot::with(&contributions(0..64));
    let summary = robot.drain(&stub, CONFIG).await;
    assert_eq!((summary.progress.acknowledged, summary.progress.refused), (62, 2));
    assert_eq!(in_log(&stub).len(), 62);
    let parked: BTreeSet<Uuid> = robot.outbox.refusals().iter().map(|r| r.id).collect();
    assert_eq!(parked, BTreeSet::from([id(3), id(40)]));
    // One for all, and at most two for each of six halvings on the way to each of the two.
    assert!(stub.ledger().uploads.len() <= 1 + 2 * 2 * 6, "{}", stub.ledger().uploads.len());
}

#[tokio::test(flavor = "multi_thread")]
async fn what_the_server_falls_over_does_not_stop_the_others() {
    let stub = Stub::start();
    stub.ledger().poison.insert(id(5));
    let robot = Robot::with(&contributions(0..64));
    let config = UploadConfig { deadline: Some(Duration::from_secs(3)), ..CONFIG };
    let summary = robot.drain(&stub, config).await;
    assert!(matches!(summary.end, UploadEnd::DeadlinePassed));
    assert_eq!((summary.progress.acknowledged, summary.contents.waiting), (63, 1));
    assert!(summary.progress.trouble.unwrap().contains("500"));
    stub.ledger().poison.clear();
    assert!(robot.drain(&stub, config).await.is_complete(), "a repaired server gets it");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_takes_less_gets_less_and_what_is_too_large_by_itself_is_parked() {
    let one = EncodedContribution::of(&contribution(0)).unwrap().cbor().len();
    let stub = Stub::start();
    stub.ledger().bytes_max = 10 * one;
    stub.ledger().count_max = 6;
    let large = {
        let mut large = contribution(50);
        large.segments = vec![large.segments[0].clone(); 60];
        large
    };
    let mut pushed = contributions(0..50);
    pushed.push(large);
    let robot = Robot::with(&pushed);
    let summary = robot.drain(&stub, CONFIG).await;
    assert_eq!((summary.progress.acknowledged, summary.progress.refused), (50, 1));
    assert_eq!(robot.outbox.refusals()[0].id, id(50));
    assert_eq!(robot.outbox.refusals()[0].problem.as_ref().unwrap().status, 413);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_batch_is_bounded_in_bytes() {
    let one = EncodedContribution::of(&contribution(0)).unwrap().cbor().len();
    let stub = Stub::start();
    let robot = Robot::with(&contributions(0..10));
    let config = UploadConfig { batch_bytes_max: 4 * one + one / 2, ..CONFIG };
    assert!(robot.drain(&stub, config).await.is_complete());
    assert!(stub.ledger().uploads.iter().all(|upload| upload.len() <= 5));
    assert!(stub.ledger().uploads.len() >= 3);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wrong_token_ends_it_at_once_and_loses_nothing() {
    let stub = Stub::start();
    "another".clone_into(&mut stub.ledger().token);
    let robot = Robot::with(&contributions(0..200));
    let summary = robot.drain(&stub, CONFIG).await;
    let UploadEnd::Refused(error) = &summary.end else { panic!("{summary:?}") };
    assert!(error.is_refusal("invalid_token"));
    assert_eq!((summary.contents.waiting, summary.contents.refused), (200, 0));
    assert!(!summary.is_complete());
    stub.ledger().token = crate::sync::tests::stub::TOKEN.to_owned();
    assert!(robot.drain(&stub, CONFIG).await.is_complete());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_is_killed_and_comes_back_is_found_again() {
    let mut stub = Stub::start();
    stub.ledger().delay = Duration::from_millis(10);
    let robot = Robot::with(&contributions(0..120));
    let config = UploadConfig { batch_max: 2, ..CONFIG };
    let uploader = robot.uploader(&stub.url(), IMPATIENT, config);
    let progress = uploader.progress();
    let killer = async {
        for acknowledged in [10, 50, 90] {
            while progress.borrow().acknowledged < acknowledged {
                tokio::time::sleep(Duration::from_millis(1)).await;
            }
            stub.kill();
            tokio::time::sleep(Duration::from_millis(60)).await;
            stub.restart();
        }
        stub
    };
    let mut rng = StdRng::seed_from_u64(6);
    let (summary, stub) = tokio::join!(uploader.drain(&mut rng), killer);
    assert!(summary.is_complete(), "{summary:?}");
    assert!(summary.progress.retries >= 3);
    assert_eq!(in_log(&stub), all(0..120));
    assert_eq!(stub.ledger().revision(), 120, "each once");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_robot_that_dies_in_the_middle_sends_the_rest_when_it_is_back() {
    let stub = Stub::start();
    stub.ledger().delay = Duration::from_millis(10);
    let robot = Robot::with(&contributions(0..200));
    let config = UploadConfig { batch_max: 2, ..CONFIG };
    let uploader = robot.uploader(&stub.url(), IMPATIENT, config);
    let progress = uploader.progress();
    let death = async {
        while progress.borrow().acknowledged < 20 {
            tokio::time::sleep(Duration::from_millis(1)).await;
        }
    };
    let mut rng = StdRng::seed_from_u64(7);
    tokio::select! {
        _ = uploader.drain(&mut rng) => panic!("it was to die before"),
        () = death => {}
    }
    let waiting = robot.outbox.contents().waiting;
    assert!((1..=180).contains(&waiting), "{waiting}");
    assert!(robot.drain(&stub, config).await.is_complete());
    assert_eq!((in_log(&stub), stub.ledger().revision()), (all(0..200), 200));
}

#[tokio::test(flavor = "multi_thread")]
async fn nobody_there_is_waited_for_until_the_deadline() {
    let mut stub = Stub::start();
    stub.kill();
    let robot = Robot::with(&contributions(0..3));
    let config = UploadConfig { deadline: Some(Duration::from_millis(300)), ..CONFIG };
    let summary = robot.drain(&stub, config).await;
    assert!(matches!(summary.end, UploadEnd::DeadlinePassed));
    assert_eq!(summary.contents.waiting, 3);
    assert!(summary.progress.retries >= 3, "{summary:?}");
    assert!(summary.progress.trouble.unwrap().contains("no answer"));
    assert_eq!(summary.progress.traffic.bytes_up, 0, "nobody got anything");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_producer_may_push_meanwhile_and_waits_for_room() {
    let stub = Stub::start();
    let folder = tempfile::tempdir().unwrap();
    let config = OutboxConfig { quota_bytes: 10_000, ..OutboxConfig::STANDARD };
    let outbox = Arc::new(Outbox::open(folder.path(), config).unwrap());
    let uploader = Uploader::new(api(&stub.url(), IMPATIENT), Arc::clone(&outbox), level(), CONFIG);
    let (producer, finished) = watch::channel(false);
    let producing = Arc::clone(&outbox);
    let produce = async move {
        let mut contents = producing.watch();
        let mut was_full = false;
        for n in 0..150 {
            loop {
                contents.mark_unchanged();
                match producing.push(&contribution(n)) {
                    Ok(pushed) => break assert_eq!(pushed, Pushed::Queued),
                    Err(OutboxError::Full { .. }) => {
                        was_full = true;
                        contents.changed().await.unwrap();
                    }
                    Err(error) => panic!("{error}"),
                }
            }
        }
        producer.send_replace(true);
        was_full
    };
    let produce = tokio::spawn(produce);
    let summary = uploader.run(finished, &mut StdRng::seed_from_u64(8)).await;
    assert!(summary.is_complete(), "{summary:?}");
    produce.await.unwrap();
    assert_eq!(in_log(&stub), all(0..150));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_conflict_is_parked_like_any_refusal() {
    let stub = Stub::start();
    let other = mapfold_schema::v1::Contribution { emulated: true, ..contribution(0) };
    stub.ledger().take(&[other]);
    let robot = Robot::with(&contributions(0..2));
    let summary = robot.drain(&stub, CONFIG).await;
    assert_eq!((summary.progress.acknowledged, summary.progress.refused), (1, 1));
    assert_eq!(robot.outbox.refusals()[0].problem.as_ref().unwrap().code, "contribution_conflict");
}

fn fault() -> impl Strategy<Value = Fault> {
    prop_oneof![
        Just(Fault::DropBefore),
        Just(Fault::DropAfter),
        Just(Fault::Busy(0)),
        Just(Fault::Broken),
        Just(Fault::Portal),
        Just(Fault::OtherContent),
        Just(Fault::OneLess),
        Just(Fault::Torn),
        Just(Fault::Redirect),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 24, ..ProptestConfig::default() })]

    #[test]
    fn in_any_weather_each_is_acknowledged_once_and_the_refused_are_parked(
        faults in prop::collection::vec(prop::option::weighted(0.6, fault()), 0..20),
        refused in prop::collection::btree_set(0..40_u64, 0..4),
        unreadable in prop::collection::btree_set(0..40_u64, 0..3),
        batch_max in 1..12_usize,
        in_flight_max in 1..4_usize,
        seed in any::<u64>(),
    ) {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        let stub = Stub::start();
        {
            let mut ledger = stub.ledger();
            // A fault that does not come is one that none of the tests waits for.
            ledger.faults.extend(faults.into_iter().map(|f| f.unwrap_or(Fault::Silence(0))));
            ledger.refused.extend(refused.iter().map(|n| id(*n)));
            ledger.unreadable.extend(unreadable.iter().map(|n| id(*n)));
        }
        let bad: BTreeSet<Uuid> = refused.union(&unreadable).map(|n| id(*n)).collect();
        let robot = Robot::with(&contributions(0..40));
        let config = UploadConfig {
            batch_max,
            in_flight_max,
            deadline: Some(Duration::from_secs(30)),
            ..CONFIG
        };
        let uploader = robot.uploader(&stub.url(), IMPATIENT, config);
        let summary = runtime.block_on(uploader.drain(&mut StdRng::seed_from_u64(seed)));
        prop_assert!(matches!(summary.end, UploadEnd::Drained), "{:?}", summary);
        let good: BTreeSet<Uuid> = all(0..40).difference(&bad).copied().collect();
        prop_assert_eq!(in_log(&stub), good);
        let parked: BTreeSet<Uuid> = robot.outbox.refusals().iter().map(|r| r.id).collect();
        prop_assert_eq!(parked, bad);
        prop_assert_eq!(summary.contents.waiting, 0);
        for (contribution, revision) in stub.ledger().log() {
            let kept = robot.outbox.acknowledgement(crate::sync::tests::FRAME, contribution);
            prop_assert_eq!(kept.map(|a| a.revision), Some(revision), "the receipt is the first");
        }
    }
}
