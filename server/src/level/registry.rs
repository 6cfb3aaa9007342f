//! Which levels are open: opens them on demand and closes them when nobody needs them.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicI64;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::time::Duration;

use tokio::sync::{Mutex as AsyncMutex, Notify, broadcast, mpsc, watch};
use tokio::task::JoinHandle;

use super::alignments::AlignmentCache;
use super::append::Appender;
use super::changes::ChangeCache;
use super::fold::Folder;
use super::gdb::ModelCache;
use super::learned::LearnedCache;
use super::open::{self, Opened};
use super::snapshot::Snapshot;
use super::write_behind::Writer;
use super::{Identity, LevelHandle, Shared};
use crate::clock::SharedClock;
use crate::store::{Store, StoreError};

/// How levels are kept. Every queue and every wait has its limit here.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct LevelOptions {
    /// Contributions that may wait for one level.
    pub queue_capacity: usize,
    /// Contributions in one transaction, 64 at most.
    pub batch_max: usize,
    /// Batches that may be on disk and wait for the fold; then appending waits too.
    pub fold_backlog_max: usize,
    /// Longest time between a change and its row on disk.
    pub write_behind_interval: Duration,
    /// Revisions after which changes are written early.
    pub write_behind_revisions: i64,
    /// How often the log is looked at for what other replicas appended.
    pub poll_interval: Duration,
    /// After how long without any handle a level is closed.
    pub idle_close: Duration,
    /// Events that a slow receiver may lag behind.
    pub event_capacity: usize,
}

impl Default for LevelOptions {
    fn default() -> Self {
        Self {
            queue_capacity: 1024,
            batch_max: 64,
            fold_backlog_max: 16,
            write_behind_interval: Duration::from_secs(2),
            write_behind_revisions: 500,
            poll_interval: Duration::from_secs(1),
            idle_close: Duration::from_mins(5),
            event_capacity: 256,
        }
    }
}

/// Why a level cannot be opened.
#[derive(Debug, thiserror::Error)]
pub enum LevelError {
    /// The store failed, or holds what it should not.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// The server is shutting down.
    #[error("the server is shutting down")]
    Closing,
}

/// Tells the program that the database's disk has failed.
#[derive(Debug, Clone)]
pub(super) struct DiskAlarm(Arc<watch::Sender<Option<String>>>);

impl DiskAlarm {
    pub(super) fn raise(&self, why: String) {
        tracing::error!(why, "the disk of the database failed");
        self.0.send_replace(Some(why));
    }

    pub(super) fn is_raised(&self) -> bool {
        self.0.borrow().is_some()
    }
}

/// The open levels. Clones share them.
#[derive(Debug, Clone)]
pub struct Levels {
    inner: Arc<Inner>,
}

#[derive(Debug)]
struct Inner {
    store: Store,
    clock: SharedClock,
    options: LevelOptions,
    alarm: DiskAlarm,
    slots: Mutex<Slots>,
}

/// Held for lines, never across a wait.
#[derive(Debug, Default)]
struct Slots {
    closing: bool,
    slots: BTreeMap<(String, String), Slot>,
}

/// Locked while its level is being opened or closed.
type Slot = Arc<AsyncMutex<Option<Open>>>;

#[derive(Debug)]
struct Open {
    shared: Arc<Shared>,
    stop: Arc<Notify>,
    task: JoinHandle<()>,
    /// Since when nobody has held a handle, in the clock's elapsed time.
    unused_since: Option<Duration>,
}

impl Open {
    fn is_alive(&self) -> bool {
        // The appender still takes, the folder still publishes, and neither has panicked.
        !self.shared.queue.is_closed()
            && self.shared.snapshots.has_changed().is_ok()
            && !self.task.is_finished()
    }

    /// Commits and folds what waits, writes what is unwritten, and ends.
    async fn close(self) {
        self.stop.notify_one();
        drop(self.shared);
        if let Err(error) = self.task.await {
            tracing::error!(%error, "a level did not end well");
        }
    }
}

