//! The raster as Nav2's and ROS's `map_server` reads it: `map.yaml` and an 8 bit PGM.
//!
//! All layers are summed. The image covers the tiles that hold evidence, so its lower left corner
//! lies on the tile grid; yaw is 0, as most readers ignore it. `free_thresh` is 0.196 because the
//! grey 205 of an unknown cell reads as probability 0.19608, which must stay unknown
//! (Nav2's own saver writes the same).

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::io::{self, Write};

use mapfold_map::level::LevelMap;
use mapfold_map::raster::{LogOdds, SensorClass, TILE_SIDE, TileIndex, TileKey};

/// Name of the image, where nobody chose another.
pub const IMAGE_NAME: &str = "map.pgm";
/// Name of the description, where nobody chose another.
pub const YAML_NAME: &str = "map.yaml";
/// Most pixels of an image: 1.6 km by 1.6 km at 10 cm, and what readers still load.
pub const PIXELS_MAX: u64 = 16_384 * 16_384;

const OCCUPIED_THRESH: f64 = 0.65;
const FREE_THRESH: f64 = 0.196;
const FREE: u8 = 254;
const OCCUPIED: u8 = 0;
const UNKNOWN: u8 = 205;

/// Why a map has no image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Nav2Error {
    /// There is no evidence at all.
    #[error("the level holds no evidence yet, so there is nothing to draw")]
    Empty,
    /// The tiles lie too far apart for one image.
    #[error(
        "an image of {columns} by {rows} pixels is larger than the {PIXELS_MAX} that readers load"
    )]
    TooLarge {
        /// Pixels across.
        columns: u64,
        /// Pixels down.
        rows: u64,
    },
}

/// A map's raster, ready to be written.
#[derive(Debug)]
pub struct Nav2Map<'a> {
    map: &'a LevelMap,
    resolution: f64,
    lower_left: TileIndex,
    tile_columns: u32,
    tile_rows: u32,
}

impl<'a> Nav2Map<'a> {
    /// The raster of `map` with cells of `resolution` metres.
    ///
    /// # Errors
    /// A map without evidence, or one whose extent is too large for one image.
    pub fn new(map: &'a LevelMap, resolution: f64) -> Result<Self, Nav2Error> {
        let xs: BTreeSet<i32> = map.tiles.keys().map(|key| key.tile.x).collect();
        let ys: BTreeSet<i32> = map.tiles.keys().map(|key| key.tile.y).collect();
        let (Some(left), Some(right), Some(bottom), Some(top)) =
            (xs.first(), xs.last(), ys.first(), ys.last())
        else {
            return Err(Nav2Error::Empty);
        };
        let pixels = |from: i32, to: i32| (u64::from(from.abs_diff(to)) + 1) * TILE_SIDE as u64;
        let (columns, rows) = (pixels(*left, *right), pixels(*bottom, *top));
        if columns.saturating_mul(rows) > PIXELS_MAX {
            return Err(Nav2Error::TooLarge { columns, rows });
        }
        Ok(Self {
            map,
            resolution,
            lower_left: TileIndex { x: *left, y: *bottom },
            tile_columns: left.abs_diff(*right) + 1,
            tile_rows: bottom.abs_diff(*top) + 1,
        })
    }

    /// The description that readers load first, of the image that lies beside it as `image`.
    pub fn yaml(&self, image: &str) -> String {
        let origin = |tiles: i32| (i64::from(tiles) * TILE_SIDE as i64) as f64 * self.resolution;
        let (x, y) = (origin(self.lower_left.x), origin(self.lower_left.y));
        let mut yaml = String::new();
        // Writing to a String cannot fail.
        let _ = write!(
            yaml,
            "image: {}\nmode: trinary\nresolution: {}\norigin: [{x:?}, {y:?}, 0.0]\n\
             negate: 0\noccupied_thresh: {OCCUPIED_THRESH}\nfree_thresh: {FREE_THRESH}\n",
            scalar(image),
            self.resolution
        );
        yaml
    }

    /// Writes the image: binary PGM, the topmost row of cells first.
    ///
    /// # Errors
    /// What `to` cannot take.
    pub fn write_pgm(&self, to: &mut impl Write) -> io::Result<()> {
        let columns = self.tile_columns as usize * TILE_SIDE;
        let rows = self.tile_rows as usize * TILE_SIDE;
        write!(to, "P5\n{columns} {rows}\n255\n")?;
        let grey = Grey::new();
        let mut sums = vec![0_i64; columns * TILE_SIDE];
        let mut line = vec![UNKNOWN; columns];
        for tile_row in (0..self.tile_rows).rev() {
            self.sum_tile_row(tile_row, columns, &mut sums);
            for row in sums.chunks_exact(columns).rev() {
                for (pixel, sum) in line.iter_mut().zip(row) {
                    *pixel = grey.of(*sum);
                }
                to.write_all(&line)?;
            }
        }
        Ok(())
    }

    /// Sums all layers of one row of tiles, row by row of cells from below.
    fn sum_tile_row(&self, tile_row: u32, columns: usize, sums: &mut [i64]) {
        sums.fill(0);
        let y = self.lower_left.y.wrapping_add_unsigned(tile_row);
        for tile_column in 0..self.tile_columns {
            let x = self.lower_left.x.wrapping_add_unsigned(tile_column);
            for class in SensorClass::ALL {
                let key = TileKey { class, tile: TileIndex { x, y } };
                let Some(tile) = self.map.tiles.get(&key) else { continue };
                let left = tile_column as usize * TILE_SIDE;
                for (row, cells) in tile.cells().chunks_exact(TILE_SIDE).enumerate() {
                    let start = row * columns + left;
                    for (sum, cell) in sums[start..start + TILE_SIDE].iter_mut().zip(cells) {
                        *sum += i64::from(*cell);
                    }
                }
            }
        }
    }
}

