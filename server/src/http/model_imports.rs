//! `L/imports` for models of other programs: objects into the draft of the GDB, prototypes into the site's library.

use std::collections::BTreeMap;

use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use mapfold_schema::geojson;
use mapfold_schema::v1::{ModelFormat, ModelImport};
use uuid::Uuid;

use super::access::{Edit, LevelFor};
use super::answer::{Reader, blocking};
use super::gdb::{answer, concluded, new_entry, tell};
use super::preconditions::IfMatch;
use super::problem::ApiError;
use super::problem::gdb::GdbRefusal;
use super::state::App;
use crate::auth;
use crate::exchange::incoming::{FileFault, Incoming};
use crate::exchange::{dxf, glb, jsonfg};
use crate::level::gdb::{WireLibrary, columns};
use crate::store::gdb::{Expected, GdbVersion};
use crate::store::library::LibraryOutcome;

/// What models are sent as.
const FORMATS: [(&[&str], ModelFormat); 4] = [
    (&[jsonfg::MEDIA_TYPE, "application/json"], ModelFormat::Jsonfg),
    (&[geojson::MEDIA_TYPE], ModelFormat::Geojson),
    (&dxf::MEDIA_TYPES, ModelFormat::Dxf),
    (&[glb::MEDIA_TYPE], ModelFormat::Glb),
];

/// The format of a body of this type, if it is a model.
pub(super) fn format_of(media_type: &str) -> Option<ModelFormat> {
    let essence = media_type.split(';').next().unwrap_or_default().trim();
    let is = |name: &&str| essence.eq_ignore_ascii_case(name);
    let known = FORMATS.iter().find(|(names, _)| names.iter().any(is));
    known.map(|(_, format)| *format)
}

/// How a model is taken.
pub(super) struct Taking {
    /// Tell what would change, and change nothing.
    pub(super) preview: bool,
    /// Whether what is in the draft and not in the file goes.
    pub(super) replace: bool,
}

/// Takes a model into the draft. `read` finds it in the file, given the frame of the level and the library of the site.
pub(super) async fn take(
    app: &App,
    level: &LevelFor<Edit>,
    taking: Taking,
    reader: &Reader,
    headers: &HeaderMap,
    read: impl FnOnce(Uuid, &WireLibrary) -> Result<Incoming, FileFault> + Send + 'static,
) -> Result<Response, ApiError> {
    let expected = IfMatch::of(headers).versions_if_any()?;
    let state = level.level.gdb_state().await?;
    let draft = level.level.gdb_model(state.draft).await?;
    let frame = level.level.frame();
    let Taking { preview, replace } = taking;
    let _turn = app.exports.acquire().await.ok().ok_or(ApiError::Closing)?;
    let (report, library, change, told) = blocking(move || {
        let Incoming { objects, prototypes, report } =
            read(frame, draft.library()).map_err(ApiError::ModelFile)?;
        let (after, change) = draft.taking(objects, replace)?;
        let mut library = draft.library().clone();
        let grows = !prototypes.is_empty();
        library.extend(prototypes);
        let columns = columns(&library)?;
        // Also to see that it is not too large.
        let model = draft.with_library(after, library)?;
        let told = preview.then(|| tell(&draft, &model));
        Ok((report, grows.then_some(columns), change, told))
    })
    .await?;
    if told.is_some() {
        return reader.small(&ModelImport { report, preview: told, answer: None });
    }
    let author = auth::granted_by(&level.caller);
    let comment = format!("a model as {:?}", report.format).to_lowercase();
    // What is stale is told by the edit, before the library changes.
    let expected = match library {
        Some(columns) if expected.allows(state.draft) => {
            let new = new_entry(app, author, &comment, Expected::Any);
            let seen = [state.draft.library];
            let put = app.store().put_library(level.level.site(), &new, Some(&seen), &columns);
            match put.await? {
                LibraryOutcome::Is(library) => on_library(&expected, state.draft, library),
                LibraryOutcome::Stale { now } => {
                    return Err(GdbRefusal::LibraryStale { now }.into());
                }
            }
        }
        _ => expected,
    };
    let new = new_entry(app, author, &comment, expected);
    let outcome = level.level.edit_gdb(&new, &change).await?;
    let concluded = concluded(outcome, BTreeMap::new())?;
    answer(reader, concluded, StatusCode::CREATED, |answer| ModelImport {
        report,
        preview: None,
        answer: Some(answer),
    })
}

/// The same draft, with the library that the import has made.
fn on_library(expected: &Expected, draft: GdbVersion, library: i64) -> Expected {
    match expected {
        Expected::Any => Expected::Any,
        Expected::OneOf(_) => Expected::OneOf(vec![GdbVersion { library, ..draft }]),
    }
}
