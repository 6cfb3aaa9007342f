//! What a replay came to, for people and for scripts.

use std::collections::BTreeMap;
use std::time::Duration;

use serde::Serialize;

use super::ReplayOptions;
use super::producer::{Surveyed, in_words};
use crate::log::Summary;
use crate::robot::SonarVerdicts;
use crate::sync::{UploadEnd, UploadSummary};

/// The outcome of a replay.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Report {
    /// The log's file.
    pub log: String,
    /// Slug of the site.
    pub site: String,
    /// Slug of the level.
    pub level: String,
    /// The robot's slug.
    pub robot: String,
    /// Whether everything that was ever to be sent is acknowledged, and the log is whole.
    pub complete: bool,
    /// What kept contributions from the server, if anything.
    pub trouble: Option<String>,
    /// Lines of the log that could not be read and were passed over.
    pub malformed_lines: u64,
    /// What cut the log short, if anything; what came before it was played.
    pub cut_short: Option<String>,
    /// Readings played.
    pub readings: u64,
    /// Readings that gave a contribution, in this run or an earlier one.
    pub contributions: u64,
    /// Of those: acknowledged in this run.
    pub acknowledged: u64,
    /// Of those: the server had them already when the run came to them.
    pub known: u64,
    /// Of those: waiting since an earlier run when this one came to them.
    pub waited: u64,
    /// Contributions in the outbox that the server has refused, in this run or an earlier one.
    pub refused: u64,
    /// Contributions that still wait.
    pub waiting: u64,
    /// Readings that gave none, by reason.
    pub passed: BTreeMap<String, u64>,
    /// What was thought of the sonar readings of contributions made in this run, rule by rule.
    pub sonar: SonarVerdicts,
    /// Highest revision in a receipt of this run.
    pub revision: Option<i64>,
    /// Bytes of request bodies sent, packed, repeated ones included.
    pub bytes_up: u64,
    /// Bytes of answers' bodies received, packed.
    pub bytes_down: u64,
    /// `bytes_up` for each contribution acknowledged in this run.
    pub bytes_up_per_contribution: f64,
    /// Requests that came to nothing and were repeated.
    pub retries: u64,
    /// From the start to the last receipt.
    pub wall_seconds: f64,
    /// Contributions acknowledged in this run in each second of it.
    pub contributions_per_second: f64,
}

impl Report {
    pub(super) fn new(
        options: &ReplayOptions,
        log: &Summary,
        surveyed: &Surveyed,
        upload: &UploadSummary,
        took: Duration,
    ) -> Self {
        let (progress, contents) = (&upload.progress, &upload.contents);
        let per = |amount: f64, count: f64| if count > 0.0 { amount / count } else { 0.0 };
        let acknowledged = progress.acknowledged as f64;
        Self {
            log: options.log.display().to_string(),
            site: options.level.site.clone(),
            level: options.level.level.clone(),
            robot: options.robot.clone(),
            complete: upload.is_complete() && log.cut_short.is_none(),
            trouble: trouble(upload),
            malformed_lines: log.malformed,
            cut_short: log.cut_short.clone(),
            readings: surveyed.readings,
            contributions: surveyed.placed,
            acknowledged: progress.acknowledged,
            known: surveyed.known,
            waited: surveyed.waited,
            refused: contents.refused as u64,
            waiting: contents.waiting as u64,
            passed: surveyed
                .passed
                .iter()
                .map(|(passed, count)| (in_words(*passed).to_owned(), *count))
                .collect(),
            sonar: surveyed.sonar,
            revision: progress.revision,
            bytes_up: progress.traffic.bytes_up,
            bytes_down: progress.traffic.bytes_down,
            bytes_up_per_contribution: per(progress.traffic.bytes_up as f64, acknowledged),
            retries: progress.retries,
            wall_seconds: took.as_secs_f64(),
            contributions_per_second: per(acknowledged, took.as_secs_f64()),
        }
    }
}

/// In words, what keeps an upload from being complete.
fn trouble(upload: &UploadSummary) -> Option<String> {
    let contents = &upload.contents;
    match &upload.end {
        UploadEnd::Refused(error) => Some(error.to_string()),
        UploadEnd::Outbox(error) => Some(error.to_string()),
        UploadEnd::DeadlinePassed => Some(format!(
            "gave up with {} contributions waiting: {}",
            contents.waiting,
            upload.progress.trouble.as_deref().unwrap_or("the time is over")
        )),
        UploadEnd::Drained if contents.refused > 0 => Some(format!(
            "the server refused {} contributions; each lies with its problem in the outbox's \
             refused/",
            contents.refused
        )),
        UploadEnd::Drained if contents.corrupt > 0 => Some(format!(
            "{} damaged files were set aside in the outbox's corrupt/",
            contents.corrupt
        )),
        UploadEnd::Drained => None,
    }
}