impl Levels {
    /// No level is open yet. Starts the task that closes idle ones, so it must be called within a
    /// tokio runtime.
    pub fn new(store: Store, clock: SharedClock, options: LevelOptions) -> Self {
        let alarm = DiskAlarm(Arc::new(watch::Sender::new(None)));
        let slots = Mutex::default();
        let inner = Arc::new(Inner { store, clock, options, alarm, slots });
        tokio::spawn(close_idle(Arc::downgrade(&inner), options.idle_close));
        Self { inner }
    }

    /// The level, opened if it is not; `None` if there is no such level.
    ///
    /// # Errors
    /// It cannot be read, or the server is shutting down.
    pub async fn open(&self, site: &str, level: &str) -> Result<Option<LevelHandle>, LevelError> {
        let key = (site.to_owned(), level.to_owned());
        let slot = self.inner.slots().find(&key)?;
        let slot = match slot {
            Some(slot) => slot,
            // Only levels that exist get a slot: names are anybody's to invent.
            None if self.inner.store.level(site, level).await?.is_none() => return Ok(None),
            None => self.inner.slots().make(key)?,
        };
        let mut slot = slot.lock().await;
        if let Some(open) = slot.as_ref().filter(|open| open.is_alive()) {
            return Ok(Some(LevelHandle { shared: Arc::clone(&open.shared) }));
        }
        if let Some(dead) = slot.take() {
            dead.close().await;
        }
        let started = self.inner.clock.elapsed();
        let Some(opened) = open::open(&self.inner.store, site, level).await? else {
            return Ok(None);
        };
        let took = self.inner.clock.elapsed().saturating_sub(started);
        metrics::histogram!("mapfold_level_open_duration_seconds").record(took.as_secs_f64());
        tracing::info!(site, level, revision = opened.folding.revision(), ?took, "level opened");
        // Shutdown may have begun while this one was being read: it then knows nothing of it.
        if self.inner.slots().closing {
            return Err(LevelError::Closing);
        }
        let open = self.inner.start(opened);
        let handle = LevelHandle { shared: Arc::clone(&open.shared) };
        *slot = Some(open);
        Ok(Some(handle))
    }

    /// Stops taking contributions, commits and folds what waits, writes what is unwritten and
    /// closes all levels.
    pub async fn shutdown(&self) {
        let slots: Vec<Slot> = {
            let mut slots = self.inner.slots();
            slots.closing = true;
            std::mem::take(&mut slots.slots).into_values().collect()
        };
        let closing = slots.into_iter().map(|slot| async move {
            if let Some(open) = slot.lock().await.take() {
                open.close().await;
            }
        });
        futures_util::future::join_all(closing).await;
    }

    /// Resolves when the database's disk has failed: the program should then stop (with a failure
    /// as its exit status), so that a restart reads back what is really there.
    pub async fn disk_failed(&self) -> String {
        let mut failed = self.inner.alarm.0.subscribe();
        match failed.wait_for(Option::is_some).await {
            Ok(why) => why.clone().unwrap_or_default(),
            // The sender lives as long as this registry does.
            Err(_) => std::future::pending().await,
        }
    }
}

impl Slots {
    fn find(&self, key: &(String, String)) -> Result<Option<Slot>, LevelError> {
        if self.closing { Err(LevelError::Closing) } else { Ok(self.slots.get(key).cloned()) }
    }

    fn make(&mut self, key: (String, String)) -> Result<Slot, LevelError> {
        if self.closing {
            return Err(LevelError::Closing);
        }
        Ok(Arc::clone(self.slots.entry(key).or_default()))
    }
}

