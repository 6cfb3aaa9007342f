//! Outboxes through crashes, damage, full disks and second processes.

use std::collections::BTreeSet;
use std::fs;
use std::path::PathBuf;

use mapfold_schema::problem::Problem;
use proptest::prelude::*;
use tempfile::TempDir;
use uuid::Uuid;

use super::*;
use crate::sync::tests::{FRAME, contribution, contributions, id};

const BOUNDS: BatchBounds = BatchBounds { count_max: 64, bytes_max: 3_000_000 };

fn open(folder: &TempDir) -> Outbox {
    Outbox::open(folder.path(), OutboxConfig::STANDARD).unwrap()
}

/// Ids in the order in which they would be sent.
fn next_ids(outbox: &Outbox) -> Vec<Uuid> {
    let batch = outbox.next_batch(&BTreeSet::new(), BOUNDS).unwrap();
    batch.iter().map(|queued| queued.contribution.id()).collect()
}

fn ids(range: std::ops::Range<u64>) -> Vec<Uuid> {
    range.map(id).collect()
}

fn files(folder: &TempDir, part: &str) -> Vec<PathBuf> {
    let mut paths: Vec<PathBuf> =
        fs::read_dir(folder.path().join(part)).unwrap().map(|e| e.unwrap().path()).collect();
    paths.sort();
    paths
}

fn described(revision: i64) -> v1::LevelDescription {
    v1::LevelDescription {
        site: "plant".to_owned(),
        level: "ground".to_owned(),
        name: String::new(),
        frame: FRAME,
        resolution_m: 0.05,
        tile_cells: 64,
        elevation_m: 0.0,
        evidence_slice_s: 86_400,
        revision,
        folded_revision: revision,
        bounds: None,
        counts: v1::Counts::default(),
        published: None,
    }
}

#[test]
fn what_was_pushed_is_there_after_a_restart_in_its_order() {
    let folder = tempfile::tempdir().unwrap();
    let pushed = contributions(0..5);
    {
        let outbox = open(&folder);
        assert_eq!(outbox.push_many(&pushed[..3]).unwrap(), [Pushed::Queued; 3]);
        assert_eq!(outbox.push(&pushed[3]).unwrap(), Pushed::Queued);
    }
    let outbox = open(&folder);
    assert_eq!(outbox.push(&pushed[4]).unwrap(), Pushed::Queued);
    assert_eq!(next_ids(&outbox), ids(0..5));
    let batch = outbox.next_batch(&BTreeSet::new(), BOUNDS).unwrap();
    for (queued, contribution) in batch.iter().zip(&pushed) {
        assert_eq!(queued.contribution, EncodedContribution::of(contribution).unwrap());
    }
    assert_eq!(outbox.contents().waiting, 5);
    let on_disk: u64 = files(&folder, "queue").iter().map(|f| f.metadata().unwrap().len()).sum();
    assert_eq!(outbox.contents().waiting_bytes, on_disk);
}

#[test]
fn what_is_acknowledged_leaves_the_queue_and_is_not_taken_again() {
    let folder = tempfile::tempdir().unwrap();
    {
        let outbox = open(&folder);
        outbox.push_many(&contributions(0..4)).unwrap();
        outbox.acknowledge(&[(1, 11), (2, 12)]).unwrap();
        assert_eq!(next_ids(&outbox), [id(0), id(3)]);
    }
    let outbox = open(&folder);
    assert_eq!(next_ids(&outbox), [id(0), id(3)]);
    let again = outbox.push_many(&contributions(0..5)).unwrap();
    let acknowledged = |revision| Pushed::AlreadyAcknowledged(Acknowledgement { revision });
    let expected = [
        Pushed::AlreadyQueued,
        acknowledged(11),
        acknowledged(12),
        Pushed::AlreadyQueued,
        Pushed::Queued,
    ];
    assert_eq!(again, expected);
    assert_eq!(outbox.acknowledgement(FRAME, id(1)), Some(Acknowledgement { revision: 11 }));
    assert_eq!(outbox.acknowledgement(Uuid::nil(), id(1)), None, "another level's");
    assert_eq!(outbox.contents().acknowledged, 2);
}

