//! `L/gdb`: the a-priori model, its edits and its publications.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::extract::{Request, State};
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use mapfold_map::gdb::Severity;
use mapfold_schema::border::gdb::{
    CONFORMS_TO, check_edit, check_gdb, coord_ref_sys, object_id, object_uuid, wire_feature,
    wire_finding,
};
use mapfold_schema::border::{VIOLATIONS_MAX, Violation};
use mapfold_schema::v1::{
    CollectionWord, GdbAnswer, GdbCollection, GdbEdit, GdbEdited, GdbEntryPage, GdbPreview,
};
use mapfold_schema::{codec, geojson, route};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use uuid::Uuid;

use super::access::{Edit, LevelFor, Publish, Read};
use super::answer::{FEATURES, Reader, blocking, tagged};
use super::body::{self, media_type};
use super::check;
use super::preconditions::{IfMatch, version_tag};
use super::problem::ApiError;
use super::problem::gdb::GdbRefusal;
use super::query::{QueryOf, before, page_limit};
use super::state::App;
use crate::auth;
use crate::level::LevelHandle;
use crate::level::gdb::{GdbModel, WireObjects, columns};
use crate::store::gdb::{Expected, GdbChange, GdbOutcome, GdbState, GdbVersion, NewGdbEntry};

/// Entries of a page, if the request names no number; and at most.
const PAGE: u32 = 50;
const PAGE_MAX: u32 = 500;
/// Findings of a preview.
const FINDINGS_MAX: usize = 200;

/// Which model is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum StateName {
    /// What people work on.
    #[default]
    Draft,
    /// What robots get.
    Published,
}

impl StateName {
    /// The version of this model; nothing published is the empty model.
    pub(super) async fn version(self, level: &LevelHandle) -> Result<GdbVersion, ApiError> {
        let state = level.gdb_state().await?;
        let published = state.published.map(|published| published.version);
        Ok(match self {
            Self::Draft => state.draft,
            Self::Published => published.unwrap_or(GdbVersion { draft: 0, library: 0 }),
        })
    }
}

/// How the model is wanted.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct ReadQuery {
    /// `draft` (if absent) or `published`.
    #[serde(default)]
    #[param(inline)]
    state: StateName,
    /// `false`: without `place`, for those who read the properties.
    place: Option<bool>,
}

/// How an edit is taken.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct EditQuery {
    /// `true`: tell what would change and what would be wrong, and change nothing.
    #[serde(default)]
    preview: bool,
    /// What for, for those who read the log; at most 500 bytes.
    #[serde(default)]
    comment: String,
}

/// What a publication is for.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct CommentQuery {
    /// What for, for those who read the log; at most 500 bytes.
    #[serde(default)]
    comment: String,
}

/// Which entries are asked for.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PageQuery {
    /// `next` of the page before.
    cursor: Option<String>,
    /// Entries of a page, at most 500; 50 if absent.
    limit: Option<u32>,
}

/// The a-priori model of the level as JSON-FG, in its frame: objects by identity.
///
/// The `ETag` is the version of the model; send it as `If-Match` with the next edit.
#[utoipa::path(
    get, path = route::GDB, operation_id = "read_gdb", tag = "gdb",
    params(("site" = String, Path), ("level" = String, Path), ReadQuery),
    responses((status = 200, description = "The model", content(
        (GdbCollection = "application/geo+json"), (GdbCollection = "application/json"),
    )))
)]
pub(super) async fn read(
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<ReadQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let media_type = reader.choose(FEATURES)?;
    let version = query.state.version(&level.level).await?;
    let model = level.level.gdb_model(version).await?;
    let with_place = query.place.unwrap_or(true);
    let form = match (media_type == codec::JSON, with_place) {
        (false, true) => "",
        (true, true) => "j",
        (false, false) => "n",
        (true, false) => "jn",
    };
    let tag = version_tag(version, form);
    let frame = level.level.frame();
    let bytes = blocking(move || collection(&model, frame, with_place)).await?;
    Ok(reader.bytes(media_type, &tag, || bytes))
}

