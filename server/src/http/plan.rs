//! What is made of the GDB: findings, plans at a height, and the prior of the raster.

use axum::extract::State;
use axum::response::Response;
use mapfold_schema::border::gdb::{wire_finding, wire_plan};
use mapfold_schema::v1::{GdbFindings, GdbPlan, Import, ImportReport};
use mapfold_schema::{codec, route};
use serde::Deserialize;

use super::access::{Edit, LevelFor, Read};
use super::answer::{DATA, Reader, blocking, created};
use super::gdb::StateName;
use super::problem::ApiError;
use super::query::QueryOf;
use super::state::App;
use crate::auth;
use crate::level::gdb::HEIGHT_M;
use crate::store::imports::NewImport;

/// Heights above a floor that anybody may ask for, metres.
const HEIGHT_MAX_M: f64 = 1000.0;

/// Which findings are asked for.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct FindingsQuery {
    /// `draft` (if absent) or `published`.
    #[serde(default)]
    #[param(inline)]
    state: StateName,
}

/// Which plan is asked for.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PlanQuery {
    /// Height above the level's floor: that of the sensor; 0.3 if absent.
    height_m: Option<f64>,
    /// `draft` (if absent) or `published`.
    #[serde(default)]
    #[param(inline)]
    state: StateName,
}

/// Of what the prior is made.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PriorQuery {
    /// Height above the level's floor: that of the sensors; 0.3 if absent.
    height_m: Option<f64>,
    /// `true`: tell what it would be, and change nothing.
    #[serde(default)]
    preview: bool,
}

/// The height that is asked for, metres.
pub(super) fn height(asked: Option<f64>) -> Result<f64, ApiError> {
    let height = asked.unwrap_or(HEIGHT_M);
    if height.abs() <= HEIGHT_MAX_M {
        return Ok(height);
    }
    Err(ApiError::Query(format!("`height_m` is a number of metres, at most {HEIGHT_MAX_M}.")))
}

/// What is wrong with the model, each with its place and what to do: faults of solids, of objects, and
/// between objects.
#[utoipa::path(
    get, path = route::GDB_FINDINGS, operation_id = "read_gdb_findings", tag = "gdb",
    params(("site" = String, Path), ("level" = String, Path), FindingsQuery),
    responses((status = 200, body = GdbFindings, description = "The findings"))
)]
pub(super) async fn findings(
    State(app): State<App>,
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<FindingsQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let media_type = reader.choose(DATA)?;
    let version = query.state.version(&level.level).await?;
    let model = level.level.gdb_model(version).await?;
    let _turn = app.exports.acquire().await.ok().ok_or(ApiError::Closing)?;
    let write = move || {
        let findings = model.findings().iter().map(wire_finding).collect();
        let (draft, library) = (version.draft, version.library);
        Ok(codec::encode(media_type, &GdbFindings { draft, library, findings })?)
    };
    reader.data(version.draft, media_type, write).await
}

/// What a sensor at one height would see of the model: outlines of what is solid, sheets, and doorways
/// with their jambs, each edge with the object that it belongs to.
///
/// The cut is the one just above the height; touching solids are one, and doorways take out what walls
/// have inside them. The same objects give the same bits.
#[utoipa::path(
    get, path = route::GDB_PLAN, operation_id = "read_gdb_plan", tag = "gdb",
    params(("site" = String, Path), ("level" = String, Path), PlanQuery),
    responses(
        (status = 200, body = GdbPlan, description = "The plan"),
        (status = 409, description = "`plan_too_crowded`: too much stands in the same place"),
    )
)]
pub(super) async fn read(
    State(app): State<App>,
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<PlanQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let media_type = reader.choose(DATA)?;
    let height_m = height(query.height_m)?;
    let version = query.state.version(&level.level).await?;
    let model = level.level.gdb_model(version).await?;
    let _turn = app.exports.acquire().await.ok().ok_or(ApiError::Closing)?;
    let write = move || {
        let plan = model.plan(height_m, |plan| wire_plan(plan, version.draft, version.library))?;
        Ok(codec::encode(media_type, &plan)?)
    };
    reader.data(version.draft, media_type, write).await
}

/// Makes what is published, cut at a height, the prior of the raster: an import like any other (see
/// `imports`), in the place of the one before. Needs `map:edit`.
///
/// Cells with a surface in them say +4.0 nat times the trust of its object, those inside of something
/// +2.0, free ones in rooms -0.5 nat.
#[utoipa::path(
    post, path = route::GDB_PRIOR, operation_id = "make_gdb_prior", tag = "gdb",
    params(("site" = String, Path), ("level" = String, Path), PriorQuery),
    responses(
        (status = 200, body = ImportReport, description = "What it would be, for a preview"),
        (status = 201, body = Import, description = "It is the prior"),
        (status = 404, description = "`publication_not_found`: nothing is published yet"),
        (status = 409, description = "`plan_too_crowded`; `prior_too_large`"),
    )
)]
pub(super) async fn make_prior(
    State(app): State<App>,
    level: LevelFor<Edit>,
    QueryOf(query): QueryOf<PriorQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let height_m = height(query.height_m)?;
    let state = level.level.gdb_state().await?;
    let name = || format!("{}/{}", level.level.site(), level.level.level());
    let published = state.published.ok_or_else(|| ApiError::not_found("publication", name()))?;
    let model = level.level.gdb_model(published.version).await?;
    let _turn = app.exports.acquire().await.ok().ok_or(ApiError::Closing)?;
    let resolution_m = level.level.resolution_m();
    let (id, at_us) = (app.parts.chance.uuid(), app.now_us());
    let author = auth::granted_by(&level.caller).to_owned();
    let new = blocking(move || {
        let made = model.prior(height_m, resolution_m)?;
        let tiles = made.tiles.iter().map(|(at, tile)| Ok((*at, NewImport::column(tile)?)));
        let tiles = tiles.collect::<Result<_, ApiError>>()?;
        let (digest, report) = (made.digest, Some(made.report));
        Ok(NewImport { id, digest, author, at_us, report, tiles })
    })
    .await?;
    if query.preview {
        return reader.small(&new.report);
    }
    let made = level.level.import(&new).await?;
    let made = made.ok_or_else(|| ApiError::Internal("an import came to nothing".to_owned()))?;
    let all = route::of_level(route::IMPORTS, level.level.site(), level.level.level());
    created(&reader, Some(&all), &made)
}
