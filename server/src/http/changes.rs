//! `L/changes`: what robots found against the published GDB, and what operators make of it.

use std::collections::BTreeMap;
use std::sync::Arc;

use axum::extract::{Path, State};
use axum::response::Response;
use mapfold_map::changes::Change;
use mapfold_schema::border::changes::wire_change;
use mapfold_schema::route;
use mapfold_schema::v1::{
    Dismissal, ModelChange, ModelChangeAnswer, ModelChangeAnswered, ModelChangeState, ModelChanges,
    NewModelChangeAnswer,
};
use serde::Deserialize;

use super::access::{Edit, LevelFor, Read};
use super::answer::Reader;
use super::body::Payload;
use super::check;
use super::gdb::{concluded, new_entry};
use super::plan::height;
use super::problem::ApiError;
use super::query::QueryOf;
use super::state::App;
use crate::auth;
use crate::level::changes::{Changes, Details, accepting, is_in_draft};
use crate::level::gdb::{GdbModel, columns};
use crate::level::{LevelHandle, Snapshot};
use crate::store::gdb::{Expected, GdbChange, Publication};

/// Which changes are asked for.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct ChangesQuery {
    /// Height of the sensors above the level's floor; 0.3 if absent.
    height_m: Option<f64>,
}

/// What the map says against the model.
struct Held {
    snapshot: Arc<Snapshot>,
    published: Option<(Publication, Arc<GdbModel>)>,
    draft: Arc<GdbModel>,
    found: Arc<Changes>,
    dismissals: BTreeMap<String, Dismissal>,
}

impl Held {
    async fn of(app: &App, level: &LevelHandle, height_m: f64) -> Result<Self, ApiError> {
        let snapshot = level.snapshot();
        let state = level.gdb_state().await?;
        let draft = level.gdb_model(state.draft).await?;
        let dismissals = app.store().dismissals(level.site(), level.level()).await?;
        let Some(publication) = state.published else {
            let found = Arc::default();
            return Ok(Self { snapshot, published: None, draft, found, dismissals });
        };
        let model = level.gdb_model(publication.version).await?;
        let _turn = app.exports.acquire().await.ok().ok_or(ApiError::Closing)?;
        let found = level.changes(&snapshot, &model, height_m).await?;
        Ok(Self { snapshot, published: Some((publication, model)), draft, found, dismissals })
    }

    /// A change with what the model and operators say of it.
    fn told(&self, id: &str, change: &Change) -> ModelChange {
        let mut told = wire_change(change);
        let Some((_, published)) = &self.published else { return told };
        let object = told.object.and_then(|object| published.objects().get(&object));
        told.object_kind = object.map(|object| object.kind);
        told.name = object.map(|object| object.name.clone()).unwrap_or_default();
        told.dismissal = self.dismissals.get(id).cloned();
        told.state = if told.dismissal.is_some() {
            ModelChangeState::Dismissed
        } else if is_in_draft(change, published.objects(), self.draft.objects()) {
            ModelChangeState::Accepted
        } else {
            ModelChangeState::Open
        };
        told
    }
}

/// What robots found against the published model, cut at a sensor's height: objects that are missing, opened or
/// stand elsewhere, and things that the model does not know; each with its evidence and what was said of it.
///
/// A function of the map and of what is published: what robots see again, or no longer see, corrects itself. The
/// model is changed by nobody but operators.
#[utoipa::path(
    get, path = route::CHANGES, operation_id = "read_changes", tag = "gdb",
    params(("site" = String, Path), ("level" = String, Path), ChangesQuery),
    responses(
        (status = 200, body = ModelChanges, description = "The changes"),
        (status = 409, description = "`plan_too_crowded`, `plan_too_large`: cut the level into smaller ones"),
    )
)]
pub(super) async fn read(
    State(app): State<App>,
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<ChangesQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let height_m = height(query.height_m)?;
    let held = Held::of(&app, &level.level, height_m).await?;
    reader.small(&ModelChanges {
        revision: held.snapshot.folded_revision(),
        publication: held.published.as_ref().map_or(0, |(publication, _)| publication.revision),
        height_m,
        changes: held.found.iter().map(|(id, change)| held.told(id, change)).collect(),
    })
}

/// Accepts a change into the draft of the model, dismisses it, or takes a dismissal back. Needs `map:edit`.
///
/// Accepting is an edit like any other, with its author in the log: a missing object is removed, one that moved is put
/// where it stands, an opened wall gets doorways, and a new thing becomes an object with the outline that was seen, to
/// be corrected by hand. It is published like any other edit, too. What is so already stays so.
#[utoipa::path(
    post, path = route::CHANGE, operation_id = "answer_change", tag = "gdb",
    params(("site" = String, Path), ("level" = String, Path), ("id" = String, Path), ChangesQuery),
    request_body = NewModelChangeAnswer,
    responses(
        (status = 200, body = ModelChangeAnswered, description = "It is so"),
        (status = 404, description = "`change_not_found`: robots see it no more, or at this height never did"),
        (status = 409, description = "`change_not_acceptable`: a person has to draw it"),
    )
)]
pub(super) async fn answer(
    State(app): State<App>,
    level: LevelFor<Edit>,
    Path((_, _, id)): Path<(String, String, String)>,
    QueryOf(query): QueryOf<ChangesQuery>,
    reader: Reader,
    Payload(new): Payload<NewModelChangeAnswer>,
) -> Result<Response, ApiError> {
    check::change_answer(&new)?;
    let name = new.name.clone().unwrap_or_default();
    let details = Details { kind: new.kind, name, upper_m: new.upper_m };
    let level_handle = &level.level;
    let height_m = height(query.height_m)?;
    let held = Held::of(&app, level_handle, height_m).await?;
    let change = held.found.get(&id).ok_or_else(|| ApiError::not_found("change", &id))?;
    let author = auth::granted_by(&level.caller);
    let key = [level_handle.site(), level_handle.level(), &id];
    let mut entry = None;
    match new.answer {
        ModelChangeAnswer::Dismiss => {
            app.store().dismiss(key, author, app.now_us(), &new.comment).await?;
        }
        ModelChangeAnswer::Reopen => app.store().reopen(key).await?,
        ModelChangeAnswer::Accept => {
            let (_, published) =
                held.published.as_ref().ok_or_else(|| ApiError::not_found("change", &id))?;
            let taken = accepting(change, &details, published.objects(), held.draft.objects())
                .map_err(ApiError::NotAcceptableChange)?;
            let edit = GdbChange::Edit { put: columns(&taken.put)?, removed: taken.removed };
            // That very draft, for it was looked at: a later one is looked at again.
            let expected = Expected::OneOf(vec![held.draft.version()]);
            let comment = match new.comment.as_str() {
                "" => format!("accepted: {id}"),
                comment => comment.to_owned(),
            };
            let new = new_entry(&app, author, &comment, expected);
            let outcome = level_handle.edit_gdb(&new, &edit).await?;
            app.store().reopen(key).await?;
            entry = concluded(outcome, BTreeMap::new())?.entry;
        }
    }
    let after = Held::of(&app, level_handle, height_m).await?;
    reader.small(&ModelChangeAnswered { change: after.told(&id, change), entry })
}
