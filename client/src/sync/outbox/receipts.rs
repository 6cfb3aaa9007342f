//! The journal of acknowledgements: which contributions the server has.
//!
//! Records of one length are appended, each with its own checksum, so that a torn tail costs the
//! last record and a flipped bit costs one; what is lost is sent again and gets the same receipt.
//!
//! ```text
//! "MFRCPTS1"          8 bytes
//! records of 80 bytes: frame 16, id 16, content digest 32, revision i64 little-endian,
//!                     the first 8 bytes of the SHA-256 of those 72
//! ```

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Write as _};
use std::path::PathBuf;

use sha2::{Digest, Sha256};
use uuid::Uuid;

use crate::sync::durable::{self, DiskError, at};
use crate::sync::encoded::ContentDigest;

const MAGIC: &[u8; 8] = b"MFRCPTS1";
const RECORD_LENGTH: usize = 80;
const CHECKSUM_AT: usize = 72;

/// A contribution of a level: the frame says which level, on whichever server.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Key {
    pub(super) frame: Uuid,
    pub(super) id: Uuid,
}

/// That the server has a contribution with this content.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Receipt {
    pub(super) key: Key,
    pub(super) digest: ContentDigest,
    pub(super) revision: i64,
}

/// What is remembered of one.
#[derive(Debug, Clone, Copy)]
struct Kept {
    digest: ContentDigest,
    revision: i64,
    /// Later ones have higher numbers.
    age: u64,
}

/// The journal, in memory and on disk.
#[derive(Debug)]
pub(super) struct Receipts {
    path: PathBuf,
    /// Absent before the first write, and after a failed one, of which nobody knows how much is on
    /// the disk: the next one then writes the whole journal anew.
    file: Option<File>,
    /// Records in the file, forgotten ones too.
    records: usize,
    kept: BTreeMap<Key, Kept>,
    kept_max: usize,
    next_age: u64,
}

/// What opening a journal found wrong with it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(super) struct Wear {
    /// Damaged records that were left out, a torn tail among them.
    pub(super) damaged: usize,
    /// The file is no journal at all.
    pub(super) is_foreign: bool,
}

impl Receipts {
    /// Opens the journal at `path` and leaves out what is damaged. A file that is no journal is
    /// moved to `aside`.
    pub(super) fn open(
        path: PathBuf,
        kept_max: usize,
        aside: impl FnOnce() -> PathBuf,
    ) -> Result<(Self, Wear), DiskError> {
        let bytes = match fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == io::ErrorKind::NotFound => Vec::new(),
            Err(error) => return Err(at(&path)(error)),
        };
        let (found, wear) = read(&bytes);
        let mut receipts =
            Self { path, file: None, records: 0, kept: BTreeMap::new(), kept_max, next_age: 0 };
        for receipt in &found {
            receipts.remember(receipt);
        }
        if wear.is_foreign {
            durable::rename(&receipts.path, &aside())?;
        }
        receipts.records = found.len();
        if wear != Wear::default() || receipts.is_overgrown() {
            receipts.rewrite()?;
        } else if !bytes.is_empty() {
            receipts.reopen()?;
        }
        Ok((receipts, wear))
    }

    /// The receipt of a contribution.
    pub(super) fn get(&self, key: &Key) -> Option<Receipt> {
        let Kept { digest, revision, .. } = *self.kept.get(key)?;
        Some(Receipt { key: *key, digest, revision })
    }

    /// How many are remembered.
    pub(super) fn len(&self) -> usize {
        self.kept.len()
    }

    /// Puts receipts on the disk, with one `fsync` for all.
    pub(super) fn append(&mut self, receipts: &[Receipt]) -> Result<(), DiskError> {
        for receipt in receipts {
            self.remember(receipt);
        }
        let Some(file) = &mut self.file else { return self.rewrite() };
        let bytes: Vec<u8> = receipts.iter().flat_map(record).collect();
        let written = file.write_all(&bytes).and_then(|()| file.sync_data());
        if let Err(error) = written {
            // An `fsync` that failed once says nothing if it succeeds the next time.
            self.file = None;
            return Err(at(&self.path)(error));
        }
        self.records += receipts.len();
        if self.is_overgrown() { self.rewrite() } else { Ok(()) }
    }

    /// Forgets all of a level beyond `revision`; answers them, oldest first.
    pub(super) fn forget_beyond(
        &mut self,
        frame: Uuid,
        revision: i64,
    ) -> Result<Vec<Key>, DiskError> {
        let beyond = |key: &Key, kept: &Kept| key.frame == frame && kept.revision > revision;
        let forgotten = self.keys_by_age(beyond);
        if !forgotten.is_empty() {
            self.kept.retain(|key, kept| !beyond(key, kept));
            self.rewrite()?;
        }
        Ok(forgotten)
    }

    /// Those beyond `revision`, oldest first.
    pub(super) fn beyond(&self, frame: Uuid, revision: i64) -> Vec<Key> {
        self.keys_by_age(|key, kept| key.frame == frame && kept.revision > revision)
    }

    fn keys_by_age(&self, which: impl Fn(&Key, &Kept) -> bool) -> Vec<Key> {
        let mut keys: Vec<(u64, Key)> = self
            .kept
            .iter()
            .filter(|(key, kept)| which(key, kept))
            .map(|(key, kept)| (kept.age, *key))
            .collect();
        keys.sort_unstable();
        keys.into_iter().map(|(_, key)| key).collect()
    }

    fn remember(&mut self, receipt: &Receipt) {
        let Receipt { key, digest, revision } = *receipt;
        self.kept.insert(key, Kept { digest, revision, age: self.next_age });
        self.next_age += 1;
    }

    /// Whether more than half of the file is forgotten, or will be: rewriting then costs as much
    /// as the appends since the last time.
    fn is_overgrown(&self) -> bool {
        self.records > 2 * self.kept_max.max(1)
    }

    /// Writes the newest of what is kept as a new file.
    fn rewrite(&mut self) -> Result<(), DiskError> {
        self.file = None;
        let keys = self.keys_by_age(|_, _| true);
        let (old, new) = keys.split_at(keys.len().saturating_sub(self.kept_max));
        for key in old {
            self.kept.remove(key);
        }
        let mut bytes = MAGIC.to_vec();
        for receipt in new.iter().filter_map(|key| self.get(key)) {
            bytes.extend(record(&receipt));
        }
        durable::replace(&self.path, &bytes)?;
        self.records = new.len();
        self.reopen()
    }

    fn reopen(&mut self) -> Result<(), DiskError> {
        let file = File::options().append(true).open(&self.path).map_err(at(&self.path))?;
        self.file = Some(file);
        Ok(())
    }
}

