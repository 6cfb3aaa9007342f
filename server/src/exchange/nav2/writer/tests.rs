//! What is written, pixel by pixel.

use std::sync::Arc;

use mapfold_map::level::LevelMap;
use mapfold_map::raster::{SensorClass, TILE_CELLS, Tile, TileKey};

use super::*;
use crate::exchange::layers::LayerId;
use crate::exchange::nav2::Image;

/// A layer, a place, and the evidence of some cells.
type Cells<'a> = (SensorClass, i32, i32, &'a [(usize, i32)]);

const SCANNER: SensorClass = SensorClass::Scanner;
const SONAR: SensorClass = SensorClass::Sonar;

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

fn all(map: &LevelMap) -> Nav2Map<'_> {
    Nav2Map::new(map, 0.05, Content::default(), Style::default()).unwrap()
}

fn image(nav2: &Nav2Map) -> Image {
    let mut bytes = Vec::new();
    nav2.write_image(&mut bytes).unwrap();
    Image::read(&bytes).unwrap()
}

#[test]
fn greys_change_exactly_at_the_thresholds_that_the_yaml_names() {
    let greys = Greys::new(Mode::Trinary);
    for steps in -600..=600 {
        let p = LogOdds(steps).probability();
        let expected = if p >= OCCUPIED_THRESH {
            OCCUPIED
        } else if p <= FREE_THRESH {
            FREE
        } else {
            UNKNOWN
        };
        assert_eq!(greys.trinary(Some(LogOdds(steps))), expected, "at {steps} steps, p = {p}");
    }
    assert_eq!(greys.trinary(None), UNKNOWN);
}

#[test]
fn an_unknown_pixel_stays_unknown_when_it_is_read_back() {
    let p = 1.0 - f64::from(UNKNOWN) / 255.0;
    assert!(p > FREE_THRESH && p < OCCUPIED_THRESH);
}

#[test]
fn rows_are_flipped_and_layers_read_together_or_told_apart() {
    // Lower left cell: 50 steps and three tenths of 50 is occupied, but neither alone.
    let map =
        map_of(&[(SCANNER, -1, 0, &[(0, 50), (TILE_CELLS - 1, -300)]), (SONAR, -1, 0, &[(0, 50)])]);
    let nav2 = all(&map);
    assert!(nav2.description("map.pgm").to_string().contains("origin: [-3.2, 0.0, 0.0]\n"));
    let mut bytes = Vec::new();
    nav2.write_image(&mut bytes).unwrap();
    let pixels = bytes.strip_prefix(b"P5\n64 64\n255\n").unwrap();
    assert_eq!(pixels.len(), TILE_CELLS);
    assert_eq!(pixels[63], FREE, "the last cell of the tile is the top right pixel");
    assert_eq!(pixels[63 * 64], OCCUPIED, "the first cell is the bottom left pixel");
    assert_eq!(pixels.iter().filter(|p| **p != UNKNOWN).count(), 2);

    let only = |class| Content { layer: Layer::Only(LayerId::Sensor(class)), bbox: None };
    for (class, known) in [(SCANNER, 1), (SONAR, 0)] {
        let nav2 = Nav2Map::new(&map, 0.05, only(class), Style::default()).unwrap();
        assert_eq!(image(&nav2).grey.iter().filter(|p| **p != UNKNOWN).count(), known);
    }
    let prior = Content { layer: Layer::Only(LayerId::Prior), bbox: None };
    let refused = Nav2Map::new(&map, 0.05, prior, Style::default()).err();
    assert_eq!(refused, Some(Nav2Error::Empty));
}

#[test]
fn raw_and_scale_tell_how_sure_the_map_is() {
    let map = map_of(&[(SCANNER, 0, 0, &[(0, 900), (1, -900), (2, 110), (3, 1)])]);
    let drawn = |mode, format| {
        let style = Style::new(mode, format).unwrap();
        image(&Nav2Map::new(&map, 0.05, Content::default(), style).unwrap())
    };
    for format in [ImageFormat::Pgm, ImageFormat::Png] {
        let raw = drawn(Mode::Raw, Some(format));
        assert_eq!(&raw.grey[63 * 64..63 * 64 + 5], [100, 0, 75, 50, 255]);
        assert_eq!(raw.opaque, None);
    }
    let scale = drawn(Mode::Scale, None);
    assert_eq!(&scale.grey[63 * 64..63 * 64 + 4], [0, 255, 64, 128]);
    let opaque = scale.opaque.unwrap();
    assert_eq!(opaque.iter().filter(|o| **o).count(), 4);
    let refused = Style::new(Mode::Scale, Some(ImageFormat::Pgm));
    assert_eq!(refused, Err(Nav2Error::NoTransparency));
}

#[test]
fn a_rectangle_is_cut_out_to_the_cell() {
    let map = map_of(&[(SCANNER, -1, -1, &[(TILE_CELLS - 1, 300)]), (SCANNER, 0, 0, &[(0, -300)])]);
    let cut = |min_x_m, min_y_m, max_x_m, max_y_m| {
        let bbox = Some(Bounds { min_x_m, min_y_m, max_x_m, max_y_m });
        Nav2Map::new(&map, 0.05, Content { layer: Layer::All, bbox }, Style::default())
    };
    let nav2 = cut(-0.06, -0.05, 0.05, 0.09).unwrap();
    let told = nav2.description("map.pgm");
    assert!(told.to_string().contains("origin: [-0.1, -0.05, 0.0]\n"));
    let image = image(&nav2);
    assert_eq!((image.columns, image.rows), (3, 3));
    let u = UNKNOWN;
    assert_eq!(image.grey, [u, u, u, u, u, FREE, u, OCCUPIED, u]);

    assert_eq!(cut(100.0, 100.0, 101.0, 101.0).err(), Some(Nav2Error::EmptyBox));
    assert_eq!(cut(1e300, 1e300, 1e300, 1e300).err(), Some(Nav2Error::EmptyBox));
    assert_eq!(cut(-1e300, -1e300, -1e300, -1e300).err(), Some(Nav2Error::EmptyBox));
    assert!(matches!(cut(-1e300, 0.0, 1e300, 1.0), Err(Nav2Error::TooLarge { .. })));
}

#[test]
fn a_level_without_evidence_or_with_tiles_a_world_apart_is_refused_and_told_what_to_do() {
    let of = |map: &LevelMap| Nav2Map::new(map, 0.05, Content::default(), Style::default()).err();
    assert_eq!(of(&LevelMap::default()), Some(Nav2Error::Empty));
    let far =
        map_of(&[(SCANNER, i32::MIN, 0, &[(0, 100)]), (SCANNER, i32::MAX, i32::MAX, &[(0, 100)])]);
    let refused = of(&far).unwrap();
    assert!(matches!(refused, Nav2Error::TooLarge { .. }));
    assert!(refused.to_string().contains("`bbox`"), "{refused}");
    // A part of it can be had.
    let bbox = Some(Bounds { min_x_m: -1e10, min_y_m: 0.0, max_x_m: 1e10, max_y_m: 0.0 });
    let wide = Nav2Map::new(&far, 0.05, Content { layer: Layer::All, bbox }, Style::default());
    assert!(matches!(wide, Err(Nav2Error::TooLarge { .. })));
}
