//! A picture pyramid of the raster: 256 by 256 pixels a picture, on a grid that never moves.
//!
//! Zoom level [`ZOOM_NATIVE`] shows one cell as one pixel, each lower level halves that, the two
//! above magnify without smoothing: `resolution(z) = resolution_m * 2^(6 - z)` metres a pixel.
//! The grid's origin is the level's: `col = floor(x / (256 * resolution))`,
//! `row = floor(-y / (256 * resolution))`. Rows grow downwards: row 0 lies just below the x axis,
//! row -1 just above it. Both may be negative.
//!
//! The colours keep their order of brightness in any colour vision: what was never seen is
//! transparent, free space very light, obstacles dark; what only sonar speaks of has a hue of its
//! own (orange against blue), and what only the prior does has none (grey).
//!
//! Up to `ZOOM_COARSE` a picture is made of the four below it, which are kept: one that shows a
//! hundred thousand tiles costs what has changed in it, not what is in it; and all of them can be drawn
//! before anybody asks ([`PictureCache::draw_ahead`]).

mod cache;
mod pyramid;
mod shades;

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::sync::Arc;

use mapfold_map::raster::{TILE_SIDE, Tile, TileIndex};

use super::layers::{Dated, Layer, LayerId, Raster};

pub use cache::{Picture, PictureCache};
pub use shades::{Shades, Shading};

/// Pixels along a picture's side.
pub const PICTURE_SIDE: usize = 256;
/// Pixels of a picture.
const PICTURE_PIXELS: usize = PICTURE_SIDE * PICTURE_SIDE;
/// The zoom level at which one cell is one pixel.
pub const ZOOM_NATIVE: u8 = 6;
/// The highest zoom level.
pub const ZOOM_MAX: u8 = 8;
/// The highest zoom level whose pictures are parts of coarser ones, and kept for them.
const ZOOM_COARSE: u8 = 4;

/// A place in the pyramid.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Address {
    z: u8,
    row: i32,
    col: i32,
}

/// The tiles of one place: its layers that are shown, in the canonical order.
pub type Layers<'a> = Vec<(LayerId, &'a Arc<Tile>)>;

impl Address {
    /// The picture at zoom level `z`; `None` beyond [`ZOOM_MAX`].
    pub fn new(z: u8, row: i32, col: i32) -> Option<Self> {
        (z <= ZOOM_MAX).then_some(Self { z, row, col })
    }

    /// The picture at zoom level `z` that shows a map tile; `None` if it has no number.
    fn showing(z: u8, tile: TileIndex) -> Option<Self> {
        let along = 1 << (ZOOM_MAX - z);
        let row = i32::try_from(-i64::from(tile.y.div_euclid(along)) - 1).ok()?;
        Some(Self { z, row, col: tile.x.div_euclid(along) })
    }

    /// The picture of the next coarser zoom level that shows the same; `None` for the coarsest.
    fn whole(self) -> Option<Self> {
        let z = self.z.checked_sub(1)?;
        Some(Self { z, row: self.row.div_euclid(2), col: self.col.div_euclid(2) })
    }

    /// The four pictures of the next zoom level that show the same: those above first, from left
    /// to right. `None` for those without a number.
    fn parts(self) -> [Option<Self>; 4] {
        [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(down, across)| {
            let row = self.row.checked_mul(2)?.checked_add(down)?;
            let col = self.col.checked_mul(2)?.checked_add(across)?;
            Some(Self { z: self.z + 1, row, col })
        })
    }

    /// Map tiles along the picture's side: 256 at zoom level 0, 1 at 8.
    fn tiles_along(self) -> i64 {
        1 << (ZOOM_MAX - self.z)
    }

    /// The map tiles across and up that the picture shows; `None` where no tile can be.
    fn tiles(self) -> Option<(RangeInclusive<i32>, RangeInclusive<i32>)> {
        let along = self.tiles_along();
        let span = |first: i64| {
            let first_tile = i32::try_from(first).ok()?;
            let last_tile = i32::try_from(first + along - 1).ok()?;
            Some(first_tile..=last_tile)
        };
        Some((span(i64::from(self.col) * along)?, span((-i64::from(self.row) - 1) * along)?))
    }

    /// What a raster holds of `layer` in this picture. Costs a search per column of map tiles,
    /// however large the map.
    pub fn select(self, raster: &impl Raster, layer: Layer) -> BTreeMap<TileIndex, Layers<'_>> {
        let mut found: BTreeMap<TileIndex, Layers> = BTreeMap::new();
        let Some((xs, ys)) = self.tiles() else { return found };
        for part in layer.parts() {
            for x in xs.clone() {
                let tile = |y: i32| TileIndex { x, y };
                for (at, tile) in raster.between(part, tile(*ys.start()), tile(*ys.end())) {
                    found.entry(at).or_default().push((part, tile));
                }
            }
        }
        found
    }

    /// The picture's pixels from the shades of its tiles.
    fn pixels<'a>(self, tiles: impl IntoIterator<Item = (TileIndex, &'a Shades)>) -> Vec<u8> {
        let side = self.block().min(TILE_SIDE);
        let mut pixels = vec![0; PICTURE_PIXELS];
        let tiles = tiles.into_iter().map(|(tile, shades)| (tile, shades.at_side(side)));
        self.paste_all(&mut pixels, tiles);
        pixels
    }

    /// Pixels along a tile's side in this picture.
    fn block(self) -> usize {
        PICTURE_SIDE >> (ZOOM_MAX - self.z)
    }

    /// Puts tiles into the picture's pixels, at the size that they have in it (or as cells).
    fn paste_all<T: AsRef<[u8]>>(
        self,
        pixels: &mut [u8],
        tiles: impl IntoIterator<Item = (TileIndex, T)>,
    ) {
        let block = self.block();
        if let Some((xs, ys)) = self.tiles() {
            for (tile, shades) in tiles {
                if xs.contains(&tile.x) && ys.contains(&tile.y) {
                    let left = tile.x.abs_diff(*xs.start()) as usize * block;
                    let top = ys.end().abs_diff(tile.y) as usize * block;
                    paste(pixels, left, top, block, shades.as_ref());
                }
            }
        }
    }
}

/// Copies a tile into a block of the picture, upside down as a picture's rows run downwards.
fn paste(pixels: &mut [u8], left: usize, top: usize, block: usize, shades: &[u8]) {
    let side = block.min(TILE_SIDE);
    let magnified = block / side;
    for down in 0..block {
        let row = side - 1 - down / magnified;
        let start = (top + down) * PICTURE_SIDE + left;
        for (across, pixel) in pixels[start..start + block].iter_mut().enumerate() {
            *pixel = shades[row * side + across / magnified];
        }
    }
}

#[cfg(test)]
mod tests;
