//! The durable queue of contributions: what is in it survives a crash, and is sent until it is
//! acknowledged or refused. Nothing in it is ever dropped silently.
//!
//! ```text
//! lock              taken by the one process that has it open
//! queue/            one file per contribution that waits, named after its place in the queue
//! refused/          what the server refused, each with its problem beside it
//! corrupt/          damaged and foreign files; never sent
//! retained/         what was acknowledged last, in case the server is set back to an older backup
//! receipts          the journal of acknowledgements
//! ```
//!
//! A contribution is on the disk before [`Outbox::push`] returns, and leaves the queue only after
//! its receipt is on the disk too. Knows nothing of the network; [`super::Uploader`] does.

mod error;
mod folders;
mod index;
mod opening;
mod receipts;
mod record;
mod transfer;

use std::fs::File;
use std::path::Path;
use std::sync::{Mutex, MutexGuard, PoisonError};

use mapfold_schema::problem::Problem;
use mapfold_schema::v1;
use tokio::sync::watch;
use uuid::Uuid;

pub use error::OutboxError;
pub(super) use transfer::{BatchBounds, Queued};

use folders::Folders;
use index::{Entry, Index};
use receipts::{Key, Receipts};

use super::durable;
use super::encoded::EncodedContribution;

/// How much an outbox may hold.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OutboxConfig {
    /// Bytes on disk of all that waits; a push beyond it is [`OutboxError::Full`].
    pub quota_bytes: u64,
    /// Bytes on disk of acknowledged contributions that are kept, newest first, in case the server
    /// is set back to an older backup and needs them again.
    pub retained_bytes: u64,
    /// Acknowledgements that are remembered for certain, newest first (up to twice as many are).
    /// What is forgotten would be sent again, and get the same receipt.
    pub acknowledgements_max: usize,
}

impl OutboxConfig {
    /// 1 GiB waiting, 32 MiB retained, 200 000 acknowledgements (16 to 32 MB).
    pub const STANDARD: Self =
        Self { quota_bytes: 1 << 30, retained_bytes: 32 << 20, acknowledgements_max: 200_000 };
}

/// What became of a push.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Pushed {
    /// It is on disk and will be sent.
    Queued,
    /// It waits already, with the same content.
    AlreadyQueued,
    /// The server has it, with the same content: it will not be sent again.
    AlreadyAcknowledged(Acknowledgement),
    /// The server refused it, with the same content: it lies in `refused/`.
    AlreadyRefused,
}

/// That the server has a contribution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Acknowledgement {
    /// Its place in the level's log.
    pub revision: i64,
}

/// What an outbox holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct OutboxContents {
    /// Contributions that wait to be acknowledged.
    pub waiting: usize,
    /// Their bytes on disk.
    pub waiting_bytes: u64,
    /// Contributions that the server refused, each with its problem beside it in `refused/`.
    pub refused: usize,
    /// Damaged or foreign files found since it was opened; they lie in `corrupt/` and are never
    /// sent.
    pub corrupt: usize,
    /// Acknowledgements that are remembered.
    pub acknowledged: usize,
}

/// A contribution that the server refused.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Refusal {
    /// Its id.
    pub id: Uuid,
    /// The server's words; absent if the file beside it is gone or cannot be read.
    pub problem: Option<Problem>,
}

/// What [`Outbox::reconcile`] did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Reconciled {
    /// Acknowledgements that no longer hold.
    pub forgotten: usize,
    /// Contributions that were retained and wait again.
    pub requeued: usize,
}

/// A durable queue of contributions in a folder of its own, for one robot. Everything takes
/// `&self`: perception may push while an uploader drains.
#[derive(Debug)]
pub struct Outbox {
    folders: Folders,
    config: OutboxConfig,
    /// Held while a push is being written, so that two of the same id cannot both be new.
    pushing: Mutex<()>,
    /// Locked after `receipts` or alone.
    index: Mutex<Index>,
    receipts: Mutex<Receipts>,
    contents: watch::Sender<OutboxContents>,
    /// Released by the system when the process ends, however it ends.
    _lock: File,
}

impl Outbox {
    /// Opens the outbox in `folder`, which is made if it is missing, and checks all that is in it.
    /// Blocks on the disk.
    ///
    /// # Errors
    /// Another process has it open; the disk fails.
    pub fn open(folder: &Path, config: OutboxConfig) -> Result<Self, OutboxError> {
        opening::open(folder, config)
    }

