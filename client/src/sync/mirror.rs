//! A local copy of a level, kept up to date by patches and kept on disk between runs.
//!
//! Patches are applied with the map's own code and compute nothing, so the copy equals the
//! server's map bit for bit. A server that was set back to an older backup, or a level that was
//! made anew, is noticed by its revision, its frame or its counts; the mirror then begins again
//! from nothing and says so. (What is not noticed: a server that was set back and has since reached
//! the same revision with as many segments, clusters, chains and tiles.)
//!
//! Beside the map it holds what robots find themselves by: the level's landmark table and the surfaces of the published
//! model.

mod file;
mod landmarks;

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use mapfold_map::gdb::Surface;
use mapfold_map::landmarks::Landmark;
use mapfold_map::level::{LevelMap, apply};
use mapfold_schema::border::{Violation, map_patch};
use mapfold_schema::codec::EncodeError;
use mapfold_schema::geojson;
use mapfold_schema::v1;
use rand::Rng;
use tokio::sync::watch;
use tokio::task::spawn_blocking;
use tokio::time::{Instant, sleep};
use uuid::Uuid;

use file::{Saved, Unusable};
use landmarks::KnownLandmarks;

use super::durable::{self, DiskError};
use super::{Api, ApiError, Backoff, BackoffConfig, LevelAddress};

/// How to keep a mirror up to date.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MirrorConfig {
    /// About how many things to ask for at a time.
    pub page_limit: u32,
    /// Waits between tries of [`Mirror::follow`].
    pub backoff: BackoffConfig,
    /// How often [`Mirror::follow`] writes the mirror to disk at most. After a crash it goes on
    /// from what was written last.
    pub save_interval: Duration,
}

impl MirrorConfig {
    /// Pages of 2000 things, on disk every ten seconds.
    pub const STANDARD: Self = Self {
        page_limit: 2000,
        backoff: BackoffConfig::QUICK,
        save_interval: Duration::from_secs(10),
    };
}

/// Why a mirror began again from nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ResyncReason {
    /// The level was made anew: its frame is another.
    OtherFrame,
    /// The server's log ends before the mirror's revision: it was set back to an older backup.
    ServerWentBack,
    /// At the same revision the server counts other numbers of segments, clusters, chains or tiles (the
    /// prior's too): it was set back and has gone another way since.
    Diverged,
    /// The file on disk was damaged; it lies beside the new one as `level.mirror.damaged`.
    DamagedFile,
}

/// What a refresh did.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Refreshed {
    /// The revision before.
    pub from_revision: i64,
    /// The revision now.
    pub to_revision: i64,
    /// Segments, clusters, chains and tiles (the prior's too) in the patches: new, changed or removed.
    pub changes: usize,
    /// Why everything was read anew, if it was.
    pub resync: Option<ResyncReason>,
}

/// Why a mirror cannot be kept up to date.
#[derive(Debug, thiserror::Error)]
pub enum MirrorError {
    /// The server did not answer, or refused.
    #[error(transparent)]
    Api(#[from] ApiError),
    /// Another process (or another part of this one) has it open.
    #[error("{}: this mirror is in use", .folder.display())]
    InUse {
        /// Its folder.
        folder: PathBuf,
    },
    /// The folder holds another level's mirror.
    #[error("{}: this is the mirror of {found}, not of {wanted}", .folder.display())]
    OtherLevel {
        /// Its folder.
        folder: PathBuf,
        /// Of which level it is.
        found: LevelAddress,
        /// Of which it should be.
        wanted: LevelAddress,
    },
    /// A page holds what cannot be in a map.
    #[error(
        "the page after revision {since} cannot be taken: {}",
        .violations.first().map_or_else(String::new, |v| format!("{} at {:?}", v.detail, v.pointer))
    )]
    BadPatch {
        /// The revision before it.
        since: i64,
        /// What is wrong with it.
        violations: Vec<Violation>,
    },
    /// The landmarks or the plan of the model hold what cannot be.
    #[error(
        "the landmarks of revision {revision} cannot be taken: {}",
        .violations.first().map_or_else(String::new, |v| format!("{} at {:?}", v.detail, v.pointer))
    )]
    BadLandmarks {
        /// Their revision.
        revision: i64,
        /// What is wrong with them.
        violations: Vec<Violation>,
    },
    /// The pages do not lead from revision to revision.
    #[error("asked for what follows revision {asked}, the server answers {since} to {revision}")]
    BadPage {
        /// What was asked for.
        asked: i64,
        /// Where the page begins.
        since: i64,
        /// Where it ends.
        revision: i64,
    },
    /// The map cannot be encoded.
    #[error(transparent)]
    Encode(#[from] EncodeError),
    /// The disk failed.
    #[error(transparent)]
    Disk(#[from] DiskError),
}

impl MirrorError {
    /// Whether it may go away by waiting.
    pub fn is_retryable(&self) -> bool {
        matches!(self, Self::Api(error) if error.is_retryable())
    }

    fn retry_after(&self) -> Option<Duration> {
        match self {
            Self::Api(error) => error.retry_after(),
            _ => None,
        }
    }
}

/// A local copy of one level.
#[derive(Debug)]
pub struct Mirror {
    folder: PathBuf,
    level: LevelAddress,
    config: MirrorConfig,
    /// Absent before the first refresh.
    ground: Option<Ground>,
    known: KnownMap,
    landmarks: Arc<KnownLandmarks>,
    /// Why the next refresh is to begin from nothing.
    resync: Option<ResyncReason>,
    /// Whether the disk holds less than this.
    is_ahead_of_disk: bool,
    /// Whether the server's counts are worth a look: not if they do not even fit a fresh copy.
    counts_are_checked: bool,
    _lock: File,
}

/// What a level's map stands on.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Ground {
    frame: Uuid,
    resolution_m: f64,
}

