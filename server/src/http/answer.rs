//! Answers to reads: in a form that the client accepts, with a strong validator, and only when the
//! client does not have it already.

use axum::body::Body;
use axum::extract::FromRequestParts;
use axum::http::header::{
    ACCEPT, CACHE_CONTROL, CONTENT_TYPE, ETAG, IF_NONE_MATCH, LOCATION, VARY,
};
use axum::http::request::Parts;
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use mapfold_schema::codec;
use mapfold_schema::geojson;
use serde::Serialize;
use sha2::{Digest, Sha256};
use uuid::Uuid;

use super::problem::ApiError;

/// Names the revision of the map that an answer shows.
pub(super) const REVISION_HEADER: &str = "mapfold-revision";

/// The forms in which one thing can be had, the preferred one first.
pub(super) type Offer = [&'static str];

/// What most things can be had as.
pub(super) const DATA: &Offer = &[codec::JSON, codec::CBOR];
/// What the vector map can be had as.
pub(super) const DATA_OR_GEOJSON: &Offer = &[codec::JSON, codec::CBOR, geojson::MEDIA_TYPE];

/// What collections of features can be had as.
pub(super) const FEATURES: &Offer = &[geojson::MEDIA_TYPE, codec::JSON];

/// A strong validator: a quoted digest or name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Tag(String);

impl Tag {
    /// By the bytes of the answer.
    pub(super) fn of_bytes(bytes: &[u8]) -> Self {
        Self::of_digest(&Sha256::digest(bytes))
    }

    /// By a digest of the bytes of the answer.
    pub(super) fn of_digest(digest: &[u8]) -> Self {
        use std::fmt::Write as _;
        let mut text = String::from("\"");
        for byte in digest.iter().take(16) {
            let _ = write!(text, "{byte:02x}"); // writing to a String cannot fail
        }
        text.push('"');
        Self(text)
    }

    /// By a name that stands for the bytes: digits, letters and points.
    pub(super) fn named(name: &str) -> Self {
        Self(format!("\"{name}\""))
    }

    /// As the value of a header.
    pub(super) fn header(&self) -> Option<HeaderValue> {
        HeaderValue::from_str(&self.0).ok()
    }

    /// By all that the bytes depend on: for files that would be dear to write only to compare.
    fn of_revisions(frame: Uuid, revisions: &[i64], target: &str, media_type: &str) -> Self {
        let mut digest = Sha256::new().chain_update(env!("CARGO_PKG_VERSION")).chain_update(frame);
        for revision in revisions {
            digest.update(revision.to_le_bytes());
        }
        let digest =
            digest.chain_update(media_type).chain_update([0]).chain_update(target).finalize();
        Self::of_digest(&digest)
    }
}

/// What a client that reads says of itself.
pub(super) struct Reader {
    accept: Option<String>,
    none_match: Option<String>,
    target: String,
}

impl<S: Send + Sync> FromRequestParts<S> for Reader {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, ApiError> {
        let joined = |name| {
            let values = parts.headers.get_all(&name).iter();
            let texts: Vec<&str> = values.filter_map(|value| value.to_str().ok()).collect();
            (!texts.is_empty()).then(|| texts.join(","))
        };
        Ok(Self {
            accept: joined(ACCEPT),
            none_match: joined(IF_NONE_MATCH),
            target: parts.uri.path_and_query().map_or_else(String::new, ToString::to_string),
        })
    }
}

impl Reader {
    /// The form of `offer` that the client likes best.
    pub(super) fn choose(&self, offer: &Offer) -> Result<&'static str, ApiError> {
        let first = offer.first().copied().unwrap_or(codec::JSON);
        let Some(accept) = &self.accept else { return Ok(first) };
        let mut best = (0.0, None);
        for media_type in offer.iter().copied() {
            let liking = liking(accept, media_type);
            if liking > best.0 {
                best = (liking, Some(media_type));
            }
        }
        let offered = match offer.len() {
            1 => first,
            2 if offer == FEATURES => "application/geo+json or application/json",
            2 => "application/json or application/cbor",
            3 if first == "application/fg+json" => {
                "application/fg+json, application/geo+json or application/json"
            }
            _ => "application/json, application/cbor or application/geo+json",
        };
        best.1.ok_or(ApiError::NotAcceptable(offered))
    }

    /// Answers with a small thing, known by its bytes.
    pub(super) fn small<T: Serialize>(&self, value: &T) -> Result<Response, ApiError> {
        let media_type = self.choose(DATA)?;
        let bytes = codec::encode(media_type, value)?;
        let tag = Tag::of_bytes(&bytes);
        Ok(self.bytes(media_type, &tag, || bytes))
    }

    /// Answers with bytes known by `tag`, written only if the client does not have them.
    pub(super) fn bytes<B: Into<Body>>(
        &self,
        media_type: &'static str,
        tag: &Tag,
        write: impl FnOnce() -> B,
    ) -> Response {
        if self.has(tag) {
            let mut response = StatusCode::NOT_MODIFIED.into_response();
            validators(response.headers_mut(), tag);
            return response;
        }
        let mut response = Response::new(write().into());
        response.headers_mut().insert(CONTENT_TYPE, HeaderValue::from_static(media_type));
        validators(response.headers_mut(), tag);
        response
    }

    /// Answers with what is known of the map at one revision, written off the threads that serve
    /// other requests.
    ///
    /// Known by its bytes, not by the revision: replicas, and a level that was read back, may date
    /// a change of the same map differently (never too early), and then say more after a `since`.
    pub(super) async fn data(
        &self,
        revision: i64,
        media_type: &'static str,
        write: impl FnOnce() -> Result<Vec<u8>, ApiError> + Send + 'static,
    ) -> Result<Response, ApiError> {
        let tagged = || write().map(|bytes| (Tag::of_bytes(&bytes), bytes));
        let (tag, bytes) = blocking(tagged).await?;
        Ok(at_revision(self.bytes(media_type, &tag, || bytes), revision))
    }

    /// Answers with a file that some `revisions` determine byte for byte, written only if the client does not have it.
    pub(super) async fn file_of(
        &self,
        frame: Uuid,
        revisions: &[i64],
        revision: i64,
        media_type: &'static str,
        write: impl FnOnce() -> Result<Vec<u8>, ApiError> + Send + 'static,
    ) -> Result<Response, ApiError> {
        let tag = Tag::of_revisions(frame, revisions, &self.target, media_type);
        let bytes = if self.has(&tag) { Vec::new() } else { blocking(write).await? };
        Ok(at_revision(self.bytes(media_type, &tag, || bytes), revision))
    }

    /// RFC 9110, section 13.1.2.
    fn has(&self, tag: &Tag) -> bool {
        self.none_match.as_deref().is_some_and(|tags| {
            tags.split(',')
                .map(str::trim)
                .any(|t| t == "*" || t.strip_prefix("W/").unwrap_or(t) == tag.0)
        })
    }
}

