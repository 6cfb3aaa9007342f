//! Levels in memory: one owning task per level, its queue, its fold, and what it publishes.
//!
//! A contribution is *accepted* (checked and encoded, by the caller), *appended* to the log
//! together with whatever else is waiting, acknowledged, *folded*, *published* as a new
//! [`Snapshot`] and *written behind*. Acts (reverts and their undoing), imports and edits of
//! the GDB go into the same log and are folded like contributions. Memory is a cache of the store, never the reverse: whatever
//! fails here, the level is dropped and read back. Knows the store and the map, not HTTP.

mod accept;
pub mod alignments;
mod append;
pub mod changes;
mod fold;
pub(crate) mod folding;
pub mod gdb;
mod gdb_prior;
mod history;
pub mod learned;
mod open;
pub(crate) mod prior;
pub(crate) mod recall;
mod recent;
mod registry;
mod reverting;
pub(crate) mod rows;
mod since;
mod snapshot;
mod trial;
mod walls;
mod write_behind;

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};
use std::time::Duration;

use mapfold_map::raster::TILE_SIDE;
use mapfold_schema::border::{Limits, Target};
use mapfold_schema::v1;
use tokio::sync::{Notify, broadcast, mpsc, oneshot, watch};
use uuid::Uuid;

pub use accept::Accepted;
pub use registry::{LevelError, LevelOptions, Levels};
pub use reverting::RevertError;
pub use since::SinceError;
pub use snapshot::Snapshot;

use crate::store::levels::LevelRow;
use crate::store::{Store, StoreError};
use alignments::AlignmentCache;
use append::Waiting;
use changes::ChangeCache;
use gdb::ModelCache;
use learned::LearnedCache;
use registry::DiskAlarm;
use trial::Trial;

/// Why a contribution was not acknowledged. Nothing of it is in the log then, except after
/// [`SubmitError::Unavailable`], which leaves that open: sending it again is safe and tells.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SubmitError {
    /// Too many contributions wait for this level; try again in a second or two.
    #[error("the queue of level {level:?} is full ({capacity} contributions)")]
    QueueFull {
        /// Slug of the level.
        level: String,
        /// How many may wait.
        capacity: usize,
    },
    /// The id stands in the log with other content.
    #[error("contribution {id} is in the log already, as revision {revision}, with other content")]
    Conflict {
        /// The contribution.
        id: Uuid,
        /// Where the other content stands.
        revision: i64,
    },
    /// The robot is not enrolled on the site.
    #[error("robot {robot:?} is not enrolled")]
    UnknownRobot {
        /// Its slug.
        robot: String,
    },
    /// No space is left for the log.
    #[error("the disk of the database is full")]
    DiskFull,
    /// The store did not answer, or the level is closing.
    #[error("the log cannot be written at the moment: {0}")]
    Unavailable(String),
}

/// Which level it is.
#[derive(Debug, PartialEq, Eq)]
struct Identity {
    site: String,
    level: String,
}

/// The near end of an open level.
#[derive(Debug)]
struct Shared {
    /// As it was when the level was opened.
    row: Arc<LevelRow>,
    capacity: usize,
    queue: mpsc::Sender<Waiting>,
    snapshots: watch::Receiver<Arc<Snapshot>>,
    /// Weak, so that receivers learn of the level's end though handles are held.
    events: broadcast::WeakSender<v1::LevelEvent>,
    /// Newest revision of the log that is known here.
    head: Arc<AtomicI64>,
    /// Tells the fold to look at the log now.
    look: Arc<Notify>,
    /// Acts to be tried out by the fold.
    trials: mpsc::Sender<Trial>,
    /// Models of the GDB that were read.
    models: ModelCache,
    /// What the map says against them.
    changes: ChangeCache,
    /// Where robots' own frames seem to lie.
    alignments: AlignmentCache,
    /// Landmarks that the map teaches.
    learned: LearnedCache,
    store: Store,
    alarm: DiskAlarm,
}

/// An open level. Clones are cheap; as long as one is held the level stays open.
#[derive(Debug, Clone)]
pub struct LevelHandle {
    shared: Arc<Shared>,
}

impl LevelHandle {
    /// Slug of its site.
    pub fn site(&self) -> &str {
        &self.shared.row.site
    }

    /// Slug.
    pub fn level(&self) -> &str {
        &self.shared.row.level
    }

    /// UUID of its frame.
    pub fn frame(&self) -> Uuid {
        self.shared.row.frame
    }

    /// Edge of a cell, metres.
    pub fn resolution_m(&self) -> f64 {
        self.shared.row.resolution_m
    }