/// A map at a revision.
#[derive(Debug, Clone, Default, PartialEq)]
struct KnownMap {
    revision: i64,
    map: LevelMap,
}

impl KnownMap {
    /// Whether the level, as it was described, counts other things at the same revision.
    fn contradicts(&self, level: &v1::LevelDescription) -> bool {
        let (map, counts) = (&self.map, &level.counts);
        let features = [map.segments.len(), map.clusters.len(), map.chains.len()];
        let there = [counts.segments, counts.clusters, counts.chains];
        let tiles = [map.tiles.len(), map.prior.len()];
        let tiles_there = [counts.tiles, counts.prior_tiles];
        self.revision == level.folded_revision
            && (features.map(|count| count as i64) != there
                || tiles.map(|count| count as i64) != tiles_there)
    }
}

impl Mirror {
    /// Opens the mirror of `level` in `folder`, which is made if it is missing; empty at revision
    /// 0 if there is none there yet, or one that is damaged. Blocks on the disk.
    ///
    /// # Errors
    /// The folder holds another level's mirror, or another process has it open; the disk fails.
    pub fn open(
        folder: &Path,
        level: &LevelAddress,
        config: MirrorConfig,
    ) -> Result<Self, MirrorError> {
        let Some(lock) = durable::lock_folder(folder)? else {
            return Err(MirrorError::InUse { folder: folder.to_owned() });
        };
        let mut mirror = Self {
            folder: folder.to_owned(),
            level: level.clone(),
            config,
            ground: None,
            known: KnownMap::default(),
            landmarks: Arc::default(),
            resync: None,
            is_ahead_of_disk: false,
            counts_are_checked: true,
            _lock: lock,
        };
        match file::read(folder) {
            Ok(None) => {}
            Ok(Some(saved)) if saved.level != *level => {
                return Err(MirrorError::OtherLevel {
                    folder: folder.to_owned(),
                    found: saved.level,
                    wanted: level.clone(),
                });
            }
            Ok(Some(saved)) => {
                mirror.ground = Some(saved.ground);
                mirror.known = saved.known;
                mirror.landmarks = saved.landmarks;
            }
            Err(Unusable::Disk(error)) => return Err(error.into()),
            Err(Unusable::Damaged(what)) => {
                file::set_aside(folder)?;
                tracing::warn!(folder = %folder.display(), what, "the mirror on disk is damaged");
                mirror.resync = Some(ResyncReason::DamagedFile);
            }
        }
        Ok(mirror)
    }

    /// The revision that it has reached.
    pub fn revision(&self) -> i64 {
        self.known.revision
    }

    /// UUID of the level's frame; absent before the first refresh.
    pub fn frame(&self) -> Option<Uuid> {
        self.ground.map(|ground| ground.frame)
    }

    /// Edge of a cell of its grid; absent before the first refresh.
    pub fn resolution_m(&self) -> Option<f64> {
        self.ground.map(|ground| ground.resolution_m)
    }

    /// The map.
    pub fn map(&self) -> &LevelMap {
        &self.known.map
    }

    /// The level's landmarks as the server tells them, those of the published model and those that robots taught.
    pub fn landmarks(&self) -> impl Iterator<Item = &Landmark> {
        self.landmarks.landmarks()
    }