fn at_revision(mut response: Response, revision: i64) -> Response {
    response.headers_mut().insert(REVISION_HEADER, HeaderValue::from(revision));
    response
}

/// Runs what takes a processor for longer than a few microseconds.
pub(super) async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, ApiError> + Send + 'static,
) -> Result<T, ApiError> {
    match tokio::task::spawn_blocking(work).await {
        Ok(result) => result,
        Err(error) => Err(ApiError::Internal(error.to_string())),
    }
}

/// The answer to something made: where it is, and what it is, in the form that the client likes.
pub(super) fn created<T: Serialize>(
    reader: &Reader,
    location: Option<&str>,
    value: &T,
) -> Result<Response, ApiError> {
    let mut response = happened(reader, StatusCode::CREATED, value)?;
    response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    if let Some(location) = location.and_then(|l| HeaderValue::from_str(l).ok()) {
        response.headers_mut().insert(LOCATION, location);
    }
    Ok(response)
}

/// The answer to a change, with the tag of what it made.
pub(super) fn tagged<T: Serialize>(
    reader: &Reader,
    status: StatusCode,
    value: &T,
    tag: &Tag,
) -> Result<Response, ApiError> {
    let mut response = happened(reader, status, value)?;
    if let Some(tag) = tag.header() {
        response.headers_mut().insert(ETAG, tag);
    }
    Ok(response)
}

