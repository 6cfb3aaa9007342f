//! Landmarks that robots taught, read from the map, and since when each is as it is.
//!
//! They are a function of the published segments. Made when somebody asks and a segment has changed, dated
//! with the revision of that change, and kept with the spans of revisions through which nothing changed: to whoever
//! was told at a revision in one of those, it can be told exactly what has changed since.

use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, PoisonError};

use mapfold_map::landmarks::{
    LandmarkKind, LearnedConfig, LearnedId, LearnedLandmark, SameConfig, landmarks_of_map, told_by,
};
use mapfold_map::level::FeatureId;

use super::LevelHandle;
use super::gdb::{GdbError, GdbModel};
use super::history::{History, Least};
use super::open::aside;
use super::recent::Recent;
use super::snapshot::Snapshot;
use crate::store::StoreError;
use crate::store::gdb::GdbVersion;

/// Spans that are kept; whoever was told before them reads all again.
const SPANS_MAX: usize = 4096;
/// Holdings against a model that are kept: what is published and what was, at a few heights.
const KEPT_MAX: usize = 6;

impl Least for LearnedId {
    const LEAST: Self =
        Self { kind: LandmarkKind::ConvexCorner, walls: [FeatureId::LEAST; 2], place: i32::MIN };
}

/// Revisions from the one of a change on, through which landmarks are known to have stayed the same.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Span {
    from: i64,
    until: i64,
}

#[derive(Debug, Default)]
struct Kept {
    history: History<LearnedId, LearnedLandmark>,
    /// Ascending; the last one is what `history` says.
    spans: Vec<Span>,
}

impl Kept {
    /// Goes on to a snapshot that is not older than the one before.
    fn follow(&mut self, snapshot: &Snapshot) {
        let (changed, reached) = (snapshot.segments_changed_at(), snapshot.folded_revision());
        if let Some(last) = self.spans.last_mut().filter(|last| last.from == changed) {
            last.until = last.until.max(reached);
            return;
        }
        let segments = snapshot.segments().map(|(id, segment)| (id, &**segment));
        let now = landmarks_of_map(segments, &LearnedConfig::STANDARD);
        let gone: Vec<LearnedId> =
            self.history.live().map(|(id, _)| *id).filter(|id| !now.contains_key(id)).collect();
        for id in gone {
            self.history.record(id, changed, None);
        }
        for (id, landmark) in now {
            self.history.record(id, changed, Some(Arc::new(landmark)));
        }
        if self.spans.len() >= SPANS_MAX {
            self.spans.remove(0);
        }
        self.spans.push(Span { from: changed, until: reached });
    }

    fn knows(&self, revision: i64) -> bool {
        self.spans.iter().any(|span| (span.from..=span.until).contains(&revision))
    }
}

/// What the cache of held landmarks depends on: the model's version, the bits of the height, and the revision
/// at which segments changed.
type Key = (GdbVersion, u64, i64);

/// The learned landmarks of a level.
#[derive(Debug)]
pub(super) struct LearnedCache {
    kept: Mutex<Kept>,
    told: Recent<Key, BTreeSet<LearnedId>>,
}

impl Default for LearnedCache {
    fn default() -> Self {
        Self { kept: Mutex::default(), told: Recent::new(KEPT_MAX) }
    }
}

/// Why it cannot be told what changed.
#[derive(Debug, thiserror::Error)]
pub enum LearnedError {
    /// The store failed, or the work was given up.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// Nobody knows here what was told then.
    #[error("what landmarks there were at revision {since} is not known here any more")]
    Forgotten {
        /// The revision.
        since: i64,
    },
}

/// The learned landmarks at one revision; a copy that shares all with the cache.
#[derive(Debug)]
pub struct Learned {
    revision: i64,
    changed_at: i64,
    history: History<LearnedId, LearnedLandmark>,
}

impl Learned {
    /// The revision of the map.
    pub fn revision(&self) -> i64 {
        self.revision
    }

    /// Those that are, each with the revision of its last change.
    pub fn live(&self) -> impl Iterator<Item = (i64, &Arc<LearnedLandmark>)> {
        let all = self.history.changed(0, i64::MAX);
        all.filter_map(|(revision, _, landmark)| Some((revision, landmark?)))
    }

    /// Those that are no more, and went after `since`.
    pub fn gone(&self, since: i64) -> impl Iterator<Item = LearnedId> {
        let changed = self.history.changed(since, i64::MAX);
        changed.filter(|(_, _, landmark)| landmark.is_none()).map(|(_, id, _)| id)
    }
}

impl LevelHandle {
    /// The landmarks that robots taught, for a reader who was told at revision `since` (0: never).
    ///
    /// # Errors
    /// [`LearnedError::Forgotten`].
    pub async fn learned(&self, since: i64) -> Result<Learned, LearnedError> {
        let handle = self.clone();
        let made = aside(move || {
            let kept = &handle.shared.learned.kept;
            let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
            // Under the lock, so that the newest is the last.
            let snapshot = handle.snapshot();
            kept.follow(&snapshot);
            if since > 0 && !kept.knows(since) {
                return Ok(Err(LearnedError::Forgotten { since }));
            }
            Ok(Ok(Learned {
                revision: snapshot.folded_revision(),
                changed_at: snapshot.segments_changed_at(),
                history: kept.history.clone(),
            }))
        });
        made.await?
    }

    /// Which of the learned landmarks a model has itself, at a height in metres. Takes a processor for a while when
    /// first asked.
    ///
    /// # Errors
    /// [`GdbError::TooCrowded`].
    pub fn told_by(
        &self,
        learned: &Learned,
        model: &GdbModel,
        height_m: f64,
    ) -> Result<Arc<BTreeSet<LearnedId>>, GdbError> {
        let key = (model.version(), height_m.to_bits(), learned.changed_at);
        let cache = &self.shared.learned.told;
        if let Some(told) = cache.get(&key) {
            return Ok(told);
        }
        let planned = model.landmarks(height_m)?;
        let planned: Vec<_> = planned.iter().map(|known| (known.landmark, known.extent)).collect();
        let all: Vec<&Arc<LearnedLandmark>> =
            learned.live().map(|(_, landmark)| landmark).collect();
        let places = all.iter().map(|learned| &learned.landmark);
        let said = told_by(places, &planned, &SameConfig::STANDARD);
        let told = all.iter().zip(said).filter(|(_, said)| *said).map(|(learned, _)| learned.id);
        let told = Arc::new(told.collect());
        cache.put(key, &told);
        Ok(told)
    }
}