fn record(receipt: &Receipt) -> [u8; RECORD_LENGTH] {
    let mut bytes = [0; RECORD_LENGTH];
    bytes[..16].copy_from_slice(receipt.key.frame.as_bytes());
    bytes[16..32].copy_from_slice(receipt.key.id.as_bytes());
    bytes[32..64].copy_from_slice(&receipt.digest);
    bytes[64..CHECKSUM_AT].copy_from_slice(&receipt.revision.to_le_bytes());
    let checksum = Sha256::digest(&bytes[..CHECKSUM_AT]);
    bytes[CHECKSUM_AT..].copy_from_slice(&checksum[..RECORD_LENGTH - CHECKSUM_AT]);
    bytes
}

/// All whole records of a file.
fn read(bytes: &[u8]) -> (Vec<Receipt>, Wear) {
    // A head that was never finished, when the very first write was cut off, is no other format.
    if MAGIC.starts_with(bytes) {
        let torn = usize::from(!bytes.is_empty() && bytes.len() < MAGIC.len());
        return (Vec::new(), Wear { damaged: torn, is_foreign: false });
    }
    let Some(records) = bytes.strip_prefix(MAGIC) else {
        return (Vec::new(), Wear { damaged: 0, is_foreign: true });
    };
    let (records, tail) = records.as_chunks::<RECORD_LENGTH>();
    let whole: Vec<Receipt> = records.iter().filter_map(read_record).collect();
    let damaged = records.len() - whole.len() + usize::from(!tail.is_empty());
    (whole, Wear { damaged, is_foreign: false })
}

