//! Pictures that were drawn before, and the shades of the tiles in them.
//!
//! Coarse pictures are the business of [`super::pyramid`]. For the others:
//! A picture is drawn again only when one of its tiles has changed, and then only the changed
//! tiles are shaded again. A tile is recognised by its place in memory: a weak reference keeps
//! that place from being used for another tile, but does not keep the tile.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, Weak};

use mapfold_map::raster::{Tile, TileIndex};
use sha2::{Digest, Sha256};
use uuid::Uuid;

use super::pyramid::Pyramid;
use super::{Address, Dated, Layer, LayerId, Layers, Shades, Shading, ZOOM_COARSE, shades};

/// Most tiles whose shades are kept, about 5 kB each.
const SHADES_MAX: usize = 8192;
/// Most pictures that are kept, a few kB each.
const PICTURES_MAX: usize = 2048;

/// A drawn picture.
#[derive(Debug)]
pub struct Picture {
    /// The PNG.
    pub png: Vec<u8>,
    /// SHA-256 of the PNG.
    pub digest: [u8; 32],
}

impl Picture {
    /// Encodes pixels.
    pub(super) fn of(pixels: &[u8]) -> Result<Arc<Self>, png::EncodingError> {
        let png = shades::encode(pixels)?;
        Ok(Arc::new(Self { digest: Sha256::digest(&png).into(), png }))
    }
}

/// Pictures of all levels of one server.
#[derive(Debug, Default)]
pub struct PictureCache {
    shading: Shading,
    blank: OnceLock<Arc<Picture>>,
    pyramid: Pyramid,
    kept: Mutex<Kept>,
}

#[derive(Debug, Default)]
struct Kept {
    serial: u64,
    shades: Generations<(Uuid, Layer, TileIndex), Arc<Shaded>>,
    pictures: Generations<(Uuid, Layer, Address), Drawn>,
}

/// The shades of one place, with the tiles that they were made from.
#[derive(Debug)]
struct Shaded {
    serial: u64,
    tiles: Vec<(LayerId, Weak<Tile>)>,
    shades: Shades,
}

impl Shaded {
    fn is_of(&self, layers: &Layers) -> bool {
        self.tiles.len() == layers.len()
            && self.tiles.iter().zip(layers).all(|((kept_class, kept), (class, tile))| {
                kept_class == class && std::ptr::eq(kept.as_ptr(), Arc::as_ptr(tile))
            })
    }
}

#[derive(Debug, Clone)]
struct Drawn {
    serials: Vec<u64>,
    picture: Arc<Picture>,
}

impl PictureCache {
    /// The picture at `address` of the level with this frame; a transparent one where nothing is
    /// known.
    ///
    /// # Errors
    /// A fault of the encoder.
    pub fn picture(
        &self,
        frame: Uuid,
        map: &impl Dated,
        address: Address,
        layer: Layer,
    ) -> Result<Arc<Picture>, png::EncodingError> {
        if address.z <= ZOOM_COARSE {
            let drawn = self.pyramid.picture(&self.shading, (frame, layer), map, address)?;
            return drawn.map_or_else(|| self.blank(), Ok);
        }
        let tiles = address.select(map, layer);
        if tiles.is_empty() {
            return self.blank();
        }
        let shaded: Vec<(TileIndex, Arc<Shaded>)> = tiles
            .iter()
            .map(|(tile, layers)| (*tile, self.shaded((frame, layer, *tile), layers)))
            .collect();
        let serials: Vec<u64> = shaded.iter().map(|(_, shaded)| shaded.serial).collect();
        let key = (frame, layer, address);
        if let Some(drawn) = self.kept().pictures.get(&key).filter(|d| d.serials == serials) {
            return Ok(drawn.picture);
        }
        let tiles = shaded.iter().map(|(tile, shaded)| (*tile, &shaded.shades));
        let picture = Picture::of(&address.pixels(tiles))?;
        let drawn = Drawn { serials, picture: Arc::clone(&picture) };
        self.kept().pictures.insert(key, drawn, PICTURES_MAX);
        Ok(picture)
    }

