//! Request bodies: their type, their size, and what is in them.

use std::error::Error;

use axum::body::Bytes;
use axum::extract::{FromRequest, Request};
use axum::http::header::CONTENT_TYPE;
use axum::http::{HeaderMap, StatusCode};
use mapfold_schema::codec::{self, DecodeError};
use serde::de::DeserializeOwned;
use tower_http::timeout::TimeoutError;

use super::cap::TooLong;
use super::problem::ApiError;
use super::state::App;

/// A body of JSON or CBOR, read as a `T`.
pub(super) struct Payload<T>(pub(super) T);

impl<T: DeserializeOwned> FromRequest<App> for Payload<T> {
    type Rejection = ApiError;

    async fn from_request(request: Request, app: &App) -> Result<Self, ApiError> {
        let media_type = media_type(request.headers())?;
        let bytes = read(request, app.parts.limits.body_bytes).await?;
        codec::decode(&media_type, &bytes).map(Self).map_err(ApiError::Body)
    }
}

/// The type of the body.
pub(super) fn media_type(headers: &HeaderMap) -> Result<String, ApiError> {
    let declared = headers.get(CONTENT_TYPE).and_then(|value| value.to_str().ok());
    let unknown = || ApiError::Body(DecodeError::MediaType("(none)".to_owned()));
    declared.map(ToOwned::to_owned).ok_or_else(unknown)
}

/// All of the body, unpacked. That it is no longer than `limit_bytes` is seen to by the
/// `DefaultBodyLimit` of the route, which stops reading there.
pub(super) async fn read(request: Request, limit_bytes: usize) -> Result<Bytes, ApiError> {
    Bytes::from_request(request, &()).await.map_err(|rejection| {
        if rejection.status() == StatusCode::PAYLOAD_TOO_LARGE {
            return ApiError::BodyTooLarge { limit_bytes };
        }
        let mut cause: Option<&(dyn Error + 'static)> = Some(&rejection);
        while let Some(error) = cause {
            if let Some(TooLong { limit_bytes }) = error.downcast_ref() {
                return ApiError::BodyTooLong { limit_bytes: *limit_bytes };
            }
            if error.is::<TimeoutError>() {
                return ApiError::BodyTimeout;
            }
            cause = error.source();
        }
        ApiError::BodyBroken
    })
}
