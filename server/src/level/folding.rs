//! A level's map while it is folded: the fold and its history, one revision after the other.
//!
//! Always one entry at a time, in the order of the log: a contribution, or an act with all that it
//! moves. Any other grouping would give the same map, but not the same history: a wall that one contribution founds and the next one
//! merges into another must leave a tombstone on every replica and after every restart, because
//! some reader may have seen it.

use mapfold_map::level::{Batch, Changes, Level, LevelConfig, Misplaced};
use mapfold_map::raster::{SliceKey, Sums};

use super::history::{ChangeCounts, MapHistory};
use super::recall::{Entry, Logged};
use crate::store::acts::{ActKind, Force};

/// An entry that cannot be the next one of the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub(crate) enum Stray {
    /// Its revision does not follow the last one.
    #[error("the log goes on with revision {next} after revision {last}")]
    Gap {
        /// Revision that is folded.
        last: i64,
        /// Revision of the entry.
        next: i64,
    },
    /// An act takes out what is not in the map, or puts back what is.
    #[error(
        "the act at revision {revision} moves {misplaced:?}, which is not where it moves it from"
    )]
    Misplaced {
        /// Revision of the act.
        revision: i64,
        /// What it moves.
        misplaced: Misplaced,
    },
}

/// A level's map and its history, up to one revision.
#[derive(Debug)]
pub(crate) struct Folding {
    level: Level,
    history: MapHistory,
    revision: i64,
    /// In the log up to there, held ones included.
    contributions: i64,
}

impl Folding {
    /// An empty level.
    pub(crate) fn empty(config: &LevelConfig) -> Self {
        Self {
            level: Level::new(*config),
            history: MapHistory::default(),
            revision: 0,
            contributions: 0,
        }
    }

    /// A level at `revision`, from the evidence stored then and the contributions up to then
    /// (without their evidence), as far as they are in force. Its history is still to be filled in.
    pub(super) fn restored(
        config: &LevelConfig,
        revision: i64,
        sums: impl IntoIterator<Item = (SliceKey, Sums)>,
        log: &[Logged],
        force: &Force,
    ) -> Self {
        let in_force = log.iter().filter(|logged| force.has(logged.revision, logged.held));
        let level = Level::restore(*config, sums, in_force.map(|logged| &*logged.contribution));
        let contributions = log.len() as i64;
        Self { level, history: MapHistory::default(), revision, contributions }
    }

    /// Folds the next entry of the log.
    ///
    /// # Errors
    /// It is not the next one; nothing has changed then.
    pub(crate) fn step(&mut self, next: &Entry) -> Result<ChangeCounts, Stray> {
        let revision = next.revision();
        if revision != self.revision + 1 {
            return Err(Stray::Gap { last: self.revision, next: revision });
        }
        let changes = match next {
            Entry::Contribution(logged) => {
                self.contributions += 1;
                if logged.held {
                    Changes::default()
                } else {
                    self.level.fold([&*logged.contribution])
                }
            }
            Entry::Act(act) => move_batch(&mut self.level, act.kind, &act.moved)
                .map_err(|misplaced| Stray::Misplaced { revision, misplaced })?,
            Entry::Import(imported) => {
                self.revision = revision;
                let tiles = imported.replace(&mut self.history.prior);
                return Ok(ChangeCounts { features: 0, tiles });
            }
            Entry::Gdb(_) => {
                self.revision = revision;
                return Ok(ChangeCounts::default());
            }
        };
        self.revision = revision;
        Ok(self.history.record(&changes, &self.level, revision))
    }

    /// Does what an act would do, without history, asks `look` about the outcome, and does the
    /// opposite: both are exact, so that the map is then what it was. The map need not be copied,
    /// which it would have to be with all that the fold remembers.
    ///
    /// # Errors
    /// It cannot be done now: nothing has changed. Or, as the outer error, the map did not come
    /// back as it was and must not be used any more.
    pub(super) fn try_out<T>(
        &mut self,
        kind: ActKind,
        moved: &Batch,
        look: impl FnOnce(&Self, &Changes) -> T,
    ) -> Result<Result<T, Misplaced>, Spoilt> {
        let changes = match move_batch(&mut self.level, kind, moved) {
            Ok(changes) => changes,
            Err(misplaced) => return Ok(Err(misplaced)),
        };
        let seen = look(self, &changes);
        let opposite = match kind {
            ActKind::Revert | ActKind::Withdraw => ActKind::Restore,
            ActKind::Restore | ActKind::Align => ActKind::Revert,
        };
        let back = move_batch(&mut self.level, opposite, moved).map_err(|Misplaced(_)| Spoilt)?;
        let as_before =
            [&changes, &back].into_iter().all(|changes| self.history.agrees(changes, &self.level));
        if as_before { Ok(Ok(seen)) } else { Err(Spoilt) }
    }

    /// Takes revisions before `next` for contributions that are not in force: for the check of a
    /// log that has lost some.
    pub(crate) fn pass_over_until(&mut self, next: i64) {
        self.revision = self.revision.max(next - 1);
    }

    /// Contributions in the log up to there.
    pub(crate) fn contributions(&self) -> i64 {
        self.contributions
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

/// A map that is not what its log folds to.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("what was tried out could not be taken back exactly")]
pub(super) struct Spoilt;

fn move_batch(level: &mut Level, kind: ActKind, moved: &Batch) -> Result<Changes, Misplaced> {
    match kind {
        ActKind::Revert | ActKind::Withdraw => level.unfold_batch(moved),
        ActKind::Restore | ActKind::Align => level.fold_batch(moved),
    }
}