/// A string as YAML: plain where nothing in it means more than itself, else between quotes (as in
/// JSON, which YAML contains).
fn scalar(text: &str) -> Cow<'_, str> {
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    if text.starts_with(|c: char| c.is_ascii_alphabetic()) && text.chars().all(plain) {
        Cow::Borrowed(text)
    } else {
        Cow::Owned(serde_json::Value::from(text).to_string())
    }
}

/// The greys of evidence: thresholds in log-odds steps, so that no cell needs an exponential.
struct Grey {
    occupied_from: i64,
    free_to: i64,
}

impl Grey {
    fn new() -> Self {
        let steps = |p: f64| (p / (1.0 - p)).ln() * LogOdds::STEPS_PER_NAT;
        Self {
            occupied_from: steps(OCCUPIED_THRESH).ceil() as i64,
            free_to: steps(FREE_THRESH).floor() as i64,
        }
    }

    fn of(&self, sum: i64) -> u8 {
        if sum >= self.occupied_from {
            OCCUPIED
        } else if sum <= self.free_to {
            FREE
        } else {
            UNKNOWN
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use mapfold_map::raster::{TILE_CELLS, Tile};

    use super::*;

    /// A layer, a place, and the evidence of some cells.
    type Cells<'a> = (SensorClass, i32, i32, &'a [(usize, i32)]);

    fn map_of(tiles: &[Cells]) -> LevelMap {
        let mut map = LevelMap::default();
        for (class, x, y, values) in tiles {
            let mut cells = Box::new([0; TILE_CELLS]);
            for (offset, value) in *values {
                cells[*offset] = *value;
            }
            let key = TileKey { class: *class, tile: TileIndex { x: *x, y: *y } };
            map.tiles.insert(key, Arc::new(Tile::new(cells)));
        }
        map
    }

    #[test]
    fn greys_change_exactly_at_the_thresholds_that_the_yaml_names() {
        let grey = Grey::new();
        for steps in -600..=600 {
            let p = LogOdds(steps).probability();
            let expected = if p >= OCCUPIED_THRESH {
                OCCUPIED
            } else if p <= FREE_THRESH {
                FREE
            } else {
                UNKNOWN
            };
            assert_eq!(grey.of(i64::from(steps)), expected, "at {steps} steps, p = {p}");
        }
    }

    #[test]
    fn an_unknown_pixel_stays_unknown_when_it_is_read_back() {
        let p = 1.0 - f64::from(UNKNOWN) / 255.0;
        assert!(p > FREE_THRESH && p < OCCUPIED_THRESH);
    }

    #[test]
    fn rows_are_flipped_and_layers_summed() {
        // Lower left cell: 40 + 40 steps is occupied together, but neither alone.
        let map = map_of(&[
            (SensorClass::Scanner, -1, 0, &[(0, 40), (TILE_CELLS - 1, -300)]),
            (SensorClass::Sonar, -1, 0, &[(0, 40)]),
        ]);
        let nav2 = Nav2Map::new(&map, 0.05).unwrap();
        assert!(nav2.yaml(IMAGE_NAME).contains("origin: [-3.2, 0.0, 0.0]\n"));
        let mut image = Vec::new();
        nav2.write_pgm(&mut image).unwrap();
        let pixels = image.strip_prefix(b"P5\n64 64\n255\n").unwrap();
        assert_eq!(pixels.len(), TILE_CELLS);
        assert_eq!(pixels[63], FREE, "the last cell of the tile is the top right pixel");
        assert_eq!(pixels[63 * 64], OCCUPIED, "the first cell is the bottom left pixel");
        let known: Vec<&u8> = pixels.iter().filter(|p| **p != UNKNOWN).collect();
        assert_eq!(known.len(), 2);
    }

    #[test]
    fn a_name_that_means_something_in_yaml_stands_between_quotes() {
        let map = map_of(&[(SensorClass::Scanner, 0, 0, &[(0, 100)])]);
        let nav2 = Nav2Map::new(&map, 0.05).unwrap();
        for (name, line) in [
            ("floor-2.pgm", "image: floor-2.pgm\n"),
            ("2.pgm", "image: \"2.pgm\"\n"),
            ("a: #1 \"x\".pgm", "image: \"a: #1 \\\"x\\\".pgm\"\n"),
        ] {
            assert!(nav2.yaml(name).starts_with(line), "{}", nav2.yaml(name));
        }
    }

    #[test]
    fn a_level_without_evidence_or_with_tiles_a_world_apart_is_refused() {
        assert_eq!(Nav2Map::new(&LevelMap::default(), 0.05).unwrap_err(), Nav2Error::Empty);
        let far = map_of(&[
            (SensorClass::Scanner, i32::MIN, 0, &[(0, 100)]),
            (SensorClass::Scanner, i32::MAX, i32::MAX, &[(0, 100)]),
        ]);
        assert!(matches!(Nav2Map::new(&far, 0.05), Err(Nav2Error::TooLarge { .. })));
    }
}