#[test]
fn the_same_id_on_another_level_is_another_contribution() {
    let folder = tempfile::tempdir().unwrap();
    let outbox = open(&folder);
    outbox.push(&contribution(0)).unwrap();
    outbox.acknowledge(&[(0, 1)]).unwrap();
    let elsewhere = v1::Contribution { frame: Uuid::from_bytes([1; 16]), ..contribution(0) };
    assert_eq!(outbox.push(&elsewhere).unwrap(), Pushed::Queued);
}

#[test]
fn other_content_under_an_id_that_waits_is_an_error_and_queues_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let outbox = open(&folder);
    outbox.push(&contribution(0)).unwrap();
    let changed = v1::Contribution { emulated: true, ..contribution(0) };
    let error = outbox.push_many(&[contribution(1), changed]).unwrap_err();
    assert!(matches!(error, OutboxError::Conflict { id: conflicting } if conflicting == id(0)));
    assert_eq!(next_ids(&outbox), [id(0)]);
    let twice = outbox.push_many(&[contribution(2), contribution(2)]).unwrap();
    assert_eq!(twice, [Pushed::Queued, Pushed::AlreadyQueued]);
    assert_eq!(outbox.contents().waiting, 2);
}

#[test]
fn a_full_outbox_says_so_takes_nothing_and_takes_it_when_there_is_room() {
    let folder = tempfile::tempdir().unwrap();
    let config = OutboxConfig { quota_bytes: 2000, ..OutboxConfig::STANDARD };
    let outbox = Outbox::open(folder.path(), config).unwrap();
    let fits = (0..100).take_while(|n| outbox.push(&contribution(*n)).is_ok()).count() as u64;
    assert!((2..20).contains(&fits), "{fits}");
    let error = outbox.push(&contribution(fits)).unwrap_err();
    assert!(matches!(error, OutboxError::Full { quota_bytes: 2000, .. }), "{error}");
    assert!(error.to_string().contains("full"));
    assert_eq!(files(&folder, "queue").len() as u64, fits);
    let mut watch = outbox.watch();
    outbox.acknowledge(&[(0, 1), (1, 2)]).unwrap();
    assert!(watch.has_changed().unwrap());
    assert!(watch.borrow_and_update().waiting_bytes < 2000);
    assert_eq!(outbox.push(&contribution(fits)).unwrap(), Pushed::Queued);
    let too_much = outbox.push_many(&contributions(100..200)).unwrap_err();
    assert!(matches!(too_much, OutboxError::Full { .. }));
}

#[test]
fn batches_are_bounded_in_number_and_bytes_and_skip_what_is_claimed() {
    let folder = tempfile::tempdir().unwrap();
    let outbox = open(&folder);
    outbox.push_many(&contributions(0..10)).unwrap();
    let one = EncodedContribution::of(&contribution(0)).unwrap().cbor().len();
    let batch = |skipped: &[u64], count_max, bytes_max| {
        let bounds = BatchBounds { count_max, bytes_max };
        let batch = outbox.next_batch(&skipped.iter().copied().collect(), bounds).unwrap();
        batch.iter().map(|queued| queued.sequence).collect::<Vec<u64>>()
    };
    assert_eq!(batch(&[], 3, usize::MAX), [0, 1, 2]);
    assert_eq!(batch(&[0, 2], 3, usize::MAX), [1, 3, 4]);
    assert_eq!(batch(&[], 64, 3 * one + one / 2), [0, 1, 2]);
    assert_eq!(batch(&[], 64, 1), [0], "what is too large by itself goes alone");
    assert_eq!(batch(&[0, 1, 2, 3, 4, 5, 6, 7, 8, 9], 64, usize::MAX), [0_u64; 0]);
}

#[test]
fn a_second_process_cannot_open_it() {
    let folder = tempfile::tempdir().unwrap();
    let outbox = open(&folder);
    let second = Outbox::open(folder.path(), OutboxConfig::STANDARD);
    assert!(matches!(second, Err(OutboxError::InUse { .. })));
    drop(outbox);
    open(&folder);
}