fn collection(model: &GdbModel, frame: Uuid, with_place: bool) -> Result<Vec<u8>, ApiError> {
    let mapped = model.model();
    let feature = |(id, object): (&Uuid, _)| {
        let mapped_object = mapped.objects.get(&object_id(*id))?;
        let mut feature = wire_feature(*id, object, mapped_object, &mapped.prototypes);
        if !with_place {
            feature.place = None;
        }
        Some(feature)
    };
    let version = model.version();
    Ok(codec::to_json(&GdbCollection {
        kind: CollectionWord::FeatureCollection,
        conforms_to: CONFORMS_TO.map(ToOwned::to_owned).to_vec(),
        coord_ref_sys: Some(coord_ref_sys(frame)),
        revision: Some(version.draft),
        library: Some(version.library),
        features: model.objects().iter().filter_map(feature).collect(),
    })?)
}

/// Makes the draft what is sent: objects that are not in it are no more. Needs `map:edit` and `If-Match`.
///
/// What changes is one entry of the level's log. What is so already changes nothing, whatever `If-Match`
/// says, so that a lost answer may be asked for again. `place` may be left out; without `solids` and
/// `prototype` it says what an object is made of.
#[utoipa::path(
    put, path = route::GDB, operation_id = "replace_gdb", tag = "gdb",
    params(("site" = String, Path), ("level" = String, Path), EditQuery),
    request_body(content((GdbCollection = "application/geo+json"), (GdbCollection = "application/json"))),
    responses(
        (status = 200, body = GdbEdited, description = "The draft is so; or, for a preview, what would change"),
        (status = 412, description = "`gdb_moved_on`: others have changed it since; `errors` says what"),
        (status = 422, description = "`body_invalid` with `errors`; `gdb_too_large`"),
        (status = 428, description = "`precondition_required`: send `If-Match`"),
    )
)]
pub(super) async fn replace(
    State(app): State<App>,
    level: LevelFor<Edit>,
    if_match: IfMatch,
    QueryOf(query): QueryOf<EditQuery>,
    reader: Reader,
    headers: HeaderMap,
    request: Request,
) -> Result<Response, ApiError> {
    change::<GdbCollection>(&app, &level, &if_match, &query, &reader, &headers, request).await
}

/// Puts some objects of the draft in the place of what they were, and removes others. Needs `map:edit`
/// and `If-Match`. As for `PUT`.
#[utoipa::path(
    patch, path = route::GDB, operation_id = "edit_gdb", tag = "gdb",
    params(("site" = String, Path), ("level" = String, Path), EditQuery),
    request_body = GdbEdit,
    responses(
        (status = 200, body = GdbEdited, description = "The draft is so; or, for a preview, what would change"),
        (status = 412, description = "`gdb_moved_on`: others have changed it since; `errors` says what"),
        (status = 422, description = "`body_invalid` with `errors`; `gdb_too_large`"),
        (status = 428, description = "`precondition_required`: send `If-Match`"),
    )
)]
pub(super) async fn edit(
    State(app): State<App>,
    level: LevelFor<Edit>,
    if_match: IfMatch,
    QueryOf(query): QueryOf<EditQuery>,
    reader: Reader,
    headers: HeaderMap,
    request: Request,
) -> Result<Response, ApiError> {
    change::<GdbEdit>(&app, &level, &if_match, &query, &reader, &headers, request).await
}

/// What a body asks for.
struct Asked {
    /// The objects of the draft as they would be.
    after: WireObjects,
    /// The change.
    change: GdbChange,
    /// Where in the body each object stands.
    named: BTreeMap<Uuid, String>,
}

/// A body that asks for a change of the draft.
trait Asks: DeserializeOwned + Send + 'static {
    /// Checks it against the draft that is there.
    fn ask(&self, frame: Uuid, draft: &GdbModel) -> Result<Asked, ApiError>;
}

impl Asks for GdbCollection {
    fn ask(&self, frame: Uuid, draft: &GdbModel) -> Result<Asked, ApiError> {
        let library = &draft.model().prototypes;
        let after = check_gdb(self, frame, library).map_err(ApiError::Invalid)?;
        let place = |(index, feature): (usize, &mapfold_schema::v1::GdbFeature)| {
            (feature.id, format!("/features/{index}"))
        };
        let named = self.features.iter().enumerate().map(place).collect();
        Ok(Asked { change: GdbChange::Replace(columns(&after)?), after, named })
    }
}

