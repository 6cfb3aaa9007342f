//! Coarse pictures, each made of the four of the next zoom level, and kept until a tile in it
//! changes.
//!
//! A picture of zoom level 0 shows 65 536 tiles: neither drawing it from them nor finding out
//! whether one of them has changed may be part of an answer. So what is kept is dated: when a
//! raster of a later revision comes, the pictures that show its changes are forgotten, five for
//! each changed tile, and nothing else is looked at.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use mapfold_map::raster::Tile;
use uuid::Uuid;

use super::cache::{Generations, Picture};
use super::{Address, Dated, Layer, LayerId, PICTURE_PIXELS, PICTURE_SIDE, Shading, ZOOM_COARSE};

/// Most coarse pictures that are kept, 16 kB each and the PNG of those that were asked for.
const NODES_MAX: usize = 8192;
/// Pixels along the side of a picture that is part of a coarser one.
const HALF: usize = PICTURE_SIDE / 2;

/// A layer of a level.
pub(super) type Of = (Uuid, Layer);

/// Coarse pictures of all levels.
#[derive(Debug, Default)]
pub(super) struct Pyramid {
    kept: Mutex<Kept>,
    shaded: AtomicU64,
}

#[derive(Debug, Default)]
struct Kept {
    /// Which revision of a layer the kept pictures show.
    revisions: BTreeMap<Of, i64>,
    /// `None` where there is nothing.
    nodes: Generations<(Of, Address), Option<Arc<Node>>>,
}

#[derive(Debug)]
struct Node {
    /// As part of the next coarser picture: 128 x 128 pixels.
    half: Box<[u8]>,
    picture: OnceLock<Arc<Picture>>,
}

/// One answer's work.
struct Drawing<'a, R> {
    pyramid: &'a Pyramid,
    shading: &'a Shading,
    of: Of,
    raster: &'a R,
}

impl Pyramid {
    /// The picture at `address`; `None` where there is nothing.
    pub(super) fn picture(
        &self,
        shading: &Shading,
        of: Of,
        raster: &impl Dated,
        address: Address,
    ) -> Result<Option<Arc<Picture>>, png::EncodingError> {
        self.catch_up(of, raster);
        let known = self.kept().nodes.get(&(of, address));
        match &known {
            Some(None) => return Ok(None),
            Some(Some(node)) => {
                if let Some(picture) = node.picture.get() {
                    return Ok(Some(Arc::clone(picture)));
                }
            }
            None => {}
        }
        let drawing = Drawing { pyramid: self, shading, of, raster };
        let Some(pixels) = drawing.pixels(address) else {
            drawing.keep(address, None);
            return Ok(None);
        };
        let picture = Picture::of(&pixels)?;
        let node = drawing.node(&pixels);
        // A node is new and nobody else has it.
        let _ = node.picture.set(Arc::clone(&picture));
        drawing.keep(address, Some(Arc::new(node)));
        Ok(Some(picture))
    }

    /// Forgets what has changed since the last raster that was seen.
    fn catch_up(&self, of: Of, raster: &impl Dated) {
        let mut kept = self.kept();
        let Kept { revisions, nodes } = &mut *kept;
        let known = revisions.entry(of).or_insert_with(|| raster.revision());
        if raster.revision() <= *known {
            return;
        }
        let changed = raster.changed_after(*known).filter(|(id, _)| of.1.shows(*id));
        for (_, tile) in changed {
            for z in 0..=ZOOM_COARSE {
                if let Some(address) = Address::showing(z, tile) {
                    nodes.remove(&(of, address));
                }
            }
        }
        *known = raster.revision();
    }

    /// How many tiles have been shaded so far.
    #[cfg(test)]
    pub(super) fn shaded(&self) -> u64 {
        self.shaded.load(Ordering::Relaxed)
    }

    fn kept(&self) -> MutexGuard<'_, Kept> {
        // What is kept is never left half changed, so a panic elsewhere does not spoil it.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<R: Dated> Drawing<'_, R> {
    /// All pixels of a picture; `None` where there is nothing.
    fn pixels(&self, address: Address) -> Option<Vec<u8>> {
        if address.z == ZOOM_COARSE {
            return self.of_tiles(address);
        }
        let parts = address.parts().map(|part| self.half(part?));
        if parts.iter().all(Option::is_none) {
            return None;
        }
        let mut pixels = vec![0_u8; PICTURE_PIXELS];
        for (number, node) in parts.iter().enumerate() {
            let Some(node) = node else { continue };
            let start = number / 2 * HALF * PICTURE_SIDE + number % 2 * HALF;
            for (row, from) in node.half.chunks_exact(HALF).enumerate() {
                let start = start + row * PICTURE_SIDE;
                pixels[start..start + HALF].copy_from_slice(from);
            }
        }
        Some(pixels)
    }

    fn of_tiles(&self, address: Address) -> Option<Vec<u8>> {
        let tiles = address.select(self.raster, self.of.1);
        if tiles.is_empty() {
            return None;
        }
        self.pyramid.shaded.fetch_add(tiles.len() as u64, Ordering::Relaxed);
        let shades = tiles.iter().map(|(tile, layers)| {
            let plain: Vec<(LayerId, &Tile)> =
                layers.iter().map(|(layer, tile)| (*layer, tile.as_ref())).collect();
            (*tile, self.shading.shade_coarsely(&plain))
        });
        Some(address.paste_all(shades))
    }

    /// A picture as part of a coarser one.
    fn half(&self, address: Address) -> Option<Arc<Node>> {
        if let Some(known) = self.pyramid.kept().nodes.get(&(self.of, address)) {
            return known;
        }
        let node = self.pixels(address).map(|pixels| Arc::new(self.node(&pixels)));
        self.keep(address, node.clone());
        node
    }

    fn node(&self, pixels: &[u8]) -> Node {
        let mut half = vec![0; HALF * HALF];
        self.shading.halve(pixels, &mut half, HALF);
        Node { half: half.into_boxed_slice(), picture: OnceLock::new() }
    }

    /// Keeps what was drawn of the newest revision. What another request has replaced meanwhile
    /// must not come back.
    fn keep(&self, address: Address, node: Option<Arc<Node>>) {
        let mut kept = self.pyramid.kept();
        if kept.revisions.get(&self.of) == Some(&self.raster.revision()) {
            kept.nodes.insert((self.of, address), node, NODES_MAX);
        }
    }
}

#[cfg(test)]
mod tests;
