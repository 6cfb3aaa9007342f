//! `L/vector`: segments, clusters and chains.

use axum::response::Response;
use mapfold_schema::codec;
use mapfold_schema::geojson;
use mapfold_schema::route;
use mapfold_schema::v1::VectorPatch;

use super::access::{LevelFor, Read};
use super::answer::{DATA_OR_GEOJSON, Reader};
use super::problem::ApiError;
use super::query::{QueryOf, SinceInBox};

/// Segments, clusters and chains that changed after `since`, and the ids of those that are no more.
///
/// `since=0` gives all. With a `bbox`: what touches it; what changed and lies outside of it is then
/// among the removed, because it may have lain inside. As GeoJSON, the coordinates are metres of
/// the level's frame.
#[utoipa::path(
    get, path = route::VECTOR, operation_id = "read_vector", tag = "map",
    params(("site" = String, Path), ("level" = String, Path), SinceInBox),
    responses(
        (status = 200, description = "The features that have changed since. In CBOR UUIDs are byte strings of 16 bytes and numbers floats", content(
            (VectorPatch = "application/json"),
            (VectorPatch = "application/cbor"),
            (Object = "application/geo+json"),
        )),
        (status = 410, description = "`cursor_expired`: `since` is ahead of the log; read from 0"),
    )
)]
pub(super) async fn read(
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<SinceInBox>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let media_type = reader.choose(DATA_OR_GEOJSON)?;
    let snapshot = level.snapshot_since(query.since).await?;
    let revision = snapshot.folded_revision();
    let write = move || {
        let patch = snapshot.vector_since(query.since, query.bbox.as_ref())?;
        if media_type != geojson::MEDIA_TYPE {
            return Ok(codec::encode(media_type, &patch)?);
        }
        let mut bytes = Vec::new();
        let failed = |error: std::io::Error| ApiError::Internal(error.to_string());
        geojson::write_patch(&patch, &mut bytes).map_err(failed)?;
        Ok(bytes)
    };
    reader.data(revision, media_type, write).await
}
