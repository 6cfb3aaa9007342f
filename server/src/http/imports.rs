//! `L/imports`: maps of other programs as the level's prior.

use axum::body::Bytes;
use axum::extract::{Request, State};
use axum::http::HeaderMap;
use axum::response::Response;
use mapfold_schema::route;
use mapfold_schema::v1::{Import, ImportPage, ImportReport, ModelFormat};
use serde::Deserialize;

use super::access::{Edit, LevelFor, Read};
use super::answer::{Reader, blocking, created};
use super::body::{self, media_type};
use super::buildings::{self, Taking, is_building};
use super::exports::ZIP;
use super::model_imports;
use super::problem::ApiError;
use super::query::{QueryOf, before, page_limit};
use super::state::App;
use crate::auth;
use crate::exchange::incoming::FileFault;
use crate::exchange::nav2::{ImportError, Package, Trust};
use crate::exchange::{dxf, geojson, glb, jsonfg};
use crate::level::gdb::WireLibrary;
use crate::store::imports::NewImport;

/// Imports of a page, if the request names no number; and at most.
const PAGE: u32 = 20;
const PAGE_MAX: u32 = 100;

/// What becomes of a map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
enum Target {
    /// A layer below what robots saw.
    #[default]
    Prior,
    /// Walls of the a-priori model.
    Gdb,
}

/// How a map is taken.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct ImportQuery {
    /// `true`: tell what is in the map, and change nothing.
    #[serde(default)]
    preview: bool,
    /// How much it is trusted, from 0 to 1; 0.5 if absent. An occupied cell says +4.0 nat times
    /// this, a free one -0.5 nat times this.
    trust: Option<f64>,
    /// Of a building: which of its levels; the only one if absent.
    building_level: Option<String>,
    /// Of a building or a model, `true`: what is in the draft of the GDB and not in the file goes.
    #[serde(default)]
    replace: bool,
    /// Of a map: what becomes of it: `prior` (if absent), or `gdb`: its occupied cells as walls of the draft.
    #[serde(default)]
    #[param(inline)]
    into: Target,
    /// Of a drawing: which layer is what, before the table of names after AIA and NCS: `PATTERN=KIND,...`, where a star stands
    /// for any letters, and a kind may be `skip`.
    layers: Option<String>,
    /// Of a drawing or a plan: metres of one unit, if what it says itself is not so.
    unit_m: Option<f64>,
    /// Of a drawing or a plan: height of walls that are drawn flat; 2.5 if absent.
    wall_height_m: Option<f64>,
}

impl ImportQuery {
    /// How a drawing is read.
    fn drawing(&self) -> Result<dxf::Options, ApiError> {
        dxf::Options::new(self.layers.as_deref(), self.unit_m, self.wall_height_m)
            .map_err(ApiError::Query)
    }
}

/// Which imports are asked for.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PageQuery {
    /// `next` of the page before.
    cursor: Option<String>,
    /// Imports of a page, at most 100; 20 if absent.
    limit: Option<u32>,
}

