//! Drains an outbox into a level, and says honestly what became of everything in it.
//!
//! Several requests are in flight at a time. What fails for now is sent again, after a wait, for
//! as long as it takes; while nothing gets through, one request at a time asks whether it does.
//! What the server refuses is parked, and the queue behind it moves. Order does not matter: the
//! map is the same in whatever order contributions arrive.

mod run;
mod verdict;

use std::sync::Arc;
use std::time::Duration;

use rand::Rng;
use tokio::sync::watch;

use super::{
    Api, ApiError, BackoffConfig, LevelAddress, Outbox, OutboxContents, OutboxError, Traffic,
};

/// How to upload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct UploadConfig {
    /// Requests in flight at a time, at least one.
    pub in_flight_max: usize,
    /// Contributions in one request; the server takes 64.
    pub batch_max: usize,
    /// Bytes of one request before packing. A contribution that is larger goes alone.
    pub batch_bytes_max: usize,
    /// Waits between tries.
    pub backoff: BackoffConfig,
    /// Give up after this long; never if absent.
    pub deadline: Option<Duration>,
}

impl UploadConfig {
    /// Two requests in flight, 64 contributions or 3 MB each, for as long as it takes.
    pub const STANDARD: Self = Self {
        in_flight_max: 2,
        batch_max: 64,
        batch_bytes_max: 3_000_000,
        backoff: BackoffConfig::QUICK,
        deadline: None,
    };
}

/// How far an upload has come: sums since the uploader was made.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct UploadProgress {
    /// Contributions sent, each time counted.
    pub sent: u64,
    /// Contributions acknowledged.
    pub acknowledged: u64,
    /// Contributions refused and parked.
    pub refused: u64,
    /// Requests that came to nothing and had to be repeated.
    pub retries: u64,
    /// What went over the wire by the uploader's [`Api`] and its clones.
    pub traffic: Traffic,
    /// Highest revision in a receipt.
    pub revision: Option<i64>,
    /// Why the last request came to nothing; absent while all is well.
    pub trouble: Option<String>,
}

/// Why an upload ended.
#[derive(Debug)]
pub enum UploadEnd {
    /// Nothing waits any more and nothing more is to come.
    Drained,
    /// The deadline passed.
    DeadlinePassed,
    /// The server refuses all that this robot sends (a wrong token, a level or robot that is not
    /// there), or nothing can be sent to it at all. What waits still waits.
    Refused(ApiError),
    /// The outbox failed.
    Outbox(OutboxError),
}

/// What became of everything.
#[derive(Debug)]
pub struct UploadSummary {
    /// Why it ended.
    pub end: UploadEnd,
    /// How far it came.
    pub progress: UploadProgress,
    /// What the outbox holds now.
    pub contents: OutboxContents,
}

impl UploadSummary {
    /// Whether all that was put into the outbox is acknowledged: nothing waits, nothing was
    /// refused (now or in an earlier run), nothing was found damaged.
    pub fn is_complete(&self) -> bool {
        matches!(self.end, UploadEnd::Drained)
            && self.contents.waiting == 0
            && self.contents.refused == 0
            && self.contents.corrupt == 0
    }
}

/// Drains an outbox into a level.
#[derive(Debug)]
pub struct Uploader {
    api: Api,
    outbox: Arc<Outbox>,
    level: LevelAddress,
    config: UploadConfig,
    traffic_before: Traffic,
    progress: watch::Sender<UploadProgress>,
}

impl Uploader {
    /// Nothing is sent before [`Self::run`].
    pub fn new(api: Api, outbox: Arc<Outbox>, level: LevelAddress, config: UploadConfig) -> Self {
        let traffic_before = api.traffic();
        let progress = watch::Sender::new(UploadProgress::default());
        Self { api, outbox, level, config, traffic_before, progress }
    }

    /// How far it has come, as it changes.
    pub fn progress(&self) -> watch::Receiver<UploadProgress> {
        self.progress.subscribe()
    }

    /// Uploads until nothing waits and `finished` says true (or its sender is gone): then nothing
    /// more is to come. May be dropped at any time: what is not acknowledged on disk by then waits
    /// in the outbox and is sent again another time.
    pub async fn run(
        &self,
        finished: watch::Receiver<bool>,
        rng: &mut (impl Rng + Send),
    ) -> UploadSummary {
        let end = run::run(self, finished, rng).await;
        self.advance(|_| ());
        let (progress, contents) = (self.progress.borrow().clone(), self.outbox.contents());
        UploadSummary { end, progress, contents }
    }

    /// Uploads what waits now.
    pub async fn drain(&self, rng: &mut (impl Rng + Send)) -> UploadSummary {
        let (_, finished) = watch::channel(true);
        self.run(finished, rng).await
    }

    fn advance(&self, change: impl FnOnce(&mut UploadProgress)) {
        let (now, before) = (self.api.traffic(), self.traffic_before);
        self.progress.send_modify(|progress| {
            progress.traffic = Traffic {
                requests: now.requests - before.requests,
                bytes_up: now.bytes_up - before.bytes_up,
                bytes_down: now.bytes_down - before.bytes_down,
            };
            change(progress);
        });
    }
}

#[cfg(test)]
mod tests;
