//! `L/reverts`: taking contributions out of the map, and putting them back.

use axum::extract::{Path, State};
use axum::response::Response;
use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::route;
use mapfold_schema::v1::{NewRevert, Revert, RevertPage, RevertPreview, RevertRecord};
use serde::Deserialize;
use sha2::{Digest, Sha256};
use uuid::Uuid;

use super::access::{Edit, LevelFor, Read};
use super::answer::{Reader, created};
use super::body::Payload;
use super::check;
use super::problem::ApiError;
use super::query::{QueryOf, before, page_limit};
use super::state::App;
use crate::auth;
use crate::store::acts::{NewAct, Targets};

/// Reverts of a page, if the request names no number; and at most.
const PAGE: u32 = 50;
const PAGE_MAX: u32 = 500;

/// Whether only to tell.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PreviewQuery {
    /// `true`: tell what would change, and change nothing.
    #[serde(default)]
    preview: bool,
}

/// Which reverts are asked for.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PageQuery {
    /// `next` of the page before.
    cursor: Option<String>,
    /// Reverts of a page, at most 500; 50 if absent.
    limit: Option<u32>,
}

/// Takes contributions out of the map: it is then bit for bit what it would have been without
/// them. Needs `map:edit`.
///
/// Either `contributions` are named, or a `robot` and, from `from` to before `to`, a span of the
/// time at which it saw them; 20000 at most. The answer comes when the revert is in the log, as one
/// revision; the map follows like after an upload. The same revert sent again under the same id is
/// answered in the same way. Contributions that come later are not affected. With `preview=true`
/// nothing is changed: the answer, of status 200, tells what would be.
#[utoipa::path(
    post, path = route::REVERTS, operation_id = "revert", tag = "contributions",
    params(("site" = String, Path), ("level" = String, Path), PreviewQuery),
    request_body = NewRevert,
    responses(
        (status = 200, body = RevertPreview, description = "What would change, for a preview"),
        (status = 201, body = Revert, description = "They are out"),
        (status = 409, description = "`nothing_to_revert`: none of them is in the map; `revert_conflict`: the id is taken; `revert_undone`: this revert was undone since; `map_moved_on`: a preview was overtaken, ask again"),
        (status = 413, description = "`too_many_contributions`: name fewer, or a shorter span"),
        (status = 422, description = "`contributions_unknown`, `contributions_held`, `body_invalid`, each with `errors`"),
    )
)]
pub(super) async fn create(
    State(app): State<App>,
    level: LevelFor<Edit>,
    QueryOf(query): QueryOf<PreviewQuery>,
    reader: Reader,
    Payload(new): Payload<NewRevert>,
) -> Result<Response, ApiError> {
    let targets = check::new_revert(&new, query.preview)?;
    if query.preview {
        return reader.small(&level.level.preview(&targets).await?);
    }
    let reason = new.reason.trim().to_owned();
    let act = NewAct {
        id: new.id.unwrap_or_else(|| app.parts.chance.uuid()),
        digest: digest(&targets, &reason),
        author: auth::granted_by(&level.caller).to_owned(),
        reason,
        at_us: app.now_us(),
    };
    let revert = level.level.revert(&act, &targets).await?;
    let all = route::of_level(route::REVERTS, level.level.site(), level.level.level());
    created(&reader, Some(&format!("{all}/{}", revert.id)), &revert)
}

/// The reverts of a level, newest first, in pages.
#[utoipa::path(
    get, path = route::REVERTS, operation_id = "list_reverts", tag = "contributions",
    params(("site" = String, Path), ("level" = String, Path), PageQuery),
    responses((status = 200, body = RevertPage, description = "A page of reverts"))
)]
pub(super) async fn list(
    State(app): State<App>,
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<PageQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let before = before(query.cursor.as_deref())?;
    let limit = page_limit(query.limit, PAGE, PAGE_MAX)?;
    let (site, name) = (level.level.site(), level.level.level());
    reader.small(&app.store().revert_page(site, name, before, limit).await?)
}

