//! The GDB as the prior of the raster.

use mapfold_map::gdb::{PriorConfig, prior};
use mapfold_map::raster::{TILE_CELLS, TILE_SIDE, Tile, TileIndex};
use mapfold_schema::v1::{Bounds, ImportReport};
use sha2::{Digest, Sha256};

use super::gdb::{GdbError, GdbModel};
use super::snapshot::{tile_bounds, union};

/// Cells that one prior may cover: as many as an imported image.
const CELLS_MAX: u64 = 1 << 26;

/// A prior made of a model.
#[derive(Debug)]
pub struct GdbPrior {
    /// What it says, by place.
    pub tiles: Vec<(TileIndex, Tile)>,
    /// SHA-256 of what it depends on, lower-case hexadecimal.
    pub digest: String,
    /// In words and figures.
    pub report: ImportReport,
}

impl GdbModel {
    /// The prior for a sensor's height and a level's cell size, metres.
    ///
    /// # Errors
    /// [`GdbError::TooCrowded`], [`GdbError::NoPrior`].
    pub fn prior(&self, height_m: f64, resolution_m: f64) -> Result<GdbPrior, GdbError> {
        let config = PriorConfig { cells_max: CELLS_MAX, ..PriorConfig::standard(resolution_m) };
        let patches = self.plan(height_m, |plan| prior(plan, &config))??;
        let tiles: Vec<(TileIndex, Tile)> = patches
            .iter()
            .map(|(at, patch)| {
                let mut tile = Tile::new(Box::new([0; TILE_CELLS]));
                tile.add(patch);
                (*at, tile)
            })
            .collect();
        let digest = Sha256::new()
            .chain_update("gdb")
            .chain_update(self.version().draft.to_le_bytes())
            .chain_update(self.version().library.to_le_bytes())
            .chain_update(height_m.to_le_bytes())
            .finalize();
        let digest = mapfold_schema::digest::hexadecimal(&digest);
        let report = report(&tiles, height_m, resolution_m);
        Ok(GdbPrior { tiles, digest, report })
    }
}

fn report(tiles: &[(TileIndex, Tile)], height_m: f64, resolution_m: f64) -> ImportReport {
    let bounds = tiles.iter().map(|(at, _)| tile_bounds(*at, resolution_m)).reduce(union);
    let origin_m = bounds.map_or([0.0; 2], |bounds: Bounds| [bounds.min_x_m, bounds.min_y_m]);
    let span = |axis: fn(&TileIndex) -> i32| {
        let places = || tiles.iter().map(|(at, _)| i64::from(axis(at)));
        let (least, most) = (places().min(), places().max());
        least.zip(most).map_or(0, |(least, most)| (most - least + 1) as u32 * TILE_SIDE as u32)
    };
    let (columns, rows) = (span(|at| at.x), span(|at| at.y));
    let cells = || tiles.iter().flat_map(|(_, tile)| tile.cells());
    let occupied = cells().filter(|cell| **cell > 0).count() as u64;
    let free = cells().filter(|cell| **cell < 0).count() as u64;
    ImportReport {
        image: format!("GDB at {height_m} m"),
        columns,
        rows,
        resolution_m,
        origin_m,
        yaw_rad: 0.0,
        mode: "gdb".to_owned(),
        occupied_thresh: None,
        free_thresh: None,
        negate: None,
        trust: 1.0,
        occupied,
        free,
        unknown: u64::from(columns) * u64::from(rows) - occupied - free,
        tiles: tiles.len() as u32,
        bounds,
        warnings: Vec::new(),
    }
}
