//! Pictures of small maps, pixel by pixel.

use mapfold_map::level::LevelMap;
use mapfold_map::raster::{Cell, SensorClass, TILE_CELLS, TileKey};
use uuid::Uuid;

use super::*;
use crate::exchange::layers::{Dated, LayerTiles, Raster};

/// A map that goes on.
pub(super) struct World {
    map: LevelMap,
    changes: Vec<TileKey>,
}

impl Raster for World {
    fn between(&self, layer: LayerId, first: TileIndex, last: TileIndex) -> LayerTiles<'_> {
        self.map.between(layer, first, last)
    }
}

impl Dated for World {
    fn revision(&self) -> i64 {
        self.changes.len() as i64
    }

    fn changed_after(&self, since: i64) -> Box<dyn Iterator<Item = (LayerId, TileIndex)> + '_> {
        let later = self.changes.iter().skip(since as usize);
        Box::new(later.map(|key| (LayerId::Sensor(key.class), key.tile)))
    }
}

impl World {
    /// Where tiles are.
    pub(super) fn tiles_at(&self) -> std::collections::BTreeSet<TileIndex> {
        self.map.tiles.keys().map(|key| key.tile).collect()
    }

    /// Puts a tile in the place of another, or takes it away, as one revision.
    pub(super) fn put(&mut self, key: TileKey, tile: Option<Arc<Tile>>) {
        match tile {
            Some(tile) => self.map.tiles.insert(key, tile),
            None => self.map.tiles.remove(&key),
        };
        self.changes.push(key);
    }
}

/// A map whose cells hold the given evidence.
pub(super) fn map_of(cells: &[(SensorClass, i32, i32, i32)]) -> World {
    let mut tiles: BTreeMap<TileKey, Box<[i32; TILE_CELLS]>> = BTreeMap::new();
    for (class, column, row, value) in cells {
        let (tile, offset) = Cell { column: *column, row: *row }.tile();
        let key = TileKey { class: *class, tile };
        tiles.entry(key).or_insert_with(|| Box::new([0; TILE_CELLS]))[offset] = *value;
    }
    let mut world = World { map: LevelMap::default(), changes: Vec::new() };
    for (key, cells) in tiles {
        world.put(key, Some(Arc::new(Tile::new(cells))));
    }
    world
}

/// What a reader sees: (red, green, blue, alpha) of each pixel.
fn pixels(png: &[u8]) -> Vec<[u8; 4]> {
    let mut decoder = png::Decoder::new(std::io::Cursor::new(png));
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::ALPHA);
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!((info.width, info.height), (256, 256));
    bytes.chunks_exact(4).map(|p| [p[0], p[1], p[2], p[3]]).collect()
}

fn drawn(map: &World, z: u8, row: i32, col: i32, layer: Layer) -> Vec<[u8; 4]> {
    let address = Address::new(z, row, col).unwrap();
    pixels(&PictureCache::default().picture(Uuid::nil(), map, address, layer).unwrap().png)
}

fn seen(pixels: &[[u8; 4]]) -> Vec<(usize, usize)> {
    let opaque = pixels.iter().enumerate().filter(|(_, p)| p[3] != 0);
    opaque.map(|(i, _)| (i / PICTURE_SIDE, i % PICTURE_SIDE)).collect()
}

const SCANNER: SensorClass = SensorClass::Scanner;
const SONAR: SensorClass = SensorClass::Sonar;

#[test]
fn every_cell_is_found_where_the_documented_formula_says() {
    // Cells in all four quadrants, also at the seams of tiles and pictures.
    for (column, row) in [(0, 0), (-1, 0), (0, -1), (-1, -1), (300, -700), (-257, 255)] {
        let map = map_of(&[(SCANNER, column, row, 300)]);
        for z in 0..=ZOOM_MAX {
            let resolution = 0.05 * 2_f64.powi(6 - i32::from(z));
            let (x, y) = ((f64::from(column) + 0.5) * 0.05, (f64::from(row) + 0.5) * 0.05);
            let side = 256.0 * resolution;
            let (col, line) = ((x / side).floor() as i32, (-y / side).floor() as i32);
            let picture = drawn(&map, z, line, col, Layer::All);
            let across = ((x - f64::from(col) * side) / resolution).floor() as usize;
            let down = ((-y - f64::from(line) * side) / resolution).floor() as usize;
            let seen = seen(&picture);
            assert!(seen.contains(&(down, across)), "cell ({column}, {row}) at zoom {z}");
            let edge = if z > 6 { 1 << (z - 6) } else { 1 };
            assert_eq!(seen.len(), edge * edge, "cell ({column}, {row}) at zoom {z}");
        }
    }
}