/// Makes a map of another program the prior of the level: a layer of its own below what robots saw.
/// Needs `map:edit`.
///
/// The body is a zip of a YAML and the image that it names, as `map_server` writes them (PGM or PNG,
/// modes trinary, scale and raw), and as `exports/nav2` gives them:
/// `zip map.zip map.yaml map.pgm; curl --data-binary @map.zip -H 'content-type: application/zip' ...`.
/// It is read by the rules of `map_server`; yaw is honoured. Where its pixels do not coincide with
/// the level's cells, each cell is looked up at places no farther apart than half a pixel, and
/// obstacles win. The import is an entry of the level's log and takes the place of the one before.
/// The same map with the same trust again changes nothing and is answered in the same way. With
/// `preview=true` nothing is changed: the answer, of status 200, tells what was found.
///
/// A `building.yaml` of Open-RMF's traffic editor, as `application/yaml`, goes into the draft of the GDB instead: walls,
/// doorways and floors of one of its levels, and models that the site has prototypes of; the answer is a
/// `BuildingImport`. The same file gives the same objects. `If-Match` may name the draft that it is taken on.
///
/// A model as JSON-FG (`application/fg+json`: a `GdbDocument`, as `exports/jsonfg` gives it) goes there too, and its prototypes
/// into the library of the site, of which no prototype is changed: one whose name is taken gets a name of its own. So does
/// a drawing (ASCII DXF, `image/vnd.dxf`): walls of pairs of parallel lines, doorways of swings of doors, blocks as
/// prototypes; a flat plan (`application/geo+json`, such as `exports/geojson?of=gdb`): its outlines drawn up; a map, with `into=gdb`: its occupied cells as walls; and a model in three dimensions (GLB, `model/gltf-binary`). The answer is a `ModelImport`, which tells what was left out, and why.
#[utoipa::path(
    post, path = route::IMPORTS, operation_id = "import", tag = "map",
    params(("site" = String, Path), ("level" = String, Path), ImportQuery),
    request_body(content = Vec<u8>, content_type = "application/zip"),
    responses(
        (status = 200, body = ImportReport, description = "What was found, for a preview"),
        (status = 201, body = Import, description = "It is the prior"),
        (status = 413, description = "`payload_too_large`, `image_too_large`"),
        (status = 422, description = "`invalid_map_package`, `invalid_map_metadata`, `invalid_map_data`, `invalid_building`, `invalid_model_file`: what is wrong, where, and what to do"),
    )
)]
pub(super) async fn create(
    State(app): State<App>,
    level: LevelFor<Edit>,
    QueryOf(query): QueryOf<ImportQuery>,
    reader: Reader,
    headers: HeaderMap,
    request: Request,
) -> Result<Response, ApiError> {
    let drawing = query.drawing()?;
    let ImportQuery { preview, trust, building_level, replace, into, .. } = query;
    let trust = trust.map_or(Some(Trust::STANDARD), Trust::new);
    let trust = trust.ok_or_else(|| ApiError::Query("`trust` is from 0 to 1.".to_owned()))?;
    let sent = media_type(&headers).unwrap_or_default();
    if is_building(&sent) {
        let bytes = body::read(request, app.parts.limits.upload_bytes).await?;
        let taking = Taking { preview, building_level, replace };
        return buildings::take(&app, &level, taking, &reader, &headers, bytes).await;
    }
    if building_level.is_some() {
        let words = "`building_level` is of buildings (`application/yaml`).";
        return Err(ApiError::Query(words.to_owned()));
    }
    if let Some(format) = model_imports::format_of(&sent) {
        let bytes = body::read(request, app.parts.limits.upload_bytes).await?;
        let taking = model_imports::Taking { preview, replace };
        let read = move |frame, library: &WireLibrary| match format {
            ModelFormat::Jsonfg => jsonfg::read(&bytes, frame, library),
            ModelFormat::Geojson => {
                let dxf::Options { unit_m, wall_height_m, .. } = drawing;
                let options = geojson::Options { unit_m, wall_height_m };
                geojson::read(&bytes, frame, library, &options)
            }
            ModelFormat::Dxf => dxf::read(&bytes, frame, library, &drawing),
            ModelFormat::Glb => glb::read(&bytes, frame, library),
            ModelFormat::Nav2 => Err(FileFault::at("the file", "a map comes as a zip")),
        };
        return model_imports::take(&app, &level, taking, &reader, &headers, read).await;
    }
    if !sent.split(';').next().is_some_and(|essence| essence.trim().eq_ignore_ascii_case(ZIP)) {
        return Err(ApiError::NotZip);
    }
    let bytes: Bytes = body::read(request, app.parts.limits.upload_bytes).await?;
    if into == Target::Gdb {
        let taking = model_imports::Taking { preview, replace };
        let read = move |frame, library: &WireLibrary| {
            let unread = |error: ImportError| FileFault::at("the map", error.to_string());
            let package = Package::unzip(&bytes).map_err(unread)?;
            package.walls(frame, library).map(|(incoming, _)| incoming)
        };
        return model_imports::take(&app, &level, taking, &reader, &headers, read).await;
    }
    if replace {
        let words = "`replace` is of buildings and models.";
        return Err(ApiError::Query(words.to_owned()));
    }
    let _turn = app.exports.acquire().await.ok().ok_or(ApiError::Closing)?;
    let resolution_m = level.level.resolution_m();
    let (id, at_us) = (app.parts.chance.uuid(), app.now_us());
    let author = auth::granted_by(&level.caller).to_owned();
    let new = blocking(move || {
        let package = Package::unzip(&bytes).map_err(ApiError::Import)?;
        let import = package.import(resolution_m, trust).map_err(ApiError::Import)?;
        let tiles = import.prior.tiles.iter();
        let tiles = tiles.map(|(at, tile)| Ok((*at, NewImport::column(tile)?)));
        Ok(NewImport {
            id,
            digest: package.digest(trust),
            author,
            at_us,
            tiles: if preview { Vec::new() } else { tiles.collect::<Result<_, ApiError>>()? },
            report: Some(import.report),
        })
    })
    .await?;
    if preview {
        return reader.small(&new.report);
    }
    let made = level.level.import(&new).await?;
    let made = made.ok_or_else(|| ApiError::Internal("an import came to nothing".to_owned()))?;
    let all = route::of_level(route::IMPORTS, level.level.site(), level.level.level());
    created(&reader, Some(&all), &made)
}

/// The imports of a level, newest first, in pages. The first one is the prior, unless it has no
/// report: then it took the prior away.
#[utoipa::path(
    get, path = route::IMPORTS, operation_id = "list_imports", tag = "map",
    params(("site" = String, Path), ("level" = String, Path), PageQuery),
    responses((status = 200, body = ImportPage, description = "A page of imports"))
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
    reader.small(&app.store().import_page(site, name, before, limit).await?)
}

/// Takes the prior away: the level is then as if no map had been imported. An entry of the log of
/// its own. Needs `map:edit`.
#[utoipa::path(
    delete, path = route::IMPORTS, operation_id = "remove_import", tag = "map",
    params(("site" = String, Path), ("level" = String, Path)),
    responses(
        (status = 200, body = Import, description = "The removal, as the log has it"),
        (status = 404, description = "`prior_not_found`: there is none"),
    )
)]
pub(super) async fn remove(
    State(app): State<App>,
    level: LevelFor<Edit>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let new = NewImport {
        id: app.parts.chance.uuid(),
        digest: String::new(),
        author: auth::granted_by(&level.caller).to_owned(),
        at_us: app.now_us(),
        report: None,
        tiles: Vec::new(),
    };
    let removed = level.level.import(&new).await?;
    let name = || format!("{}/{}", level.level.site(), level.level.level());
    reader.small(&removed.ok_or_else(|| ApiError::not_found("prior", name()))?)
}
