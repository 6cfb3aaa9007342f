//! The robot's own part of a replay: readings into contributions, contributions into the outbox.

use std::collections::BTreeMap;
use std::sync::Arc;

use mapfold_schema::v1;
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until};
use uuid::Uuid;

use super::{AHEAD_MAX, CHUNK, ReplayError, ReplayProgress, TICK, worker};
use crate::log::{Log, Reading};
use crate::robot::{KnownWalls, Look, MappedWalls, Passed, Probation, SonarVerdicts, Surveyor};
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
        Passed::NoMap => "have no map to be placed on",
        Passed::Unplaced => "were taken before the robot had found its place, or while it was lost",
        Passed::Doubted => {
            "do not fit the map where the robot should have been, or were taken shortly before it turned out to be lost"
        }
    }
}

/// Surveys readings and fills the outbox.
pub(super) struct Producer {
    log: Arc<Log>,
    numbers: Arc<[u32]>,
    /// Absent while a worker has it.
    work: Option<Work>,
    ground: Ground,
    outbox: Arc<Outbox>,
    fixes: watch::Sender<Option<v1::RobotFix>>,
}

/// What the poses are in.
pub(super) struct Ground {
    /// UUID of the level's frame.
    pub(super) frame: Uuid,
    /// Slug of the level.
    pub(super) level: String,
}

impl Producer {
    /// One for the readings with these `numbers`; `fixes` hears where the robot finds itself.
    pub(super) fn new(
        log: Log,
        numbers: Vec<u32>,
        surveyor: Surveyor,
        walls: Option<MappedWalls>,
        ground: Ground,
        outbox: Arc<Outbox>,
        fixes: watch::Sender<Option<v1::RobotFix>>,
    ) -> Self {
        let (probation, surveyed) = (Probation::default(), Surveyed::default());
        Self {
            log: Arc::new(log),
            numbers: numbers.into(),
            work: Some(Work { surveyor, walls, probation, surveyed }),
            ground,
            outbox,
            fixes,
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
            let played =
                self.work.as_ref().map(|work| (work.surveyed.readings, work.surveyed.known));
            progress.send_modify(|p| (p.surveyed, p.known) = played.unwrap_or_default());
        }
        Ok(self.work.map(|work| work.surveyed).unwrap_or_default())
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
        let Some(mut work) = self.work.take() else {
            return Err(ReplayError::Worker("the surveyor is gone".to_owned()));
        };
        let (log, numbers) = (Arc::clone(&self.log), Arc::clone(&self.numbers));
        let (outbox, frame) = (Arc::clone(&self.outbox), self.ground.frame);
        let last = stretch.end.checked_sub(1).map(|last| numbers[last] as usize);
        let time_s = last.map_or(0.0, |last| log.readings[last].time_s);
        let work = worker(move || {
            let is_last = stretch.end == numbers.len();
            let mut looks = Vec::with_capacity(stretch.len());
            for number in &numbers[stretch] {
                let is_known = |id| outbox.acknowledgement(frame, id).is_some();
                looks.extend(work.survey(&log.readings[*number as usize], is_known));
            }
            if is_last {
                looks.extend(work.probation.finish());
            }
            let made: Vec<v1::Contribution> =
                looks.iter().map(|look| look.to_wire(frame)).collect();
            for pushed in outbox.push_many(&made)? {
                match pushed {
                    Pushed::Queued | Pushed::AlreadyRefused => {}
                    Pushed::AlreadyQueued => work.surveyed.waited += 1,
                    Pushed::AlreadyAcknowledged(_) => work.surveyed.known += 1,
                }
            }
            Ok::<_, ReplayError>(work)
        })
        .await??;
        let whereabouts = work.surveyor.whereabouts();
        if let Some(fix) = whereabouts.and_then(|w| w.report(&self.ground.level, time_s)) {
            self.fixes.send_replace(Some(fix));
        }
        self.work = Some(work);
        Ok(())
    }
}

/// What surveying goes on with from stretch to stretch.
struct Work {
    surveyor: Surveyor,
    walls: Option<MappedWalls>,
    probation: Probation,
    surveyed: Surveyed,
}

impl Work {
    /// Surveys one reading; the looks that are to be sent now. `is_known` tells whether the server has one.
    fn survey(&mut self, reading: &Reading, is_known: impl Fn(Uuid) -> bool) -> Vec<Look> {
        self.surveyed.readings += 1;
        let located = self.surveyor.locate(reading);
        let finds = self.surveyor.whereabouts().map(|whereabouts| whereabouts.basis().finds);
        if located == Err(Passed::Unplaced)
            || self.probation.finds().is_some_and(|f| Some(f) != finds)
        {
            let doubted = self.probation.fail();
            self.surveyed.placed -= doubted;
            self.pass(Passed::Doubted, doubted);
        }
        let pose = match located {
            Ok(pose) => pose,
            Err(passed) => {
                self.pass(passed, 1);
                return Vec::new();
            }
        };
        self.surveyed.placed += 1;
        if is_known(Uuid::from_bytes(self.surveyor.id(reading).0)) {
            self.surveyed.known += 1;
            return Vec::new();
        }
        let walls = self.walls.as_ref().map(|walls| walls as &dyn KnownWalls);
        let look = self.surveyor.observe_among(reading, pose, walls);
        self.surveyed.sonar.add(&look.sonar);
        self.probation.pass(look)
    }

    /// So many readings give no contribution.
    fn pass(&mut self, passed: Passed, count: u64) {
        if count > 0 {
            *self.surveyed.passed.entry(passed).or_default() += count;
        }
    }
}
