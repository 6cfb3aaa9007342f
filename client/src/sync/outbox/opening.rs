//! Opening an outbox: whatever a crash, a full disk or a hand left there is found out now.

use std::fs;
use std::path::Path;
use std::sync::Mutex;

use tokio::sync::watch;

use super::folders::{Folders, is_unfinished, sequence_of};
use super::index::{Entry, Index};
use super::receipts::{Receipts, Wear};
use super::record::{self, Damage};
use super::{Outbox, OutboxConfig, OutboxError};
use crate::sync::durable::{self, DiskError};

pub(super) fn open(folder: &Path, config: OutboxConfig) -> Result<Outbox, OutboxError> {
    let Some(lock) = durable::lock_folder(folder)? else {
        return Err(OutboxError::InUse { folder: folder.to_owned() });
    };
    let folders = Folders::make(folder)?;
    let mut index = Index::default();
    let receipts = open_receipts(&folders, config, &mut index)?;
    find_retained(&folders, &mut index)?;
    find_refused(&folders, &mut index)?;
    find_waiting(&folders, &receipts, &mut index)?;
    while let Some(entry) = index.take_surplus(config.retained_bytes) {
        folders.remove_retained(entry.sequence)?;
    }
    let contents = watch::Sender::new(index.contents(receipts.len()));
    Ok(Outbox {
        folders,
        config,
        pushing: Mutex::new(()),
        index: Mutex::new(index),
        receipts: Mutex::new(receipts),
        contents,
        _lock: lock,
    })
}

fn open_receipts(
    folders: &Folders,
    config: OutboxConfig,
    index: &mut Index,
) -> Result<Receipts, DiskError> {
    let path = folders.receipts();
    let aside = || folders.aside("receipts".as_ref());
    let (receipts, wear) = Receipts::open(path, config.acknowledgements_max, aside)?;
    if wear != Wear::default() {
        let (damaged, is_foreign) = (wear.damaged, wear.is_foreign);
        tracing::warn!(damaged, is_foreign, "the journal of receipts was damaged");
    }
    if wear.is_foreign {
        index.found_corrupt();
    }
    Ok(receipts)
}

/// What waits: whole records that are not acknowledged, each id once.
fn find_waiting(
    folders: &Folders,
    receipts: &Receipts,
    index: &mut Index,
) -> Result<(), DiskError> {
    for path in Folders::list(&folders.queue())? {
        if is_unfinished(&path) && path.is_file() {
            // It was never promised that this is there.
            durable::remove(&path)?;
            continue;
        }
        let (sequence, entry) = match read_entry(&path) {
            Ok(entry) => (entry.sequence, entry),
            Err(damage) => {
                set_aside(folders, &path, &damage, index)?;
                continue;
            }
        };
        index.sequence_is_taken(sequence);
        if index.waiting(&entry.key).is_some() {
            set_aside(folders, &path, &"the same contribution waits already", index)?;
        } else if receipts.get(&entry.key).is_some_and(|receipt| receipt.digest == entry.digest) {
            // The crash came between the receipt and this.
            folders.retain(sequence)?;
            index.insert_retained(entry);
        } else {
            index.insert(entry);
        }
    }
    Ok(())
}

fn find_refused(folders: &Folders, index: &mut Index) -> Result<(), DiskError> {
    for path in Folders::list(&folders.refused())? {
        // Problems lie beside what they are about, and people may put notes there.
        if sequence_of(&path).is_none() {
            continue;
        }
        match read_entry(&path) {
            Ok(entry) => {
                index.sequence_is_taken(entry.sequence);
                index.insert_refused(entry);
            }
            Err(damage) => set_aside(folders, &path, &damage, index)?,
        }
    }
    Ok(())
}

/// What is retained has its receipt: if it is damaged, nothing is lost.
fn find_retained(folders: &Folders, index: &mut Index) -> Result<(), DiskError> {
    for path in Folders::list(&folders.retained())? {
        if let Ok(entry) = read_entry(&path) {
            index.sequence_is_taken(entry.sequence);
            index.insert_retained(entry);
        } else {
            folders.set_aside(&path)?;
        }
    }
    Ok(())
}

fn read_entry(path: &Path) -> Result<Entry, Unusable> {
    let sequence = sequence_of(path).ok_or(Unusable::Damage(Damage::Foreign))?;
    let bytes = fs::read(path).map_err(Unusable::Unreadable)?;
    let head = record::read_head(&bytes).map_err(Unusable::Damage)?;
    Ok(Entry::of_file(&head, sequence, bytes.len() as u64))
}

/// Why a file is not used.
#[derive(Debug, thiserror::Error)]
enum Unusable {
    #[error(transparent)]
    Damage(Damage),
    #[error("it cannot be read: {0}")]
    Unreadable(std::io::Error),
}

fn set_aside(
    folders: &Folders,
    path: &Path,
    why: &impl std::fmt::Display,
    index: &mut Index,
) -> Result<(), DiskError> {
    folders.set_aside(path)?;
    index.found_corrupt();
    tracing::warn!(path = %path.display(), %why, "set a file of the outbox aside");
    Ok(())
}
