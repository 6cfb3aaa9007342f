//! `L/exports/{format}` of the a-priori model: the draft or what is published, in the format of another program.

use std::io;
use std::sync::Arc;

use axum::extract::State;
use axum::response::Response;
use mapfold_schema::{codec, geojson, route};
use serde::Deserialize;
use uuid::Uuid;

use super::access::{LevelFor, Read};
use super::answer::{Offer, Reader};
use super::gdb::StateName;
use super::problem::ApiError;
use super::query::QueryOf;
use super::state::App;
use crate::exchange::outgoing::Outgoing;
use crate::exchange::{dxf, glb, jsonfg};
use crate::level::Snapshot;
use crate::level::gdb::GdbModel;

/// What JSON-FG can be had as.
pub(super) const JSONFG: &Offer = &[jsonfg::MEDIA_TYPE, geojson::MEDIA_TYPE, codec::JSON];

/// What a file of features shows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum Content {
    /// What robots saw.
    #[default]
    Map,
    /// The plan of the a-priori model at a height, and its landmarks.
    Gdb,
    /// Both.
    All,
}

/// Formats that hold a whole model.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Format {
    Jsonfg,
    Dxf,
    Glb,
}

impl Format {
    pub(super) fn offer(self) -> &'static Offer {
        match self {
            Self::Jsonfg => JSONFG,
            Self::Dxf => &[dxf::MEDIA_TYPE],
            Self::Glb => &[glb::MEDIA_TYPE],
        }
    }

    pub(super) fn extension(self) -> &'static str {
        match self {
            Self::Jsonfg => "json",
            Self::Dxf => "dxf",
            Self::Glb => "glb",
        }
    }
}

/// Which model is asked for.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct StateQuery {
    /// `draft` (if absent) or `published`.
    #[serde(default)]
    #[param(inline)]
    state: StateName,
}

/// The a-priori model in three dimensions, as binary glTF: a node for each object, a mesh for each prototype. The same as
/// `exports/glb`.
#[utoipa::path(
    get, path = route::GDB_GLB, operation_id = "read_gdb_glb", tag = "gdb",
    params(("site" = String, Path), ("level" = String, Path), StateQuery),
    responses((status = 200, description = "The model", content((Vec<u8> = "model/gltf-binary"))))
)]
pub(super) async fn glb(
    State(app): State<App>,
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<StateQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    whole(&app, &level, Format::Glb, query.state, &reader).await
}

/// A whole model as a file.
pub(super) async fn whole(
    app: &App,
    level: &LevelFor<Read>,
    format: Format,
    state: StateName,
    reader: &Reader,
) -> Result<Response, ApiError> {
    let media_type = reader.choose(format.offer())?;
    let model = model(level, state).await?;
    let _turn = app.exports.acquire().await.ok().ok_or(ApiError::Closing)?;
    let frame = level.level.frame();
    let version = model.version();
    let write = move || {
        let mut bytes = Vec::new();
        let model = outgoing(&model, frame);
        let written = match format {
            Format::Jsonfg => jsonfg::write(model, &mut bytes),
            Format::Dxf => dxf::write(model, &mut bytes),
            Format::Glb => glb::write(model, &mut bytes),
        };
        written.map_err(|error| failed(&error))?;
        Ok(bytes)
    };
    let of = [version.draft, version.library];
    reader.file_of(frame, &of, version.draft, media_type, write).await
}

/// Features of the plan of a model at a height, and of `snapshot` if there is one.
pub(super) async fn features(
    level: &LevelFor<Read>,
    state: StateName,
    height_m: f64,
    snapshot: Option<Arc<Snapshot>>,
    reader: &Reader,
) -> Result<Response, ApiError> {
    let model = model(level, state).await?;
    let version = model.version();
    let revision = snapshot.as_ref().map_or(version.draft, |s| s.folded_revision());
    let write = move || {
        let landmarks = model.landmarks(height_m)?;
        let map = snapshot.map(|snapshot| snapshot.map());
        let mut bytes = Vec::new();
        let write = |plan: &_| geojson::write(map.as_deref(), Some((plan, &landmarks)), &mut bytes);
        model.plan(height_m, write)?.map_err(|error| failed(&error))?;
        Ok(bytes)
    };
    let of = [version.draft, version.library, revision];
    reader.file_of(level.level.frame(), &of, revision, geojson::MEDIA_TYPE, write).await
}

async fn model(level: &LevelFor<Read>, state: StateName) -> Result<Arc<GdbModel>, ApiError> {
    let version = state.version(&level.level).await?;
    Ok(level.level.gdb_model(version).await?)
}

fn outgoing(model: &GdbModel, frame: Uuid) -> Outgoing<'_> {
    let version = model.version();
    Outgoing {
        frame,
        version: [version.draft, version.library],
        objects: model.objects(),
        library: model.library(),
        model: model.model(),
    }
}

fn failed(error: &io::Error) -> ApiError {
    ApiError::Internal(error.to_string())
}
