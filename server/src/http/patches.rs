//! `L/patches`: all that changed, in pages, for robots.

use axum::response::Response;
use mapfold_schema::v1::Patch;
use mapfold_schema::{codec, route};
use serde::Deserialize;

use super::access::{LevelFor, Read};
use super::answer::{DATA, Reader};
use super::problem::ApiError;
use super::query::{QueryOf, page_limit};

/// Things of a page, if the request names no number; and at most.
const PAGE: usize = 2000;
const PAGE_MAX: usize = 20_000;

/// From where on, and how much at once.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PatchQuery {
    /// Only what changed after this revision; 0 gives all.
    #[serde(default)]
    since: i64,
    /// About how many things (segments, clusters, chains, tiles, removals) at once, at most 20000; 2000 if
    /// absent. A revision is never cut in two.
    limit: Option<usize>,
}

/// All that changed after `since`, in pages.
///
/// Ask again with the answer's `revision` as `since` until there is no `more`: applying page after
/// page gives the same map as a full fetch, also if the map goes on meanwhile.
#[utoipa::path(
    get, path = route::PATCHES, operation_id = "read_patch", tag = "map",
    params(("site" = String, Path), ("level" = String, Path), PatchQuery),
    responses(
        (status = 200, description = "What has changed since. In CBOR UUIDs are byte strings of 16 bytes", content((Patch = "application/json"), (Patch = "application/cbor"))),
        (status = 410, description = "`cursor_expired`: `since` is ahead of the log; read from 0"),
    )
)]
pub(super) async fn read(
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<PatchQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let limit = page_limit(query.limit, PAGE, PAGE_MAX)?;
    let media_type = reader.choose(DATA)?;
    let snapshot = level.snapshot_since(query.since).await?;
    let revision = snapshot.folded_revision();
    let write =
        move || Ok(codec::encode(media_type, &snapshot.patches_since(query.since, limit)?)?);
    reader.data(revision, media_type, write).await
}
