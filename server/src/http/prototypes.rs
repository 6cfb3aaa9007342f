//! `/sites/{site}/prototypes`: the library of a site.

use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use mapfold_schema::border::gdb::{CONFORMS_TO, check_library, map_prototype, wire_prototype};
use mapfold_schema::v1::{CollectionWord, GdbPrototype, PrototypeCollection};
use mapfold_schema::{codec, route};

use super::access::{Edit, Read, SiteFor};
use super::answer::{FEATURES, Reader, blocking, tagged};
use super::body::{self, media_type};
use super::gdb::{decode, new_entry};
use super::preconditions::{IfMatch, library_tag};
use super::problem::ApiError;
use super::problem::gdb::GdbRefusal;
use super::state::App;
use crate::auth;
use crate::level::gdb::{WireLibrary, columns, library};
use crate::store::gdb::Expected;
use crate::store::library::LibraryOutcome;

/// The prototypes of a site as JSON-FG, by name. The `ETag` is for `If-Match` of the next change.
#[utoipa::path(
    get, path = route::PROTOTYPES, operation_id = "read_prototypes", tag = "gdb",
    params(("site" = String, Path)),
    responses((status = 200, description = "The library", content(
        (PrototypeCollection = "application/geo+json"), (PrototypeCollection = "application/json"),
    )))
)]
pub(super) async fn read(
    State(app): State<App>,
    site: SiteFor<Read>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let media_type = reader.choose(FEATURES)?;
    let (revision, library) = library(app.store(), &site.site, i64::MAX).await?;
    let tag = library_tag(revision, if media_type == codec::JSON { "j" } else { "" });
    let bytes = blocking(move || Ok(codec::to_json(&collection(revision, &library)?)?)).await?;
    Ok(reader.bytes(media_type, &tag, || bytes))
}

fn collection(revision: i64, library: &WireLibrary) -> Result<PrototypeCollection, ApiError> {
    let feature = |(name, prototype): (&String, &GdbPrototype)| {
        let mapped = map_prototype(prototype);
        let mapped = mapped.map_err(|wrong| ApiError::Internal(format!("{name:?}: {wrong:?}")))?;
        Ok(wire_prototype(name, prototype, &mapped))
    };
    Ok(PrototypeCollection {
        kind: CollectionWord::FeatureCollection,
        conforms_to: CONFORMS_TO.map(ToOwned::to_owned).to_vec(),
        revision: Some(revision),
        features: library.iter().map(feature).collect::<Result<_, ApiError>>()?,
    })
}

/// Makes the library what is sent: prototypes that are not in it are no more. Needs `map:edit` and
/// `If-Match`. Drafts take their instances from the library as it is; what is published keeps that
/// with which it was published.
#[utoipa::path(
    put, path = route::PROTOTYPES, operation_id = "replace_prototypes", tag = "gdb",
    params(("site" = String, Path)),
    request_body(content((PrototypeCollection = "application/geo+json"), (PrototypeCollection = "application/json"))),
    responses(
        (status = 200, body = PrototypeCollection, description = "The library is so"),
        (status = 412, description = "`library_moved_on`: it was changed since; read it again"),
        (status = 422, description = "`body_invalid` with `errors`"),
        (status = 428, description = "`precondition_required`: send `If-Match`"),
    )
)]
pub(super) async fn replace(
    State(app): State<App>,
    site: SiteFor<Edit>,
    if_match: IfMatch,
    reader: Reader,
    headers: HeaderMap,
    request: Request,
) -> Result<Response, ApiError> {
    let seen = if_match.revisions()?;
    let sent = media_type(&headers)?;
    let bytes = body::read(request, app.parts.limits.upload_bytes).await?;
    let (wire, columns) = blocking(move || {
        let collection: PrototypeCollection = decode(&sent, &bytes)?;
        let wire = check_library(&collection).map_err(ApiError::Invalid)?;
        let columns = columns(&wire)?;
        Ok((wire, columns))
    })
    .await?;
    let new = new_entry(&app, auth::granted_by(&site.caller), "", Expected::Any);
    let outcome = app.store().put_library(&site.site, &new, seen.as_deref(), &columns).await?;
    match outcome {
        LibraryOutcome::Is(revision) => {
            let answer = collection(revision, &wire)?;
            tagged(&reader, StatusCode::OK, &answer, &library_tag(revision, ""))
        }
        LibraryOutcome::Stale { now } => Err(GdbRefusal::LibraryStale { now }.into()),
    }
}
