//! Where robots' own frames lie on a level: proposed out of what is held, accepted by an operator or by rule.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use mapfold_map::alignment::{Alignment, AlignmentConfig, Chart, align};
use mapfold_map::level::Level;
use mapfold_schema::border::alignment::wire_pose;
use mapfold_schema::v1;
use uuid::Uuid;

use super::LevelHandle;
use super::open::aside;
use super::recall::{self, Reading};
use super::recent::Recent;
use crate::store::StoreError;
use crate::store::alignments::{ALIGNED_MAX, AlignmentRefusal, Frames, HeldFrame, NewEntry};

/// Proposals that are kept.
const KEPT_MAX: usize = 16;
/// Rows that are read at once.
const PAGE: usize = 256;
/// The rule looks at a frame when so many of its contributions are held, and again with each half as many more.
const RULE_BEGINS: usize = 16;
/// Who accepted what the rule did.
pub const BY_RULE: &str = "rule";

/// What a proposal depends on: the frame, the last of what is held of it, and the map's revision.
type Key = (Uuid, i64, i64);

/// Proposals that were asked for last, and how much was held when the rule last looked at a frame.
#[derive(Debug)]
pub(super) struct AlignmentCache {
    proposals: Recent<Key, Alignment>,
    looked_at: Mutex<BTreeMap<Uuid, usize>>,
    /// One proposal is worked out at a time: each may take seconds.
    turn: tokio::sync::Mutex<()>,
}

impl Default for AlignmentCache {
    fn default() -> Self {
        Self {
            proposals: Recent::new(KEPT_MAX),
            looked_at: Mutex::default(),
            turn: tokio::sync::Mutex::default(),
        }
    }
}