    /// The surfaces of the published model at the height at which its landmarks are told.
    pub fn surfaces(&self) -> &[Surface] {
        self.landmarks.surfaces()
    }

    /// Brings it up to date, and onto disk if anything changed.
    ///
    /// # Errors
    /// See [`MirrorError`]; the mirror is then as it was or at a revision in between.
    pub async fn refresh(&mut self, api: &Api) -> Result<Refreshed, MirrorError> {
        let refreshed = self.advance(api).await?;
        self.save().await?;
        Ok(refreshed)
    }

    /// Brings it up to date if the server can be reached, and else leaves it as it was when it last could; why, then.
    ///
    /// # Errors
    /// As for [`Self::refresh`]; a server out of reach too, if there is no earlier mirror to go by.
    pub async fn refresh_if_reachable(
        &mut self,
        api: &Api,
    ) -> Result<Option<MirrorError>, MirrorError> {
        match self.refresh(api).await {
            Ok(_) => Ok(None),
            Err(error) if error.is_retryable() && self.frame().is_some() => Ok(Some(error)),
            Err(error) => Err(error),
        }
    }

    /// The folder in which a robot keeps its mirror of a level unless it is told another one.
    pub fn default_folder(level: &LevelAddress) -> PathBuf {
        PathBuf::from("mapfold-robot-data").join(format!("{level}.mirror").replace('/', "."))
    }

    /// Refreshes every `interval`, through outages too, until `stop` says true (or its sender is
    /// gone). `tell` hears of every try.
    ///
    /// # Errors
    /// Those that do not go away by waiting.
    pub async fn follow(
        &mut self,
        api: &Api,
        interval: Duration,
        mut stop: watch::Receiver<bool>,
        rng: &mut (impl Rng + Send),
        mut tell: impl FnMut(&Self, Result<Refreshed, &MirrorError>) + Send,
    ) -> Result<(), MirrorError> {
        let mut backoff = Backoff::new(self.config.backoff);
        let mut saved_at = Instant::now();
        loop {
            // Between its waits the refresh leaves the mirror whole: it may be dropped.
            let outcome = tokio::select! {
                outcome = self.advance(api) => outcome,
                _ = stop.wait_for(|stop| *stop) => break,
            };
            let wait = match outcome {
                Ok(refreshed) => {
                    backoff.succeeded();
                    tell(self, Ok(refreshed));
                    interval
                }
                Err(error) if error.is_retryable() => {
                    tell(self, Err(&error));
                    backoff.failed(error.retry_after(), rng)
                }
                Err(error) => {
                    self.save().await?;
                    return Err(error);
                }
            };
            if saved_at.elapsed() >= self.config.save_interval {
                self.save().await?;
                saved_at = Instant::now();
            }
            tokio::select! {
                () = sleep(wait) => {}
                _ = stop.wait_for(|stop| *stop) => break,
            }
        }
        self.save().await
    }

    /// Writes it as GeoJSON, byte for byte like the server's export of that name.
    ///
    /// # Errors
    /// What `to` cannot take.
    pub fn write_geojson(&self, to: &mut impl Write) -> io::Result<()> {
        geojson::write_map(&self.known.map, to)
    }

    /// Brings it up to date in memory.
    async fn advance(&mut self, api: &Api) -> Result<Refreshed, MirrorError> {
        let from_revision = self.known.revision;
        let level = api.level(&self.level).await?;
        let (mut resync, mut changes) = (self.reason_to_resync(&level), 0);
        if resync.is_none() {
            self.ground = Some(ground_of(&level));
            match self.take_pages(api, &mut changes).await {
                Err(MirrorError::Api(error)) if error.is_refusal("cursor_expired") => {
                    resync = Some(ResyncReason::ServerWentBack);
                }
                other => other?,
            }
            if self.counts_are_checked && self.known.contradicts(&level) {
                resync = Some(ResyncReason::Diverged);
            }
        }
        if let Some(reason) = resync {
            self.begin_again(api, &level, reason, &mut changes).await?;
            self.counts_are_checked = !self.known.contradicts(&level);
        }
        self.take_landmarks(api).await?;
        Ok(Refreshed { from_revision, to_revision: self.known.revision, changes, resync })
    }

    fn reason_to_resync(&self, level: &v1::LevelDescription) -> Option<ResyncReason> {
        if self.ground.is_some_and(|ground| ground != ground_of(level)) {
            Some(ResyncReason::OtherFrame)
        } else if level.revision < self.known.revision {
            Some(ResyncReason::ServerWentBack)
        } else {
            self.resync
        }
    }