fn read_record(bytes: &[u8; RECORD_LENGTH]) -> Option<Receipt> {
    let (said, checksum) = bytes.split_at(CHECKSUM_AT);
    if !Sha256::digest(said).starts_with(checksum) {
        return None;
    }
    Some(Receipt {
        key: Key {
            frame: Uuid::from_slice(&said[..16]).ok()?,
            id: Uuid::from_slice(&said[16..32]).ok()?,
        },
        digest: said[32..64].try_into().ok()?,
        revision: i64::from_le_bytes(said[64..].try_into().ok()?),
    })
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn receipt(n: u8) -> Receipt {
        Receipt {
            key: Key { frame: Uuid::from_bytes([9; 16]), id: Uuid::from_bytes([n; 16]) },
            digest: [n; 32],
            revision: i64::from(n),
        }
    }

    fn file(count: u8) -> Vec<u8> {
        let mut bytes = MAGIC.to_vec();
        bytes.extend((0..count).flat_map(|n| record(&receipt(n))));
        bytes
    }

    fn open(folder: &tempfile::TempDir, kept_max: usize) -> (Receipts, Wear) {
        let aside = || folder.path().join("aside");
        Receipts::open(folder.path().join("receipts"), kept_max, aside).unwrap()
    }

    #[test]
    fn receipts_are_there_after_a_restart() {
        let folder = tempfile::tempdir().unwrap();
        {
            let (mut receipts, wear) = open(&folder, 100);
            assert_eq!(wear, Wear::default());
            receipts.append(&[receipt(1), receipt(2)]).unwrap();
            receipts.append(&[receipt(3)]).unwrap();
        }
        let (receipts, wear) = open(&folder, 100);
        assert_eq!((wear, receipts.len()), (Wear::default(), 3));
        assert_eq!(receipts.get(&receipt(2).key), Some(receipt(2)));
        assert_eq!(receipts.get(&receipt(4).key), None);
    }

    #[test]
    fn a_torn_tail_costs_the_last_receipt_only_and_the_journal_goes_on() {
        let whole = file(3);
        for length in 0..=whole.len() {
            let folder = tempfile::tempdir().unwrap();
            fs::write(folder.path().join("receipts"), &whole[..length]).unwrap();
            let (mut receipts, wear) = open(&folder, 100);
            let left = length.saturating_sub(MAGIC.len()) / RECORD_LENGTH;
            assert_eq!(receipts.len(), left, "cut to {length}");
            assert!(!wear.is_foreign);
            if length % 37 != 0 {
                continue; // the rest at some places only: each costs an fsync
            }
            receipts.append(&[receipt(77)]).unwrap();
            drop(receipts);
            let (receipts, wear) = open(&folder, 100);
            assert_eq!((receipts.len(), wear), (left + 1, Wear::default()), "cut to {length}");
        }
    }

    #[test]
    fn another_file_is_set_aside_and_not_overwritten() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join("receipts"), b"a letter to the operator").unwrap();
        let (receipts, wear) = open(&folder, 100);
        assert!(wear.is_foreign && receipts.len() == 0);
        assert_eq!(fs::read(folder.path().join("aside")).unwrap(), b"a letter to the operator");
    }

    #[test]
    fn only_the_newest_are_kept_and_the_file_stays_bounded() {
        let folder = tempfile::tempdir().unwrap();
        let (mut receipts, _) = open(&folder, 4);
        for n in 0..100 {
            receipts.append(&[receipt(n)]).unwrap();
            let length = fs::metadata(folder.path().join("receipts")).unwrap().len();
            assert!(length <= (MAGIC.len() + 8 * RECORD_LENGTH) as u64);
        }
        drop(receipts);
        let (receipts, _) = open(&folder, 4);
        assert!(receipts.len() >= 4 && receipts.len() <= 8, "{}", receipts.len());
        assert!((96..100).all(|n| receipts.get(&receipt(n).key).is_some()));
    }

    #[test]
    fn what_a_server_forgot_is_forgotten_for_its_level_only() {
        let folder = tempfile::tempdir().unwrap();
        let (mut receipts, _) = open(&folder, 100);
        let elsewhere = Key { frame: Uuid::nil(), id: receipt(8).key.id };
        let mut all: Vec<Receipt> = [5, 6, 9, 7].map(receipt).to_vec();
        all.push(Receipt { key: elsewhere, ..receipt(8) });
        receipts.append(&all).unwrap();
        let frame = receipt(0).key.frame;
        assert_eq!(receipts.beyond(frame, 6), [receipt(9).key, receipt(7).key]);
        assert_eq!(receipts.forget_beyond(frame, 6).unwrap(), [receipt(9).key, receipt(7).key]);
        drop(receipts);
        let (receipts, _) = open(&folder, 100);
        assert_eq!(receipts.len(), 3);
        assert!(receipts.get(&elsewhere).is_some() && receipts.get(&receipt(9).key).is_none());
    }

    proptest! {
        #![proptest_config(ProptestConfig { cases: 2000, ..ProptestConfig::default() })]

        #[test]
        fn damage_costs_what_it_hits_and_never_makes_a_receipt(
            flips in prop::collection::vec((MAGIC.len()..MAGIC.len() + 20 * RECORD_LENGTH, 0..8_u8), 1..5),
            cut in MAGIC.len()..MAGIC.len() + 20 * RECORD_LENGTH,
        ) {
            let mut bytes = file(20);
            for (place, bit) in &flips {
                bytes[*place] ^= 1 << bit;
            }
            bytes.truncate(cut);
            let (found, _) = read(&bytes);
            prop_assert!(found.iter().all(|r| *r == receipt(r.digest[0])));
            let whole = (cut - MAGIC.len()) / RECORD_LENGTH;
            let hit = whole.saturating_sub(found.len());
            prop_assert!(found.len() <= whole && hit <= flips.len());
        }

        #[test]
        fn no_bytes_at_all_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
            read(&bytes);
            let (found, _) = read(&[MAGIC.as_slice(), &bytes].concat());
            prop_assert!(found.is_empty());
        }
    }
}
