//! What lies where in an outbox, in memory. Knows no files.

use std::collections::{BTreeMap, BTreeSet};

use super::OutboxContents;
use super::receipts::Key;
use super::record::RecordHead;
use crate::sync::encoded::{ContentDigest, EncodedContribution};

/// One file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Entry {
    pub(super) sequence: u64,
    pub(super) key: Key,
    pub(super) digest: ContentDigest,
    pub(super) cbor_bytes: usize,
    pub(super) file_bytes: u64,
}

impl Entry {
    /// An entry without a file yet.
    pub(super) fn of(contribution: &EncodedContribution, sequence: u64) -> Self {
        let EncodedContribution { id, frame, digest, cbor } = contribution;
        Self {
            sequence,
            key: Key { frame: *frame, id: *id },
            digest: *digest,
            cbor_bytes: cbor.len(),
            file_bytes: 0,
        }
    }

    /// The entry of a file that was read.
    pub(super) fn of_file(head: &RecordHead, sequence: u64, file_bytes: u64) -> Self {
        Self {
            sequence,
            key: Key { frame: head.frame, id: head.id },
            digest: head.digest,
            cbor_bytes: head.cbor_bytes as usize,
            file_bytes,
        }
    }
}

/// What waits, what was refused, and what is retained.
#[derive(Debug, Default)]
pub(super) struct Index {
    queue: BTreeMap<u64, Entry>,
    by_key: BTreeMap<Key, u64>,
    waiting_bytes: u64,
    refused: BTreeMap<Key, Entry>,
    retained: BTreeMap<Key, Entry>,
    /// Places in the order in which they were retained.
    retained_order: BTreeSet<(u64, Key)>,
    retained_bytes: u64,
    corrupt: usize,
    next_sequence: u64,
}

impl Index {
    /// The next `count` places of the queue; answers the first.
    pub(super) fn take_sequences(&mut self, count: u64) -> u64 {
        let first = self.next_sequence;
        self.next_sequence += count;
        first
    }

    /// No new place will be one that was given before.
    pub(super) fn sequence_is_taken(&mut self, sequence: u64) {
        self.next_sequence = self.next_sequence.max(sequence.saturating_add(1));
    }

    pub(super) fn insert(&mut self, entry: Entry) {
        self.waiting_bytes += entry.file_bytes;
        self.by_key.insert(entry.key, entry.sequence);
        self.queue.insert(entry.sequence, entry);
    }

    /// Takes an entry out of the queue.
    pub(super) fn remove(&mut self, sequence: u64) -> Option<Entry> {
        let entry = self.queue.remove(&sequence)?;
        self.by_key.remove(&entry.key);
        self.waiting_bytes -= entry.file_bytes;
        Some(entry)
    }

    pub(super) fn waiting(&self, key: &Key) -> Option<&Entry> {
        self.queue.get(self.by_key.get(key)?)
    }

    pub(super) fn at(&self, sequence: u64) -> Option<&Entry> {
        self.queue.get(&sequence)
    }

    /// The queue in its order.
    pub(super) fn queue(&self) -> impl Iterator<Item = &Entry> {
        self.queue.values()
    }

    pub(super) fn waiting_bytes(&self) -> u64 {
        self.waiting_bytes
    }

    pub(super) fn insert_refused(&mut self, entry: Entry) {
        self.refused.insert(entry.key, entry);
    }

    pub(super) fn take_refused(&mut self, key: &Key) -> Option<Entry> {
        self.refused.remove(key)
    }

    /// The content that was refused under this key, if any was.
    pub(super) fn refusal(&self, key: &Key) -> Option<ContentDigest> {
        Some(self.refused.get(key)?.digest)
    }

    /// All that was refused, in the order of the queue.
    pub(super) fn refused(&self) -> Vec<(Key, Entry)> {
        let mut refused: Vec<(Key, Entry)> = self.refused.iter().map(|(k, e)| (*k, *e)).collect();
        refused.sort_unstable_by_key(|(_, entry)| entry.sequence);
        refused
    }

    pub(super) fn insert_retained(&mut self, entry: Entry) {
        self.take_retained(&entry.key);
        self.retained_bytes += entry.file_bytes;
        self.retained_order.insert((entry.sequence, entry.key));
        self.retained.insert(entry.key, entry);
    }

    pub(super) fn take_retained(&mut self, key: &Key) -> Option<Entry> {
        let entry = self.retained.remove(key)?;
        self.retained_order.remove(&(entry.sequence, entry.key));
        self.retained_bytes -= entry.file_bytes;
        Some(entry)
    }

    /// The oldest of what is retained, as long as that is more than `bytes_max`.
    pub(super) fn take_surplus(&mut self, bytes_max: u64) -> Option<Entry> {
        if self.retained_bytes <= bytes_max {
            return None;
        }
        let (_, key) = *self.retained_order.first()?;
        self.take_retained(&key)
    }

    pub(super) fn found_corrupt(&mut self) {
        self.corrupt += 1;
    }

    pub(super) fn contents(&self, acknowledged: usize) -> OutboxContents {
        OutboxContents {
            waiting: self.queue.len(),
            waiting_bytes: self.waiting_bytes,
            refused: self.refused.len(),
            corrupt: self.corrupt,
            acknowledged,
        }
    }
}