impl Asks for GdbEdit {
    fn ask(&self, _: Uuid, draft: &GdbModel) -> Result<Asked, ApiError> {
        let library = &draft.model().prototypes;
        let checked = check_edit(self, library).map_err(ApiError::Invalid)?;
        let put = self.put.iter().enumerate().map(|(i, feature)| (feature.id, format!("/put/{i}")));
        let gone = self.remove.iter().enumerate().map(|(i, id)| (*id, format!("/remove/{i}")));
        let named = put.chain(gone).collect();
        let put = columns(&checked.put)?;
        let mut after = draft.objects().clone();
        after.retain(|id, _| !checked.removed.contains(id));
        after.extend(checked.put);
        Ok(Asked { after, change: GdbChange::Edit { put, removed: checked.removed }, named })
    }
}

async fn change<T: Asks>(
    app: &App,
    level: &LevelFor<Edit>,
    if_match: &IfMatch,
    query: &EditQuery,
    reader: &Reader,
    headers: &HeaderMap,
    request: Request,
) -> Result<Response, ApiError> {
    check::comment(&query.comment)?;
    let expected = if query.preview { Expected::Any } else { if_match.versions()? };
    let sent = media_type(headers)?;
    let bytes = body::read(request, app.parts.limits.upload_bytes).await?;
    let state = level.level.gdb_state().await?;
    let draft = level.level.gdb_model(state.draft).await?;
    let (frame, preview) = (level.level.frame(), query.preview);
    let _turn = app.exports.acquire().await.ok().ok_or(ApiError::Closing)?;
    let (asked, told) = blocking(move || {
        let asked = decode::<T>(&sent, &bytes)?.ask(frame, &draft)?;
        // Also to see that it is not too large.
        let after = draft.with_objects(asked.after.clone())?;
        let told = preview.then(|| tell(&draft, &after));
        Ok((asked, told))
    })
    .await?;
    if let Some(told) = told {
        return reader.small(&told);
    }
    let new = new_entry(app, auth::granted_by(&level.caller), &query.comment, expected);
    let outcome = level.level.edit_gdb(&new, &asked.change).await?;
    answer(reader, concluded(outcome, asked.named)?, StatusCode::OK, |answer| answer)
}

/// Reads JSON (also under the names of GeoJSON and JSON-FG) or CBOR.
pub(super) fn decode<T: DeserializeOwned>(media_type: &str, bytes: &[u8]) -> Result<T, ApiError> {
    let essence = media_type.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    let is_features = [geojson::MEDIA_TYPE, "application/fg+json"].contains(&essence.as_str());
    let decoded =
        if is_features { codec::from_json(bytes) } else { codec::decode(media_type, bytes) };
    decoded.map_err(ApiError::Body)
}

/// What a change would come to.
pub(super) fn tell(draft: &GdbModel, after: &GdbModel) -> GdbPreview {
    let (old, new) = (draft.objects(), after.objects());
    let changed = new.iter().filter(|(id, object)| old.get(*id).is_some_and(|o| o != *object));
    let findings = after.findings();
    GdbPreview {
        draft: draft.version().draft,
        new: new.keys().filter(|id| !old.contains_key(id)).count() as u32,
        changed: changed.count() as u32,
        removed: old.keys().filter(|id| !new.contains_key(id)).count() as u32,
        more_findings: findings.len() > FINDINGS_MAX,
        findings: findings.iter().take(FINDINGS_MAX).map(wire_finding).collect(),
    }
}

/// Publishes the draft: robots get its plans and landmarks from then on. Needs `map:publish` and `If-Match`.
///
/// A draft with errors (see `findings`) is not published. What is published stays as it is, also when
/// prototypes change: that takes another publication.
#[utoipa::path(
    post, path = route::GDB_PUBLICATIONS, operation_id = "publish_gdb", tag = "gdb",
    params(("site" = String, Path), ("level" = String, Path), CommentQuery),
    responses(
        (status = 200, body = GdbAnswer, description = "It is published already"),
        (status = 201, body = GdbAnswer, description = "It is published"),
        (status = 409, description = "`gdb_has_errors`: `errors` names the first"),
        (status = 412, description = "`gdb_moved_on`: others have changed it since; `errors` says what"),
        (status = 428, description = "`precondition_required`: send `If-Match`"),
    )
)]
pub(super) async fn publish(
    State(app): State<App>,
    level: LevelFor<Publish>,
    if_match: IfMatch,
    QueryOf(query): QueryOf<CommentQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    check::comment(&query.comment)?;
    let mut expected = if_match.versions()?;
    let state = level.level.gdb_state().await?;
    if expected.allows(state.draft) {
        let draft = level.level.gdb_model(state.draft).await?;
        let _turn = app.exports.acquire().await.ok().ok_or(ApiError::Closing)?;
        blocking(move || without_errors(&draft)).await?;
        // That very draft, and no other that is made meanwhile.
        expected = Expected::OneOf(vec![state.draft]);
    }
    let new = new_entry(&app, auth::granted_by(&level.caller), &query.comment, expected);
    let outcome = level.level.publish_gdb(&new).await?;
    let concluded = concluded(outcome, BTreeMap::new())?;
    answer(&reader, concluded, StatusCode::CREATED, |answer| answer)
}