    /// Reads everything from revision 0. The old copy stays until the new one is whole.
    async fn begin_again(
        &mut self,
        api: &Api,
        level: &v1::LevelDescription,
        reason: ResyncReason,
        changes: &mut usize,
    ) -> Result<(), MirrorError> {
        tracing::warn!(
            level = %self.level,
            ?reason,
            mirror_revision = self.known.revision,
            server_revision = level.revision,
            "the mirror begins again from nothing"
        );
        // Kept until it is done: a try that breaks off is repeated for the same reason.
        self.resync = Some(reason);
        let mut known = KnownMap::default();
        while take_page(api, &self.level, self.config.page_limit, &mut known, changes).await? {}
        self.known = known;
        self.landmarks = Arc::default();
        self.ground = Some(ground_of(level));
        self.resync = None;
        self.is_ahead_of_disk = true;
        Ok(())
    }

    async fn take_pages(&mut self, api: &Api, changes: &mut usize) -> Result<(), MirrorError> {
        loop {
            let before = self.known.revision;
            let (level, limit) = (&self.level, self.config.page_limit);
            let more = take_page(api, level, limit, &mut self.known, changes).await?;
            self.is_ahead_of_disk |= self.known.revision != before;
            if !more {
                return Ok(());
            }
        }
    }

    /// Brings landmarks and model up to date, if the map is ahead of them.
    async fn take_landmarks(&mut self, api: &Api) -> Result<(), MirrorError> {
        if self.landmarks.is_asked(self.known.revision) {
            return Ok(());
        }
        let told = match api.landmarks(&self.level, self.landmarks.since()).await {
            // What changed since is not known any more.
            Err(error) if error.is_refusal("cursor_expired") => {
                self.landmarks = Arc::default();
                api.landmarks(&self.level, 0).await
            }
            told => told,
        };
        let table = match told {
            Err(error) if error.is_refusal("plan_too_crowded") => {
                tracing::warn!(level = %self.level, %error, "going by the map alone");
                self.landmarks = Arc::new(KnownLandmarks::untold(self.known.revision));
                self.is_ahead_of_disk = true;
                return Ok(());
            }
            told => told?,
        };
        let is_published = table.publication > 0;
        let plan = if is_published && self.landmarks.needs_plan(table.publication) {
            Some(api.published_plan(&self.level).await?)
        } else {
            None
        };
        let revision = table.revision;
        let bad = |violations| MirrorError::BadLandmarks { revision, violations };
        Arc::make_mut(&mut self.landmarks).take(table, plan).map_err(bad)?;
        self.is_ahead_of_disk = true;
        Ok(())
    }

    /// Writes it to disk, if that holds less.
    async fn save(&mut self) -> Result<(), MirrorError> {
        let Some(ground) = self.ground.filter(|_| self.is_ahead_of_disk) else { return Ok(()) };
        // The copy shares all that it holds with the original.
        let saved = Saved {
            level: self.level.clone(),
            ground,
            known: self.known.clone(),
            landmarks: Arc::clone(&self.landmarks),
        };
        let folder = self.folder.clone();
        match spawn_blocking(move || file::write(&folder, &saved)).await {
            Ok(written) => written?,
            Err(error) => match error.try_into_panic() {
                Ok(panic) => std::panic::resume_unwind(panic),
                Err(cancelled) => unreachable!("a task that nobody cancels: {cancelled}"),
            },
        }
        self.is_ahead_of_disk = false;
        Ok(())
    }
}

fn ground_of(level: &v1::LevelDescription) -> Ground {
    Ground { frame: level.frame, resolution_m: level.resolution_m }
}

/// Applies the page that follows `known`, all of it or nothing; answers whether there is more.
async fn take_page(
    api: &Api,
    level: &LevelAddress,
    limit: u32,
    known: &mut KnownMap,
    changes: &mut usize,
) -> Result<bool, MirrorError> {
    let asked = known.revision;
    let page = api.patches(level, asked, limit).await?;
    let (since, revision, more) = (page.since, page.revision, page.more);
    if since != asked || revision < asked || (more && revision == asked) {
        return Err(MirrorError::BadPage { asked, since, revision });
    }
    let patch =
        map_patch(&page).map_err(|violations| MirrorError::BadPatch { since, violations })?;
    apply(&patch, &mut known.map);
    known.revision = revision;
    *changes += patch.change_count();
    Ok(more)
}

#[cfg(test)]
mod tests;
