//! `L/exports/{format}`: the whole map in the format of another program.

use std::io::{self, Cursor, Write};

use axum::extract::{Path, State};
use axum::http::HeaderValue;
use axum::http::header::CONTENT_DISPOSITION;
use axum::response::Response;
use mapfold_schema::geojson;
use mapfold_schema::route;
use mapfold_schema::v1::{Bounds, GdbDocument};
use serde::Deserialize;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::access::{LevelFor, Read};
use super::answer::Reader;
use super::gdb::StateName;
use super::model_exports::{self, Content as Shown, Format};
use super::plan::height;
use super::problem::ApiError;
use super::query::{QueryOf, bbox};
use super::state::App;
use super::tiles::LayerName;
use crate::exchange::nav2::{self, Content, ImageFormat, Mode, Nav2Map, Style};
use crate::level::Snapshot;

/// Media type of a zip.
pub(super) const ZIP: &str = "application/zip";

/// How greys of a nav2 image stand for occupancy.
#[derive(Debug, Clone, Copy, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
enum ModeName {
    /// Occupied, free or unknown.
    Trinary,
    /// As many greys as there are; transparent where nothing is known.
    Scale,
    /// The grey is the occupancy in per cent; 255 where nothing is known.
    Raw,
}

/// How a nav2 image is written.
#[derive(Debug, Clone, Copy, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
enum ImageName {
    Pgm,
    Png,
}

/// What is written, and how. What a format does not know is refused.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct ExportQuery {
    /// `nav2`: `trinary` (the default), `scale` or `raw`.
    #[param(inline)]
    mode: Option<ModeName>,
    /// `nav2`: `pgm` or `png`; `png` for mode scale and `pgm` for the others if absent.
    #[param(inline)]
    image: Option<ImageName>,
    /// `nav2`: `all` (together, the default), `scanner`, `sonar`, `prior` or `walls`.
    #[param(inline)]
    layer: Option<LayerName>,
    /// `nav2`: only the cells that touch this rectangle, `min_x,min_y,max_x,max_y` in metres.
    #[serde(default, deserialize_with = "bbox")]
    #[param(value_type = Option<String>)]
    bbox: Option<Bounds>,
    /// `geojson`: `map` (what robots saw, the default), `gdb` (the plan of the a-priori model, and its landmarks) or `all`.
    #[param(inline)]
    of: Option<Shown>,
    /// `jsonfg`, `dxf`, `glb`, and `geojson` of the model: `draft` (if absent) or `published`.
    #[param(inline)]
    state: Option<StateName>,
    /// `geojson` of the model: the height that it is cut at; 0.3 if absent.
    height_m: Option<f64>,
}

impl ExportQuery {
    fn is_of_nav2(&self) -> bool {
        !matches!(self, Self { mode: None, image: None, layer: None, bbox: None, .. })
    }

    /// Whether nothing is asked that this format does not know.
    fn fits(&self, format: FormatName) -> bool {
        let of_model = self.state.is_some() || self.height_m.is_some();
        match format {
            FormatName::Nav2 => self.of.is_none() && !of_model,
            FormatName::Model(_) => {
                !self.is_of_nav2() && self.of.is_none() && self.height_m.is_none()
            }
            FormatName::Geojson => {
                let is_map = self.of.unwrap_or_default() == Shown::Map;
                !(self.is_of_nav2() || is_map && of_model)
            }
        }
    }

    fn content(&self) -> Content {
        Content { layer: self.layer.unwrap_or_default().into(), bbox: self.bbox }
    }

    fn style(&self) -> Result<Style, ApiError> {
        let mode = self.mode.map_or(Mode::Trinary, |mode| match mode {
            ModeName::Trinary => Mode::Trinary,
            ModeName::Scale => Mode::Scale,
            ModeName::Raw => Mode::Raw,
        });
        let format = self.image.map(|image| match image {
            ImageName::Pgm => ImageFormat::Pgm,
            ImageName::Png => ImageFormat::Png,
        });
        Style::new(mode, format).map_err(ApiError::Nav2)
    }
}

/// A format that can be asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum FormatName {
    Geojson,
    Nav2,
    Model(Format),
}

