//! Why the GDB was not changed or cannot be shown, and the problem that it becomes.

use std::collections::BTreeMap;

use mapfold_schema::border::gdb::OBJECTS_MAX;
use mapfold_schema::border::{VIOLATIONS_MAX, Violation};
use mapfold_schema::problem::Problem;
use uuid::Uuid;

use super::{ApiError, of, of_store, sentence};
use crate::level::gdb::GdbError;
use crate::store::gdb::Stale;

/// Why the GDB was not changed, or cannot be shown.
#[derive(Debug)]
pub(in super::super) enum GdbRefusal {
    /// The request does not say which draft it is made on.
    NoPrecondition,
    /// The draft has moved on. Where in the body the objects stand that are named.
    Stale { stale: Stale, named: BTreeMap<Uuid, String> },
    /// The library has moved on.
    LibraryStale { now: i64 },
    /// A model with errors is not published.
    Faults { count: usize, first: Vec<Violation> },
    /// More objects than a level may have.
    TooMany { objects: i64 },
    /// The model cannot be read, or not be cut.
    Model(GdbError),
}

impl From<GdbRefusal> for ApiError {
    fn from(refusal: GdbRefusal) -> Self {
        Self::Gdb(Box::new(refusal))
    }
}

impl From<GdbError> for ApiError {
    fn from(error: GdbError) -> Self {
        match error {
            GdbError::Store(error) => Self::Store(error),
            other => GdbRefusal::Model(other).into(),
        }
    }
}

pub(super) fn problem(refusal: &GdbRefusal) -> Problem {
    match refusal {
        GdbRefusal::NoPrecondition => {
            let detail = "Send the `ETag` of what the edit is made on as `If-Match`; or `*`, whatever is there.";
            of(428, "precondition_required", detail)
        }
        GdbRefusal::Stale { stale, named } => moved_on(stale, named),
        GdbRefusal::LibraryStale { now } => {
            let detail = format!(
                "The library is at revision {now} by now: read it again, and make the change on that. \
                 Nothing of yours was taken."
            );
            of(412, "library_moved_on", detail)
        }
        GdbRefusal::Faults { count, first } => {
            let detail = format!(
                "The draft has {count} errors, and is published once they are mended. `errors` names the first, \
                 by their places in what `GET` of the draft answers; `findings` has them all."
            );
            Problem { errors: first.clone(), ..of(409, "gdb_has_errors", detail) }
        }
        GdbRefusal::TooMany { objects } => {
            let detail =
                format!("There would be {objects} objects; a level has at most {OBJECTS_MAX}.");
            of(422, "gdb_too_large", detail)
        }
        GdbRefusal::Model(error) => {
            let detail = sentence(&error.to_string());
            match error {
                GdbError::TooLarge { .. } => of(422, "gdb_too_large", detail),
                GdbError::TooCrowded(_) => of(409, "plan_too_crowded", detail),
                GdbError::NoPrior(_) => of(409, "prior_too_large", detail),
                GdbError::TooMuchSurface(_) => of(409, "plan_too_large", detail),
                GdbError::Store(error) => of_store(error),
            }
        }
    }
}

/// Who changed what since the author looked.
fn moved_on(stale: &Stale, named: &BTreeMap<Uuid, String>) -> Problem {
    let Stale { seen, now, entries, changes } = stale;
    let mut errors = Vec::new();
    if seen.library != now.library {
        let detail =
            format!("the library was at revision {}, and is at {}", seen.library, now.library);
        let code = "library_changed".to_owned();
        errors.push(Violation { pointer: String::new(), code, detail });
    }
    for change in changes {
        let (code, word) = if change.is_removed {
            ("object_removed", "removed")
        } else {
            ("object_changed", "changed")
        };
        errors.push(Violation {
            pointer: named.get(&change.object).cloned().unwrap_or_default(),
            code: code.to_owned(),
            detail: format!(
                "object {} was {word} at revision {} by {:?}, {}",
                change.object, change.revision, change.author, change.at
            ),
        });
    }
    // What the author is about to change comes first.
    errors.sort_by_key(|violation| violation.pointer.is_empty());
    errors.truncate(VIOLATIONS_MAX);
    let last = entries.first().map_or_else(String::new, |last| {
        format!(", last by {:?} at {}: {:?}", last.author, last.at, last.comment)
    });
    let detail = format!(
        "The model has moved on from draft {} to {}{last}. Nothing of yours was taken: read it again, look at what \
         `errors` names, and make your edit on that.",
        seen.draft, now.draft
    );
    Problem { errors, ..of(412, "gdb_moved_on", detail) }
}
