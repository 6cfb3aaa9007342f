//! Coarse pictures, each made of the four of the next zoom level, and kept until a tile in it
//! changes.
//!
//! A picture of zoom level 0 shows 65 536 tiles: neither drawing it from them nor finding out
//! whether one of them has changed may be part of an answer. So what is kept is dated: when a
//! raster of a later revision comes, the pictures that show its changes are forgotten, five for
//! each changed tile, and nothing else is looked at. Of the finest coarse level all pixels are kept as
//! canvases, on which only the tiles that have changed are painted anew.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

use mapfold_map::raster::{Tile, TileIndex};
use uuid::Uuid;

use super::cache::{Generations, Picture};
use super::shades::COARSE_SIDE;
use super::{Address, Dated, Layer, LayerId, PICTURE_PIXELS, PICTURE_SIDE, Shading, ZOOM_COARSE};

/// Most coarse pictures that are kept, 16 kB each and the PNG of those that were asked for.
const NODES_MAX: usize = 8192;
/// Most canvases that are kept, 64 kB each: what 262 144 tiles lie on.
const CANVASES_MAX: usize = 1024;
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
    /// The pixels of pictures of zoom level `ZOOM_COARSE`.
    canvases: Generations<(Of, Address), Arc<[u8]>>,
    /// What has changed on canvases since they were painted; never more of them than canvases.
    stale: BTreeMap<(Of, Address), BTreeSet<TileIndex>>,
}

impl Kept {
    /// Notes that a tile has changed on a canvas.
    fn spoil(&mut self, at: (Of, Address), tile: TileIndex) {
        if self.canvases.get(&at).is_none() {
            return;
        }
        if self.stale.len() >= CANVASES_MAX && !self.stale.contains_key(&at) {
            // Canvases go without a word when there are too many; what was noted of them goes here.
            self.stale.clear();
            self.canvases = Generations::default();
            return;
        }
        self.stale.entry(at).or_default().insert(tile);
    }

    /// A canvas, and which of its tiles have changed.
    fn canvas(&mut self, at: (Of, Address)) -> Option<(Arc<[u8]>, BTreeSet<TileIndex>)> {
        let canvas = self.canvases.get(&at)?;
        Some((canvas, self.stale.get(&at).cloned().unwrap_or_default()))
    }
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
            drawing.keep(address, None, None);
            return Ok(None);
        };
        let picture = Picture::of(&pixels)?;
        let node = drawing.node(&pixels);
        // A node is new and nobody else has it.
        let _ = node.picture.set(Arc::clone(&picture));
        drawing.keep(address, Some(Arc::new(node)), Some(pixels));
        Ok(Some(picture))
    }

    /// Forgets what has changed since the last raster that was seen.
    fn catch_up(&self, of: Of, raster: &impl Dated) {
        let mut kept = self.kept();
        let known = *kept.revisions.entry(of).or_insert_with(|| raster.revision());
        if raster.revision() <= known {
            return;
        }
        let changed = raster.changed_after(known).filter(|(id, _)| of.1.shows(*id));
        for (_, tile) in changed {
            for z in 0..=ZOOM_COARSE {
                if let Some(address) = Address::showing(z, tile) {
                    kept.nodes.remove(&(of, address));
                    if z == ZOOM_COARSE {
                        kept.spoil((of, address), tile);
                    }
                }
            }
        }
        kept.revisions.insert(of, raster.revision());
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
        let canvas = self.pyramid.kept().canvas((self.of, address));
        if let Some((canvas, stale)) = canvas {
            return self.painted_anew(address, &canvas, &stale);
        }
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
        let mut pixels = vec![0; PICTURE_PIXELS];
        address.paste_all(&mut pixels, shades);
        Some(pixels)
    }

    /// A canvas on which some tiles are painted as they are now.
    fn painted_anew(
        &self,
        address: Address,
        canvas: &[u8],
        stale: &BTreeSet<TileIndex>,
    ) -> Option<Vec<u8>> {
        self.pyramid.shaded.fetch_add(stale.len() as u64, Ordering::Relaxed);
        let shades = stale.iter().map(|at| {
            let layers: Vec<(LayerId, &Tile)> = self
                .of
                .1
                .parts()
                .flat_map(|part| {
                    self.raster.between(part, *at, *at).map(move |(_, t)| (part, &**t))
                })
                .collect();
            let is_there = !layers.is_empty();
            let shades = is_there.then(|| self.shading.shade_coarsely(&layers));
            (*at, shades.unwrap_or([0; COARSE_SIDE * COARSE_SIDE]))
        });
        let mut pixels = canvas.to_vec();
        address.paste_all(&mut pixels, shades);
        pixels.iter().any(|pixel| *pixel != 0).then_some(pixels)
    }

    /// A picture as part of a coarser one.
    fn half(&self, address: Address) -> Option<Arc<Node>> {
        if let Some(known) = self.pyramid.kept().nodes.get(&(self.of, address)) {
            return known;
        }
        let pixels = self.pixels(address);
        let node = pixels.as_ref().map(|pixels| Arc::new(self.node(pixels)));
        self.keep(address, node.clone(), pixels);
        node
    }

    fn node(&self, pixels: &[u8]) -> Node {
        let mut half = vec![0; HALF * HALF];
        self.shading.halve(pixels, &mut half, HALF);
        Node { half: half.into_boxed_slice(), picture: OnceLock::new() }
    }

    /// Keeps what was drawn of the newest revision. What another request has replaced meanwhile
    /// must not come back.
    fn keep(&self, address: Address, node: Option<Arc<Node>>, pixels: Option<Vec<u8>>) {
        let (at, is_canvas) = ((self.of, address), address.z == ZOOM_COARSE);
        let canvas: Option<Arc<[u8]>> = pixels.filter(|_| is_canvas).map(Into::into);
        let mut kept = self.pyramid.kept();
        if kept.revisions.get(&self.of) != Some(&self.raster.revision()) {
            return;
        }
        kept.nodes.insert(at, node, NODES_MAX);
        if is_canvas {
            kept.stale.remove(&at);
            match canvas {
                Some(canvas) => kept.canvases.insert(at, canvas, CANVASES_MAX),
                None => kept.canvases.remove(&at),
            }
        }
    }
}

#[cfg(test)]
mod tests;
