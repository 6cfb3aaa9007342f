//! The robot's own part of a replay: readings into contributions, contributions into the outbox.

use std::collections::BTreeMap;
use std::sync::Arc;

use mapfold_schema::v1;
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until};
use uuid::Uuid;

use super::{AHEAD_MAX, CHUNK, ReplayError, ReplayProgress, TICK, worker};
use crate::log::Log;
use crate::robot::{KnownWalls, MappedWalls, Passed, SonarVerdicts, Surveyor};
use crate::sync::{Outbox, OutboxConfig, OutboxContents, Pushed};

/// What became of the readings.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub(super) struct Surveyed {
    /// Readings played.
    pub(super) readings: u64,
    /// Readings that gave a contribution, now or in an earlier run.
    pub(super) placed: u64,
    /// Of those: the server had them already.
    pub(super) known: u64,
    /// Of those: waiting in the outbox since an earlier run.
    pub(super) waited: u64,
    /// Readings that gave none, by reason.
    pub(super) passed: BTreeMap<Passed, u64>,
    /// What was thought of the sonar readings of this run's contributions.
    pub(super) sonar: SonarVerdicts,
}

impl Surveyed {
    /// Why no reading gave a contribution, in words.
    pub(super) fn why_nothing(&self) -> String {
        let reasons: Vec<String> = self
            .passed
            .iter()
            .map(|(passed, count)| format!("{count} readings {}", in_words(*passed)))
            .collect();
        reasons.join(", ")
    }
}

/// What a reading lacked.
pub(super) fn in_words(passed: Passed) -> &'static str {
    match passed {
        Passed::OtherSensor => "are of sensors that this robot does not use",
        Passed::NoPose => "have no pose in the log",
        Passed::NoOdometry => "have no odometry in the log",
        Passed::Lost => "lie too far along to be placed by odometry",
    }
}

/// Surveys readings and fills the outbox.
pub(super) struct Producer {
    log: Arc<Log>,
    numbers: Arc<[u32]>,
    surveyor: Option<Surveyor>,
    walls: Option<Arc<MappedWalls>>,
    frame: Uuid,
    outbox: Arc<Outbox>,
    surveyed: Surveyed,
}

impl Producer {
    /// One for the readings with these `numbers`.
    pub(super) fn new(
        log: Log,
        numbers: Vec<u32>,
        surveyor: Surveyor,
        walls: Option<MappedWalls>,
        frame: Uuid,
        outbox: Arc<Outbox>,
    ) -> Self {
        Self {
            log: Arc::new(log),
            numbers: numbers.into(),
            surveyor: Some(surveyor),
            walls: walls.map(Arc::new),
            frame,
            outbox,
            surveyed: Surveyed::default(),
        }
    }

    /// Surveys everything, `speed` times as fast as life if given, never further ahead of the
    /// upload than a bound.
    pub(super) async fn produce(
        mut self,
        speed: Option<f64>,
        progress: &watch::Sender<ReplayProgress>,
    ) -> Result<Surveyed, ReplayError> {
        let start = Instant::now();
        let mut contents = self.outbox.watch();
        let mut next = 0;
        while next < self.numbers.len() {
            let mut due = (next + CHUNK).min(self.numbers.len());
            if let Some(speed) = speed {
                due = self.due(next, due, start.elapsed().as_secs_f64() * speed);
                if due == next {
                    sleep_until(Instant::now() + TICK).await;
                    continue;
                }
            }
            // The sender lives as long as the outbox, which is ours too.
            let room = |c: &OutboxContents| {
                c.waiting < AHEAD_MAX && c.waiting_bytes < OutboxConfig::STANDARD.quota_bytes / 2
            };
            let _ = contents.wait_for(room).await;
            self.survey(next..due).await?;
            next = due;
            progress.send_modify(|p| {
                p.surveyed = self.surveyed.readings;
                p.known = self.surveyed.known;
            });
        }
        Ok(self.surveyed)
    }

    /// The end of the readings from `from` on, at most `to`, that were taken within `seconds` of
    /// the first.
    fn due(&self, from: usize, to: usize, seconds: f64) -> usize {
        let time = |i: usize| self.log.readings[self.numbers[i] as usize].time_s;
        let first = time(0);
        // A reading that the log's clock puts before its predecessor is due with it.
        (from..to).find(|i| time(*i) - first > seconds).unwrap_or(to)
    }

    /// Surveys a stretch of readings and lays it into the outbox, off the async threads.
    async fn survey(&mut self, stretch: std::ops::Range<usize>) -> Result<(), ReplayError> {
        let Some(mut surveyor) = self.surveyor.take() else {
            return Err(ReplayError::Worker("the surveyor is gone".to_owned()));
        };
        let (log, numbers) = (Arc::clone(&self.log), Arc::clone(&self.numbers));
        let (outbox, frame) = (Arc::clone(&self.outbox), self.frame);
        let mut surveyed = std::mem::take(&mut self.surveyed);
        let walls = self.walls.clone();
        let (surveyor, surveyed) = worker(move || {
            let mut made: Vec<v1::Contribution> = Vec::with_capacity(stretch.len());
            for number in &numbers[stretch] {
                let reading = &log.readings[*number as usize];
                surveyed.readings += 1;
                let pose = match surveyor.locate(reading) {
                    Ok(pose) => pose,
                    Err(passed) => {
                        *surveyed.passed.entry(passed).or_default() += 1;
                        continue;
                    }
                };
                surveyed.placed += 1;
                let id = Uuid::from_bytes(surveyor.id(reading).0);
                if outbox.acknowledgement(frame, id).is_some() {
                    surveyed.known += 1;
                } else {
                    let walls = walls.as_deref().map(|walls| walls as &dyn KnownWalls);
                    let look = surveyor.observe_among(reading, pose, walls);
                    surveyed.sonar.add(&look.sonar);
                    made.push(look.to_wire(frame));
                }
            }
            for pushed in outbox.push_many(&made)? {
                match pushed {
                    Pushed::Queued | Pushed::AlreadyRefused => {}
                    Pushed::AlreadyQueued => surveyed.waited += 1,
                    Pushed::AlreadyAcknowledged(_) => surveyed.known += 1,
                }
            }
            Ok::<_, ReplayError>((surveyor, surveyed))
        })
        .await??;
        self.surveyor = Some(surveyor);
        self.surveyed = surveyed;
        Ok(())
    }
}
