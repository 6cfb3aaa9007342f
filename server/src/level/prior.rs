//! What was known of a level before any robot came: the latest map that was imported.
//!
//! A layer of its own below the evidence, never mixed into it: the fold does not read it. Its
//! imports are entries of the log like acts, so every replica and every start comes to the same.

use std::collections::BTreeMap;
use std::sync::Arc;

use mapfold_map::raster::{Tile, TileIndex};
use mapfold_schema::v1;

use super::LevelHandle;
use super::history::{History, Least};
use crate::store::imports::{ImportRow, NewImport};
use crate::store::levels::LevelRow;
use crate::store::{Store, StoreError};

impl Least for TileIndex {
    const LEAST: Self = Self { x: i32::MIN, y: i32::MIN };
}

/// Since when each tile of the prior is as it is.
pub(super) type PriorHistory = History<TileIndex, Tile>;

/// An import with its place in the log.
#[derive(Debug, Clone)]
pub(crate) struct Imported {
    /// Its place.
    pub(crate) revision: i64,
    /// The prior from there on.
    tiles: BTreeMap<TileIndex, Arc<Tile>>,
}

impl From<ImportRow> for Imported {
    fn from(row: ImportRow) -> Self {
        let tiles = row.tiles.into_iter().map(|(at, tile)| (at, Arc::new(tile)));
        Self { revision: row.revision, tiles: tiles.collect() }
    }
}

impl Imported {
    /// Notes that this is the prior; how many tiles have changed.
    pub(super) fn replace(&self, history: &mut PriorHistory) -> u32 {
        let gone = history.live().map(|(at, _)| *at).filter(|at| !self.tiles.contains_key(at));
        let gone: Vec<TileIndex> = gone.collect();
        let mut count = 0;
        for at in gone {
            count += u32::from(history.record(at, self.revision, None));
        }
        for (at, tile) in &self.tiles {
            count += u32::from(history.record(*at, self.revision, Some(Arc::clone(tile))));
        }
        count
    }
}

/// The prior at revision `until`, read back. All of it counts as changed with the latest import:
/// that is never too early.
pub(super) async fn restore(
    store: &Store,
    row: &LevelRow,
    until: i64,
) -> Result<(usize, PriorHistory), StoreError> {
    let mut history = PriorHistory::default();
    let imports = store.import_revisions(&row.site, &row.level, until).await?;
    if let Some(last) = imports.last() {
        for at in store.prior_places(&row.site, &row.level, until).await? {
            history.put(at, *last, None);
        }
        let imported = Imported::from(store.import_row(&row.site, &row.level, *last).await?);
        for (at, tile) in imported.tiles {
            history.put(at, *last, Some(tile));
        }
    }
    Ok((imports.len(), history))
}

impl LevelHandle {
    /// Makes a map the prior, or takes the prior away; resolves when that is on disk. The level
    /// follows, here and on every replica, like after a contribution. `None` if there is nothing to
    /// take away.
    ///
    /// # Errors
    /// The store fails. After [`StoreError::Unavailable`] it is open whether it has happened; asking
    /// again does no harm.
    pub async fn import(&self, new: &NewImport) -> Result<Option<v1::Import>, StoreError> {
        let imported = self.shared.store.import(self.site(), self.level(), new).await;
        let imported = self.watched(imported)?;
        if let Some(imported) = &imported {
            metrics::counter!("mapfold_imports_total").increment(1);
            self.look_for(imported.revision);
        }
        Ok(imported)
    }
}
