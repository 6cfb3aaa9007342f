//! The writer of a level: brings the folded map to disk, behind the log.
//!
//! It needs no list of what is unwritten: the map's history tells what changed after the revision
//! that the store has reached. Losing it loses nothing, the log holds everything.

use std::sync::Arc;

use tokio::sync::watch;
use tokio::time::MissedTickBehavior;

use super::Identity;
use super::open::aside;
use super::registry::{DiskAlarm, LevelOptions};
use super::rows;
use super::snapshot::Snapshot;
use crate::clock::SharedClock;
use crate::store::map_rows::WriteBehind;
use crate::store::{Store, StoreError};

/// What the writer works with.
#[derive(Debug)]
pub(super) struct Writer {
    pub(super) identity: Arc<Identity>,
    pub(super) store: Store,
    pub(super) clock: SharedClock,
    pub(super) options: LevelOptions,
    pub(super) snapshots: watch::Receiver<Arc<Snapshot>>,
    pub(super) alarm: DiskAlarm,
}

impl Writer {
    /// Runs until nothing more is published, and writes the last of it.
    pub(super) async fn run(mut self) {
        let mut written = 0;
        let mut tick = tokio::time::interval(self.options.write_behind_interval);
        tick.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            let last = tokio::select! {
                changed = self.snapshots.changed() => match changed {
                    Ok(()) => {
                        let ahead = self.snapshots.borrow().folded_revision() - written;
                        if ahead < self.options.write_behind_revisions {
                            continue;
                        }
                        false
                    }
                    Err(_) => true,
                },
                _ = tick.tick() => false,
            };
            let snapshot = Arc::clone(&self.snapshots.borrow_and_update());
            match self.write(&snapshot, written).await {
                Ok(revision) => written = revision,
                Err(error) => {
                    tracing::warn!(
                        site = self.identity.site,
                        level = self.identity.level,
                        %error,
                        "write-behind failed"
                    );
                    metrics::counter!("mapfold_write_behind_failures_total").increment(1);
                    if let StoreError::DiskFailed(why) = error {
                        self.alarm.raise(why);
                    }
                }
            }
            if last {
                return;
            }
        }
    }

    /// Writes what the store lacks of `snapshot`; the revision that the store has then, which
    /// another replica may have brought beyond.
    async fn write(&self, snapshot: &Arc<Snapshot>, written: i64) -> Result<i64, StoreError> {
        let until = snapshot.folded_revision();
        // A failed disk is not written to again: what it says then is worth nothing.
        if until <= written || self.alarm.is_raised() {
            return Ok(written);
        }
        let Identity { site, level } = &*self.identity;
        let Some(stored) = self.store.revisions(site, level).await? else { return Ok(written) };
        if until <= stored.folded {
            return Ok(stored.folded);
        }
        let started = self.clock.elapsed();
        let source = Arc::clone(snapshot);
        let rows = aside(move || rows::changed(source.history(), stored.folded, until)).await?;
        let outcome = self.store.write_map(site, level, stored.folded, until, &rows).await?;
        let took = self.clock.elapsed().saturating_sub(started);
        metrics::histogram!("mapfold_write_behind_duration_seconds").record(took.as_secs_f64());
        metrics::counter!("mapfold_write_behind_rows_total").increment(rows.len() as u64);
        tracing::debug!(
            site,
            level,
            from = stored.folded,
            until,
            rows = rows.len(),
            ?outcome,
            "written behind"
        );
        Ok(match outcome {
            WriteBehind::Written => until,
            WriteBehind::Overtaken(revision) => revision,
        })
    }
}