/// Why a frame was not aligned, or an alignment not withdrawn.
#[derive(Debug, thiserror::Error)]
pub enum AlignmentError {
    /// It must not be. Nothing has changed.
    #[error(transparent)]
    Refused(#[from] AlignmentRefusal),
    /// The first candidate is doubtful, and no pose was named.
    #[error("No place of this frame is certain: name the pose.")]
    Uncertain,
    /// The store failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl LevelHandle {
    /// Where a frame seems to lie on the map that is published now, out of all that is held of it.
    ///
    /// # Errors
    /// The store fails.
    pub async fn proposal(&self, held: &HeldFrame) -> Result<Arc<Alignment>, StoreError> {
        let cache = &self.shared.alignments;
        let _turn = cache.turn.lock().await;
        let snapshot = self.snapshot();
        let last = held.revisions.last().copied().unwrap_or_default();
        let key = (held.frame, last, snapshot.folded_revision());
        if let Some(known) = cache.proposals.get(&key) {
            return Ok(known);
        }
        let row = Arc::clone(&self.shared.row);
        let mut own = Level::new(recall::config(&row));
        let reading = Reading::new(&row, Frames::new());
        let revisions = &held.revisions[..held.revisions.len().min(ALIGNED_MAX)];
        for piece in revisions.chunks(PAGE) {
            let rows = self.shared.store.log_rows(&row.site, &row.level, piece).await?;
            let reading = reading.clone();
            own = aside(move || {
                let looks = rows.iter().map(|row| recall::whole(row, &reading));
                let looks = looks.collect::<Result<Vec<_>, StoreError>>()?;
                own.fold(looks.iter().map(|look| &*look.contribution));
                Ok(own)
            })
            .await?;
        }
        let resolution_m = self.resolution_m();
        let found = aside(move || {
            let config = AlignmentConfig::STANDARD;
            let level = Chart::of_map(&snapshot.map(), resolution_m, &config);
            let own = Chart::of_map(own.map(), resolution_m, &config);
            Ok(align(&level, &own, &config))
        })
        .await?;
        let found = Arc::new(found);
        cache.proposals.put(key, &found);
        Ok(found)
    }

    /// Frames of which contributions are held.
    ///
    /// # Errors
    /// The store fails.
    pub async fn held_frames(&self) -> Result<Vec<HeldFrame>, StoreError> {
        self.shared.store.held_frames(self.site(), self.level()).await
    }

    /// Puts what is held of a frame into the map: at `pose`, or where it is certain to lie. Resolves when that is on disk.
    ///
    /// # Errors
    /// Why not.
    pub async fn align(
        &self,
        frame: Uuid,
        pose: Option<v1::UncertainPose>,
        entry: &NewEntry,
    ) -> Result<v1::Alignment, AlignmentError> {
        let pose = if let Some(pose) = pose {
            pose
        } else {
            let frames = self.held_frames().await?;
            let held = frames.iter().find(|held| held.frame == frame);
            let held = held.ok_or(AlignmentRefusal::NothingHeld)?;
            let found = self.proposal(held).await?;
            let certain = found.aligned().ok_or(AlignmentError::Uncertain)?;
            wire_pose(&certain.level_from_odom)
        };
        self.put_in(frame, Some(&pose), entry).await
    }

    async fn put_in(
        &self,
        frame: Uuid,
        pose: Option<&v1::UncertainPose>,
        entry: &NewEntry,
    ) -> Result<v1::Alignment, AlignmentError> {
        let store = &self.shared.store;
        let aligned = store.align(self.site(), self.level(), frame, pose, entry).await;
        let aligned = self.watched(aligned)??;
        metrics::counter!("mapfold_acts_total", "kind" => "align").increment(1);
        self.look_for(aligned.revision);
        Ok(aligned)
    }

    /// Takes what alignments of a frame have put in out of the map again; answers the revision, when that
    /// is on disk. From then on the frame is an operator's to align.
    ///
    /// # Errors
    /// Why not.
    pub async fn withdraw(&self, frame: Uuid, entry: &NewEntry) -> Result<i64, AlignmentError> {
        let store = &self.shared.store;
        let revision = store.withdraw(self.site(), self.level(), frame, entry).await;
        let revision = self.watched(revision)??;
        metrics::counter!("mapfold_acts_total", "kind" => "withdraw").increment(1);
        self.look_for(revision);
        Ok(revision)
    }

    /// What the rule does when contributions of frames were held: those of a frame that is aligned follow it; a
    /// frame of which enough is held is aligned where it lies for certain. One that was withdrawn is an
    /// operator's to decide, and so is what a robot sends that is held as such.
    ///
    /// # Errors
    /// The store fails.
    pub async fn follow_rule(&self, frames: &[Uuid], at_us: i64) -> Result<(), StoreError> {
        let (site, level) = (self.site(), self.level());
        let told = self.shared.store.alignments(site, level, u32::MAX).await?;
        for held in self.held_frames().await? {
            if !frames.contains(&held.frame) || held.is_quarantined {
                continue;
            }
            let author = BY_RULE.to_owned();
            let entry = NewEntry { author, comment: String::new(), at_us };
            let mut of_frame = told.iter().filter(|alignment| alignment.frame == held.frame);
            let done = if told.iter().any(|a| a.frame == held.frame && a.withdrawn.is_none()) {
                self.put_in(held.frame, None, &entry).await
            } else if of_frame.next().is_some() || !self.is_due(&held) {
                continue;
            } else {
                self.align(held.frame, None, &entry).await
            };
            match done {
                Ok(_) | Err(AlignmentError::Refused(_) | AlignmentError::Uncertain) => {}
                Err(AlignmentError::Store(error)) => return Err(error),
            }
        }
        Ok(())
    }

    /// Whether enough is held of a frame that was not looked at before.
    fn is_due(&self, held: &HeldFrame) -> bool {
        let looked_at = &self.shared.alignments.looked_at;
        // Nothing that runs under this lock can leave it half done.
        let mut looked_at = looked_at.lock().unwrap_or_else(PoisonError::into_inner);
        let before = looked_at.entry(held.frame).or_default();
        let count = held.revisions.len();
        let is_due = count >= RULE_BEGINS && 2 * count >= 3 * *before;
        if is_due {
            *before = count;
        }
        is_due
    }
}