/// One revert, with the contributions that it covers.
#[utoipa::path(
    get, path = route::REVERT, operation_id = "read_revert", tag = "contributions",
    params(("site" = String, Path), ("level" = String, Path), ("id" = Uuid, Path)),
    responses((status = 200, body = RevertRecord, description = "The revert"))
)]
pub(super) async fn describe(
    State(app): State<App>,
    level: LevelFor<Read>,
    Path((_, _, id)): Path<(String, String, String)>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let missing = || ApiError::not_found("revert", &id);
    let uuid = Uuid::try_parse(&id).ok().ok_or_else(missing)?;
    let (site, name) = (level.level.site(), level.level.level());
    let record = app.store().revert_record(site, name, uuid).await?;
    reader.small(&record.ok_or_else(missing)?)
}

/// Undoes a revert: puts back what it took out, but for what another revert that stands covers
/// too. Needs `map:edit`.
///
/// An entry of the log of its own, with a revision of its own. One that is undone already stays as
/// it is, with the same answer. With `preview=true` nothing is changed: the answer is a
/// `RevertPreview` of what would be.
#[utoipa::path(
    delete, path = route::REVERT, operation_id = "undo_revert", tag = "contributions",
    params(("site" = String, Path), ("level" = String, Path), ("id" = Uuid, Path), PreviewQuery),
    responses(
        (status = 200, body = Revert, description = "The revert, undone"),
        (status = 409, description = "`map_moved_on`: a preview was overtaken, ask again"),
    )
)]
pub(super) async fn undo(
    State(app): State<App>,
    level: LevelFor<Edit>,
    Path((_, _, id)): Path<(String, String, String)>,
    QueryOf(query): QueryOf<PreviewQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let missing = || ApiError::not_found("revert", &id);
    let uuid = Uuid::try_parse(&id).ok().ok_or_else(missing)?;
    if query.preview {
        return reader.small(&level.level.preview_undo(uuid).await?.ok_or_else(missing)?);
    }
    let act = NewAct {
        id: app.parts.chance.uuid(),
        digest: hex(&Sha256::digest(uuid)),
        author: auth::granted_by(&level.caller).to_owned(),
        reason: String::new(),
        at_us: app.now_us(),
    };
    reader.small(&level.level.undo(uuid, &act).await?.ok_or_else(missing)?)
}

/// By what the same revert is known: whose order or spelling does not matter.
fn digest(targets: &Targets, reason: &str) -> String {
    let mut digest = Sha256::new();
    let mut add = |part: &str| {
        digest.update((part.len() as u64).to_le_bytes());
        digest.update(part);
    };
    match targets {
        Targets::Contributions(ids) => {
            let mut ids = ids.clone();
            ids.sort_unstable();
            ids.dedup();
            add("contributions");
            for id in ids {
                add(&id.to_string());
            }
        }
        Targets::Span(span) => {
            add("span");
            add(&span.robot);
            for bound in [span.from_us, span.to_us] {
                add(&bound.map_or_else(String::new, to_rfc3339));
            }
        }
    }
    add(reason);
    hex(&digest.finalize())
}

fn hex(bytes: &[u8]) -> String {
    use std::fmt::Write as _;
    bytes.iter().fold(String::new(), |mut text, byte| {
        let _ = write!(text, "{byte:02x}"); // writing to a String cannot fail
        text
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::acts::Span;

    #[test]
    fn the_same_revert_is_known_however_it_is_written() {
        let (a, b) = (Uuid::from_u128(1), Uuid::from_u128(2));
        let these = |ids: &[Uuid]| digest(&Targets::Contributions(ids.to_vec()), "why");
        assert_eq!(these(&[a, b]), these(&[b, a, b]));
        assert_ne!(these(&[a, b]), these(&[a]));
        let span = |from_us, to_us, reason| {
            digest(&Targets::Span(Span { robot: "r".into(), from_us, to_us }), reason)
        };
        let one = span(Some(5), None, "why");
        for other in
            [span(None, Some(5), "why"), span(Some(5), Some(5), "why"), span(Some(5), None, "")]
        {
            assert_ne!(one, other);
        }
    }
}
