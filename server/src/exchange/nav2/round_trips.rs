//! What is written is read back as it was, whatever the mode, format, place and resolution.

use std::sync::Arc;

use mapfold_map::level::LevelMap;
use mapfold_map::raster::{Cell, LogOdds, SensorClass, TILE_CELLS, Tile, TileIndex, TileKey};
use mapfold_schema::v1::Bounds;
use proptest::prelude::*;

use super::*;
use crate::exchange::layers::Layer;

fn map_of(cells: &[(i32, i32, i32)]) -> LevelMap {
    let mut map = LevelMap::default();
    for (column, row, value) in cells {
        let (tile, offset) = Cell { column: *column, row: *row }.tile();
        let key = TileKey { class: SensorClass::Scanner, tile };
        let known = map.tiles.get(&key).map_or([0; TILE_CELLS], |tile: &Arc<Tile>| *tile.cells());
        let mut cells = Box::new(known);
        cells[offset] = *value;
        map.tiles.insert(key, Arc::new(Tile::new(cells)));
    }
    map
}

/// Written, read back, and loaded.
fn round_trip(
    map: &LevelMap,
    resolution_m: f64,
    content: Content,
    style: Style,
) -> (Description, Loaded) {
    let nav2 = Nav2Map::new(map, resolution_m, content, style).unwrap();
    let mut image = Vec::new();
    nav2.write_image(&mut image).unwrap();
    let yaml = nav2.description("a map.pgm").to_string();
    let (description, warnings) = Description::read(yaml.as_bytes()).unwrap();
    assert_eq!((&description, warnings), (&nav2.description("a map.pgm"), vec![]));
    let loaded = load(&description, &Image::read(&image).unwrap());
    (description, loaded)
}

fn styles() -> impl Strategy<Value = Style> {
    use ImageFormat::{Pgm, Png};
    prop::sample::select(vec![
        Style::new(Mode::Trinary, Some(Pgm)).unwrap(),
        Style::new(Mode::Trinary, Some(Png)).unwrap(),
        Style::new(Mode::Scale, None).unwrap(),
        Style::new(Mode::Raw, Some(Pgm)).unwrap(),
        Style::new(Mode::Raw, Some(Png)).unwrap(),
    ])
}

/// What a cell of this evidence has to come back as.
fn expected(mode: Mode, steps: i32) -> i8 {
    let p = |steps| LogOdds(steps).probability();
    match mode {
        _ if steps == 0 => UNKNOWN,
        Mode::Trinary if p(steps) >= 0.65 => 100,
        Mode::Trinary if p(steps) <= 0.196 => 0,
        Mode::Trinary => UNKNOWN,
        Mode::Scale | Mode::Raw => {
            ((p(steps.clamp(-500, 500)) - p(-500)) / (p(500) - p(-500)) * 100.0).round() as i8
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    #[test]
    fn every_cell_comes_back_with_its_place(
        cells in prop::collection::btree_map((-70..70, -70..70), -700..700_i32, 1..40),
        resolution_m in prop::sample::select(vec![0.05, 0.0333, 0.1, 0.025_000_01, 1.0 / 3.0]),
        style in styles(),
        bbox in prop::option::of((-5.0..5.0_f64, -5.0..5.0_f64, 0.0..4.0_f64, 0.0..4.0_f64)),
    ) {
        let list: Vec<(i32, i32, i32)> =
            cells.iter().filter(|(_, v)| **v != 0).map(|((c, r), v)| (*c, *r, *v)).collect();
        prop_assume!(!list.is_empty());
        let map = map_of(&list);
        let bbox = bbox.map(|(x, y, w, h)| Bounds {
            min_x_m: x, min_y_m: y, max_x_m: x + w, max_y_m: y + h,
        });
        let content = Content { layer: Layer::All, bbox };
        prop_assume!(Nav2Map::new(&map, resolution_m, content, style).is_ok());
        let (description, Loaded { cells: loaded, .. }) = round_trip(&map, resolution_m, content, style);
        prop_assert_eq!(description.resolution_m.to_bits(), resolution_m.to_bits());
        prop_assert_eq!(description.origin[2].to_bits(), 0.0_f64.to_bits());
        let left = (description.origin[0] / resolution_m).round() as i32;
        let bottom = (description.origin[1] / resolution_m).round() as i32;
        for (index, value) in loaded.values.iter().enumerate() {
            let column = left + (index % loaded.columns as usize) as i32;
            let row = bottom + (index / loaded.columns as usize) as i32;
            let steps = cells.get(&(column, row)).copied().unwrap_or(0);
            prop_assert_eq!(*value, expected(description.mode, steps), "cell {} {}", column, row);
        }
    }

    #[test]
    fn an_export_taken_as_a_prior_lies_where_it_was_drawn(
        cells in prop::collection::btree_map((-70..70, -70..70), prop::bool::ANY, 1..40),
        resolution_m in prop::sample::select(vec![0.05, 0.0333, 0.1, 1.0 / 3.0]),
    ) {
        let list: Vec<(i32, i32, i32)> =
            cells.iter().map(|((c, r), full)| (*c, *r, if *full { 300 } else { -300 })).collect();
        let map = map_of(&list);
        let (description, loaded) =
            round_trip(&map, resolution_m, Content::default(), Style::default());
        let trust = Trust::new(1.0).unwrap();
        let (prior, warnings) = Prior::on_grid(&loaded.cells, &description, resolution_m, trust).unwrap();
        prop_assert_eq!(warnings, vec![]);
        for (column, row, value) in list {
            let (TileIndex { x, y }, offset) = Cell { column, row }.tile();
            let says = prior.tiles[&TileIndex { x, y }].cells()[offset];
            prop_assert_eq!(says, if value > 0 { 400 } else { -50 });
        }
        let known: usize = prior.tiles.values().map(|t| t.cells().iter().filter(|c| **c != 0).count()).sum();
        prop_assert_eq!(known, cells.len());
    }

    /// Whatever the description says, it is read back as it was.
    #[test]
    fn every_description_comes_back(
        image in "[a-zA-Z0-9 .:#'\"/-]{1,20}",
        resolution_m in 1e-6..1e3_f64,
        origin in prop::array::uniform3(-1e5..1e5_f64),
        negate in prop::bool::ANY,
        thresholds in (0.0..0.5_f64, 0.5..1.0_f64),
        mode in prop::sample::select(Mode::ALL.to_vec()),
    ) {
        let (free_thresh, occupied_thresh) = thresholds;
        let description =
            Description { image, resolution_m, origin, negate, occupied_thresh, free_thresh, mode };
        prop_assert_eq!(Description::read(description.to_string().as_bytes()).unwrap().0, description);
    }

    /// Whatever comes in, it is read or refused; nothing panics.
    #[test]
    fn any_bytes_are_read_or_refused(
        mut bytes in prop::collection::vec(any::<u8>(), 0..200),
        head in prop::sample::select(vec![&b""[..], b"P5\n3 2\n255\n", b"P2 3 2 9 ", b"\x89PNG\r\n\x1a\n"]),
    ) {
        let mut file = head.to_vec();
        file.append(&mut bytes);
        let _ = Image::read(&file);
        let _ = Description::read(&file);
        let text = String::from_utf8_lossy(&file);
        let _ = Description::read(format!("image: {text}\norigin: [{text}]").as_bytes());
    }
}