#[test]
fn what_was_refused_is_parked_with_the_problem_and_can_be_put_back() {
    let folder = tempfile::tempdir().unwrap();
    let problem = Problem::new(422, "contribution_invalid", "Invalid", "the pose is on the moon");
    {
        let outbox = open(&folder);
        outbox.push_many(&contributions(0..3)).unwrap();
        outbox.refuse(1, &problem).unwrap();
        assert_eq!(next_ids(&outbox), [id(0), id(2)]);
        assert_eq!(outbox.push(&contribution(1)).unwrap(), Pushed::AlreadyRefused);
    }
    let outbox = open(&folder);
    let contents = outbox.contents();
    assert_eq!((contents.waiting, contents.refused, contents.corrupt), (2, 1, 0));
    assert_eq!(outbox.refusals(), [Refusal { id: id(1), problem: Some(problem) }]);
    let corrected = v1::Contribution { emulated: true, ..contribution(1) };
    assert_eq!(outbox.push(&corrected).unwrap(), Pushed::Queued, "other content is not refused");
    outbox.acknowledge(&[(3, 1)]).unwrap();
    assert_eq!(outbox.requeue_refused().unwrap(), 1);
    assert_eq!(next_ids(&outbox), ids(0..3), "at its old place");
    drop(outbox);
    assert_eq!(next_ids(&open(&folder)), ids(0..3));
    assert_eq!(files(&folder, "refused").len(), 0);
}

/// A crash at every step of a push, of an acknowledgement and of a refusal, as what it leaves.
#[test]
fn whatever_a_crash_leaves_is_whole_or_absent_and_nothing_is_sent_that_has_its_receipt() {
    let folder = tempfile::tempdir().unwrap();
    let outbox = open(&folder);
    outbox.push_many(&contributions(0..4)).unwrap();
    let queue = files(&folder, "queue");
    let bytes: Vec<Vec<u8>> = queue.iter().map(|path| fs::read(path).unwrap()).collect();
    outbox.acknowledge(&[(2, 7)]).unwrap();
    drop(outbox);
    // Before the rename of a push: another file, whole or not, under its unfinished name.
    fs::write(durable::unfinished(&queue[3].with_file_name("9.contribution")), b"half").unwrap();
    fs::rename(&queue[3], durable::unfinished(&queue[3])).unwrap();
    // After the receipt, before the queue: the acknowledged file is still there.
    fs::write(&queue[2], &bytes[2]).unwrap();
    // After the problem, before the contribution was moved beside it.
    fs::write(folder.path().join("refused/00000000000000000001.problem.json"), b"{}").unwrap();
    let outbox = open(&folder);
    assert_eq!(next_ids(&outbox), [id(0), id(1)]);
    let contents = outbox.contents();
    assert_eq!((contents.waiting, contents.refused, contents.corrupt), (2, 0, 0));
    assert_eq!(files(&folder, "queue").len(), 2);
    assert!(matches!(outbox.push(&contribution(2)).unwrap(), Pushed::AlreadyAcknowledged(_)));
    assert_eq!(outbox.push(&contribution(3)).unwrap(), Pushed::Queued, "it was never promised");
}

#[test]
fn foreign_files_and_copies_are_set_aside_and_counted() {
    let folder = tempfile::tempdir().unwrap();
    drop({
        let outbox = open(&folder);
        outbox.push_many(&contributions(0..2)).unwrap();
        outbox
    });
    let queue = folder.path().join("queue");
    fs::write(queue.join("letter.txt"), b"to the operator").unwrap();
    fs::write(queue.join("00000000000000000001.contribution.1"), b"").unwrap();
    fs::create_dir(queue.join("00000000000000000007.contribution")).unwrap();
    fs::copy(&files(&folder, "queue")[0], queue.join("00000000000000000009.contribution")).unwrap();
    let outbox = open(&folder);
    assert_eq!(next_ids(&outbox), ids(0..2));
    assert_eq!(outbox.contents().corrupt, 4);
    assert_eq!(files(&folder, "corrupt").len(), 4);
    outbox.push(&contribution(2)).unwrap();
    assert_eq!(files(&folder, "queue").len(), 3, "the new one took no name that was given before");
    drop(outbox);
    fs::write(queue.join("letter.txt"), b"a second one").unwrap();
    drop(open(&folder));
    assert_eq!(fs::read(folder.path().join("corrupt/letter.txt")).unwrap(), b"to the operator");
    assert_eq!(fs::read(folder.path().join("corrupt/letter.txt.1")).unwrap(), b"a second one");
}

