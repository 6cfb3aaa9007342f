//! The folder of a level: folds what was appended, here or by another replica, and publishes.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use mapfold_schema::v1;
use tokio::sync::{Notify, broadcast, mpsc, watch};
use tokio::time::MissedTickBehavior;

use super::folding::Folding;
use super::history::ChangeCounts;
use super::open::{LOG_PAGE, aside};
use super::recall::{self, Logged};
use super::registry::LevelOptions;
use super::snapshot::Snapshot;
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
                appended = self.appended.recv() => match appended {
                    Some(appended) => folding = self.fold_appended(folding, appended).await?,
                    None => return Ok(()),
                },
                () = look.notified() => folding = self.fold_others(folding).await?,
                _ = poll.tick() => folding = self.fold_others(folding).await?,
            }
        }
    }

    /// Folds what was appended here, and before it what another replica put in between.
    async fn fold_appended(
        &self,
        mut folding: Box<Folding>,
        mut appended: Vec<Logged>,
    ) -> Result<Box<Folding>, StoreError> {
        let Some(first) = appended.first().map(|logged| logged.revision) else {
            return Ok(folding);
        };
        while folding.revision() + 1 < first {
            let page = self.read_log(folding.revision()).await?;
            if page.is_empty() {
                break;
            }
            folding = self.fold(folding, page).await?;
        }
        // What the log gave may hold some of these already.
        appended.retain(|logged| logged.revision > folding.revision());
        self.fold(folding, appended).await
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
            let page = match self.read_log(folding.revision()).await {
                Ok(page) => page,
                Err(error @ StoreError::Corrupt { .. }) => return Err(error),
                Err(_) => break,
            };
            if page.is_empty() {
                break;
            }
            folding = self.fold(folding, page).await?;
        }
        Ok(folding)
    }

    async fn read_log(&self, after: i64) -> Result<Vec<Logged>, StoreError> {
        let rows = self.store.log_after(&self.row.site, &self.row.level, after, LOG_PAGE).await?;
        let target = recall::target(&self.row);
        aside(move || rows.iter().map(|row| recall::whole(row, &target)).collect()).await
    }

    /// Folds `next`, which follows what is folded, and publishes the outcome.
    async fn fold(
        &self,
        mut folding: Box<Folding>,
        next: Vec<Logged>,
    ) -> Result<Box<Folding>, StoreError> {
        if next.is_empty() {
            return Ok(folding);
        }
        let clock = Arc::clone(&self.clock);
        let (folding, progress) = aside(move || {
            let mut progress = Progress::default();
            for logged in &next {
                let started = clock.elapsed();
                progress.changes += folding.step(logged).map_err(|gap| StoreError::Corrupt {
                    table: "contributions",
                    key: format!("revision {}", logged.revision),
                    detail: gap.to_string(),
                })?;
                if logged.in_force() {
                    progress.robots.insert(Arc::clone(&logged.contribution.robot));
                    let took = clock.elapsed().saturating_sub(started);
                    metrics::histogram!("mapfold_fold_duration_seconds").record(took.as_secs_f64());
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
        });
    }
}
