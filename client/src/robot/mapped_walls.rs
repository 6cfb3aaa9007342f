//! Walls of a map that the robot holds already, for those who judge by them.

use std::collections::BTreeMap;
use std::sync::Arc;

use mapfold_map::level::LevelMap;
use mapfold_map::raster::{Cell, LogOdds, SensorClass, Tile, TileIndex};

use crate::evidence::KnownWalls;

/// From this evidence on a cell is all but surely occupied: a probability of 0.9.
const WALL_NAT: f64 = 2.2;

/// The cells in which scanners have found walls, as a map stood when it was taken. What sonars say of
/// themselves is no witness for or against them.
#[derive(Debug, Clone, Default)]
pub struct MappedWalls {
    tiles: BTreeMap<TileIndex, Arc<Tile>>,
}

impl MappedWalls {
    /// Those of a map; tiles are shared with it, not copied.
    pub fn of(map: &LevelMap) -> Self {
        let of_scanners = map.tiles.iter().filter(|(key, _)| key.class == SensorClass::Scanner);
        Self { tiles: of_scanners.map(|(key, tile)| (key.tile, Arc::clone(tile))).collect() }
    }
}

impl KnownWalls for MappedWalls {
    fn is_wall(&self, cell: Cell) -> bool {
        let (index, offset) = cell.tile();
        let value = |tile: &Arc<Tile>| tile.cells().get(offset).copied().unwrap_or(0);
        self.tiles.get(&index).map_or(0, value) >= LogOdds::from_nat(WALL_NAT).0
    }
}

#[cfg(test)]
mod tests {
    use mapfold_map::raster::{TILE_CELLS, TileKey};

    use super::*;

    fn map_with(class: SensorClass, value: i32) -> LevelMap {
        let mut cells = Box::new([0; TILE_CELLS]);
        cells[5] = value;
        let key = TileKey { class, tile: TileIndex { x: -1, y: 2 } };
        LevelMap {
            tiles: BTreeMap::from([(key, Arc::new(Tile::new(cells)))]),
            ..LevelMap::default()
        }
    }

    #[test]
    fn only_what_scanners_are_sure_of_is_a_wall() {
        let at = TileIndex { x: -1, y: 2 }.cell(5);
        let is_wall = |class, value| MappedWalls::of(&map_with(class, value)).is_wall(at);
        assert!(is_wall(SensorClass::Scanner, 220));
        assert!(!is_wall(SensorClass::Scanner, 219));
        assert!(!is_wall(SensorClass::Sonar, 1000));
        let walls = MappedWalls::of(&map_with(SensorClass::Scanner, 400));
        assert!(!walls.is_wall(TileIndex { x: -1, y: 2 }.cell(6)));
        assert!(!walls.is_wall(TileIndex { x: 4, y: 2 }.cell(5)));
    }
}