    /// Draws all coarse pictures of a layer that show anything, from the finest up, so that nobody who
    /// asks for them has to wait; how many there are. `newest` gives the raster to draw from, anew for
    /// each picture, until there is none.
    ///
    /// # Errors
    /// A fault of the encoder.
    pub fn draw_ahead<R: Dated>(
        &self,
        frame: Uuid,
        layer: Layer,
        newest: impl Fn() -> Option<Arc<R>>,
    ) -> Result<usize, png::EncodingError> {
        let Some(raster) = newest() else { return Ok(0) };
        let tiles = layer.parts().flat_map(|part| raster.tiles_of(part)).map(|(at, _)| at);
        let mut next: BTreeSet<Address> =
            tiles.filter_map(|at| Address::showing(ZOOM_COARSE, at)).collect();
        drop(raster);
        let mut drawn = 0;
        while !next.is_empty() {
            for address in &next {
                let Some(raster) = newest() else { return Ok(drawn) };
                self.pyramid.picture(&self.shading, (frame, layer), &*raster, *address)?;
                drawn += 1;
            }
            next = next.into_iter().filter_map(Address::whole).collect();
        }
        Ok(drawn)
    }

    fn blank(&self) -> Result<Arc<Picture>, png::EncodingError> {
        if let Some(blank) = self.blank.get() {
            return Ok(Arc::clone(blank));
        }
        let blank = Picture::of(&vec![0; super::PICTURE_PIXELS])?;
        Ok(Arc::clone(self.blank.get_or_init(|| blank)))
    }

    fn shaded(&self, key: (Uuid, Layer, TileIndex), layers: &Layers) -> Arc<Shaded> {
        if let Some(shaded) = self.kept().shades.get(&key).filter(|s| s.is_of(layers)) {
            return shaded;
        }
        let plain: Vec<(LayerId, &Tile)> =
            layers.iter().map(|(class, tile)| (*class, tile.as_ref())).collect();
        let shades = self.shading.shade(&plain);
        let tiles = layers.iter().map(|(class, tile)| (*class, Arc::downgrade(tile))).collect();
        let mut kept = self.kept();
        kept.serial += 1;
        let shaded = Arc::new(Shaded { serial: kept.serial, tiles, shades });
        kept.shades.insert(key, Arc::clone(&shaded), SHADES_MAX);
        shaded
    }

    /// The coarse pictures.
    #[cfg(test)]
    pub(super) fn pyramid(&self) -> &Pyramid {
        &self.pyramid
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        // What is kept is never left half changed, so a panic elsewhere does not spoil it.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A map that forgets: when the young half is full, the old half goes and the young one becomes
/// old. What is asked for stays young.
#[derive(Debug)]
pub(super) struct Generations<K, V> {
    young: BTreeMap<K, V>,
    old: BTreeMap<K, V>,
}

impl<K, V> Default for Generations<K, V> {
    fn default() -> Self {
        Self { young: BTreeMap::new(), old: BTreeMap::new() }
    }
}

impl<K: Ord + Copy, V: Clone> Generations<K, V> {
    pub(super) fn get(&mut self, key: &K) -> Option<V> {
        if let Some(value) = self.old.remove(key) {
            self.young.insert(*key, value);
        }
        self.young.get(key).cloned()
    }

    pub(super) fn remove(&mut self, key: &K) {
        self.young.remove(key);
        self.old.remove(key);
    }

    pub(super) fn insert(&mut self, key: K, value: V, max: usize) {
        self.old.remove(&key);
        if self.young.len() >= max / 2 {
            self.old = std::mem::take(&mut self.young);
        }
        self.young.insert(key, value);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_asked_for_survives_and_the_rest_is_forgotten() {
        let mut kept: Generations<u32, u32> = Generations::default();
        for key in 0..100 {
            kept.insert(key, key, 8);
            assert_eq!(kept.get(&0), Some(0));
            assert!(kept.young.len() + kept.old.len() <= 9);
        }
        assert_eq!(kept.get(&50), None);
        assert_eq!(kept.get(&99), Some(99));
    }
}
