//! One run of an uploader: what to send next, what is in flight, and when to try again.

use std::collections::{BTreeSet, VecDeque};

use mapfold_schema::problem::Problem;
use mapfold_schema::v1::UploadAnswer;
use rand::Rng;
use tokio::sync::watch;
use tokio::task::{JoinError, JoinSet, spawn_blocking};
use tokio::time::{Instant, sleep_until};

use super::verdict::{self, BatchVerdict, ItemVerdict};
use super::{UploadEnd, Uploader};
use crate::sync::api::UploadBatch;
use crate::sync::outbox::{BatchBounds, Queued};
use crate::sync::{ApiError, Backoff, OutboxError};

/// The batch of a request, and what came of it.
struct Reply {
    sequences: Vec<u64>,
    unpacked_bytes: usize,
    /// The number of outages seen when it was sent.
    outage: u64,
    outcome: Result<Vec<UploadAnswer>, ApiError>,
}

struct Run<'u> {
    uploader: &'u Uploader,
    bounds: BatchBounds,
    in_flight: JoinSet<Reply>,
    /// What is in flight, or among `divided`.
    claimed: BTreeSet<u64>,
    /// Parts of batches that were refused as a whole, to be sent apart.
    divided: VecDeque<Vec<u64>>,
    /// What the server fell over: sent again when nothing else waits.
    deferred: BTreeSet<u64>,
    backoff: Backoff,
    /// Requests that were in flight together fail together, and are one outage.
    outage: u64,
    not_before: Option<Instant>,
}

/// Runs until the end.
pub(super) async fn run(
    uploader: &Uploader,
    mut finished: watch::Receiver<bool>,
    rng: &mut (impl Rng + Send),
) -> UploadEnd {
    let config = uploader.config;
    let deadline = config.deadline.map(|deadline| Instant::now() + deadline);
    let mut contents = uploader.outbox.watch();
    let mut run = Run {
        uploader,
        bounds: BatchBounds {
            count_max: config.batch_max.max(1),
            bytes_max: config.batch_bytes_max,
        },
        in_flight: JoinSet::new(),
        claimed: BTreeSet::new(),
        divided: VecDeque::new(),
        deferred: BTreeSet::new(),
        backoff: Backoff::new(config.backoff),
        outage: 0,
        not_before: None,
    };
    loop {
        // Asked before the queue is looked at: what was pushed before it was said is then seen.
        let nothing_to_come = *finished.borrow_and_update() || finished.has_changed().is_err();
        contents.mark_unchanged();
        if let Err(end) = run.fill().await {
            return run.wind_up(end, rng).await;
        }
        let waiting = uploader.outbox.contents().waiting;
        if run.in_flight.is_empty() && nothing_to_come && waiting == 0 {
            return UploadEnd::Drained;
        }
        tokio::select! {
            Some(reply) = run.in_flight.join_next() => {
                if let Err(end) = run.settle(reply, rng).await {
                    return run.wind_up(end, rng).await;
                }
            }
            () = until(run.not_before) => run.not_before = None,
            () = until(deadline) => return UploadEnd::DeadlinePassed,
            _ = contents.changed() => {}
            _ = finished.changed(), if !nothing_to_come => {}
        }
    }
}

/// Never, if there is no such instant.
async fn until(instant: Option<Instant>) {
    match instant {
        Some(instant) => sleep_until(instant).await,
        None => std::future::pending().await,
    }
}

