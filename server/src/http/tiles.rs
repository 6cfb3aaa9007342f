//! `L/tiles`: the picture pyramid.

use axum::extract::{Path, State};
use axum::response::Response;
use mapfold_map::raster::{TileIndex, TileKey};
use mapfold_schema::route;
use mapfold_schema::v1::SensorClass;
use serde::Deserialize;

use super::access::{LevelFor, Read};
use super::answer::{Reader, Tag, blocking};
use super::problem::ApiError;
use super::query::QueryOf;
use super::state::App;
use crate::exchange::layers::{Dated, Layer, LayerId, LayerTiles, Raster};
use crate::exchange::png_tiles::{self, Address};
use crate::level::Snapshot;

const PNG: &str = "image/png";

impl Raster for Snapshot {
    fn between(&self, layer: LayerId, first: TileIndex, last: TileIndex) -> LayerTiles<'_> {
        let class = match layer {
            LayerId::Sensor(class) => class,
            LayerId::Prior => {
                return Box::new(self.prior_between(first, last).map(|(at, tile)| (*at, tile)));
            }
            LayerId::Walls => {
                return Box::new(self.walls_between(first, last).map(|(at, tile)| (*at, tile)));
            }
        };
        let key = |tile| TileKey { class, tile };
        Box::new(self.tiles_between(key(first), key(last)).map(|(key, tile)| (key.tile, tile)))
    }
}

impl Dated for Snapshot {
    fn revision(&self) -> i64 {
        self.folded_revision()
    }

    fn changed_after(&self, since: i64) -> Box<dyn Iterator<Item = (LayerId, TileIndex)> + '_> {
        let seen = self.tiles_changed_after(since);
        let seen = seen.map(|key| (LayerId::Sensor(key.class), key.tile));
        let prior = self.prior_changed_after(since).map(|at| (LayerId::Prior, at));
        let walls = self.walls_changed_after(since).map(|at| (LayerId::Walls, at));
        Box::new(seen.chain(prior).chain(walls))
    }
}

/// Which evidence is asked for.
#[derive(Debug, Clone, Copy, Default, Deserialize, utoipa::ToSchema)]
#[serde(rename_all = "snake_case")]
pub(super) enum LayerName {
    /// All together.
    #[default]
    All,
    /// Scanners alone.
    Scanner,
    /// Sonars alone.
    Sonar,
    /// What was imported, alone.
    Prior,
    /// What confirmed walls say of the cells that they pass through, alone.
    Walls,
}

/// Which evidence a picture shows.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct PictureQuery {
    /// `all` (together, the default), `scanner`, `sonar`, `prior` or `walls`.
    #[serde(default)]
    #[param(inline)]
    layer: LayerName,
}

impl From<LayerName> for Layer {
    fn from(name: LayerName) -> Self {
        match name {
            LayerName::All => Self::All,
            LayerName::Scanner => Self::Only(LayerId::Sensor(SensorClass::Scanner.into())),
            LayerName::Sonar => Self::Only(LayerId::Sensor(SensorClass::Sonar.into())),
            LayerName::Prior => Self::Only(LayerId::Prior),
            LayerName::Walls => Self::Only(LayerId::Walls),
        }
    }
}

/// A picture of the raster: 256 x 256 pixels, PNG, on a grid that never moves.
///
/// `resolution(z) = resolution_m * 2^(6 - z)` metres a pixel, for z from 0 to 8: at z = 6 one cell
/// is one pixel, each lower z shows twice as much, 7 and 8 magnify without smoothing. The grid's
/// origin is the level's: `col = floor(x / (256 * resolution(z)))`,
/// `row = floor(-y / (256 * resolution(z)))`. Rows grow downwards: row 0 lies just below the x
/// axis, row -1 just above it; both numbers may be negative. (OpenLayers: a `TileGrid` with
/// `origin: [0, 0]` and these resolutions has exactly these z, row and col.)
///
/// What was never seen is transparent, free space very light, obstacles dark; what only sonar
/// speaks of is orange instead of blue. A lower z keeps obstacles of one cell visible. Where
/// nothing is known the picture is wholly transparent.
#[utoipa::path(
    get, path = format!("{}.png", route::TILES), operation_id = "read_picture", tag = "map",
    params(
        ("site" = String, Path), ("level" = String, Path),
        ("z" = u8, Path, maximum = 8), ("row" = i32, Path), ("col" = i32, Path),
        PictureQuery,
    ),
    responses((status = 200, content_type = "image/png", body = [u8], description = "The picture"))
)]
pub(super) async fn read(
    State(app): State<App>,
    level: LevelFor<Read>,
    Path((_, _, z, row, col)): Path<(String, String, String, String, String)>,
    QueryOf(query): QueryOf<PictureQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let media_type = reader.choose(&[PNG])?;
    let missing = || ApiError::not_found("picture", format!("{z}/{row}/{col}"));
    let address = address(&z, &row, &col).ok_or_else(missing)?;
    let (snapshot, frame) = (level.level.snapshot(), level.level.frame());
    let picture = blocking(move || {
        let layer = query.layer.into();
        app.pictures
            .picture(frame, snapshot.as_ref(), address, layer)
            .map_err(|error| ApiError::Internal(error.to_string()))
    })
    .await?;
    let tag = Tag::of_digest(&picture.digest);
    Ok(reader.bytes(media_type, &tag, || picture.png.clone()))
}

/// `{z}`, `{row}` and `{col}.png` of the path.
fn address(z: &str, row: &str, col: &str) -> Option<png_tiles::Address> {
    let col = col.strip_suffix(".png")?;
    Address::new(z.parse().ok()?, row.parse().ok()?, col.parse().ok()?)
}
