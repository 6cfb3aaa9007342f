//! Plays a robot's log against a server as the robot would have lived it.
//!
//! Surveys the log's readings, lays every contribution into the durable outbox and lets the
//! uploader drain it at the same time. Stopped and started again it goes on where it was: ids
//! follow from the log, and the outbox knows what the server has.
//!
//! Knows nothing of command lines or terminals; progress goes into a channel, the outcome into a
//! [`Report`].

mod enrolment;
mod producer;
mod report;
mod reporter;
mod sensors;
mod window;

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use mapfold_map::level::Provenance;
use mapfold_schema::codec::EncodeError;
use rand::Rng;
use tokio::sync::watch;
use tokio::time::Instant;

use crate::localization::{KnownLevel, LocalizerConfig, NOTHING_KNOWN};
use crate::log::carmen;
use crate::robot::at_rest::{self, AtRestConfig};
use crate::robot::{
    MappedWalls, OdometryNoise, PoseSd, PoseSource, Surveyor, SurveyorConfig, SurveyorError,
    Whereabouts,
};
use crate::sensor::Sensors;
use crate::sync::{
    Api, ApiError, LevelAddress, Mirror, MirrorConfig, MirrorError, Outbox, OutboxConfig,
    OutboxError, UploadConfig, UploadProgress, UploadSummary, Uploader,
};

pub use enrolment::Enrolment;
pub use report::Report;
pub use sensors::{Competence, SensorChoice, SensorsError};
pub use window::{Cut, CutError, Window};

use producer::{Ground, Producer};

/// What to play, and how.
#[derive(Debug, Clone)]
pub struct ReplayOptions {
    /// The log.
    pub log: PathBuf,
    /// The part of it to play.
    pub window: Window,
    /// How many times as fast as life; as fast as it goes if absent.
    pub speed: Option<f64>,
    /// Which level.
    pub level: LevelAddress,
    /// The robot's slug.
    pub robot: String,
    /// Whether to make site, level and robot if they are missing.
    pub create: bool,
    /// Edge of a cell, metres, of a level to be made; an existing one must have it.
    pub resolution_m: Option<f64>,
    /// The robot's sensors.
    pub sensors: SensorChoice,
    /// Where poses come from.
    pub poses: PoseSource,
    /// How certain the log's poses are.
    pub pose_sd: PoseSd,
    /// What is claimed of the log's poses.
    pub provenance: Provenance,
    /// The outbox's folder; one of its own for robot and level under `./mapfold-robot-data` if absent.
    pub outbox: Option<PathBuf>,
    /// The folder of a mirror, which is brought up to date first: its walls then tell which echoes of sonars are
    /// ghosts, and a robot that localizes itself does so on it. If absent, nothing is known beforehand, or one of
    /// its own under `./mapfold-robot-data` is localized on.
    pub mirror: Option<PathBuf>,
    /// How to upload.
    pub upload: UploadConfig,
}

impl ReplayOptions {
    /// A whole log at its own poses, as fast as it goes, with the sensors that the log tells of.
    pub fn new(log: impl Into<PathBuf>, level: LevelAddress, robot: &str) -> Self {
        Self {
            log: log.into(),
            window: Window::default(),
            speed: None,
            level,
            robot: robot.to_owned(),
            create: false,
            resolution_m: None,
            sensors: SensorChoice::default(),
            poses: PoseSource::Log,
            pose_sd: PoseSd::CORRECTED_LOG,
            provenance: Provenance::SharedMap,
            outbox: None,
            mirror: None,
            upload: UploadConfig::STANDARD,
        }
    }
}

/// How far a replay has come.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ReplayProgress {
    /// Readings to play; 0 before the log is read.
    pub readings: u64,
    /// Readings played.
    pub surveyed: u64,
    /// Contributions that the server had already when their reading was played.
    pub known: u64,
    /// How the upload is doing.
    pub upload: UploadProgress,
    /// What is wrong with the log, for people, a line each.
    pub damage: Vec<String>,
    /// Why it does not get on before the upload starts; absent while all is well.
    pub trouble: Option<String>,
}