    /// A disk that has failed under an entry of the log has failed under all.
    fn watched<T>(&self, outcome: Result<T, StoreError>) -> Result<T, StoreError> {
        if let Err(StoreError::DiskFailed(why)) = &outcome {
            self.shared.alarm.raise(why.clone());
        }
        outcome
    }

    /// Has the folder look for what is in the log at `revision`.
    fn look_for(&self, revision: i64) {
        self.shared.head.fetch_max(revision, Ordering::AcqRel);
        self.shared.look.notify_one();
    }

    /// What a contribution to it is checked against.
    pub fn target(&self, limits: Limits) -> Target {
        Target { frame: self.frame(), resolution_m: self.resolution_m(), limits }
    }

    /// The level in words and figures.
    pub fn describe(&self) -> v1::LevelDescription {
        let row = &self.shared.row;
        let snapshot = self.snapshot();
        v1::LevelDescription {
            site: row.site.clone(),
            level: row.level.clone(),
            name: row.name.clone(),
            frame: row.frame,
            resolution_m: row.resolution_m,
            tile_cells: TILE_SIDE as u32,
            elevation_m: row.elevation_m,
            evidence_slice_s: row.slice_s,
            revision: self.shared.head.load(Ordering::Acquire).max(snapshot.revision()),
            folded_revision: snapshot.folded_revision(),
            bounds: snapshot.bounds(),
            counts: snapshot.counts(),
            published: None,
        }
    }

    /// Hands a contribution in; resolves when it is on disk. The same id and content gets the
    /// same receipt, however often it is sent.
    ///
    /// # Errors
    /// Why there is no receipt.
    pub async fn submit(&self, accepted: Accepted) -> Result<v1::Receipt, SubmitError> {
        match self.submit_many(vec![accepted]).await.pop() {
            Some(outcome) => outcome,
            None => Err(self.closing()),
        }
    }

    /// Hands several contributions in, each with an answer of its own, in their order. Either all
    /// of them find a place in the queue or none does.
    pub async fn submit_many(
        &self,
        accepted: Vec<Accepted>,
    ) -> Vec<Result<v1::Receipt, SubmitError>> {
        let count = accepted.len();
        let places = match self.shared.queue.try_reserve_many(count) {
            Ok(places) => places,
            Err(mpsc::error::TrySendError::Full(())) => {
                metrics::counter!("mapfold_contributions_total", "outcome" => "queue_full")
                    .increment(count as u64);
                return vec![Err(self.queue_full()); count];
            }
            Err(mpsc::error::TrySendError::Closed(())) => return vec![Err(self.closing()); count],
        };
        let answers: Vec<oneshot::Receiver<_>> = places
            .zip(accepted)
            .map(|(place, accepted)| {
                let (answer, receiver) = oneshot::channel();
                place.send(Waiting { accepted, answer });
                receiver
            })
            .collect();
        let mut outcomes = Vec::with_capacity(count);
        for answer in answers {
            outcomes.push(answer.await.unwrap_or_else(|_| Err(self.closing())));
        }
        outcomes
    }

    fn queue_full(&self) -> SubmitError {
        SubmitError::QueueFull { level: self.level().to_owned(), capacity: self.shared.capacity }
    }

    fn closing(&self) -> SubmitError {
        SubmitError::Unavailable(format!("level {:?} is closing", self.level()))
    }

    /// What is published now.
    pub fn snapshot(&self) -> Arc<Snapshot> {
        Arc::clone(&self.shared.snapshots.borrow())
    }

    /// What is published once it has reached `revision`, or what is published after `patience` if
    /// it has not: for a reader that another replica has served before.
    pub async fn snapshot_at(&self, revision: i64, patience: Duration) -> Arc<Snapshot> {
        let mut snapshots = self.shared.snapshots.clone();
        if snapshots.borrow().folded_revision() < revision {
            self.shared.look.notify_one();
            let reached = snapshots.wait_for(|s| s.folded_revision() >= revision);
            // Late or closing: what there is, is the answer.
            let _ = tokio::time::timeout(patience, reached).await;
        }
        self.snapshot()
    }

    /// Events from now on, one for each published snapshot. A receiver that lags by more than
    /// [`LevelOptions::event_capacity`] is told so and must read again from its revision. It ends
    /// when the level is closed.
    pub fn events(&self) -> broadcast::Receiver<v1::LevelEvent> {
        match self.shared.events.upgrade() {
            Some(events) => events.subscribe(),
            None => broadcast::Sender::new(1).subscribe(),
        }
    }
}
