//! `L/exports/{format}`: the whole map in the format of another program.

use std::io::{self, Cursor, Write};

use axum::extract::{Path, State};
use axum::http::HeaderValue;
use axum::http::header::CONTENT_DISPOSITION;
use axum::response::Response;
use mapfold_schema::geojson;
use mapfold_schema::route;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::access::{LevelFor, Read};
use super::answer::Reader;
use super::problem::ApiError;
use super::state::App;
use crate::exchange::nav2;
use crate::level::Snapshot;

/// Media type of a zip.
pub(super) const ZIP: &str = "application/zip";

type Writer = fn(&Snapshot) -> Result<Vec<u8>, ApiError>;

/// The whole map as a file: `geojson`, or `nav2` (a zip of `map.yaml` and `map.pgm`).
///
/// Equal maps give equal bytes. GeoJSON has a `LineString` for each solid part of a segment (with
/// the feature id `<segment id>#<n>`), a `Polygon` for each cluster and the one or the other for each
/// chain, in metres of the level.
#[utoipa::path(
    get, path = route::EXPORTS, operation_id = "export", tag = "map",
    params(
        ("site" = String, Path), ("level" = String, Path),
        ("format" = String, Path, description = "`geojson` or `nav2`"),
    ),
    responses(
        (status = 200, description = "The file", content((Object = "application/geo+json"), (Vec<u8> = "application/zip"))),
        (status = 404, description = "`format_not_found`"),
        (status = 409, description = "`map_empty`, `map_too_large`: there is no image of this map"),
    )
)]
pub(super) async fn read(
    State(app): State<App>,
    level: LevelFor<Read>,
    Path((site, name, format)): Path<(String, String, String)>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let (media_type, extension, write): (_, _, Writer) = match format.as_str() {
        "geojson" => (geojson::MEDIA_TYPE, "geojson", write_geojson),
        "nav2" => (ZIP, "zip", write_nav2),
        _ => return Err(ApiError::not_found("format", format)),
    };
    let media_type = reader.choose(&[media_type])?;
    let _turn = app.exports.acquire().await.ok().ok_or(ApiError::Closing)?;
    let snapshot = level.level.snapshot();
    let (frame, revision) = (level.level.frame(), snapshot.folded_revision());
    let mut response = reader.file(frame, revision, media_type, move || write(&snapshot)).await?;
    let name = format!("attachment; filename=\"{site}-{name}.{extension}\"");
    if let Ok(name) = HeaderValue::from_str(&name) {
        response.headers_mut().insert(CONTENT_DISPOSITION, name);
    }
    Ok(response)
}

fn write_geojson(snapshot: &Snapshot) -> Result<Vec<u8>, ApiError> {
    let mut bytes = Vec::new();
    geojson::write_map(&snapshot.map(), &mut bytes).map_err(|error| failed(&error))?;
    Ok(bytes)
}

fn write_nav2(snapshot: &Snapshot) -> Result<Vec<u8>, ApiError> {
    let map = snapshot.map();
    let nav2 = nav2::Nav2Map::new(&map, snapshot.resolution_m()).map_err(ApiError::Nav2)?;
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    // No times: the same map gives the same bytes.
    let options = SimpleFileOptions::default().last_modified_time(zip::DateTime::default());
    let zipped = |error: zip::result::ZipError| ApiError::Internal(error.to_string());
    zip.start_file(nav2::YAML_NAME, options).map_err(zipped)?;
    zip.write_all(nav2.yaml(nav2::IMAGE_NAME).as_bytes()).map_err(|error| failed(&error))?;
    zip.start_file(nav2::IMAGE_NAME, options).map_err(zipped)?;
    nav2.write_pgm(&mut zip).map_err(|error| failed(&error))?;
    Ok(zip.finish().map_err(zipped)?.into_inner())
}

fn failed(error: &io::Error) -> ApiError {
    ApiError::Internal(error.to_string())
}