fn without_errors(draft: &Arc<GdbModel>) -> Result<(), ApiError> {
    let index: BTreeMap<&Uuid, usize> = draft.objects().keys().zip(0..).collect();
    let is_error =
        |finding: &&mapfold_map::gdb::Finding| finding.kind.severity() == Severity::Error;
    let errors: Vec<_> = draft.findings().iter().filter(is_error).collect();
    if errors.is_empty() {
        return Ok(());
    }
    let violation = |finding: &&mapfold_map::gdb::Finding| {
        let wire = wire_finding(finding);
        let object = finding.place.object.map(object_uuid);
        let at = object.and_then(|id| index.get(&id).map(|i| format!("/features/{i}")));
        let solid = wire.solid.map(|solid| format!("/properties/solids/{solid}"));
        let named = |id: Uuid| format!("object {id}: {}", wire.detail);
        let prototype = wire.prototype.as_ref();
        let named_prototype = prototype.map(|name| format!("prototype {name:?}: {}", wire.detail));
        Violation {
            pointer: at.map(|at| at + &solid.unwrap_or_default()).unwrap_or_default(),
            code: wire.code.clone(),
            detail: object.map(named).or(named_prototype).unwrap_or_else(|| wire.detail.clone()),
        }
    };
    let first = errors.iter().take(VIOLATIONS_MAX).map(violation).collect();
    Err(GdbRefusal::Faults { count: errors.len(), first }.into())
}

pub(super) fn new_entry(app: &App, author: &str, comment: &str, expected: Expected) -> NewGdbEntry {
    NewGdbEntry {
        id: app.parts.chance.uuid(),
        author: author.to_owned(),
        at_us: app.now_us(),
        comment: comment.trim().to_owned(),
        expected,
    }
}

/// What is there after a change, the entry if there is one; or why there is none.
pub(super) fn concluded(
    outcome: GdbOutcome,
    named: BTreeMap<Uuid, String>,
) -> Result<GdbAnswer, ApiError> {
    match outcome {
        GdbOutcome::Done(entry) => {
            Ok(GdbAnswer { draft: entry.draft, library: entry.library, entry: Some(entry) })
        }
        GdbOutcome::Same(GdbState { draft: GdbVersion { draft, library }, .. }) => {
            Ok(GdbAnswer { draft, library, entry: None })
        }
        GdbOutcome::Stale(stale) => Err(GdbRefusal::Stale { stale, named }.into()),
        GdbOutcome::TooMany { objects } => Err(GdbRefusal::TooMany { objects }.into()),
    }
}

/// The answer to a change, which `of` makes of what is there now, with the tag of that.
pub(super) fn answer<T: serde::Serialize>(
    reader: &Reader,
    concluded: GdbAnswer,
    done: StatusCode,
    of: impl FnOnce(GdbAnswer) -> T,
) -> Result<Response, ApiError> {
    let GdbAnswer { draft, library, .. } = concluded;
    let status = if concluded.entry.is_some() { done } else { StatusCode::OK };
    tagged(reader, status, &of(concluded), &version_tag(GdbVersion { draft, library }, ""))
}

/// Who changed and published the model, newest first, in pages.
#[utoipa::path(
    get, path = route::GDB_ENTRIES, operation_id = "list_gdb_entries", tag = "gdb",
    params(("site" = String, Path), ("level" = String, Path), PageQuery),
    responses((status = 200, body = GdbEntryPage, description = "A page of entries"))
)]
pub(super) async fn entries(
    State(app): State<App>,
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<PageQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let before = before(query.cursor.as_deref())?;
    let limit = page_limit(query.limit, PAGE, PAGE_MAX)?;
    let (site, name) = (level.level.site(), level.level.level());
    reader.small(&app.store().gdb_page(site, name, before, limit).await?)
}
