//! The layers of a level's raster, and where their tiles are: a map, or what a level publishes.

use std::sync::Arc;

use mapfold_map::level::LevelMap;
use mapfold_map::raster::{Layered, SensorClass, Tile, TileIndex, TileKey};

/// One layer of a level's raster.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum LayerId {
    /// What sensors of one class saw.
    Sensor(SensorClass),
    /// What was known before any robot came.
    Prior,
    /// What confirmed walls say of the cells that they pass through.
    Walls,
}

impl LayerId {
    /// All layers, in their canonical order.
    pub const ALL: [Self; 4] = [
        Self::Sensor(SensorClass::Scanner),
        Self::Sensor(SensorClass::Sonar),
        Self::Prior,
        Self::Walls,
    ];
}

/// Which evidence is asked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Layer {
    /// All layers together.
    All,
    /// One layer alone.
    Only(LayerId),
}

impl Layer {
    /// Whether a layer is among those that are asked for.
    pub fn shows(self, id: LayerId) -> bool {
        self == Self::All || self == Self::Only(id)
    }

    /// The layers that are read, in their canonical order.
    pub fn parts(self) -> impl Iterator<Item = LayerId> {
        LayerId::ALL.into_iter().filter(move |id| self.shows(*id))
    }
}

/// Tiles of a layer with their places, ascending.
pub type LayerTiles<'a> = Box<dyn Iterator<Item = (TileIndex, &'a Arc<Tile>)> + 'a>;

/// Where tiles are.
pub trait Raster {
    /// The tiles of a layer from `first` to `last`, in the order of [`TileIndex`].
    fn between(&self, layer: LayerId, first: TileIndex, last: TileIndex) -> LayerTiles<'_>;

    /// All tiles of a layer.
    fn tiles_of(&self, layer: LayerId) -> LayerTiles<'_> {
        let first = TileIndex { x: i32::MIN, y: i32::MIN };
        self.between(layer, first, TileIndex { x: i32::MAX, y: i32::MAX })
    }
}

/// A raster that can tell what has changed.
pub trait Dated: Raster {
    /// The revision that it shows.
    fn revision(&self) -> i64;

    /// Where something has changed after revision `since`, in no order; a place may come twice.
    fn changed_after(&self, since: i64) -> Box<dyn Iterator<Item = (LayerId, TileIndex)> + '_>;
}

/// The tiles of one place, to be read together.
pub fn layered<'a>(tiles: impl IntoIterator<Item = (LayerId, &'a Tile)>) -> Layered<'a> {
    let mut layered = Layered::default();
    for (layer, tile) in tiles {
        let place = match layer {
            LayerId::Sensor(SensorClass::Scanner) => &mut layered.scanner,
            LayerId::Sensor(SensorClass::Sonar) => &mut layered.sonar,
            LayerId::Prior => &mut layered.prior,
            LayerId::Walls => &mut layered.walls,
        };
        *place = Some(tile);
    }
    layered
}

/// What a raster holds of some layers in one place, to be read together.
pub fn layered_at(
    raster: &(impl Raster + ?Sized),
    at: TileIndex,
    parts: impl IntoIterator<Item = LayerId>,
) -> Layered<'_> {
    let tile = |part| raster.between(part, at, at).next().map(|(_, tile)| (part, tile.as_ref()));
    layered(parts.into_iter().filter_map(tile))
}

/// What robots saw, and the prior; walls a map holds as segments.
impl Raster for LevelMap {
    fn between(&self, layer: LayerId, first: TileIndex, last: TileIndex) -> LayerTiles<'_> {
        let class = match layer {
            LayerId::Sensor(class) => class,
            LayerId::Prior => {
                return Box::new(self.prior.range(first..=last).map(|(at, tile)| (*at, tile)));
            }
            LayerId::Walls => return Box::new(std::iter::empty()),
        };
        let key = |tile| TileKey { class, tile };
        let range = self.tiles.range(key(first)..=key(last));
        Box::new(range.map(|(key, tile)| (key.tile, tile)))
    }
}
