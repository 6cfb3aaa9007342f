//! What is wrong with a body, collected place by place.

use std::fmt;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How many violations are reported of one body; a body with more is not worth more words.
pub const VIOLATIONS_MAX: usize = 32;

/// One thing that is wrong with a body.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct Violation {
    /// JSON pointer (RFC 6901) of the place.
    pub pointer: String,
    /// Stable name of the fault, `snake_case`.
    pub code: String,
    /// What is wrong and what would be right, for a person.
    pub detail: String,
}

/// A place in a body: a chain up to the root, written out only when something is wrong there.
#[derive(Debug, Clone, Copy)]
pub(super) enum Place<'a> {
    /// The whole body.
    Root,
    /// A member of an object.
    Field(&'a Place<'a>, &'static str),
    /// An element of an array.
    Index(&'a Place<'a>, usize),
}

impl<'a> Place<'a> {
    pub(super) fn field(&'a self, name: &'static str) -> Place<'a> {
        Place::Field(self, name)
    }

    pub(super) fn index(&'a self, index: usize) -> Place<'a> {
        Place::Index(self, index)
    }
}

/// As a JSON pointer. The names of our fields hold neither `~` nor `/`.
impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Root => Ok(()),
            Self::Field(up, name) => write!(f, "{up}/{name}"),
            Self::Index(up, index) => write!(f, "{up}/{index}"),
        }
    }
}

/// The violations found so far, at most [`VIOLATIONS_MAX`].
#[derive(Debug, Default)]
pub(super) struct Violations {
    found: Vec<Violation>,
}

impl Violations {
    /// Notes that `place` is wrong.
    pub(super) fn add(&mut self, place: &Place<'_>, code: &str, detail: impl fmt::Display) {
        if !self.is_full() {
            self.found.push(Violation {
                pointer: place.to_string(),
                code: code.to_owned(),
                detail: detail.to_string(),
            });
        }
    }

    /// Whether looking on would report nothing more.
    pub(super) fn is_full(&self) -> bool {
        self.found.len() >= VIOLATIONS_MAX
    }

    /// All that was found.
    pub(super) fn all(self) -> Vec<Violation> {
        self.found
    }

    /// `value`, if nothing was wrong.
    pub(super) fn none_or<T>(self, value: Option<T>) -> Result<T, Vec<Violation>> {
        match value {
            Some(value) if self.found.is_empty() => Ok(value),
            _ => Err(self.found),
        }
    }
}
