//! A level's map while it is folded: the fold and its history, one revision after the other.
//!
//! Always one contribution at a time, in the order of the log. Any other grouping would give the
//! same map, but not the same history: a wall that one contribution founds and the next one
//! merges into another must leave a tombstone on every replica and after every restart, because
//! some reader may have seen it.

use mapfold_map::level::{Level, LevelConfig};
use mapfold_map::raster::{Tile, TileKey};

use super::history::{ChangeCounts, MapHistory};
use super::recall::Logged;

/// A revision that does not follow the last one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("the log goes on with revision {next} after revision {last}")]
pub(crate) struct Gap {
    last: i64,
    next: i64,
}

/// A level's map and its history, up to one revision.
#[derive(Debug)]
pub(crate) struct Folding {
    level: Level,
    history: MapHistory,
    revision: i64,
}

impl Folding {
    /// An empty level.
    pub(crate) fn empty(resolution_m: f64) -> Self {
        Self {
            level: Level::new(LevelConfig::standard(resolution_m)),
            history: MapHistory::default(),
            revision: 0,
        }
    }

    /// A level at `revision`, from the tiles stored then and the contributions up to then
    /// (without their evidence). Its history is still to be filled in.
    pub(super) fn restored(
        resolution_m: f64,
        revision: i64,
        tiles: impl IntoIterator<Item = (TileKey, Tile)>,
        log: &[Logged],
    ) -> Self {
        let in_force = log.iter().filter(|logged| logged.in_force());
        let level = Level::restore(
            LevelConfig::standard(resolution_m),
            tiles,
            in_force.map(|logged| &*logged.contribution),
        );
        Self { level, history: MapHistory::default(), revision }
    }

    /// Folds the next contribution of the log.
    ///
    /// # Errors
    /// It is not the next one; nothing has changed then.
    pub(crate) fn step(&mut self, next: &Logged) -> Result<ChangeCounts, Gap> {
        if next.revision != self.revision + 1 {
            return Err(Gap { last: self.revision, next: next.revision });
        }
        self.revision = next.revision;
        if !next.in_force() {
            return Ok(ChangeCounts::default());
        }
        let changes = self.level.fold([&*next.contribution]);
        Ok(self.history.record(&changes, self.level.map(), self.revision))
    }

    /// Takes revisions before `next` for contributions that are not in force: for the check of a
    /// log that has lost some.
    pub(crate) fn pass_over_until(&mut self, next: i64) {
        self.revision = self.revision.max(next - 1);
    }

    /// The revision that it has reached.
    pub(crate) fn revision(&self) -> i64 {
        self.revision
    }

    /// The map.
    pub(crate) fn level(&self) -> &Level {
        &self.level
    }

    /// Since when each thing is as it is.
    pub(crate) fn history(&self) -> &MapHistory {
        &self.history
    }

    /// The same, to be filled in or put right.
    pub(super) fn history_mut(&mut self) -> &mut MapHistory {
        &mut self.history
    }
}