#[test]
fn what_is_damaged_or_lost_while_it_is_open_is_noticed_before_it_is_sent() {
    let folder = tempfile::tempdir().unwrap();
    let outbox = open(&folder);
    outbox.push_many(&contributions(0..5)).unwrap();
    let queue = files(&folder, "queue");
    let mut bytes = fs::read(&queue[0]).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    fs::write(&queue[0], bytes).unwrap();
    fs::remove_file(&queue[1]).unwrap();
    fs::copy(&queue[3], &queue[2]).unwrap();
    let bounds = BatchBounds { count_max: 2, ..BOUNDS };
    let batch = outbox.next_batch(&BTreeSet::new(), bounds).unwrap();
    assert_eq!(batch.len(), 1, "the first two are gone, of the next two one is another's copy");
    assert_eq!(batch[0].contribution.id(), id(3));
    assert_eq!((outbox.contents().waiting, outbox.contents().corrupt), (2, 3));
    assert_eq!(files(&folder, "corrupt").len(), 2);
}

#[test]
fn what_a_server_lost_waits_again_as_far_as_it_is_retained() {
    let folder = tempfile::tempdir().unwrap();
    let outbox = open(&folder);
    outbox.push_many(&contributions(0..6)).unwrap();
    let receipts: Vec<(u64, i64)> = (0..5).map(|n| (n, n as i64 + 1)).collect();
    outbox.acknowledge(&receipts).unwrap();
    assert_eq!(outbox.reconcile(&described(5)).unwrap(), Reconciled::default());
    let reconciled = outbox.reconcile(&described(2)).unwrap();
    assert_eq!(reconciled, Reconciled { forgotten: 3, requeued: 3 });
    assert_eq!(next_ids(&outbox), ids(2..6));
    drop(outbox);
    let outbox = open(&folder);
    assert_eq!(next_ids(&outbox), ids(2..6));
    assert!(matches!(outbox.push(&contribution(1)).unwrap(), Pushed::AlreadyAcknowledged(_)));
}

#[test]
fn only_as_much_is_retained_as_may_be() {
    let folder = tempfile::tempdir().unwrap();
    let config = OutboxConfig { retained_bytes: 1500, ..OutboxConfig::STANDARD };
    let outbox = Outbox::open(folder.path(), config).unwrap();
    outbox.push_many(&contributions(0..20)).unwrap();
    for n in 0..20 {
        outbox.acknowledge(&[(n, n as i64 + 1)]).unwrap();
        let retained = files(&folder, "retained");
        let bytes: u64 = retained.iter().map(|file| file.metadata().unwrap().len()).sum();
        assert!(bytes <= 1500);
    }
    let kept = files(&folder, "retained").len();
    assert!(kept >= 2);
    let reconciled = outbox.reconcile(&described(0)).unwrap();
    assert_eq!(reconciled, Reconciled { forgotten: 20, requeued: kept });
    assert_eq!(next_ids(&outbox), ids(20 - kept as u64..20), "the newest");
    drop(outbox);
    let none = OutboxConfig { retained_bytes: 0, ..OutboxConfig::STANDARD };
    let outbox = Outbox::open(folder.path(), none).unwrap();
    let waiting: Vec<(u64, i64)> = (20 - kept as u64..20).map(|n| (n, n as i64 + 1)).collect();
    outbox.acknowledge(&waiting).unwrap();
    assert_eq!(files(&folder, "retained").len(), 0);
    assert_eq!(outbox.contents().waiting, 0);
}

/// What may happen to one file of the queue.
#[derive(Debug, Clone)]
enum Mutation {
    Flip { file: usize, place: prop::sample::Index, bit: u8 },
    Cut { file: usize, place: prop::sample::Index },
    Zero { file: usize, place: prop::sample::Index, length: usize },
    Append { file: usize, bytes: Vec<u8> },
    Swap { file: usize, other: usize },
    Foreign { name: String, bytes: Vec<u8> },
}

const FILES: usize = 5;

