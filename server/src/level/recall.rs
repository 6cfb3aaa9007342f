//! From rows of the log back to what was folded: contributions, and the acts between them.

use std::sync::Arc;

use mapfold_map::alignment::moved;
use mapfold_map::level::{Batch, Contribution, LevelConfig};
use mapfold_map::raster::SliceConfig;
use mapfold_schema::border::{Limits, Target, Violation, check_contribution};
use mapfold_schema::v1::{self, ContributionState};

use super::accept::as_received;
use super::open::{LOG_PAGE, aside};
use super::prior::Imported;
use crate::store::acts::{ActKind, ActRow};
use crate::store::alignments::Frames;
use crate::store::log::{FeaturesRow, LogRow};
use crate::store::payload::{self, PayloadError};
use crate::store::{Store, StoreError, levels::LevelRow};

/// What stands in the log has passed the border once, perhaps under wider limits than today's.
const NO_LIMITS: Limits = Limits {
    coordinate_max_m: f64::MAX,
    segments_max: usize::MAX,
    segments_length_max_m: f64::MAX,
    clusters_max: usize::MAX,
    clusters_width_max_m: f64::MAX,
    hull_points_max: usize::MAX,
    tiles_max: usize::MAX,
    evidence_max: i32::MAX,
    batch_max: usize::MAX,
};

/// How rows of a log are read.
#[derive(Debug, Clone)]
pub(crate) struct Reading {
    target: Target,
    /// Where robots' own frames lay at the moment of the log for which it is read.
    frames: Arc<Frames>,
}

impl Reading {
    /// Of a level; contributions in a robot's own frame are told where `frames` knows of it, and as they are otherwise.
    pub(crate) fn new(row: &LevelRow, frames: Frames) -> Self {
        Self { target: target(row), frames: Arc::new(frames) }
    }
}

/// A contribution with its place in the log.
#[derive(Debug, Clone)]
pub(crate) struct Logged {
    /// Its place.
    pub(crate) revision: i64,
    /// Whether it was kept out of the map when it came. One that was reverted was not: at its own
    /// revision it was in the map. One in a robot's own frame was, also if it was put in since.
    pub(crate) held: bool,
    /// What it says, on the level if it is known where its frame lies.
    pub(crate) contribution: Arc<Contribution>,
}

/// An act with its place in the log and all that folding it needs.
#[derive(Debug, Clone)]
pub(crate) struct Act {
    /// Its place.
    pub(crate) revision: i64,
    /// What it does.
    pub(crate) kind: ActKind,
    /// The contributions that it moves.
    pub(crate) moved: Batch,
}

/// An entry of the log.
#[derive(Debug, Clone)]
pub(crate) enum Entry {
    /// A robot's.
    Contribution(Logged),
    /// An operator's.
    Act(Box<Act>),
    /// A map of another program, as the prior.
    Import(Box<Imported>),
    /// About the GDB, at this revision: the fold does not read it.
    Gdb(i64),
}

impl Entry {
    /// Its place.
    pub(crate) fn revision(&self) -> i64 {
        match self {
            Self::Contribution(logged) => logged.revision,
            Self::Act(act) => act.revision,
            Self::Import(imported) => imported.revision,
            Self::Gdb(revision) => *revision,
        }
    }
}

/// The next entries of a level's log after revision `after`; none if it has ended. An act,
/// an import or an entry about the GDB comes alone, so that there is only one batch in memory at a time.
///
/// # Errors
/// The store fails, or the log does not hold what was accepted.
pub(crate) async fn entries_after(
    store: &Store,
    row: &LevelRow,
    after: i64,
) -> Result<Vec<Entry>, StoreError> {
    let stretch = store.stretch_after(&row.site, &row.level, after, LOG_PAGE).await?;
    if let Some(act) = stretch.act.filter(|_| stretch.contributions.is_empty()) {
        return Ok(vec![Entry::Act(Box::new(gather(store, row, &act).await?))]);
    }
    if let Some(import) = stretch.import.filter(|_| stretch.contributions.is_empty()) {
        return Ok(vec![Entry::Import(Box::new(imported(store, row, import).await?))]);
    }
    if let Some(revision) = stretch.gdb.filter(|_| stretch.contributions.is_empty()) {
        return Ok(vec![Entry::Gdb(revision)]);
    }
    // What is in a robot's own frame is held when it comes, wherever that lies.
    let (rows, reading) = (stretch.contributions, Reading::new(row, Frames::new()));
    let entry = move |row: &LogRow| whole(row, &reading).map(Entry::Contribution);
    aside(move || rows.iter().map(entry).collect()).await
}

