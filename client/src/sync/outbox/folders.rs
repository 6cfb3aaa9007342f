//! Where things lie in an outbox's folder.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use mapfold_schema::codec;
use mapfold_schema::problem::Problem;

use crate::sync::durable::{self, DiskError, at};

const SUFFIX: &str = ".contribution";
const PROBLEM_SUFFIX: &str = ".problem.json";
/// Digits of a sequence number: those of the largest `u64`, so that names sort as numbers do.
const DIGITS: usize = 20;

/// The outbox's folder and its parts.
#[derive(Debug)]
pub(super) struct Folders {
    root: PathBuf,
}

impl Folders {
    /// Makes what is missing.
    pub(super) fn make(root: &Path) -> Result<Self, DiskError> {
        let folders = Self { root: root.to_owned() };
        for folder in [folders.queue(), folders.refused(), folders.corrupt(), folders.retained()] {
            fs::create_dir_all(&folder).map_err(at(&folder))?;
        }
        durable::sync_folder(root)?;
        Ok(folders)
    }

    pub(super) fn queue(&self) -> PathBuf {
        self.root.join("queue")
    }

    pub(super) fn refused(&self) -> PathBuf {
        self.root.join("refused")
    }

    pub(super) fn retained(&self) -> PathBuf {
        self.root.join("retained")
    }

    pub(super) fn receipts(&self) -> PathBuf {
        self.root.join("receipts")
    }

    fn corrupt(&self) -> PathBuf {
        self.root.join("corrupt")
    }

    /// The file of a contribution that waits.
    pub(super) fn waiting(&self, sequence: u64) -> PathBuf {
        self.queue().join(file_name(sequence))
    }

    fn refused_file(&self, sequence: u64) -> PathBuf {
        self.refused().join(file_name(sequence))
    }

    fn retained_file(&self, sequence: u64) -> PathBuf {
        self.retained().join(file_name(sequence))
    }

    fn problem(&self, sequence: u64) -> PathBuf {
        self.refused().join(format!("{sequence:0DIGITS$}{PROBLEM_SUFFIX}"))
    }

    /// A name in `corrupt/` that is still free, after that of the file which is to go there.
    pub(super) fn aside(&self, name: &OsStr) -> PathBuf {
        let free = self.corrupt().join(name);
        if !free.exists() {
            return free;
        }
        let numbered = |n: u64| {
            let mut name = name.to_owned();
            name.push(format!(".{n}"));
            self.corrupt().join(name)
        };
        (1..u64::MAX).map(numbered).find(|path| !path.exists()).unwrap_or(free)
    }

    /// Puts what may not be sent where it is never sent from. Not synced: if a crash undoes it, it
    /// is found again.
    pub(super) fn set_aside(&self, path: &Path) -> Result<(), DiskError> {
        durable::rename(path, &self.aside(path.file_name().unwrap_or_default()))
    }

    /// Moves a contribution from the queue to what was refused, its problem first.
    pub(super) fn park(&self, sequence: u64, problem: &Problem) -> Result<(), DiskError> {
        // A problem is words and numbers, which JSON can hold.
        let words = codec::to_json(problem).unwrap_or_default();
        durable::replace(&self.problem(sequence), &words)?;
        durable::rename(&self.waiting(sequence), &self.refused_file(sequence))?;
        durable::sync_folder(&self.refused())?;
        durable::sync_folder(&self.queue())
    }

    pub(super) fn read_problem(&self, sequence: u64) -> Option<Problem> {
        codec::from_json(&fs::read(self.problem(sequence)).ok()?).ok()
    }

    pub(super) fn requeue_refused(&self, sequence: u64) -> Result<(), DiskError> {
        durable::rename(&self.refused_file(sequence), &self.waiting(sequence))?;
        durable::remove(&self.problem(sequence))
    }

    pub(super) fn requeue_retained(&self, sequence: u64) -> Result<(), DiskError> {
        durable::rename(&self.retained_file(sequence), &self.waiting(sequence))
    }

    /// Moves what was acknowledged out of the queue.
    pub(super) fn retain(&self, sequence: u64) -> Result<(), DiskError> {
        durable::rename(&self.waiting(sequence), &self.retained_file(sequence))
    }

    pub(super) fn remove_retained(&self, sequence: u64) -> Result<(), DiskError> {
        durable::remove(&self.retained_file(sequence))
    }

    /// All entries of a folder, sorted by name.
    pub(super) fn list(folder: &Path) -> Result<Vec<PathBuf>, DiskError> {
        let entries = fs::read_dir(folder).map_err(at(folder))?;
        let paths = entries.map(|entry| entry.map(|entry| entry.path()));
        let mut paths: Vec<PathBuf> = paths.collect::<Result<_, _>>().map_err(at(folder))?;
        paths.sort_unstable();
        Ok(paths)
    }
}

fn file_name(sequence: u64) -> String {
    format!("{sequence:0DIGITS$}{SUFFIX}")
}

/// The place in the queue that a file's name says; `None` for names that are not given here.
pub(super) fn sequence_of(path: &Path) -> Option<u64> {
    let name = path.file_name()?.to_str()?;
    let sequence = name.strip_suffix(SUFFIX)?.parse().ok()?;
    (file_name(sequence) == name).then_some(sequence)
}

/// Whether a file is the rest of a write that was cut off.
pub(super) fn is_unfinished(path: &Path) -> bool {
    path.file_name().and_then(OsStr::to_str).is_some_and(|n| n.ends_with(durable::UNFINISHED))
}