fn mutation() -> impl Strategy<Value = Mutation> {
    let file = 0..FILES;
    let place = any::<prop::sample::Index>;
    let bytes = || prop::collection::vec(any::<u8>(), 0..50);
    prop_oneof![
        4 => (file.clone(), place(), 0..8_u8)
            .prop_map(|(file, place, bit)| Mutation::Flip { file, place, bit }),
        3 => (file.clone(), place()).prop_map(|(file, place)| Mutation::Cut { file, place }),
        2 => (file.clone(), place(), 1..600_usize)
            .prop_map(|(file, place, length)| Mutation::Zero { file, place, length }),
        1 => (file.clone(), bytes()).prop_map(|(file, bytes)| Mutation::Append { file, bytes }),
        1 => (file.clone(), file).prop_map(|(file, other)| Mutation::Swap { file, other }),
        1 => ("[a-z0-9]{1,12}(\\.contribution|\\.tmp|\\.problem\\.json)?", bytes())
            .prop_map(|(name, bytes)| Mutation::Foreign { name, bytes }),
    ]
}

fn mutate(files: &mut [(PathBuf, Vec<u8>)], mutation: &Mutation) {
    match mutation {
        Mutation::Flip { file, place, bit } => {
            let bytes = &mut files[*file].1;
            if !bytes.is_empty() {
                let place = place.index(bytes.len());
                bytes[place] ^= 1 << bit;
            }
        }
        Mutation::Cut { file, place } => {
            let bytes = &mut files[*file].1;
            bytes.truncate(place.index(bytes.len() + 1));
        }
        Mutation::Zero { file, place, length } => {
            let bytes = &mut files[*file].1;
            let from = place.index(bytes.len() + 1);
            let to = (from + length).min(bytes.len());
            bytes[from..to].fill(0);
        }
        Mutation::Append { file, bytes } => files[*file].1.extend(bytes),
        Mutation::Swap { file, other } => {
            let bytes = files[*file].1.clone();
            files[*file].1 = std::mem::replace(&mut files[*other].1, bytes);
        }
        Mutation::Foreign { .. } => {}
    }
}

/// Every file of a queue as it was written.
fn queue_files() -> Vec<(String, Vec<u8>)> {
    (0..FILES as u64)
        .map(|n| {
            let encoded = EncodedContribution::of(&contribution(n)).unwrap();
            (format!("{n:020}.contribution"), record::write(&encoded).unwrap().unwrap())
        })
        .collect()
}

proptest! {
    #[test]
    fn a_mutated_outbox_sends_what_is_whole_and_nothing_else(
        mutations in prop::collection::vec(mutation(), 1..6),
    ) {
        let folder = tempfile::tempdir().unwrap();
        let queue = folder.path().join("queue");
        fs::create_dir(&queue).unwrap();
        let original = queue_files();
        let mut files: Vec<(PathBuf, Vec<u8>)> =
            original.iter().map(|(name, bytes)| (queue.join(name), bytes.clone())).collect();
        let mut foreign = BTreeSet::new();
        for mutation in &mutations {
            mutate(&mut files, mutation);
            if let Mutation::Foreign { name, bytes } = mutation {
                fs::write(queue.join(name), bytes).unwrap();
                foreign.insert(name.clone());
            }
        }
        for (path, bytes) in &files {
            fs::write(path, bytes).unwrap();
        }
        // Whole is what equals one of the originals, wherever it lies; each once.
        let whole: BTreeSet<Uuid> = (0..FILES)
            .filter(|n| files.iter().any(|(_, bytes)| *bytes == original[*n].1))
            .map(|n| id(n as u64))
            .collect();
        let unfinished = foreign.iter().filter(|name| name.ends_with(durable::UNFINISHED)).count();

        let outbox = open(&folder);
        let batch = outbox.next_batch(&BTreeSet::new(), BOUNDS).unwrap();
        let sent: BTreeSet<Uuid> = batch.iter().map(|queued| queued.contribution.id()).collect();
        prop_assert_eq!(&sent, &whole);
        for queued in &batch {
            let n = (0..FILES as u64).find(|n| id(*n) == queued.contribution.id()).unwrap();
            let expected = EncodedContribution::of(&contribution(n)).unwrap();
            prop_assert_eq!(&queued.contribution, &expected);
        }
        let contents = outbox.contents();
        prop_assert_eq!(contents.waiting, whole.len());
        prop_assert_eq!(contents.corrupt, FILES - whole.len() + foreign.len() - unfinished);

        let receipts: Vec<(u64, i64)> = batch.iter().map(|q| (q.sequence, 1)).collect();
        outbox.acknowledge(&receipts).unwrap();
        prop_assert_eq!(outbox.contents().waiting, 0);
        prop_assert!(next_ids(&outbox).is_empty());
    }
}
