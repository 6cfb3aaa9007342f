//! The appender of a level: takes what waits in its queue, puts it into the log in one
//! transaction, and answers.
//!
//! A batch is whatever came in while the last one was being committed: no timer, so a lone
//! contribution never waits for company.

use std::sync::Arc;
use std::sync::atomic::{AtomicI64, Ordering};

use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::v1;
use tokio::sync::{Notify, mpsc, oneshot};

use super::accept::Accepted;
use super::recall::Logged;
use super::registry::{DiskAlarm, LevelOptions};
use super::{Identity, SubmitError};
use crate::clock::SharedClock;
use crate::store::contributions::{Appended, BATCH_MAX, NewContribution, Place};
use crate::store::{Store, StoreError};

/// A contribution in the queue and where its answer goes.
#[derive(Debug)]
pub(super) struct Waiting {
    pub(super) accepted: Accepted,
    pub(super) answer: oneshot::Sender<Result<v1::Receipt, SubmitError>>,
}

/// What the appender works with.
#[derive(Debug)]
pub(super) struct Appender {
    pub(super) identity: Arc<Identity>,
    pub(super) store: Store,
    pub(super) clock: SharedClock,
    pub(super) options: LevelOptions,
    pub(super) queue: mpsc::Receiver<Waiting>,
    /// Rows that are on disk, to be folded. Full while the fold lags; then appending waits.
    pub(super) fold: mpsc::Sender<Vec<Logged>>,
    /// Newest revision of the log that is known here.
    pub(super) head: Arc<AtomicI64>,
    /// Tells to take nothing more and to come to an end.
    pub(super) stop: Arc<Notify>,
    pub(super) alarm: DiskAlarm,
}

impl Appender {
    /// Runs until the queue is closed and empty, or the fold or the disk has failed.
    pub(super) async fn run(mut self) {
        let batch_max = self.options.batch_max.clamp(1, BATCH_MAX);
        let stop = Arc::clone(&self.stop);
        let mut stopping = std::pin::pin!(stop.notified());
        let mut stopped = false;
        let mut waiting = Vec::with_capacity(batch_max);
        loop {
            tokio::select! {
                biased;
                () = &mut stopping, if !stopped => {
                    stopped = true;
                    self.queue.close();
                    continue;
                }
                taken = self.queue.recv_many(&mut waiting, batch_max) => {
                    if taken == 0 {
                        return;
                    }
                }
            }
            metrics::gauge!(
                "mapfold_level_queue_length",
                "site" => self.identity.site.clone(),
                "level" => self.identity.level.clone()
            )
            .set(self.queue.len() as f64);
            let logged = match self.append(&mut waiting).await {
                Ok(logged) => logged,
                Err(StoreError::DiskFailed(why)) => {
                    // What is on the disk is uncertain now: nothing more is taken or tried.
                    self.alarm.raise(why);
                    return;
                }
                // The robots have their answers; the next batch may find the store well again.
                Err(_) => continue,
            };
            if !logged.is_empty() && self.fold.send(logged).await.is_err() {
                return;
            }
        }
    }

    /// Appends and answers all that waits; what is new comes back to be folded.
    async fn append(&self, waiting: &mut Vec<Waiting>) -> Result<Vec<Logged>, StoreError> {
        let mut logged = Vec::new();
        match self.append_together(waiting, &mut logged).await {
            Ok(()) => Ok(logged),
            // The database refuses some statement as such: what is wrong with one contribution
            // must not fail its neighbours.
            Err(StoreError::Refused(_)) if waiting.len() > 1 => {
                for one in std::mem::take(waiting) {
                    let mut alone = vec![one];
                    if let Err(error) = self.append_together(&mut alone, &mut logged).await {
                        self.refuse(&mut alone, &error);
                    }
                }
                Ok(logged)
            }
            Err(error) => {
                self.refuse(waiting, &error);
                Err(error)
            }
        }
    }

    /// One transaction. On an error, all of `waiting` are left without an answer.
    async fn append_together(
        &self,
        waiting: &mut Vec<Waiting>,
        logged: &mut Vec<Logged>,
    ) -> Result<(), StoreError> {
        let rows: Vec<NewContribution> = waiting.iter().map(|w| w.accepted.row.clone()).collect();
        let started = self.clock.elapsed();
        let answers = self.store.append(&self.identity.site, &self.identity.level, &rows).await?;
        let took = self.clock.elapsed().saturating_sub(started);
        metrics::histogram!("mapfold_log_append_duration_seconds").record(took.as_secs_f64());
        metrics::histogram!("mapfold_log_append_batch").record(rows.len() as f64);
        for (Waiting { accepted, answer }, appended) in waiting.drain(..).zip(answers) {
            if let Appended::New(place) = appended {
                self.head.fetch_max(place.revision, Ordering::AcqRel);
                logged.push(Logged {
                    revision: place.revision,
                    held: place.state == v1::ContributionState::Held,
                    contribution: Arc::clone(&accepted.checked),
                });
            }
            // A robot that has gone away meanwhile asks again; the log knows.
            let _ = answer.send(outcome(&accepted.row, appended));
        }
        Ok(())
    }

    fn refuse(&self, waiting: &mut Vec<Waiting>, error: &StoreError) {
        tracing::error!(
            site = self.identity.site,
            level = self.identity.level,
            contributions = waiting.len(),
            %error,
            "append failed"
        );
        for Waiting { answer, .. } in waiting.drain(..) {
            count("failed");
            let refusal = match error {
                StoreError::DiskFull => SubmitError::DiskFull,
                other => SubmitError::Unavailable(other.to_string()),
            };
            let _ = answer.send(Err(refusal));
        }
    }
}

fn outcome(row: &NewContribution, appended: Appended) -> Result<v1::Receipt, SubmitError> {
    let receipt = |Place { revision, received_at_us, state }| v1::Receipt {
        id: row.id,
        revision,
        received_at: to_rfc3339(received_at_us),
        // As it was when it was taken, so that the receipt stays the same.
        state: match state {
            _ if row.frame.is_some() => v1::ContributionState::Held,
            v1::ContributionState::Held => v1::ContributionState::Held,
            v1::ContributionState::Folded | v1::ContributionState::Reverted => {
                v1::ContributionState::Folded
            }
        },
        digest: row.digest.clone(),
    };
    match appended {
        Appended::New(place) => {
            count(match place.state {
                v1::ContributionState::Folded => "folded",
                v1::ContributionState::Held => "held",
                v1::ContributionState::Reverted => "reverted",
            });
            Ok(receipt(place))
        }
        Appended::Known(place) => {
            count("repeated");
            Ok(receipt(place))
        }
        Appended::Conflict(revision) => {
            count("conflict");
            Err(SubmitError::Conflict { id: row.id, revision })
        }
        Appended::UnknownRobot => {
            count("unknown_robot");
            Err(SubmitError::UnknownRobot { robot: row.robot.clone() })
        }
    }
}

fn count(outcome: &'static str) {
    metrics::counter!("mapfold_contributions_total", "outcome" => outcome).increment(1);
}
