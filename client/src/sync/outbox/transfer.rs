//! The uploader's side of the outbox: what to send next, and what became of it.

use std::collections::BTreeSet;
use std::fs;

use mapfold_schema::problem::Problem;

use super::receipts::Receipt;
use super::{Entry, Outbox, OutboxError, record};
use crate::sync::encoded::EncodedContribution;

/// A contribution that waits, and its place in the queue.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(in crate::sync) struct Queued {
    pub(in crate::sync) sequence: u64,
    pub(in crate::sync) contribution: EncodedContribution,
}

/// How much to send at a time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::sync) struct BatchBounds {
    pub(in crate::sync) count_max: usize,
    /// Before packing; what is larger by itself goes alone.
    pub(in crate::sync) bytes_max: usize,
}

impl Outbox {
    /// The first of the queue that are not among `skipped`, read and checked. What is found
    /// damaged now is set aside; the answer is empty only if nothing (else) waits.
    pub(in crate::sync) fn next_batch(
        &self,
        skipped: &BTreeSet<u64>,
        bounds: BatchBounds,
    ) -> Result<Vec<Queued>, OutboxError> {
        loop {
            let entries = self.first_waiting(skipped, bounds);
            if entries.is_empty() {
                return Ok(Vec::new());
            }
            let batch = self.read_waiting(&entries)?;
            if !batch.is_empty() {
                return Ok(batch);
            }
        }
    }

    /// Those of `sequences` that (still) wait, read and checked.
    pub(in crate::sync) fn read_batch(
        &self,
        sequences: &[u64],
    ) -> Result<Vec<Queued>, OutboxError> {
        let index = self.index();
        let entries: Vec<Entry> = sequences.iter().filter_map(|s| index.at(*s)).copied().collect();
        drop(index);
        self.read_waiting(&entries)
    }

    fn first_waiting(&self, skipped: &BTreeSet<u64>, bounds: BatchBounds) -> Vec<Entry> {
        let index = self.index();
        let mut entries = Vec::new();
        let mut bytes = 0;
        for entry in index.queue().filter(|entry| !skipped.contains(&entry.sequence)) {
            bytes += entry.cbor_bytes;
            let fits = entries.len() < bounds.count_max && bytes <= bounds.bytes_max;
            if !fits && !entries.is_empty() {
                break;
            }
            entries.push(*entry);
        }
        entries
    }

    fn read_waiting(&self, entries: &[Entry]) -> Result<Vec<Queued>, OutboxError> {
        let mut batch = Vec::with_capacity(entries.len());
        for entry in entries {
            let path = self.folders.waiting(entry.sequence);
            let read = fs::read(&path)
                .map_err(|error| error.to_string())
                .and_then(|bytes| record::read(&bytes).map_err(|damage| damage.to_string()));
            let fault = match read {
                // The digest tells a whole file that took another's place from the one it was.
                Ok(contribution) if contribution.digest != entry.digest => {
                    "it is no longer the file that it was".to_owned()
                }
                Ok(contribution) if !record::is_consistent(&contribution) => {
                    "its content is not the contribution that its head says".to_owned()
                }
                Ok(contribution) => {
                    batch.push(Queued { sequence: entry.sequence, contribution });
                    continue;
                }
                Err(fault) => fault,
            };
            tracing::error!(path = %path.display(), fault, "lost a contribution that waited");
            let mut index = self.index();
            index.remove(entry.sequence);
            index.found_corrupt();
            drop(index);
            self.tell();
            if path.exists() {
                self.folders.set_aside(&path)?;
            }
        }
        Ok(batch)
    }

    /// The server has these, at these revisions: on disk first, then they leave the queue.
    pub(in crate::sync) fn acknowledge(
        &self,
        acknowledged: &[(u64, i64)],
    ) -> Result<(), OutboxError> {
        let index = self.index();
        let entries: Vec<(Entry, i64)> = acknowledged
            .iter()
            .filter_map(|(sequence, revision)| Some((*index.at(*sequence)?, *revision)))
            .collect();
        drop(index);
        let receipt = |(entry, revision): &(Entry, i64)| Receipt {
            key: entry.key,
            digest: entry.digest,
            revision: *revision,
        };
        self.receipts().append(&entries.iter().map(receipt).collect::<Vec<_>>())?;
        for (entry, _) in &entries {
            self.folders.retain(entry.sequence)?;
        }
        let mut index = self.index();
        for (entry, _) in &entries {
            index.remove(entry.sequence);
            index.insert_retained(*entry);
        }
        let surplus: Vec<Entry> =
            std::iter::from_fn(|| index.take_surplus(self.config.retained_bytes)).collect();
        drop(index);
        self.tell();
        for entry in surplus {
            self.folders.remove_retained(entry.sequence)?;
        }
        Ok(())
    }

    /// The server will never take this one: it is parked with the server's words beside it.
    pub(in crate::sync) fn refuse(
        &self,
        sequence: u64,
        problem: &Problem,
    ) -> Result<(), OutboxError> {
        if self.index().at(sequence).is_none() {
            return Ok(());
        }
        self.folders.park(sequence, problem)?;
        let mut index = self.index();
        if let Some(entry) = index.remove(sequence) {
            index.insert_refused(entry);
        }
        drop(index);
        self.tell();
        Ok(())
    }
}
