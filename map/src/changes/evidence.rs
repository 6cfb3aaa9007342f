//! What scanners say of places.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::geometry::Point;
use crate::raster::{Cell, LogOdds, SensorClass, Tile, TileIndex, TileKey};

/// The scanners' layer, read place by place.
#[derive(Debug)]
pub(super) struct Scanned<'a> {
    tiles: &'a BTreeMap<TileKey, Arc<Tile>>,
    resolution: f64,
    /// The tile that was read last: the next place mostly lies in it.
    last: Option<(TileIndex, Option<&'a Tile>)>,
}

impl<'a> Scanned<'a> {
    pub(super) fn new(tiles: &'a BTreeMap<TileKey, Arc<Tile>>, resolution: f64) -> Self {
        Self { tiles, resolution, last: None }
    }

    /// The evidence of the cell that holds `p`; 0 where no scanner looked.
    pub(super) fn at(&mut self, p: &Point) -> LogOdds {
        let (index, offset) = Cell::holding(p, self.resolution).tile();
        let tile = match self.last {
            Some((at, tile)) if at == index => tile,
            _ => {
                let key = TileKey { class: SensorClass::Scanner, tile: index };
                let tile = self.tiles.get(&key).map(|tile| &**tile);
                self.last = Some((index, tile));
                tile
            }
        };
        LogOdds(tile.map_or(0, |tile| tile.cells()[offset]))
    }
}