#[test]
fn a_wall_one_cell_thick_stays_an_unbroken_dark_line_at_every_zoom() {
    let mut cells: Vec<(SensorClass, i32, i32, i32)> = Vec::new();
    for column in 0..64 * 8 {
        for row in -128..0 {
            cells.push((SCANNER, column, row, if row == -77 { 250 } else { -400 }));
        }
    }
    let map = map_of(&cells);
    for z in 0..=ZOOM_NATIVE {
        let picture = drawn(&map, z, 0, 0, Layer::All);
        let line = 76 >> (ZOOM_NATIVE - z);
        let length = (512_usize >> (ZOOM_NATIVE - z)).min(PICTURE_SIDE);
        for across in 0..length {
            let [red, _, _, alpha] = picture[line * PICTURE_SIDE + across];
            assert!(alpha == 255 && red < 0x60, "pixel {across} at zoom {z} is {red:#x}");
        }
    }
}

#[test]
fn sonar_has_its_own_hue_only_where_no_scanner_speaks() {
    let map = map_of(&[(SCANNER, 0, -1, 300), (SONAR, 0, -1, 300), (SONAR, 1, -1, 300)]);
    let all = drawn(&map, 6, 0, 0, Layer::All);
    let is_orange = |p: [u8; 4]| p[0] > p[2];
    assert!(!is_orange(all[0]) && is_orange(all[1]));
    let sonar = drawn(&map, 6, 0, 0, Layer::Only(LayerId::Sensor(SONAR)));
    assert!(is_orange(sonar[0]) && is_orange(sonar[1]));
    let scanner = drawn(&map, 6, 0, 0, Layer::Only(LayerId::Sensor(SCANNER)));
    assert_eq!(seen(&scanner), [(0, 0)]);
}

#[test]
fn what_a_scanner_saw_is_not_washed_away_by_sonar() {
    let map = map_of(&[(SCANNER, 0, -1, 250), (SONAR, 0, -1, -600), (SONAR, 1, -1, -600)]);
    for z in [6, 4] {
        let all = drawn(&map, z, 0, 0, Layer::All);
        assert!(all[0][0] < 0x80, "the wall is {:?} at zoom {z}", all[0]);
    }
    assert!(drawn(&map, 6, 0, 0, Layer::All)[1][0] > 0xe0, "free where only sonar looked");
    assert!(drawn(&map, 6, 0, 0, Layer::Only(LayerId::Sensor(SONAR)))[0][0] > 0xe0);
}

#[test]
fn where_nothing_is_known_the_picture_is_transparent_however_far_out() {
    let map = map_of(&[(SCANNER, 0, 0, 300)]);
    for (z, row, col) in [(6, 5, 5), (0, i32::MIN, i32::MAX), (8, i32::MAX, i32::MIN)] {
        assert!(seen(&drawn(&map, z, row, col, Layer::All)).is_empty());
    }
    assert!(Address::new(9, 0, 0).is_none());
}

#[test]
fn a_picture_is_kept_until_one_of_its_tiles_changes() {
    for z in [0, 3, 4, 5] {
        let mut map = map_of(&[(SCANNER, 0, -1, 300), (SCANNER, 100, -1, 300)]);
        let (cache, address) = (PictureCache::default(), Address::new(z, 0, 0).unwrap());
        let picture = |map: &World| cache.picture(Uuid::nil(), map, address, Layer::All).unwrap();
        let first = picture(&map);
        assert!(Arc::ptr_eq(&first, &picture(&map)), "the same tiles, the same picture");

        let changed = map_of(&[(SCANNER, 100, -1, -300)]);
        let (key, tile) = changed.map.tiles.iter().next_back().unwrap();
        map.put(*key, Some(Arc::clone(tile)));
        let second = picture(&map);
        assert_ne!(first.digest, second.digest);

        map.put(*key, None);
        assert_ne!(second.digest, picture(&map).digest);
    }
}
