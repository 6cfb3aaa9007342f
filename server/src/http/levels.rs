//! `/sites/{site}/levels`.

use axum::extract::State;
use axum::response::Response;
use mapfold_map::raster::SliceConfig;
use mapfold_schema::route;
use mapfold_schema::v1::{LevelDescription, NewLevel};

use super::access::{Admin, LevelFor, Read, SiteFor};
use super::answer::{Reader, created};
use super::body::Payload;
use super::check;
use super::problem::ApiError;
use super::state::App;
use crate::store::levels::NewLevelRow;

/// Edge of a cell of a level that names none, metres.
const RESOLUTION_M: f64 = 0.05;

/// The levels of a site, by slug.
#[utoipa::path(
    get, path = route::LEVELS, operation_id = "list_levels", tag = "levels",
    params(("site" = String, Path)),
    responses((status = 200, body = Vec<LevelDescription>, description = "The levels of the site"))
)]
pub(super) async fn list(
    State(app): State<App>,
    site: SiteFor<Read>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let mut levels = Vec::new();
    for row in app.store().levels(&site.site).await? {
        if let Some(level) = app.parts.levels.open(&site.site, &row.level).await? {
            levels.push(level.describe());
        }
    }
    reader.small(&levels)
}

/// Makes a level with a frame of its own. Needs `admin`.
#[utoipa::path(
    post, path = route::LEVELS, operation_id = "create_level", tag = "levels",
    params(("site" = String, Path)), request_body = NewLevel,
    responses((status = 201, body = LevelDescription, description = "The new level"), (status = 409, description = "`level_exists`"))
)]
pub(super) async fn create(
    State(app): State<App>,
    site: SiteFor<Admin>,
    reader: Reader,
    Payload(new): Payload<NewLevel>,
) -> Result<Response, ApiError> {
    check::new_level(&new)?;
    let row = NewLevelRow {
        level: &new.level,
        name: new.name.as_deref().unwrap_or(&new.level),
        frame: app.parts.chance.uuid(),
        resolution_m: new.resolution_m.unwrap_or(RESOLUTION_M),
        elevation_m: new.elevation_m.unwrap_or(0.0),
        slice_s: new.evidence_slice_s.unwrap_or(SliceConfig::STANDARD.length_s),
        created_at_us: app.now_us(),
    };
    app.store().create_level(&site.site, &row).await?;
    let level = app.parts.levels.open(&site.site, &new.level).await?;
    let level = level.ok_or_else(|| ApiError::not_found("level", &new.level))?;
    created(&reader, Some(&route::level(&site.site, &new.level)), &level.describe())
}

/// One level: its frame, grid, revisions, bounds and counts.
#[utoipa::path(
    get, path = route::LEVEL, operation_id = "describe_level", tag = "levels",
    params(("site" = String, Path), ("level" = String, Path)),
    responses((status = 200, body = LevelDescription, description = "The level"))
)]
pub(super) async fn describe(level: LevelFor<Read>, reader: Reader) -> Result<Response, ApiError> {
    reader.small(&level.level.describe())
}