    /// Puts a contribution on disk, to be sent. Blocks on the disk.
    ///
    /// # Errors
    /// Quota reached; other content waits under its id; the disk fails.
    pub fn push(&self, contribution: &v1::Contribution) -> Result<Pushed, OutboxError> {
        let pushed = self.push_many(std::slice::from_ref(contribution))?;
        Ok(pushed.first().copied().unwrap_or(Pushed::AlreadyQueued))
    }

    /// Like [`Self::push`] for several, all or none, in less time than one by one.
    ///
    /// # Errors
    /// As for [`Self::push`]; nothing of it is queued then.
    pub fn push_many(
        &self,
        contributions: &[v1::Contribution],
    ) -> Result<Vec<Pushed>, OutboxError> {
        let encoded: Vec<EncodedContribution> =
            contributions.iter().map(EncodedContribution::of).collect::<Result<_, _>>()?;
        let _pushing = self.pushing.lock().unwrap_or_else(PoisonError::into_inner);
        let (answers, news) = self.tell_new(&encoded)?;
        let files = news
            .into_iter()
            .map(|new| Ok((Entry::of(new, 0), record_of(new)?)))
            .collect::<Result<Vec<_>, OutboxError>>()?;
        self.check_quota(files.iter().map(|(_, bytes)| bytes.len() as u64).sum())?;
        self.write(&files)?;
        Ok(answers)
    }

    /// Whether the server has the contribution `id` of the level with this `frame`: one that need
    /// not even be made again.
    pub fn acknowledgement(&self, frame: Uuid, id: Uuid) -> Option<Acknowledgement> {
        let receipt = self.receipts().get(&Key { frame, id })?;
        Some(Acknowledgement { revision: receipt.revision })
    }

    /// What it holds now.
    pub fn contents(&self) -> OutboxContents {
        *self.contents.borrow()
    }

    /// What it holds, as it changes: for a producer that waits for room, or a progress bar.
    pub fn watch(&self) -> watch::Receiver<OutboxContents> {
        self.contents.subscribe()
    }

    /// What was refused, and why. Blocks on the disk.
    pub fn refusals(&self) -> Vec<Refusal> {
        let refused = self.index().refused();
        let refusal = |(key, entry): (Key, Entry)| Refusal {
            id: key.id,
            problem: self.folders.read_problem(entry.sequence),
        };
        refused.into_iter().map(refusal).collect()
    }

    /// To be called with the level's description before uploading: if the server's log ends before
    /// what it has acknowledged, it was set back to an older backup. What it forgot is forgotten
    /// here too, so that it may be pushed again, and what is retained of it waits again.
    ///
    /// # Errors
    /// The disk fails.
    pub fn reconcile(&self, level: &v1::LevelDescription) -> Result<Reconciled, OutboxError> {
        let mut receipts = self.receipts();
        let beyond = receipts.beyond(level.frame, level.revision);
        if beyond.is_empty() {
            return Ok(Reconciled::default());
        }
        // First back into the queue, then forgotten: a crash in between repeats it all.
        let mut index = self.index();
        let mut requeued = 0;
        for key in &beyond {
            let Some(entry) = index.take_retained(key) else { continue };
            self.folders.requeue_retained(entry.sequence)?;
            index.insert(entry);
            requeued += 1;
        }
        drop(index);
        durable::sync_folder(&self.folders.queue())?;
        let forgotten = receipts.forget_beyond(level.frame, level.revision)?.len();
        drop(receipts);
        self.tell();
        tracing::warn!(
            site = level.site,
            level = level.level,
            revision = level.revision,
            forgotten,
            requeued,
            "the server has lost what it had acknowledged: was it set back to an older backup?"
        );
        Ok(Reconciled { forgotten, requeued })
    }

    /// Puts all that was refused back into the queue, at its old place. Answers how many.
    ///
    /// # Errors
    /// The disk fails.
    pub fn requeue_refused(&self) -> Result<usize, OutboxError> {
        let mut index = self.index();
        let mut requeued = 0;
        for (key, entry) in index.refused() {
            self.folders.requeue_refused(entry.sequence)?;
            index.take_refused(&key);
            index.insert(entry);
            requeued += 1;
        }
        drop(index);
        durable::sync_folder(&self.folders.queue())?;
        self.tell();
        Ok(requeued)
    }