/// The whole map as a file: `geojson`, or `nav2` (a zip of `map.yaml` and `map.pgm` or `map.png`). Or the a-priori
/// model: `jsonfg` (all of it, with the prototypes that it uses; `imports` takes it back without loss) or `dxf` (solids as
/// outlines with a height or as faces, on a layer for each kind, prototypes as blocks) or `glb` (in three dimensions, as `gdb.glb`).
///
/// Equal maps give equal bytes. GeoJSON has a `LineString` for each solid part of a segment (with
/// the feature id `<segment id>#<n>`), a `Polygon` for each cluster and the one or the other for each
/// chain, in metres of the level; of the model, the outlines (`Polygon`), sheets and openings (`LineString`) that a sensor
/// at a height would see, and the landmarks there (`Point`). A nav2 map can be had in every mode of `map_server`, of each layer,
/// and of a rectangle; its yaw is 0, and its numbers are written in full.
#[utoipa::path(
    get, path = route::EXPORTS, operation_id = "export", tag = "map",
    params(
        ("site" = String, Path), ("level" = String, Path),
        ("format" = String, Path, description = "`geojson`, `nav2`, `jsonfg`, `dxf` or `glb`"),
        ExportQuery,
    ),
    responses(
        (status = 200, description = "The file", content((Object = "application/geo+json"), (GdbDocument = "application/fg+json"), (Vec<u8> = "application/zip"), (Vec<u8> = "image/vnd.dxf"), (Vec<u8> = "model/gltf-binary"))),
        (status = 404, description = "`format_not_found`"),
        (status = 409, description = "`map_empty`, `map_too_large`: there is no image of this map, or not of all of it"),
    )
)]
pub(super) async fn read(
    State(app): State<App>,
    level: LevelFor<Read>,
    Path((site, name, format)): Path<(String, String, String)>,
    QueryOf(query): QueryOf<ExportQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let asked = match format.as_str() {
        "geojson" => FormatName::Geojson,
        "nav2" => FormatName::Nav2,
        "jsonfg" => FormatName::Model(Format::Jsonfg),
        "dxf" => FormatName::Model(Format::Dxf),
        "glb" => FormatName::Model(Format::Glb),
        _ => return Err(ApiError::not_found("format", format)),
    };
    if !query.fits(asked) {
        return Err(ApiError::Query(format!("{format} does not take all of these.")));
    }
    let (mut response, extension) = match asked {
        FormatName::Model(format) => {
            let state = query.state.unwrap_or_default();
            let response = model_exports::whole(&app, &level, format, state, &reader).await?;
            (response, format.extension())
        }
        FormatName::Geojson if query.of.unwrap_or_default() != Shown::Map => {
            reader.choose(&[geojson::MEDIA_TYPE])?;
            let _turn = app.exports.acquire().await.ok().ok_or(ApiError::Closing)?;
            let height_m = height(query.height_m)?;
            let snapshot = (query.of == Some(Shown::All)).then(|| level.level.snapshot());
            let state = query.state.unwrap_or_default();
            let response =
                model_exports::features(&level, state, height_m, snapshot, &reader).await?;
            (response, "geojson")
        }
        FormatName::Geojson => {
            let media_type = reader.choose(&[geojson::MEDIA_TYPE])?;
            (of_map(&app, &level, media_type, &reader, write_geojson).await?, "geojson")
        }
        FormatName::Nav2 => {
            let (content, style) = (query.content(), query.style()?);
            let media_type = reader.choose(&[ZIP])?;
            let write = move |snapshot: &Snapshot| write_nav2(snapshot, content, style);
            (of_map(&app, &level, media_type, &reader, write).await?, "zip")
        }
    };
    let name = format!("attachment; filename=\"{site}-{name}.{extension}\"");
    if let Ok(name) = HeaderValue::from_str(&name) {
        response.headers_mut().insert(CONTENT_DISPOSITION, name);
    }
    Ok(response)
}

/// A file of what robots saw.
async fn of_map(
    app: &App,
    level: &LevelFor<Read>,
    media_type: &'static str,
    reader: &Reader,
    write: impl FnOnce(&Snapshot) -> Result<Vec<u8>, ApiError> + Send + 'static,
) -> Result<Response, ApiError> {
    let _turn = app.exports.acquire().await.ok().ok_or(ApiError::Closing)?;
    let snapshot = level.level.snapshot();
    let (frame, revision) = (level.level.frame(), snapshot.folded_revision());
    reader.file_of(frame, &[revision], revision, media_type, move || write(&snapshot)).await
}

fn write_geojson(snapshot: &Snapshot) -> Result<Vec<u8>, ApiError> {
    let mut bytes = Vec::new();
    geojson::write_map(&snapshot.map(), &mut bytes).map_err(|error| failed(&error))?;
    Ok(bytes)
}

fn write_nav2(snapshot: &Snapshot, content: Content, style: Style) -> Result<Vec<u8>, ApiError> {
    let nav2 = Nav2Map::new(snapshot, snapshot.resolution_m(), content, style);
    let nav2 = nav2.map_err(ApiError::Nav2)?;
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    // No times: the same map gives the same bytes.
    let options = SimpleFileOptions::default().last_modified_time(zip::DateTime::default());
    let zipped = |error: zip::result::ZipError| ApiError::Internal(error.to_string());
    let image = format!("map.{}", nav2.format().extension());
    zip.start_file(nav2::YAML_NAME, options).map_err(zipped)?;
    let yaml = nav2.description(&image).to_string();
    zip.write_all(yaml.as_bytes()).map_err(|error| failed(&error))?;
    zip.start_file(image, options).map_err(zipped)?;
    nav2.write_image(&mut zip).map_err(|error| failed(&error))?;
    Ok(zip.finish().map_err(zipped)?.into_inner())
}

fn failed(error: &io::Error) -> ApiError {
    ApiError::Internal(error.to_string())
}
