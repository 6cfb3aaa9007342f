//! Coarse pictures: the same as drawn from tiles, and no more work than what has changed.

use mapfold_map::raster::{Cell, SensorClass, TILE_CELLS, TileIndex, TileKey};

use super::super::cache::PictureCache;
use super::super::tests::{World, map_of};
use super::super::{Shades, ZOOM_MAX};
use super::*;

const OF: Of = (Uuid::nil(), Layer::All);

/// Numbers without order, the same in each run.
fn scattered(count: u64) -> impl Iterator<Item = [i32; 3]> {
    (0..count).map(|n| {
        let mix = |salt: u64| {
            let x = (n * 3 + salt).wrapping_mul(0x9e37_79b9_7f4a_7c15);
            ((x ^ (x >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 40) as i32
        };
        [mix(0) % 12_000 - 6000, mix(1) % 12_000 - 6000, mix(2) % 1200 - 600]
    })
}

#[test]
fn tiles_are_shaded_coarsely_as_they_are_shaded_finely() {
    let shading = Shading::default();
    let tile = |salt: u64, sparse: i32| {
        let mut cells = Box::new([0; TILE_CELLS]);
        for (cell, [a, b, value]) in
            cells.iter_mut().zip(scattered(TILE_CELLS as u64 + salt).skip(salt as usize))
        {
            *cell = if (a ^ b) % sparse == 0 { value } else { 0 };
        }
        Tile::new(cells)
    };
    for salt in 0..60 {
        let sparse = 1 + (salt % 12) as i32 * 3;
        let (a, b) = (tile(salt, sparse), tile(salt + 5000, 2 * sparse));
        for ids in [&LayerId::ALL[..1], &LayerId::ALL[1..2], &LayerId::ALL[2..], &LayerId::ALL[..2]]
        {
            let layers: Vec<(LayerId, &Tile)> = ids.iter().copied().zip([&a, &b]).collect();
            let fine = shading.shade(&layers);
            assert_eq!(
                fine.at_side(COARSE_SIDE),
                shading.shade_coarsely(&layers),
                "{ids:?}, {salt}"
            );
        }
    }
}

fn world() -> World {
    let cells: Vec<(SensorClass, i32, i32, i32)> = scattered(1500)
        .map(|[column, row, value]| {
            let class = if value % 3 == 0 { SensorClass::Sonar } else { SensorClass::Scanner };
            (class, column, row, value)
        })
        .collect();
    map_of(&cells)
}

/// The picture as drawn from its tiles alone.
fn plain(shading: &Shading, world: &World, address: Address) -> Vec<u8> {
    let shaded: Vec<(TileIndex, Shades)> = address
        .select(world, Layer::All)
        .into_iter()
        .map(|(at, layers)| {
            let layers: Vec<_> = layers.iter().map(|(id, tile)| (*id, tile.as_ref())).collect();
            (at, shading.shade(&layers))
        })
        .collect();
    address.pixels(shaded.iter().map(|(at, shades)| (*at, shades)))
}

#[test]
fn every_coarse_picture_is_the_one_drawn_from_its_tiles_also_after_changes() {
    let (mut world, pyramid, shading) = (world(), Pyramid::default(), Shading::default());
    for round in 0..3 {
        for z in 0..=ZOOM_COARSE {
            let reach = (6000 >> (ZOOM_MAX - 2 - z)) / 256 + 1;
            for row in -reach..=reach {
                for col in -reach..=reach {
                    let address = Address::new(z, row, col).unwrap();
                    let drawn = pyramid.picture(&shading, OF, &world, address).unwrap();
                    let pixels = plain(&shading, &world, address);
                    if pixels.iter().all(|pixel| *pixel == 0) {
                        assert!(drawn.is_none());
                    } else {
                        let expected = Picture::of(&pixels).unwrap();
                        assert_eq!(drawn.unwrap().digest, expected.digest, "{address:?}, {round}");
                    }
                }
            }
        }
        for [column, row, value] in scattered(40).skip(round * 10).take(10) {
            let (tile, offset) = Cell { column, row }.tile();
            let mut cells = Box::new([0; TILE_CELLS]);
            cells[offset] = value;
            let key = TileKey { class: SensorClass::Scanner, tile };
            world.put(key, (round < 2).then(|| Arc::new(Tile::new(cells))));
        }
    }
}

#[test]
fn a_change_costs_its_surroundings_however_large_the_level() {
    let (mut world, pyramid, shading) = (world(), Pyramid::default(), Shading::default());
    let whole = Address::new(0, 0, 0).unwrap();
    let draw = |world: &World| pyramid.picture(&shading, OF, world, whole).unwrap();
    let first = draw(&world).unwrap();
    let cold = pyramid.shaded();
    assert!(cold > 200, "{cold} tiles");
    assert!(Arc::ptr_eq(&first, &draw(&world).unwrap()));
    assert_eq!(pyramid.shaded(), cold, "what is kept is not drawn again");

    let place = TileIndex { x: 20, y: -20 };
    let key = TileKey { class: SensorClass::Scanner, tile: place };
    world.put(key, Some(Arc::new(Tile::new(Box::new([300; TILE_CELLS])))));
    assert_ne!(draw(&world).unwrap().digest, first.digest);
    assert_eq!(pyramid.shaded() - cold, 1, "one tile is painted anew");
    // What has gone is painted over; and a canvas that is left without anything is none.
    world.put(key, None);
    let draw_part = |world: &World| {
        let part = Address::showing(ZOOM_COARSE, place).unwrap();
        pyramid.picture(&shading, OF, world, part).unwrap()
    };
    assert_eq!(draw(&world).unwrap().digest, first.digest);
    let tiles = Address::showing(ZOOM_COARSE, place).unwrap().select(&world, Layer::All);
    let keys: Vec<TileKey> = tiles
        .iter()
        .flat_map(|(at, layers)| layers.iter().map(|(id, _)| (*at, *id)))
        .filter_map(|(tile, id)| match id {
            LayerId::Sensor(class) => Some(TileKey { class, tile }),
            _ => None,
        })
        .collect();
    assert!(keys.len() > 5 && draw_part(&world).is_some());
    for key in keys {
        world.put(key, None);
    }
    assert!(draw_part(&world).is_none());
}

#[test]
fn what_an_older_revision_shows_is_not_kept_for_a_newer_one() {
    let (mut newer, pyramid, shading) = (world(), Pyramid::default(), Shading::default());
    let older = world();
    let key = TileKey { class: SensorClass::Scanner, tile: TileIndex { x: 1, y: -1 } };
    newer.put(key, Some(Arc::new(Tile::new(Box::new([300; TILE_CELLS])))));
    let whole = Address::new(0, 0, 0).unwrap();
    let draw = |world: &World| pyramid.picture(&shading, OF, world, whole).unwrap().unwrap().digest;
    let new = draw(&newer);
    // Somebody who asked earlier comes to an end later.
    let other = Address::new(ZOOM_COARSE, 0, 0).unwrap();
    pyramid.catch_up(OF, &newer);
    pyramid.kept().nodes.remove(&(OF, other));
    pyramid.picture(&shading, OF, &older, other).unwrap();
    assert!(pyramid.kept().nodes.get(&(OF, other)).is_none());
    assert_eq!(draw(&newer), new);
}

#[test]
fn layers_and_levels_are_kept_apart() {
    let (pyramid, shading) = (Pyramid::default(), Shading::default());
    let one = map_of(&[(SensorClass::Scanner, 0, -1, 300)]);
    let other = map_of(&[(SensorClass::Sonar, 0, -1, 300)]);
    let whole = Address::new(0, 0, 0).unwrap();
    let draw = |of: Of, world: &World| pyramid.picture(&shading, of, world, whole).unwrap();
    let sonar = Layer::Only(LayerId::Sensor(SensorClass::Sonar));
    assert!(draw(OF, &one).is_some());
    assert!(draw((Uuid::nil(), sonar), &one).is_none());
    assert_ne!(
        draw((Uuid::max(), Layer::All), &other).unwrap().digest,
        draw(OF, &one).unwrap().digest
    );
}

#[test]
fn what_was_drawn_ahead_is_all_that_there_is_and_is_not_drawn_again() {
    let (world, cache) = (Arc::new(world()), PictureCache::default());
    let drawn = cache.draw_ahead(Uuid::nil(), Layer::All, || Some(Arc::clone(&world))).unwrap();
    let cold = cache.pyramid().shaded();
    assert_eq!(cold, world.tiles_at().len() as u64, "each tile once");
    let mut known = BTreeSet::new();
    for tile in world.tiles_at() {
        for z in 0..=ZOOM_COARSE {
            let address = Address::showing(z, tile).unwrap();
            let picture = cache.picture(Uuid::nil(), &*world, address, Layer::All).unwrap();
            known.insert(address);
            assert_ne!(picture.digest, blank(&cache, &world).digest);
        }
    }
    assert_eq!((cache.pyramid().shaded(), known.len()), (cold, drawn));

    // Whoever has no raster any more is done.
    let rasters = Mutex::new(vec![Arc::clone(&world); 4]);
    let stopped = PictureCache::default();
    let drawn = stopped.draw_ahead(Uuid::nil(), Layer::All, || rasters.lock().unwrap().pop());
    assert_eq!(drawn.unwrap(), 3);
}

fn blank(cache: &PictureCache, world: &World) -> Arc<Picture> {
    let nowhere = Address::new(ZOOM_COARSE, 9999, 9999).unwrap();
    cache.picture(Uuid::nil(), world, nowhere, Layer::All).unwrap()
}
