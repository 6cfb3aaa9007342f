//! The GDB of a level in its log: edits of the draft, and publications of it.
//!
//! An object's row says what it is from one revision on, so that the model at any revision can be read.
//! A publication names a draft and a revision of the site's library: what is published never changes by itself.

mod read;
mod stale;
mod write;

use std::collections::{BTreeMap, BTreeSet};

use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::v1;
use sqlx::any::AnyRow;
use uuid::Uuid;

pub(super) use read::first_entry_after as first_gdb_entry_after;
pub use stale::{ObjectChange, Stale};

use super::StoreError;
use super::row::{corrupt, count, get};

const ENTRIES: &str = "gdb_entries";
const OBJECTS: &str = "gdb_objects";

/// Which model it is: a draft, and the library that its instances are taken from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct GdbVersion {
    /// Revision of the edit that made the draft; 0 for the empty model.
    pub draft: i64,
    /// Revision of the site's library; 0 for the empty one.
    pub library: i64,
}

/// A publication.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Publication {
    /// Its place in the level's log.
    pub revision: i64,
    /// What it published.
    pub version: GdbVersion,
}

/// How far the GDB of a level has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct GdbState {
    /// The draft, and the site's library as it is now.
    pub draft: GdbVersion,
    /// Objects of the draft.
    pub objects: i64,
    /// The latest publication.
    pub published: Option<Publication>,
}

/// Which drafts an edit may be made on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Expected {
    /// Whatever is there.
    Any,
    /// One of these.
    OneOf(Vec<GdbVersion>),
}

impl Expected {
    /// Whether `now` is expected.
    pub fn allows(&self, now: GdbVersion) -> bool {
        match self {
            Self::Any => true,
            Self::OneOf(versions) => versions.contains(&now),
        }
    }
}

/// Who makes an entry, and what for.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewGdbEntry {
    /// The entry.
    pub id: Uuid,
    /// Public id of the token.
    pub author: String,
    /// Now, microseconds since 1970.
    pub at_us: i64,
    /// In the author's words.
    pub comment: String,
    /// The drafts that the author may have seen.
    pub expected: Expected,
}

/// What is to become of the draft; objects as their columns.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum GdbChange {
    /// It is to hold these objects and no others.
    Replace(BTreeMap<Uuid, Vec<u8>>),
    /// Some objects are put, and others removed.
    Edit {
        /// By identity.
        put: BTreeMap<Uuid, Vec<u8>>,
        /// Those that are not there are none.
        removed: BTreeSet<Uuid>,
    },
}

/// What became of an edit or a publication.
#[derive(Debug, Clone, PartialEq)]
pub enum GdbOutcome {
    /// It is in the log.
    Done(v1::GdbEntry),
    /// All of it was so already: nothing has changed.
    Same(GdbState),
    /// The draft is none of those that the author may have seen: nothing has changed.
    Stale(Stale),
    /// There would be more objects than a level may have: nothing has changed.
    TooMany {
        /// How many there would be.
        objects: i64,
    },
}

/// The columns that make a [`v1::GdbEntry`].
macro_rules! entries {
    ($conditions:literal) => {
        concat!(
            "select entry, revision, kind, draft, library, at_us, author, comment, put_count, \
             removed_count from gdb_entries where site = $1 and level = $2 ",
            $conditions
        )
    };
}
use entries;

fn describe(row: &AnyRow) -> Result<v1::GdbEntry, StoreError> {
    let id: String = get(row, ENTRIES, "entry")?;
    let kind: String = get(row, ENTRIES, "kind")?;
    Ok(v1::GdbEntry {
        revision: get(row, ENTRIES, "revision")?,
        kind: match kind.as_str() {
            "edit" => v1::GdbEntryKind::Edit,
            "publication" => v1::GdbEntryKind::Publication,
            _ => return Err(corrupt(ENTRIES, id, format!("{kind:?} is no kind of entry"))),
        },
        draft: get(row, ENTRIES, "draft")?,
        library: get(row, ENTRIES, "library")?,
        at: to_rfc3339(get(row, ENTRIES, "at_us")?),
        author: get(row, ENTRIES, "author")?,
        comment: get(row, ENTRIES, "comment")?,
        put: count(row, ENTRIES, "put_count")?,
        removed: count(row, ENTRIES, "removed_count")?,
        id: id.parse().map_err(|e| corrupt(ENTRIES, &*id, e))?,
    })
}

fn object_id(row: &AnyRow) -> Result<Uuid, StoreError> {
    let id: String = get(row, OBJECTS, "object")?;
    id.parse().map_err(|e| corrupt(OBJECTS, &*id, e))
}
