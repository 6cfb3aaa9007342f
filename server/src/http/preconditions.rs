//! `If-Match`: on which version of a thing a change is made, so that nobody overwrites what he has not seen.
//!
//! The tags of the GDB and of libraries are their versions: `"17.3"` is draft 17 with library 3. What may follow them
//! (a coding, another form) does not matter here: the thing is the same.

use axum::extract::FromRequestParts;
use axum::http::HeaderMap;
use axum::http::header::IF_MATCH;
use axum::http::request::Parts;

use super::answer::Tag;
use super::problem::ApiError;
use super::problem::gdb::GdbRefusal;
use crate::store::gdb::{Expected, GdbVersion};

/// What the client expects to be there.
pub(super) struct IfMatch(Option<String>);

impl<S: Send + Sync> FromRequestParts<S> for IfMatch {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, ApiError> {
        Ok(Self::of(&parts.headers))
    }
}

impl IfMatch {
    pub(super) fn of(headers: &HeaderMap) -> Self {
        let values = headers.get_all(IF_MATCH).iter();
        let texts: Vec<&str> = values.filter_map(|value| value.to_str().ok()).collect();
        Self((!texts.is_empty()).then(|| texts.join(",")))
    }

    /// The versions of the GDB that may be there; any if the client does not say.
    pub(super) fn versions_if_any(&self) -> Result<Expected, ApiError> {
        if self.0.is_none() { Ok(Expected::Any) } else { self.versions() }
    }

    /// The versions of the GDB that may be there.
    pub(super) fn versions(&self) -> Result<Expected, ApiError> {
        let version = |(draft, library)| GdbVersion { draft, library };
        let pairs = self.pairs()?;
        Ok(pairs.map_or(Expected::Any, |pairs| {
            Expected::OneOf(pairs.into_iter().map(version).collect())
        }))
    }

    /// The revisions of the library that may be there; `None` for any.
    pub(super) fn revisions(&self) -> Result<Option<Vec<i64>>, ApiError> {
        Ok(self.pairs()?.map(|pairs| pairs.into_iter().map(|(revision, _)| revision).collect()))
    }

    /// What the tags name; one that is none of ours names nothing. `None` for `*`.
    fn pairs(&self) -> Result<Option<Vec<(i64, i64)>>, ApiError> {
        let tags = self.0.as_deref().ok_or(GdbRefusal::NoPrecondition)?;
        if tags.trim() == "*" {
            return Ok(None);
        }
        Ok(Some(tags.split(',').filter_map(pair).collect()))
    }
}

fn pair(tag: &str) -> Option<(i64, i64)> {
    let tag = tag.trim();
    let name = tag.strip_prefix("W/").unwrap_or(tag).trim_matches('"');
    let numbers = name.split(|c: char| !c.is_ascii_digit() && c != '.').next()?;
    let (draft, library) = numbers.split_once('.')?;
    Some((draft.parse().ok()?, library.parse().ok()?))
}

/// The tag of a version of the GDB; `form` tells forms of it apart.
pub(super) fn version_tag(version: GdbVersion, form: &str) -> Tag {
    Tag::named(&format!("{}.{}{form}", version.draft, version.library))
}

/// The tag of a revision of a library.
pub(super) fn library_tag(revision: i64, form: &str) -> Tag {
    Tag::named(&format!("{revision}.0{form}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn versions(text: &str) -> Option<Vec<(i64, i64)>> {
        IfMatch(Some(text.to_owned())).pairs().ok().flatten()
    }

    #[test]
    fn tags_are_versions_whatever_form_they_were_had_in() {
        assert_eq!(versions("\"17.3\""), Some(vec![(17, 3)]));
        assert_eq!(versions("\"17.3j-zstd\", W/\"4.0\""), Some(vec![(17, 3), (4, 0)]));
        assert_eq!(versions("*"), None);
        for foreign in ["\"\"", "\"abc\"", "17", "\"1.\"", "\"99999999999999999999.1\""] {
            assert_eq!(versions(foreign), Some(vec![]), "{foreign}");
        }
        assert!(IfMatch(None).versions().is_err());
    }
}