impl Inner {
    fn slots(&self) -> MutexGuard<'_, Slots> {
        // Nothing that runs under this lock can leave it half done.
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Starts the task that owns a level.
    fn start(&self, opened: Opened) -> Open {
        let Opened { row, folding } = opened;
        let row = Arc::new(row);
        let identity = Arc::new(Identity { site: row.site.clone(), level: row.level.clone() });
        let options = self.options;
        let head = Arc::new(AtomicI64::new(row.revision.max(folding.revision())));
        let (stop, look) = (Arc::new(Notify::new()), Arc::new(Notify::new()));
        let (queue, waiting) = mpsc::channel(options.queue_capacity.max(1));
        let (fold, appended) = mpsc::channel(options.fold_backlog_max.max(1));
        let (trials, tried) = mpsc::channel(1);
        let snapshot = Arc::new(Snapshot::of(&folding, row.revision));
        let (snapshots, published) = watch::channel(snapshot);
        let events = broadcast::Sender::new(options.event_capacity.max(1));
        let weak_events = events.downgrade();

        let appender = Appender {
            identity: Arc::clone(&identity),
            store: self.store.clone(),
            clock: Arc::clone(&self.clock),
            options,
            queue: waiting,
            fold,
            head: Arc::clone(&head),
            stop: Arc::clone(&stop),
            alarm: self.alarm.clone(),
        };
        let folder = Folder {
            row: Arc::clone(&row),
            store: self.store.clone(),
            clock: Arc::clone(&self.clock),
            options,
            appended,
            trials: tried,
            head: Arc::clone(&head),
            look: Arc::clone(&look),
            snapshots,
            events,
        };
        let writer = Writer {
            identity: Arc::clone(&identity),
            store: self.store.clone(),
            clock: Arc::clone(&self.clock),
            options,
            snapshots: published.clone(),
            alarm: self.alarm.clone(),
        };
        let stop_all = Arc::clone(&stop);
        let task = tokio::spawn(async move {
            metrics::gauge!("mapfold_levels_open").increment(1.0);
            let folder = async {
                if let Err(error) = folder.run(folding).await {
                    // The others must end too: what is appended now would not be folded. Whoever
                    // asks for the level next has it read back.
                    stop_all.notify_one();
                    tracing::error!(
                        site = identity.site,
                        level = identity.level,
                        %error,
                        "level dropped from memory"
                    );
                    metrics::counter!("mapfold_levels_dropped_total").increment(1);
                }
            };
            tokio::join!(appender.run(), folder, writer.run());
            metrics::gauge!("mapfold_levels_open").decrement(1.0);
        });
        let capacity = options.queue_capacity.max(1);
        let shared = Arc::new(Shared {
            row,
            capacity,
            queue,
            snapshots: published,
            events: weak_events,
            head,
            look,
            trials,
            models: ModelCache::default(),
            changes: ChangeCache::default(),
            alignments: AlignmentCache::default(),
            learned: LearnedCache::default(),
            store: self.store.clone(),
            alarm: self.alarm.clone(),
        });
        Open { shared, stop, task, unused_since: None }
    }
}

/// Closes levels that nobody has held for `idle_close`, until the registry is gone.
async fn close_idle(inner: Weak<Inner>, idle_close: Duration) {
    loop {
        tokio::time::sleep(idle_close / 4).await;
        let Some(inner) = inner.upgrade() else { return };
        let slots: Vec<((String, String), Slot)> =
            inner.slots().slots.iter().map(|(key, slot)| (key.clone(), Arc::clone(slot))).collect();
        for (key, slot) in slots {
            // One that is being opened or closed is in use.
            let Ok(mut guard) = slot.try_lock() else { continue };
            if let Some(open) = guard.as_mut().filter(|open| open.is_alive()) {
                // One is the registry's; handles hold the others.
                if Arc::strong_count(&open.shared) > 1 {
                    open.unused_since = None;
                    continue;
                }
                let now = inner.clock.elapsed();
                let since = *open.unused_since.get_or_insert(now);
                if now.saturating_sub(since) < idle_close {
                    continue;
                }
            }
            if let Some(open) = guard.take() {
                tracing::info!(site = key.0, level = key.1, "idle level closed");
                open.close().await;
            }
            drop(guard);
            // Whoever waits for the slot keeps it: it is the one that it will open the level in.
            let mut slots = inner.slots();
            if Arc::strong_count(&slot) == 2 {
                slots.slots.remove(&key);
            }
        }
    }
}