impl Run<'_> {
    /// Sends as much as may be in flight.
    async fn fill(&mut self) -> Result<(), UploadEnd> {
        let in_trouble = self.backoff.failures() > 0;
        let in_flight_max = if in_trouble { 1 } else { self.uploader.config.in_flight_max.max(1) };
        while self.not_before.is_none() && self.in_flight.len() < in_flight_max {
            let Some((sequences, batch)) = self.next().await? else { break };
            let (api, level) = (self.uploader.api.clone(), self.uploader.level.clone());
            let outage = self.outage;
            self.uploader.advance(|progress| progress.sent += batch.len() as u64);
            self.in_flight.spawn(async move {
                let outcome = api.upload(&level, &batch).await;
                Reply { sequences, unpacked_bytes: batch.unpacked_bytes(), outage, outcome }
            });
        }
        Ok(())
    }

    /// What to send next, claimed; `None` if nothing waits that is not in flight.
    async fn next(&mut self) -> Result<Option<(Vec<u64>, UploadBatch)>, UploadEnd> {
        while let Some(part) = self.divided.pop_front() {
            for sequence in &part {
                self.claimed.remove(sequence);
            }
            let outbox = self.uploader.outbox.clone();
            if let Some(found) = self.claim(move || outbox.read_batch(&part)).await? {
                return Ok(Some(found));
            }
        }
        let waiting = self.uploader.outbox.contents().waiting;
        if waiting > 0 && waiting == self.deferred.len() && self.in_flight.is_empty() {
            self.deferred.clear();
        }
        if waiting == self.claimed.len() + self.deferred.len() {
            return Ok(None);
        }
        let (outbox, bounds) = (self.uploader.outbox.clone(), self.bounds);
        let skipped: BTreeSet<u64> = self.claimed.union(&self.deferred).copied().collect();
        self.claim(move || outbox.next_batch(&skipped, bounds)).await
    }

    /// Reads and packs a batch off the threads that serve the network, and claims it.
    async fn claim(
        &mut self,
        read: impl FnOnce() -> Result<Vec<Queued>, OutboxError> + Send + 'static,
    ) -> Result<Option<(Vec<u64>, UploadBatch)>, UploadEnd> {
        let packed = spawn_blocking(move || {
            let queued = read().map_err(UploadEnd::Outbox)?;
            let sequences: Vec<u64> = queued.iter().map(|queued| queued.sequence).collect();
            let contributions: Vec<_> = queued.into_iter().map(|q| q.contribution).collect();
            let batch = UploadBatch::pack(&contributions).map_err(UploadEnd::Refused)?;
            Ok((sequences, batch))
        });
        let (sequences, batch) = resumed(packed.await)?;
        if sequences.is_empty() {
            return Ok(None);
        }
        self.claimed.extend(&sequences);
        Ok(Some((sequences, batch)))
    }

    /// Draws the conclusions from a reply.
    async fn settle(
        &mut self,
        reply: Result<Reply, JoinError>,
        rng: &mut (impl Rng + Send),
    ) -> Result<(), UploadEnd> {
        let Reply { sequences, unpacked_bytes, outage, outcome } = resumed(reply);
        for sequence in &sequences {
            self.claimed.remove(sequence);
        }
        match outcome {
            Ok(answers) => self.settle_answers(&sequences, answers, outage, rng).await,
            Err(error) => self.settle_error(sequences, unpacked_bytes, outage, error, rng).await,
        }
    }

    async fn settle_answers(
        &mut self,
        sequences: &[u64],
        answers: Vec<UploadAnswer>,
        outage: u64,
        rng: &mut (impl Rng + Send),
    ) -> Result<(), UploadEnd> {
        let (mut acknowledged, mut refused) = (Vec::new(), Vec::new());
        let (mut later, mut stop) = (None, None);
        for (sequence, answer) in sequences.iter().zip(answers) {
            match verdict::of_answer(answer) {
                ItemVerdict::Acknowledged(revision) => acknowledged.push((*sequence, revision)),
                ItemVerdict::Refused(problem) => refused.push((*sequence, problem)),
                ItemVerdict::Later(problem) => later = Some(problem),
                ItemVerdict::Stop(problem) => stop = Some(problem),
            }
        }
        if !acknowledged.is_empty() || !refused.is_empty() {
            self.got_through();
        }
        self.record(acknowledged, refused).await?;
        if let Some(problem) = later {
            self.uploader.advance(|progress| progress.retries += 1);
            self.wait(outage, None, problem.detail, rng);
        }
        match stop {
            Some(problem) => Err(UploadEnd::Refused(ApiError::Refused(problem))),
            None => Ok(()),
        }
    }

    /// Puts on disk what was taken and what was refused.
    async fn record(
        &self,
        acknowledged: Vec<(u64, i64)>,
        refused: Vec<(u64, Box<Problem>)>,
    ) -> Result<(), UploadEnd> {
        let (acknowledged_count, refused_count) = (acknowledged.len(), refused.len());
        let revision = acknowledged.iter().map(|(_, revision)| *revision).max();
        let outbox = self.uploader.outbox.clone();
        let recorded = spawn_blocking(move || {
            if !acknowledged.is_empty() {
                outbox.acknowledge(&acknowledged)?;
            }
            for (sequence, problem) in &refused {
                outbox.refuse(*sequence, problem)?;
                tracing::warn!(
                    code = problem.code,
                    detail = problem.detail,
                    errors = ?problem.errors,
                    "the server refused a contribution; it lies in the outbox under refused/"
                );
            }
            Ok(())
        });
        resumed(recorded.await).map_err(UploadEnd::Outbox)?;
        self.uploader.advance(|progress| {
            progress.acknowledged += acknowledged_count as u64;
            progress.refused += refused_count as u64;
            progress.revision = progress.revision.max(revision);
        });
        Ok(())
    }

    async fn settle_error(
        &mut self,
        sequences: Vec<u64>,
        unpacked_bytes: usize,
        outage: u64,
        error: ApiError,
        rng: &mut (impl Rng + Send),
    ) -> Result<(), UploadEnd> {
        let verdict = verdict::of_error(&error);
        if !matches!(verdict, BatchVerdict::Stop) {
            tracing::debug!(%error, contributions = sequences.len(), "an upload came to nothing");
        }
        match verdict {
            BatchVerdict::Stop => return Err(UploadEnd::Refused(error)),
            BatchVerdict::Later => {}
            BatchVerdict::LaterApart => self.divide(&sequences, |run, alone| {
                run.deferred.insert(alone);
            }),
            BatchVerdict::TooLarge | BatchVerdict::Refused => {
                self.got_through();
                if let ([alone], ApiError::Refused(problem)) = (sequences.as_slice(), &error) {
                    return self.record(Vec::new(), vec![(*alone, problem.clone())]).await;
                }
                if matches!(verdict, BatchVerdict::TooLarge) {
                    self.shrink(&error, sequences.len(), unpacked_bytes);
                }
                self.divide(&sequences, |_, _| ());
                self.uploader.advance(|progress| progress.retries += 1);
                return Ok(());
            }
        }
        self.uploader.advance(|progress| progress.retries += 1);
        self.wait(outage, error.retry_after(), error.to_string(), rng);
        Ok(())
    }

    /// Sends a batch again in halves; one that is alone is left to `alone`.
    fn divide(&mut self, sequences: &[u64], alone: impl FnOnce(&mut Self, u64)) {
        match sequences {
            [] => {}
            [one] => alone(self, *one),
            several => {
                self.claimed.extend(several);
                let (first, second) = several.split_at(several.len() / 2);
                self.divided.push_front(second.to_vec());
                self.divided.push_front(first.to_vec());
            }
        }
    }

    /// The server takes less at a time than was thought.
    fn shrink(&mut self, error: &ApiError, count: usize, unpacked_bytes: usize) {
        if error.is_refusal("too_many_items") {
            self.bounds.count_max = self.bounds.count_max.min(count / 2).max(1);
        } else {
            self.bounds.bytes_max = self.bounds.bytes_max.min(unpacked_bytes / 2);
        }
    }

    /// The server is there and answers to the point.
    fn got_through(&mut self) {
        self.backoff.succeeded();
        self.uploader.advance(|progress| progress.trouble = None);
    }

    /// Nothing is sent for a while.
    fn wait(
        &mut self,
        outage: u64,
        retry_after: Option<std::time::Duration>,
        trouble: String,
        rng: &mut (impl Rng + Send),
    ) {
        self.uploader.advance(|progress| progress.trouble = Some(trouble));
        if outage == self.outage {
            self.outage += 1;
            let wait = self.backoff.failed(retry_after, rng);
            self.not_before = Some(Instant::now() + wait);
        }
    }

    /// Before a run ends for a reason of its own: what is in flight may still be acknowledged.
    async fn wind_up(mut self, end: UploadEnd, rng: &mut (impl Rng + Send)) -> UploadEnd {
        while let Some(reply) = self.in_flight.join_next().await {
            // The first reason counts.
            let _ = self.settle(reply, rng).await;
        }
        end
    }
}

/// The answer of a task. Ours are never cancelled, and a panic goes on where it is waited for.
fn resumed<T>(joined: Result<T, JoinError>) -> T {
    match joined {
        Ok(value) => value,
        Err(error) => match error.try_into_panic() {
            Ok(panic) => std::panic::resume_unwind(panic),
            Err(cancelled) => unreachable!("a task that nobody cancels: {cancelled}"),
        },
    }
}
