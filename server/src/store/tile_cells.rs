//! The column that holds a tile: zstd of its 64 x 64 sums as little-endian 32-bit integers.

use mapfold_map::raster::{TILE_CELLS, Tile};

use super::payload::PayloadError;

const ZSTD_LEVEL: i32 = 1;
const CELL_BYTES: usize = size_of::<i32>();

/// The cells of a tile: row by row from below, little-endian.
pub fn bytes(tile: &Tile) -> Vec<u8> {
    tile.cells().iter().flat_map(|cell| cell.to_le_bytes()).collect()
}

/// The column of a tile.
///
/// # Errors
/// No memory for it.
pub fn encode(tile: &Tile) -> Result<Vec<u8>, PayloadError> {
    zstd::bulk::compress(&bytes(tile), ZSTD_LEVEL).map_err(|e| PayloadError::Zstd(e.to_string()))
}

/// The tile of a column.
///
/// # Errors
/// A column that [`encode`] did not write.
pub fn decode(column: &[u8]) -> Result<Tile, PayloadError> {
    let bytes = zstd::bulk::decompress(column, TILE_CELLS * CELL_BYTES)
        .map_err(|e| PayloadError::Zstd(e.to_string()))?;
    let (cells, rest) = bytes.as_chunks::<CELL_BYTES>();
    if cells.len() != TILE_CELLS || !rest.is_empty() {
        return Err(PayloadError::Zstd(format!("{} bytes are no tile", bytes.len())));
    }
    let mut tile = Box::new([0; TILE_CELLS]);
    for (to, from) in tile.iter_mut().zip(cells) {
        *to = i32::from_le_bytes(*from);
    }
    Ok(Tile::new(tile))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tile_survives_its_column() {
        let mut cells = Box::new([0; TILE_CELLS]);
        cells[0] = i32::MIN;
        cells[77] = -1;
        cells[TILE_CELLS - 1] = i32::MAX;
        let tile = Tile::new(cells);
        assert_eq!(decode(&encode(&tile).unwrap()).unwrap(), tile);
    }

    #[test]
    fn a_spoilt_column_is_refused() {
        assert!(decode(b"not zstd").is_err());
        assert!(decode(&zstd::bulk::compress(&[1; 5], 1).unwrap()).is_err());
    }
}
