//! `L/raster/batch`: the evidence of many tiles in one answer.

use axum::response::Response;
use mapfold_map::raster::TileIndex;
use mapfold_schema::route;
use serde::{Deserialize, Deserializer};

use super::access::{LevelFor, Read};
use super::answer::Reader;
use super::problem::ApiError;
use super::query::QueryOf;
use super::raster::parts;
use super::tiles::LayerName;
use crate::exchange::layers::layered_at;
use crate::store::tile_cells;

/// Media type of a batch. Its tiles are packed already, so it is not packed again.
pub(super) const TILES: &str = "application/vnd.mapfold.tiles";
/// Most tiles of a batch: 4 MB unpacked.
const TILES_MAX: usize = 256;
/// What a batch begins with.
const MAGIC: [u8; 4] = *b"mft1";

/// Which tiles are asked for.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct BatchQuery {
    /// Places of tiles as `x,y,x,y,...`, at most 256.
    #[serde(deserialize_with = "places")]
    #[param(value_type = String)]
    tiles: Vec<TileIndex>,
    /// `scanner`, `sonar`, `prior`, `walls`, or `all`, these together; without prior and walls if absent.
    #[param(inline)]
    layer: Option<LayerName>,
}

fn places<'de, D: Deserializer<'de>>(from: D) -> Result<Vec<TileIndex>, D::Error> {
    let text = String::deserialize(from)?;
    parse(&text).ok_or_else(|| {
        let words = format!("tiles is x,y,x,y,... in whole numbers, of 1 to {TILES_MAX} tiles");
        serde::de::Error::custom(words)
    })
}

fn parse(text: &str) -> Option<Vec<TileIndex>> {
    let numbers: Vec<i32> =
        text.split(',').take(2 * TILES_MAX + 1).map(str::parse).collect::<Result<_, _>>().ok()?;
    let (pairs, rest) = numbers.as_chunks::<2>();
    let fits = rest.is_empty() && (1..=TILES_MAX).contains(&pairs.len());
    fits.then(|| pairs.iter().map(|[x, y]| TileIndex { x: *x, y: *y }).collect())
}

/// The evidence of up to 256 tiles, such as `L/raster` names them.
///
/// All numbers are little-endian: the bytes `mft1`, the count of tiles (`u32`), and for each tile in
/// the order of the request x (`i32`), y (`i32`), a length (`u32`) and so many bytes: zstd of its
/// 64 x 64 cells, row by row from below, each an `i32` of log-odds in 0.01 nat, not clamped. The
/// length is 0 where there is no evidence. Layers are read together as a single tile's are.
#[utoipa::path(
    get, path = route::RASTER_BATCH, operation_id = "read_raster_batch", tag = "map",
    params(("site" = String, Path), ("level" = String, Path), BatchQuery),
    responses((
        status = 200, content_type = "application/vnd.mapfold.tiles", body = [u8],
        description = "The cells of the tiles"
    ))
)]
pub(super) async fn read(
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<BatchQuery>,
    reader: Reader,
) -> Result<Response, ApiError> {
    let media_type = reader.choose(&[TILES])?;
    let snapshot = level.level.snapshot();
    let revision = snapshot.folded_revision();
    let write = move || {
        let parts = parts(query.layer);
        let mut batch = MAGIC.to_vec();
        batch.extend((query.tiles.len() as u32).to_le_bytes());
        for at in query.tiles {
            let read = layered_at(&*snapshot, at, parts.iter().copied()).together();
            let packed = read.map(|tile| tile_cells::encode(&tile));
            let packed = packed.transpose()?.unwrap_or_default();
            batch.extend(at.x.to_le_bytes());
            batch.extend(at.y.to_le_bytes());
            batch.extend((packed.len() as u32).to_le_bytes());
            batch.extend(packed);
        }
        Ok(batch)
    };
    reader.data(revision, media_type, write).await
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_pairs_of_whole_numbers_and_not_too_many() {
        let at = |x, y| TileIndex { x, y };
        assert_eq!(parse("1,-2,2147483647,0"), Some(vec![at(1, -2), at(i32::MAX, 0)]));
        let of = |count: usize| vec!["7"; count].join(",");
        assert_eq!(parse(&of(2 * TILES_MAX)).unwrap().len(), TILES_MAX);
        for bad in ["", "1", "1,2,3", "1,x", "1,2147483648", "1, 2", &of(2 * TILES_MAX + 2)] {
            assert_eq!(parse(bad), None, "{bad:?}");
        }
    }
}
