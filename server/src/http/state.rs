//! What all handlers share.

use std::sync::Arc;

use mapfold_schema::border::{DEFAULT_LIMITS, Limits};
use tokio::sync::{Semaphore, watch};

use super::drawing::Drawing;
use super::observe::Metrics;
use crate::chance::Chance;
use crate::clock::SharedClock;
use crate::config::HttpLimits;
use crate::exchange::png_tiles::PictureCache;
use crate::level::Levels;
use crate::store::Store;

/// Exports that are written at a time: each may take a processor for seconds.
const EXPORTS_MAX: usize = 2;

/// What the HTTP side stands on.
#[derive(Debug)]
pub struct Parts {
    /// What is on disk.
    pub store: Store,
    /// What is in memory.
    pub levels: Levels,
    /// Time.
    pub clock: SharedClock,
    /// Randomness.
    pub chance: Chance,
    /// What one client may take.
    pub limits: HttpLimits,
    /// Becomes true when the server is about to stop.
    pub closing: watch::Receiver<bool>,
}

/// Shared by all handlers; clones are cheap.
#[derive(Debug, Clone)]
pub struct App(Arc<Inner>);

/// The fields of [`App`].
#[derive(Debug)]
pub struct Inner {
    pub(super) parts: Parts,
    pub(super) upload_limits: Limits,
    pub(super) pictures: PictureCache,
    pub(super) drawing: Drawing,
    pub(super) metrics: Metrics,
    pub(super) streams: Arc<Semaphore>,
    pub(super) exports: Semaphore,
}

impl App {
    /// Puts the parts together.
    pub fn new(parts: Parts) -> Self {
        Self(Arc::new(Inner {
            streams: Arc::new(Semaphore::new(parts.limits.streams_max)),
            exports: Semaphore::new(EXPORTS_MAX),
            upload_limits: DEFAULT_LIMITS,
            pictures: PictureCache::default(),
            drawing: Drawing::default(),
            metrics: Metrics::default(),
            parts,
        }))
    }

    /// Now, microseconds since 1970.
    pub(super) fn now_us(&self) -> i64 {
        self.0.parts.clock.now_us()
    }

    pub(super) fn store(&self) -> &Store {
        &self.0.parts.store
    }

    /// Makes `/metrics` tell of the whole process, not only of this server's HTTP side.
    pub fn record_process(&self) {
        self.0.metrics.take_process();
    }

    /// What has to be done now and then.
    pub fn upkeep(&self) {
        self.0.metrics.upkeep();
    }

    pub(super) fn is_closing(&self) -> bool {
        *self.0.parts.closing.borrow()
    }
}

impl std::ops::Deref for App {
    type Target = Inner;

    fn deref(&self) -> &Inner {
        &self.0
    }
}
