//! `/openapi.json`, and `/docs`: a page about it that loads nothing from elsewhere.

use std::sync::Arc;

use axum::extract::Path;
use axum::http::HeaderValue;
use axum::http::header::{CACHE_CONTROL, VARY};
use axum::response::{IntoResponse, Redirect, Response};
use mapfold_schema::codec::JSON;
use utoipa_swagger_ui::Config;

use super::answer::{Reader, Tag};
use super::layers::POLICY_HEADER;
use super::openapi;
use super::problem::ApiError;
use crate::page::media_type;

/// Where the description is.
pub(super) const DESCRIPTION: &str = "/openapi.json";
/// Like every page's policy, but for the styles that Swagger UI writes into its page.
const POLICY: &str = "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; \
    img-src 'self' data:; font-src 'self'; connect-src 'self'; base-uri 'none'; \
    form-action 'self'; frame-ancestors 'none'";

pub(super) async fn description(reader: Reader) -> Result<Response, ApiError> {
    let text = openapi::text()?;
    let tag = Tag::of_bytes(text.as_bytes());
    Ok(public(reader.bytes(JSON, &tag, || text)))
}

pub(super) async fn redirect() -> Response {
    Redirect::permanent("/docs/").into_response()
}

pub(super) async fn index(reader: Reader) -> Result<Response, ApiError> {
    file(&reader, "index.html")
}

pub(super) async fn asset(Path(path): Path<String>, reader: Reader) -> Result<Response, ApiError> {
    file(&reader, &path)
}

fn file(reader: &Reader, path: &str) -> Result<Response, ApiError> {
    let config = Arc::new(Config::from(DESCRIPTION));
    let served = utoipa_swagger_ui::serve(path, config);
    let failed = |error: Box<dyn std::error::Error>| ApiError::Internal(error.to_string());
    let bytes = served.map_err(failed)?.ok_or(ApiError::NoRoute)?.bytes.into_owned();
    let tag = Tag::of_bytes(&bytes);
    let mut response = public(reader.bytes(media_type(path), &tag, || bytes));
    response.headers_mut().insert(POLICY_HEADER, HeaderValue::from_static(POLICY));
    Ok(response)
}

fn public(mut response: Response) -> Response {
    response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static("no-cache"));
    // The same for everybody.
    response.headers_mut().remove(VARY);
    response
}