/// What has happened, in the form that the client likes.
fn happened<T: Serialize>(
    reader: &Reader,
    status: StatusCode,
    value: &T,
) -> Result<Response, ApiError> {
    // It cannot be taken back: an answer in a form the client did not ask for beats a refusal.
    let media_type = reader.choose(DATA).unwrap_or(codec::JSON);
    let content_type = [(CONTENT_TYPE, HeaderValue::from_static(media_type))];
    Ok((status, content_type, codec::encode(media_type, value)?).into_response())
}

fn validators(headers: &mut HeaderMap, tag: &Tag) {
    if let Some(tag) = tag.header() {
        headers.insert(ETAG, tag);
    }
    headers.insert(CACHE_CONTROL, HeaderValue::from_static("private, no-cache"));
    headers.insert(VARY, HeaderValue::from_static("accept, authorization, cookie"));
}

/// The weight that `accept` gives to `media_type`, by its most specific range (RFC 9110, section
/// 12.5.1); 0 if it is not accepted.
fn liking(accept: &str, media_type: &str) -> f64 {
    let mut best = (0, 0.0);
    for range in accept.split(',') {
        let mut parts = range.split(';').map(str::trim);
        let essence = parts.next().unwrap_or_default();
        let family = media_type.split_once('/').map_or("", |(family, _)| family);
        let specificity = if essence.eq_ignore_ascii_case(media_type) {
            3
        } else if essence.strip_suffix("/*").is_some_and(|f| f.eq_ignore_ascii_case(family)) {
            2
        } else if essence == "*/*" {
            1
        } else {
            continue;
        };
        let weight =
            parts.find_map(|part| part.strip_prefix("q=")).map_or(Some(1.0), |q| q.parse().ok());
        if specificity > best.0 {
            best = (specificity, weight.unwrap_or(0.0));
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;

    fn reader(accept: Option<&str>, none_match: Option<&str>) -> Reader {
        Reader {
            accept: accept.map(ToOwned::to_owned),
            none_match: none_match.map(ToOwned::to_owned),
            target: "/x".to_owned(),
        }
    }

    #[test]
    fn the_form_that_the_client_likes_best_is_chosen() {
        for (accept, chosen) in [
            (None, Some("application/json")),
            (Some("*/*"), Some("application/json")),
            (Some("application/cbor"), Some("application/cbor")),
            (Some("application/cbor;q=0.5, application/json;q=0.4"), Some("application/cbor")),
            (Some("application/*;q=0.2, application/json;q=0"), Some("application/cbor")),
            (
                Some("text/html, application/geo+json;q=0.9, */*;q=0.1"),
                Some("application/geo+json"),
            ),
            (Some("text/html"), None),
            (Some("application/json;q=0"), None),
        ] {
            let choice = reader(accept, None).choose(DATA_OR_GEOJSON).ok();
            assert_eq!(choice, chosen, "{accept:?}");
        }
    }

    #[test]
    fn a_client_has_what_any_of_its_tags_names() {
        let tag = Tag::of_bytes(b"x");
        let own = tag.0.clone();
        for list in [own.clone(), format!("\"a\", {own}"), format!("W/{own}"), "*".to_owned()] {
            assert!(reader(None, Some(&list)).has(&tag), "{list}");
        }
        assert!(!reader(None, Some("\"a\"")).has(&tag));
        assert!(!reader(None, None).has(&tag));
    }

    #[test]
    fn a_tag_changes_with_all_that_the_bytes_depend_on() {
        let (a, b) = (Uuid::from_u128(1), Uuid::from_u128(2));
        let tag = Tag::of_revisions(a, &[1], "/x?since=0", "application/json");
        for other in [
            Tag::of_revisions(b, &[1], "/x?since=0", "application/json"),
            Tag::of_revisions(a, &[2], "/x?since=0", "application/json"),
            Tag::of_revisions(a, &[1], "/x?since=1", "application/json"),
            Tag::of_revisions(a, &[1], "/x?since=0", "application/cbor"),
        ] {
            assert_ne!(tag, other);
        }
    }

    #[test]
    fn what_the_client_has_is_not_written() {
        let tag = Tag::of_bytes(b"x");
        let response = reader(None, Some(&tag.0))
            .bytes("image/png", &tag, || -> Vec<u8> { unreachable!("the client has it") });
        assert_eq!(response.status(), StatusCode::NOT_MODIFIED);
        assert_eq!(response.headers()[ETAG].to_str().unwrap(), tag.0);
    }
}
