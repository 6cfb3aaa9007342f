//! The folder of a level: folds what was appended, here or by another replica, and publishes.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use mapfold_schema::v1;
use tokio::sync::{Notify, broadcast, mpsc, watch};
use tokio::time::MissedTickBehavior;

use super::folding::Folding;
use super::history::ChangeCounts;
use super::open::aside;
use super::recall::{self, Entry, Logged};
use super::registry::LevelOptions;
use super::snapshot::Snapshot;
use super::trial::{Outcome, Trial};
use crate::clock::SharedClock;
use crate::store::levels::LevelRow;
use crate::store::{Store, StoreError};

/// What the folder works with.
#[derive(Debug)]
pub(super) struct Folder {
    pub(super) row: Arc<LevelRow>,
    pub(super) store: Store,
    pub(super) clock: SharedClock,
    pub(super) options: LevelOptions,
    /// Rows that were appended here.
    pub(super) appended: mpsc::Receiver<Vec<Logged>>,
    /// Acts to be tried out.
    pub(super) trials: mpsc::Receiver<Trial>,
    /// Newest revision of the log that is known here.
    pub(super) head: Arc<AtomicI64>,
    /// Tells to look at the log now.
    pub(super) look: Arc<Notify>,
    pub(super) snapshots: watch::Sender<Arc<Snapshot>>,
    pub(super) events: broadcast::Sender<v1::LevelEvent>,
}

/// What a run of steps came to.
#[derive(Debug, Default)]
struct Progress {
    changes: ChangeCounts,
    robots: BTreeSet<Arc<str>>,
    acts: u32,
}

impl Folder {
    /// Runs until there is nothing more to fold, or something fails: the level must then be
    /// dropped and read back.
    pub(super) async fn run(mut self, mut folding: Box<Folding>) -> Result<(), StoreError> {
        let look = Arc::clone(&self.look);
        let mut poll = tokio::time::interval(self.options.poll_interval);
        poll.set_missed_tick_behavior(MissedTickBehavior::Delay);
        loop {
            tokio::select! {
                biased;
                Some(trial) = self.trials.recv() => folding = self.try_out(folding, trial).await?,
                appended = self.appended.recv() => match appended {
                    Some(appended) => folding = self.fold_appended(folding, appended).await?,
                    None => return Ok(()),
                },
                () = look.notified() => folding = self.fold_others(folding).await?,
                _ = poll.tick() => folding = self.fold_others(folding).await?,
            }
        }
    }

    /// Folds what was appended here, and before it what others put in between.
    async fn fold_appended(
        &self,
        mut folding: Box<Folding>,
        appended: Vec<Logged>,
    ) -> Result<Box<Folding>, StoreError> {
        let mut rest = appended.into_iter().map(Entry::Contribution).peekable();
        while let Some(next) = rest.peek().map(Entry::revision) {
            let folded = folding.revision();
            if next <= folded {
                // What the log gave held it already.
                rest.next();
            } else if next == folded + 1 {
                let mut run = Vec::new();
                while let Some(entry) =
                    rest.next_if(|entry| entry.revision() == folded + 1 + run.len() as i64)
                {
                    run.push(entry);
                }
                folding = self.fold(folding, run).await?;
            } else {
                let between = recall::entries_after(&self.store, &self.row, folded).await?;
                if between.is_empty() {
                    return Err(StoreError::Corrupt {
                        table: "contributions",
                        key: format!("revision {}", folded + 1),
                        detail: format!("it is not there, but {next} is"),
                    });
                }
                folding = self.fold(folding, between).await?;
            }
        }
        Ok(folding)
    }

    /// Folds what other replicas have appended.
    async fn fold_others(&self, mut folding: Box<Folding>) -> Result<Box<Folding>, StoreError> {
        let revisions = match self.store.revisions(&self.row.site, &self.row.level).await {
            Ok(revisions) => revisions,
            // Nothing is wrong with this level; the next look may find the store well again.
            Err(error) => {
                tracing::warn!(site = self.row.site, level = self.row.level, %error, "poll failed");
                return Ok(folding);
            }
        };
        let Some(revisions) = revisions else { return Ok(folding) };
        self.head.fetch_max(revisions.log, Ordering::AcqRel);
        while folding.revision() < revisions.log {
            let after = folding.revision();
            let next = match recall::entries_after(&self.store, &self.row, after).await {
                Ok(next) => next,
                Err(error @ StoreError::Corrupt { .. }) => return Err(error),
                Err(_) => break,
            };
            if next.is_empty() {
                break;
            }
            folding = self.fold(folding, next).await?;
        }
        Ok(folding)
    }

    /// Tells what an act would change.
    async fn try_out(
        &self,
        mut folding: Box<Folding>,
        trial: Trial,
    ) -> Result<Box<Folding>, StoreError> {
        let Trial { kind, moved, answer } = trial;
        // Whoever asked may have gone while others were served.
        if answer.is_closed() {
            return Ok(folding);
        }
        let (folding, outcome) = aside(move || {
            let outcome = folding.try_out(kind, &moved, Outcome::of);
            let outcome = outcome.map_err(|spoilt| StoreError::Corrupt {
                table: "levels",
                key: format!("revision {}", folding.revision()),
                detail: spoilt.to_string(),
            })?;
            Ok((folding, outcome))
        })
        .await?;
        let _ = answer.send(outcome.ok());
        Ok(folding)
    }

    /// Folds `next`, which follows what is folded, and publishes the outcome.
    async fn fold(
        &self,
        mut folding: Box<Folding>,
        next: Vec<Entry>,
    ) -> Result<Box<Folding>, StoreError> {
        if next.is_empty() {
            return Ok(folding);
        }
        let clock = Arc::clone(&self.clock);
        let (folding, progress) = aside(move || {
            let mut progress = Progress::default();
            for entry in &next {
                let started = clock.elapsed();
                progress.changes += folding.step(entry).map_err(|stray| StoreError::Corrupt {
                    table: "contributions",
                    key: format!("revision {}", entry.revision()),
                    detail: stray.to_string(),
                })?;
                let took = clock.elapsed().saturating_sub(started).as_secs_f64();
                match entry {
                    Entry::Contribution(logged) if logged.held => {}
                    Entry::Contribution(logged) => {
                        progress.robots.insert(Arc::clone(&logged.contribution.robot));
                        metrics::histogram!("mapfold_fold_duration_seconds").record(took);
                    }
                    Entry::Import(_) | Entry::Gdb(_) => progress.acts += 1,
                    Entry::Act(_) => {
                        progress.acts += 1;
                        metrics::histogram!("mapfold_act_duration_seconds").record(took);
                    }
                }
            }
            Ok((folding, progress))
        })
        .await?;
        self.publish(&folding, &progress);
        Ok(folding)
    }

    fn publish(&self, folding: &Folding, progress: &Progress) {
        let head = self.head.fetch_max(folding.revision(), Ordering::AcqRel);
        let snapshot = Arc::new(Snapshot::of(folding, head));
        metrics::gauge!(
            "mapfold_level_fold_lag",
            "site" => self.row.site.clone(),
            "level" => self.row.level.clone()
        )
        .set((snapshot.revision() - snapshot.folded_revision()) as f64);
        self.snapshots.send_replace(snapshot);
        // No receiver is no fault: nobody looks at the moment.
        let _ = self.events.send(v1::LevelEvent {
            revision: folding.revision(),
            robots: progress.robots.iter().map(ToString::to_string).collect(),
            features: progress.changes.features,
            tiles: progress.changes.tiles,
            acts: progress.acts,
        });
    }
}
