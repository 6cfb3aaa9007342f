//! The part of a URL behind the question mark, and typed parts of its path.

use std::fmt::Display;

use axum::extract::rejection::QueryRejection;
use axum::extract::{FromRequestParts, Query};
use axum::http::request::Parts;
use mapfold_schema::v1::Bounds;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Deserializer};

use super::problem::ApiError;

/// A query of known fields; anything else is refused by name.
pub(super) struct QueryOf<T>(pub(super) T);

impl<S: Send + Sync, T: DeserializeOwned + Send> FromRequestParts<S> for QueryOf<T> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, state: &S) -> Result<Self, ApiError> {
        match Query::from_request_parts(parts, state).await {
            Ok(Query(query)) => Ok(Self(query)),
            Err(QueryRejection::FailedToDeserializeQueryString(error)) => {
                Err(ApiError::Query(format!("The query does not fit: {}.", error.body_text())))
            }
            Err(_) => Err(ApiError::Query("The query cannot be read.".to_owned())),
        }
    }
}

/// `since` and `bbox`, as all reads of the map take them.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct SinceInBox {
    /// Only what changed after this revision; 0 gives all.
    #[serde(default)]
    pub(super) since: i64,
    /// Only what touches this rectangle: `min_x,min_y,max_x,max_y` in metres.
    #[serde(default, deserialize_with = "bbox")]
    #[param(value_type = Option<String>)]
    pub(super) bbox: Option<Bounds>,
}

/// The `cursor` of a page of the log: the revision before which it begins.
pub(super) fn before(cursor: Option<&str>) -> Result<Option<i64>, ApiError> {
    let unknown = |_| ApiError::Query("`cursor` is not one that this server gave.".to_owned());
    cursor.map(str::parse::<i64>).transpose().map_err(unknown)
}

/// How much a page holds: `limit` if the request names one, and at most so much.
pub(super) fn page_limit<N: Copy + PartialOrd + Display + From<u8>>(
    limit: Option<N>,
    usual: N,
    most: N,
) -> Result<N, ApiError> {
    let limit = limit.unwrap_or(usual);
    if limit < N::from(1) || limit > most {
        return Err(ApiError::Query(format!("`limit` is 1 to {most}.")));
    }
    Ok(limit)
}

/// `min_x,min_y,max_x,max_y` in metres.
pub(super) fn bbox<'de, D: Deserializer<'de>>(from: D) -> Result<Option<Bounds>, D::Error> {
    let text = String::deserialize(from)?;
    Bounds::parse(&text).map(Some).ok_or_else(|| {
        serde::de::Error::custom(
            "bbox is four numbers, min_x,min_y,max_x,max_y in metres, the minima not above the maxima",
        )
    })
}