    /// What each push comes to, and which are new. A contribution that is twice among them is new
    /// once.
    fn tell_new<'c>(
        &self,
        pushed: &'c [EncodedContribution],
    ) -> Result<(Vec<Pushed>, Vec<&'c EncodedContribution>), OutboxError> {
        let receipts = self.receipts();
        let index = self.index();
        let mut answers = Vec::with_capacity(pushed.len());
        let mut news: Vec<&EncodedContribution> = Vec::new();
        for contribution in pushed {
            let key = Key { frame: contribution.frame, id: contribution.id };
            let same = |digest| contribution.digest == digest;
            let earlier = news.iter().find(|new| new.id == key.id && new.frame == key.frame);
            let waiting = index.waiting(&key).map(|entry| entry.digest);
            let answer = match waiting.or(earlier.map(|new| new.digest)) {
                Some(digest) if same(digest) => Pushed::AlreadyQueued,
                Some(_) => return Err(OutboxError::Conflict { id: key.id }),
                None => match receipts.get(&key).filter(|receipt| same(receipt.digest)) {
                    Some(receipt) => {
                        Pushed::AlreadyAcknowledged(Acknowledgement { revision: receipt.revision })
                    }
                    None if index.refusal(&key).is_some_and(same) => Pushed::AlreadyRefused,
                    None => {
                        news.push(contribution);
                        Pushed::Queued
                    }
                },
            };
            answers.push(answer);
        }
        Ok((answers, news))
    }

    fn check_quota(&self, needed_bytes: u64) -> Result<(), OutboxError> {
        let (quota_bytes, used_bytes) = (self.config.quota_bytes, self.index().waiting_bytes());
        if used_bytes + needed_bytes <= quota_bytes {
            Ok(())
        } else {
            Err(OutboxError::Full { quota_bytes, used_bytes, needed_bytes })
        }
    }

    /// Writes new files: all bytes, a wait for the disk, all names, a wait for the folder.
    /// Only what is on the disk for certain enters the index; what could not be finished is taken
    /// away again, and if that fails too it is found when the outbox is opened.
    fn write(&self, files: &[(Entry, Vec<u8>)]) -> Result<(), OutboxError> {
        if files.is_empty() {
            return Ok(());
        }
        let first = self.index().take_sequences(files.len() as u64);
        let entries: Vec<Entry> = (first..)
            .zip(files)
            .map(|(sequence, (entry, bytes))| Entry {
                sequence,
                file_bytes: bytes.len() as u64,
                ..*entry
            })
            .collect();
        let written = self.write_all(&entries, files);
        if written.is_err() {
            for entry in &entries {
                let path = self.folders.waiting(entry.sequence);
                for path in [durable::unfinished(&path), path] {
                    if let Err(error) = durable::remove(&path) {
                        tracing::warn!(%error, "what could not be queued cannot be removed");
                    }
                }
            }
            return written;
        }
        let mut index = self.index();
        for entry in entries {
            index.insert(entry);
        }
        drop(index);
        self.tell();
        Ok(())
    }

    fn write_all(&self, entries: &[Entry], files: &[(Entry, Vec<u8>)]) -> Result<(), OutboxError> {
        let mut open = Vec::with_capacity(files.len());
        for (entry, (_, bytes)) in entries.iter().zip(files) {
            let unfinished = durable::unfinished(&self.folders.waiting(entry.sequence));
            open.push((durable::write(&unfinished, bytes)?, unfinished));
        }
        durable::sync_together(&open)?;
        for (entry, (_, unfinished)) in entries.iter().zip(&open) {
            durable::rename(unfinished, &self.folders.waiting(entry.sequence))?;
        }
        durable::sync_folder(&self.folders.queue())?;
        Ok(())
    }

    fn index(&self) -> MutexGuard<'_, Index> {
        self.index.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn receipts(&self) -> MutexGuard<'_, Receipts> {
        self.receipts.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Tells those who watch.
    fn tell(&self) {
        let acknowledged = self.receipts().len();
        let contents = self.index().contents(acknowledged);
        self.contents.send_replace(contents);
    }
}

fn record_of(contribution: &EncodedContribution) -> Result<Vec<u8>, OutboxError> {
    match record::write(contribution) {
        Some(Ok(bytes)) => Ok(bytes),
        Some(Err(error)) => Err(OutboxError::Pack(error)),
        None => Err(OutboxError::TooLarge { id: contribution.id }),
    }
}

#[cfg(test)]
mod tests;
