//! `L/raster`: which tiles changed, and one tile's evidence.

use axum::extract::Path;
use axum::response::Response;
use mapfold_map::raster::TileIndex;
use mapfold_schema::v1::{RasterChanges, SensorClass};
use mapfold_schema::{codec, route};
use serde::Deserialize;

use super::access::{LevelFor, Read};
use super::answer::{DATA, Reader, Tag};
use super::problem::ApiError;
use super::query::{QueryOf, SinceInBox};
use super::tiles::LayerName;
use crate::exchange::layers::{Layer, LayerId, layered_at};
use crate::store::tile_cells;

const BINARY: &str = "application/octet-stream";

/// Which tiles changed after `since`, of all layers.
#[utoipa::path(
    get, path = route::RASTER, operation_id = "read_raster_changes", tag = "map",
    params(("site" = String, Path), ("level" = String, Path), SinceInBox),
    responses(
        (status = 200, description = "The tiles that have changed since", content(
            (RasterChanges = "application/json"),
            (RasterChanges = "application/cbor"),
        )),
        (status = 410, description = "`cursor_expired`: `since` is ahead of the log; read from 0"),
    )
)]
pub(super) async fn changes(
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<SinceInBox>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let media_type = reader.choose(DATA)?;
    let snapshot = level.snapshot_since(query.since).await?;
    let revision = snapshot.folded_revision();
    let write = move || {
        let changes = snapshot.raster_since(query.since, query.bbox.as_ref())?;
        Ok(codec::encode(media_type, &changes)?)
    };
    reader.data(revision, media_type, write).await
}

/// Which layer of a tile is asked for.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct TileQuery {
    /// The class of sensors; those of robots together, without prior and walls, if neither this nor `layer` is there.
    #[param(inline)]
    sensor: Option<SensorClass>,
    /// Instead of `sensor`: `scanner`, `sonar`, `prior`, `walls`, or `all`, these together.
    #[param(inline)]
    layer: Option<LayerName>,
}

/// One tile's evidence: 64 x 64 cells, row by row from below, each a little-endian `i32` of
/// log-odds in 0.01 nat, not clamped. A tile without evidence is not found. Layers together are their
/// sum, but that sonar counts three tenths of itself in cells of which scanners say anything, and that
/// cells that a confirmed wall passes through read no less than it says (2 nat).
#[utoipa::path(
    get, path = route::RASTER_TILE, operation_id = "read_raster_tile", tag = "map",
    params(
        ("site" = String, Path), ("level" = String, Path),
        ("x" = i32, Path, description = "Tiles to the right of the level's origin"),
        ("y" = i32, Path, description = "Tiles up from the level's origin"),
        TileQuery,
    ),
    responses(
        (status = 200, content_type = "application/octet-stream", body = [u8], description = "The cells of the tile"),
        (status = 404, description = "`tile_not_found`: no evidence there"),
    )
)]
pub(super) async fn tile(
    level: LevelFor<Read>,
    Path((_, _, x, y)): Path<(String, String, String, String)>,
    QueryOf(query): QueryOf<TileQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let media_type = reader.choose(&[BINARY])?;
    let parts: Vec<LayerId> = match (query.sensor, query.layer) {
        (Some(_), Some(_)) => {
            return Err(ApiError::Query("`sensor` and `layer` exclude each other.".to_owned()));
        }
        (Some(sensor), None) => vec![LayerId::Sensor(sensor.into())],
        (None, layer) => parts(layer),
    };
    let missing = || ApiError::not_found("tile", format!("{x}/{y}"));
    let (Ok(x_index), Ok(y_index)) = (x.parse(), y.parse()) else { return Err(missing()) };
    let tile = TileIndex { x: x_index, y: y_index };
    let snapshot = level.level.snapshot();
    let read = layered_at(&*snapshot, tile, parts).together().ok_or_else(missing)?;
    let bytes = tile_cells::bytes(&read);
    let tag = Tag::of_bytes(&bytes);
    Ok(reader.bytes(media_type, &tag, || bytes))
}

/// The layers that are read together: those of robots, if none is named.
pub(super) fn parts(layer: Option<LayerName>) -> Vec<LayerId> {
    match layer {
        Some(layer) => Layer::from(layer).parts().collect(),
        None => Layer::All.parts().filter(|part| matches!(part, LayerId::Sensor(_))).collect(),
    }
}
