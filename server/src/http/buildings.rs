//! `L/imports` for buildings of Open-RMF: walls, doorways and floors into the draft of the GDB.

use std::collections::{BTreeMap, BTreeSet};

use axum::body::Bytes;
use axum::http::{HeaderMap, StatusCode};
use axum::response::Response;
use mapfold_schema::v1::BuildingImport;

use super::access::{Edit, LevelFor};
use super::answer::{Reader, blocking};
use super::gdb::{answer, concluded, new_entry, tell};
use super::preconditions::IfMatch;
use super::problem::ApiError;
use super::state::App;
use crate::auth;
use crate::exchange::building::Document;

/// What YAML is sent as.
const YAML: [&str; 3] = ["application/yaml", "application/x-yaml", "text/yaml"];

/// Whether a body of this type is a building.
pub(super) fn is_building(media_type: &str) -> bool {
    let essence = media_type.split(';').next().unwrap_or_default().trim();
    YAML.iter().any(|yaml| essence.eq_ignore_ascii_case(yaml))
}

/// How a building is taken.
pub(super) struct Taking {
    /// Tell what would change, and change nothing.
    pub(super) preview: bool,
    /// Which of its levels; the only one if absent.
    pub(super) building_level: Option<String>,
    /// Whether what is in the draft and not in the building goes.
    pub(super) replace: bool,
}

/// Takes one level of a building into the draft.
pub(super) async fn take(
    app: &App,
    level: &LevelFor<Edit>,
    taking: Taking,
    reader: &Reader,
    headers: &HeaderMap,
    bytes: Bytes,
) -> Result<Response, ApiError> {
    let expected = IfMatch::of(headers).versions_if_any()?;
    let state = level.level.gdb_state().await?;
    let draft = level.level.gdb_model(state.draft).await?;
    let frame = level.level.frame();
    let Taking { preview, building_level, replace } = taking;
    let _turn = app.exports.acquire().await.ok().ok_or(ApiError::Closing)?;
    let (report, change, preview) = blocking(move || {
        let prototypes: BTreeSet<&str> = draft.library().keys().map(String::as_str).collect();
        let document = Document::read(&bytes).map_err(ApiError::Building)?;
        let imported = document.import(building_level.as_deref(), frame, &prototypes);
        let imported = imported.map_err(ApiError::Building)?;
        let (after, change) = draft.taking(imported.objects, replace)?;
        let model = draft.with_objects(after)?;
        let told = preview.then(|| tell(&draft, &model));
        Ok((imported.report, change, told))
    })
    .await?;
    if preview.is_some() {
        return reader.small(&BuildingImport { report, preview, answer: None });
    }
    let comment = format!("{} of {}", report.building_level, report.building);
    let comment: String = comment.chars().filter(|c| !c.is_control()).take(120).collect();
    let new = new_entry(app, auth::granted_by(&level.caller), &comment, expected);
    let outcome = level.level.edit_gdb(&new, &change).await?;
    answer(reader, concluded(outcome, BTreeMap::new())?, StatusCode::CREATED, |answer| {
        BuildingImport { report, preview: None, answer: Some(answer) }
    })
}