/// Reads what an import says.
///
/// # Errors
/// The store fails, or a row is spoilt.
pub(crate) async fn imported(
    store: &Store,
    row: &LevelRow,
    revision: i64,
) -> Result<Imported, StoreError> {
    Ok(store.import_row(&row.site, &row.level, revision).await?.into())
}

/// Reads what an act moves, a few rows at a time.
///
/// # Errors
/// The store fails, or the log does not hold what was accepted.
pub(crate) async fn gather(store: &Store, row: &LevelRow, act: &ActRow) -> Result<Act, StoreError> {
    let moved = batch(store, row, &act.moved, act.revision).await?;
    Ok(Act { revision: act.revision, kind: act.kind, moved })
}

/// Reads the contributions of these revisions, a few rows at a time, as they are folded at revision `at` of the log.
///
/// # Errors
/// The store fails, or the log does not hold what was accepted.
pub(crate) async fn batch(
    store: &Store,
    row: &LevelRow,
    revisions: &[i64],
    at: i64,
) -> Result<Batch, StoreError> {
    let reading = Reading::new(row, store.frames_at(&row.site, &row.level, at).await?);
    let mut batch = Batch::new(&config(row));
    for piece in revisions.chunks(LOG_PAGE as usize) {
        let rows = store.log_rows(&row.site, &row.level, piece).await?;
        if rows.len() != piece.len() {
            return Err(StoreError::Corrupt {
                table: "acts",
                key: format!("contributions from revision {}", piece[0]),
                detail: format!("{} of {} are in the log", rows.len(), piece.len()),
            });
        }
        let reading = reading.clone();
        batch = aside(move || {
            for row in &rows {
                batch.add(Arc::unwrap_or_clone(whole(row, &reading)?.contribution));
            }
            Ok(batch)
        })
        .await?;
    }
    Ok(batch)
}

/// What a level's fold depends on besides its log.
pub(crate) fn config(row: &LevelRow) -> LevelConfig {
    let standard = LevelConfig::standard(row.resolution_m);
    LevelConfig { slices: SliceConfig { length_s: row.slice_s, ..standard.slices }, ..standard }
}

/// What the contributions of a level were checked against, but for limits.
fn target(row: &LevelRow) -> Target {
    Target { frame: row.frame, resolution_m: row.resolution_m, limits: NO_LIMITS }
}

/// A whole row of the log.
///
/// # Errors
/// A row that does not hold what was accepted.
pub(crate) fn whole(row: &LogRow, reading: &Reading) -> Result<Logged, StoreError> {
    let wire = payload::join(&row.payload.features, &row.payload.evidence);
    logged(row.revision, row.state, row.received_at_us, wire, reading)
}

/// A row of the log without its evidence.
///
/// # Errors
/// A row that does not hold what was accepted.
pub(crate) fn features(row: &FeaturesRow, reading: &Reading) -> Result<Logged, StoreError> {
    let wire = payload::without_evidence(&row.features);
    logged(row.revision, row.state, row.received_at_us, wire, reading)
}

fn logged(
    revision: i64,
    state: ContributionState,
    received_at_us: i64,
    wire: Result<v1::Contribution, PayloadError>,
    reading: &Reading,
) -> Result<Logged, StoreError> {
    let corrupt = |detail: String| StoreError::Corrupt {
        table: "contributions",
        key: format!("revision {revision}"),
        detail,
    };
    let wire = wire.map_err(|e| corrupt(e.to_string()))?;
    let contribution = check_contribution(&wire, &reading.target).map_err(|wrong| {
        let first =
            wrong.first().map(|Violation { pointer, detail, .. }| format!("{pointer}: {detail}"));
        corrupt(first.unwrap_or_else(|| "is refused".to_owned()))
    })?;
    let is_own = wire.pose.provenance == v1::Provenance::OwnMap;
    let held = is_own || state == ContributionState::Held;
    let contribution = as_received(contribution, received_at_us);
    let frame = reading.frames.get(&wire.frame).filter(|_| is_own);
    let contribution = match frame {
        Some(level_from_odom) => moved(&contribution, level_from_odom, reading.target.resolution_m),
        None => contribution,
    };
    Ok(Logged { revision, held, contribution: Arc::new(contribution) })
}