/// Why a replay cannot be.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The log cannot be used.
    #[error(transparent)]
    Log(#[from] carmen::ReadError),
    /// Nothing of the log lies in the window.
    #[error("the log has {readings} readings, and none of them between --from and --to")]
    EmptyWindow {
        /// Readings of the whole log.
        readings: usize,
    },
    /// The sensors do not fit the log.
    #[error(transparent)]
    Sensors(#[from] SensorsError),
    /// The settings cannot work.
    #[error(transparent)]
    Surveyor(#[from] SurveyorError),
    /// No reading could be placed.
    #[error("no contribution: {0}")]
    NothingPlaced(String),
    /// The server refused before anything was uploaded.
    #[error("{what}: {source}")]
    Server {
        /// What was wanted of it.
        what: String,
        /// Why it came to nothing.
        source: ApiError,
    },
    /// The level is not as asked for.
    #[error("level {level} has cells of {has_m} m, not {wanted_m} m")]
    Resolution {
        /// Which level.
        level: LevelAddress,
        /// Its cells, metres.
        has_m: f64,
        /// What was asked for, metres.
        wanted_m: f64,
    },
    /// A robot cannot find itself on a level of which nothing is known.
    #[error(
        "level {level} {NOTHING_KNOWN}: play this robot with other poses, or another robot first"
    )]
    NothingKnown {
        /// Which level.
        level: LevelAddress,
    },
    /// The speed is no speed.
    #[error("a speed of {0} is none: it must be more than 0")]
    Speed(f64),
    /// The server could not be reached in the time given.
    #[error("gave up: {0}")]
    GaveUp(ApiError),
    /// The outbox failed.
    #[error(transparent)]
    Outbox(#[from] OutboxError),
    /// The mirror cannot be used.
    #[error("the mirror: {0}")]
    Mirror(#[from] MirrorError),
    /// A contribution cannot be encoded.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// A worker thread was lost.
    #[error("a worker thread was lost: {0}")]
    Worker(String),
}

/// Plays a log. Returns when everything is acknowledged or refused, or the server refuses the
/// robot altogether; the report says which.
///
/// # Errors
/// What keeps it from starting, and failures of the disk. What waits in the outbox then goes on
/// waiting for the next run.
pub async fn run(
    options: ReplayOptions,
    api: Api,
    mut rng: impl Rng + Send,
    progress: &watch::Sender<ReplayProgress>,
) -> Result<Report, ReplayError> {
    let started = Instant::now();
    if let Some(speed) = options.speed
        && !(speed.is_finite() && speed > 0.0)
    {
        return Err(ReplayError::Speed(speed));
    }
    let path = options.log.clone();
    let log = worker(move || {
        let mut log = carmen::read(path)?;
        log.readings = at_rest::settle(log.readings, &AtRestConfig::STANDARD);
        Ok::<_, carmen::ReadError>(log)
    })
    .await??;
    progress.send_modify(|p| p.damage = log.summary.damage());
    let sensors = options.sensors.choose(&log)?;
    let window = options.window;
    let total = log.readings.len();
    let numbers = window.select(&log);
    let Some(&first) = numbers.first() else {
        return Err(ReplayError::EmptyWindow { readings: total });
    };
    progress.send_modify(|p| p.readings = numbers.len() as u64);

    let config = |resolution| surveyor_config(&options, &sensors, log.digest, resolution);
    // The sensors do not depend on the resolution, which only the level tells.
    let declared = Surveyor::new(config(0.05), first)?.declared_sensors();
    let enrolment = Enrolment { options: &options, sensors: declared };
    let level = enrolment.level(&api, &mut rng, progress).await?;

    let folder = options.outbox.clone().unwrap_or_else(|| default_outbox(&options, level.frame));
    let outbox = worker(move || Outbox::open(&folder, OutboxConfig::STANDARD)).await??;
    let outbox = Arc::new(outbox);
    let (at, described) = (Arc::clone(&outbox), level.clone());
    let reconciled = worker(move || at.reconcile(&described)).await??;
    if reconciled.forgotten > 0 {
        tracing::warn!(?reconciled, "the server was set back to an older state; sending again");
    }

    let mut surveyor = Surveyor::new(config(level.resolution_m), first)?;
    let mut walls = None;
    if let Some(mirror) = mirror(&options, &api).await? {
        walls = Some(MappedWalls::of(mirror.map()));
        if options.poses == PoseSource::Localize {
            let whereabouts = whereabouts(mirror, &options.level).await?;
            surveyor = surveyor.localize_on(whereabouts);
        }
    }
    let of_log = log.summary.clone();
    let (tell, fixes) = watch::channel(None);
    let revision = surveyor.whereabouts().map_or(0, |whereabouts| whereabouts.basis().revision);
    let producer = Producer::new(
        log,
        numbers,
        surveyor,
        walls,
        Ground { frame: level.frame, level: options.level.level.clone() },
        Arc::clone(&outbox),
        tell,
    );
    let uploader =
        Uploader::new(api.clone(), Arc::clone(&outbox), options.level.clone(), options.upload);
    let ((), played) = tokio::join!(
        reporter::report(&api, &options.level, &options.robot, revision, fixes),
        play(producer, &uploader, options.speed, &mut rng, progress),
    );
    let (surveyed, summary) = played?;
    let report = Report::new(&options, &of_log, &surveyed, &summary, started.elapsed());
    if surveyed.placed == 0 && report.trouble.is_none() {
        return Err(ReplayError::NothingPlaced(surveyed.why_nothing()));
    }
    Ok(report)
}

/// The level as it is now or, if the server cannot be reached, as its mirror has it since it last could. `None` if
/// the robot needs none.
async fn mirror(options: &ReplayOptions, api: &Api) -> Result<Option<Mirror>, ReplayError> {
    let is_needed = options.poses == PoseSource::Localize;
    let default = || is_needed.then(|| Mirror::default_folder(&options.level));
    let Some(folder) = options.mirror.clone().or_else(default) else { return Ok(None) };
    let level = options.level.clone();
    let open = move || Mirror::open(&folder, &level, MirrorConfig::STANDARD);
    let mut mirror = worker(open).await??;
    if let Some(error) = mirror.refresh_if_reachable(api).await? {
        tracing::warn!(%error, revision = mirror.revision(), "the map is taken from the mirror as it was");
    }
    Ok(Some(mirror))
}

/// What a robot goes by that has this mirror: the map, the published model and the landmark table; `None` if its level has
/// no raster, neither from robots nor as a prior.
pub fn known_level(mirror: &Mirror, config: &LocalizerConfig) -> Option<KnownLevel> {
    let landmarks = mirror.landmarks().copied();
    let resolution_m = mirror.resolution_m()?;
    KnownLevel::of_map_and_model(mirror.map(), mirror.surfaces(), landmarks, resolution_m, config)
}

/// What a robot is localized by that has this mirror.
async fn whereabouts(mirror: Mirror, level: &LevelAddress) -> Result<Whereabouts, ReplayError> {
    let level = level.clone();
    worker(move || {
        let config = LocalizerConfig::STANDARD;
        let known = known_level(&mirror, &config).ok_or(ReplayError::NothingKnown { level })?;
        Ok(Whereabouts::new(known, mirror.revision(), config))
    })
    .await?
}

/// Surveys and uploads side by side until both are done, or the upload cannot go on.
async fn play(
    producer: Producer,
    uploader: &Uploader,
    speed: Option<f64>,
    rng: &mut (impl Rng + Send),
    progress: &watch::Sender<ReplayProgress>,
) -> Result<(producer::Surveyed, UploadSummary), ReplayError> {
    let (finished, nothing_more) = watch::channel(false);
    let mut uploading = uploader.progress();
    let mut surveyed = producer::Surveyed::default();
    let mut made = std::pin::pin!(producer.produce(speed, progress));
    let mut upload = std::pin::pin!(uploader.run(nothing_more, rng));
    let mut making = true;
    let summary = loop {
        tokio::select! {
            result = &mut made, if making => {
                surveyed = result?;
                making = false;
                finished.send_replace(true);
            }
            summary = &mut upload => break summary,
            Ok(()) = uploading.changed() => {
                let now = uploading.borrow_and_update().clone();
                progress.send_modify(|p| p.upload = now);
            }
        }
    };
    progress.send_modify(|p| p.upload = summary.progress.clone());
    Ok((surveyed, summary))
}

fn surveyor_config(
    options: &ReplayOptions,
    sensors: &Sensors,
    source: [u8; 32],
    resolution: f64,
) -> SurveyorConfig {
    SurveyorConfig {
        robot: options.robot.clone(),
        sensors: sensors.clone(),
        emulate_sonar: options.sensors.emulate_sonar,
        poses: options.poses,
        pose_sd: options.pose_sd,
        provenance: options.provenance,
        odometry: OdometryNoise::STANDARD,
        resolution,
        source,
    }
}

/// A folder of its own for this robot on this level, also if the level is made anew.
fn default_outbox(options: &ReplayOptions, frame: uuid::Uuid) -> PathBuf {
    let LevelAddress { site, level } = &options.level;
    let name = format!("{site}.{level}.{}.{}", options.robot, frame.simple());
    PathBuf::from("mapfold-robot-data").join(name)
}

/// Runs what blocks on disk or processor off the async threads.
async fn worker<T: Send + 'static>(
    work: impl FnOnce() -> T + Send + 'static,
) -> Result<T, ReplayError> {
    tokio::task::spawn_blocking(work).await.map_err(|e| ReplayError::Worker(e.to_string()))
}

/// Longest that a producer runs ahead of the upload, in contributions: an hour of scans, and a
/// bound on the disk that a replay takes.
const AHEAD_MAX: usize = 1024;
/// Readings surveyed before they are laid into the outbox together, when nothing waits for them.
const CHUNK: usize = 32;
/// Wait between looks at the clock of a paced replay.
const TICK: Duration = Duration::from_millis(20);
