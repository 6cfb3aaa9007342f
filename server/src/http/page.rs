//! `/` and the files of the operators' page.

use axum::http::header::{CACHE_CONTROL, VARY};
use axum::http::{HeaderValue, Method, Uri};
use axum::response::Response;

use super::answer::{Reader, Tag};
use super::problem::ApiError;
use crate::page::{self, Asset};

const FOR_EVER: &str = "public, max-age=31536000, immutable";
const REVALIDATE: &str = "no-cache";

pub(super) async fn index(reader: Reader) -> Response {
    answer(&reader, page::index())
}

/// Where no route is: only files that the page has; any other path is nothing.
pub(super) async fn asset(method: Method, uri: Uri, reader: Reader) -> Result<Response, ApiError> {
    if method != Method::GET && method != Method::HEAD {
        return Err(ApiError::NoRoute);
    }
    let asset = page::asset(uri.path().trim_start_matches('/'));
    asset.map(|asset| answer(&reader, asset)).ok_or(ApiError::NoRoute)
}

fn answer(reader: &Reader, asset: Asset) -> Response {
    let tag = Tag::of_digest(&asset.digest);
    let kept = if asset.is_immutable { FOR_EVER } else { REVALIDATE };
    let mut response = reader.bytes(asset.media_type, &tag, || asset.bytes);
    response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static(kept));
    // The same for everybody.
    response.headers_mut().remove(VARY);
    response
}
