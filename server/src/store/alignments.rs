//! Where robots' own frames lie on a level: entries of its log that put held contributions into the map.
//!
//! A contribution in a robot's own frame is held. An alignment moves all that are held of its frame into the
//! map, at the pose that stands with it; later ones of the frame follow by another entry with the same pose.
//! A withdrawal takes out again what all alignments that stand for the frame have put in.

mod read;

use std::collections::BTreeMap;

use mapfold_map::geometry::{Level, Odom, UncertainPose};
use mapfold_schema::v1;
use uuid::Uuid;

pub(super) use read::{acts_between, first_after};

use super::acts::{move_contributions, next_revision};
use super::log::state_text;
use super::revision_list;
use super::row::{corrupt, get};
use super::transaction::Tx;
use super::{Store, StoreError, retried};

const TABLE: &str = "alignments";

/// Contributions that one alignment may move.
pub const ALIGNED_MAX: usize = 20_000;

/// Poses of robots' own frames, by frame.
pub type Frames = BTreeMap<Uuid, UncertainPose<Level, Odom>>;

/// A frame of which contributions are held.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct HeldFrame {
    /// The frame.
    pub frame: Uuid,
    /// Who contributed in it, by name.
    pub robots: Vec<String>,
    /// Whether one of these robots is held as such, whatever it sends.
    pub is_quarantined: bool,
    /// Revisions of what is held, ascending.
    pub revisions: Vec<i64>,
}

/// Who accepts or withdraws, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewEntry {
    /// Public id of the token, or `rule`.
    pub author: String,
    /// In the author's words.
    pub comment: String,
    /// Now, microseconds since 1970.
    pub at_us: i64,
}

/// Why a frame is not aligned, or an alignment not withdrawn. Nothing has changed then.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AlignmentRefusal {
    /// Nothing of it is held.
    #[error("No contribution in this frame is held.")]
    NothingHeld,
    /// It lies elsewhere already.
    #[error("The frame is aligned already, at revision {0}: withdraw that first.")]
    Aligned(i64),
    /// No alignment of it stands.
    #[error("No alignment of this frame stands.")]
    NotAligned,
    /// What reverts have taken out would be put back at another place.
    #[error("{0} contributions of this frame are reverted: undo these reverts first.")]
    Reverted(usize),
    /// More than one entry takes.
    #[error("These are more than {0} contributions.")]
    TooMany(usize),
}

impl Store {
    /// Puts all that is held of a frame into the map at `pose`, as one entry of the log; without a pose, at
    /// that of the alignment which stands for it.
    ///
    /// # Errors
    /// As [`Self::revert`].
    pub async fn align(
        &self,
        site: &str,
        level: &str,
        frame: Uuid,
        pose: Option<&v1::UncertainPose>,
        entry: &NewEntry,
    ) -> Result<Result<v1::Alignment, AlignmentRefusal>, StoreError> {
        retried("align", || self.try_align(site, level, frame, pose, entry)).await
    }

    async fn try_align(
        &self,
        site: &str,
        level: &str,
        frame: Uuid,
        pose: Option<&v1::UncertainPose>,
        entry: &NewEntry,
    ) -> Result<Result<v1::Alignment, AlignmentRefusal>, StoreError> {
        let mut tx = self.begin_write().await?;
        let revision = next_revision(&mut tx, site, level).await?;
        let standing = read::standing(&mut tx, site, level, frame).await?;
        let moved = in_state(&mut tx, site, level, frame, v1::ContributionState::Held).await?;
        let pose = match (pose, &standing) {
            (Some(_), Some(standing)) => Err(AlignmentRefusal::Aligned(standing.revision)),
            (None, None) => Err(AlignmentRefusal::NotAligned),
            _ if moved.is_empty() => Err(AlignmentRefusal::NothingHeld),
            _ if moved.len() > ALIGNED_MAX => Err(AlignmentRefusal::TooMany(ALIGNED_MAX)),
            (Some(pose), None) => Ok(pose.clone()),
            (None, Some(standing)) => Ok(standing.pose.clone()),
        };
        let pose = match pose {
            Ok(pose) => pose,
            Err(refusal) => {
                tx.rollback().await?;
                return Ok(Err(refusal));
            }
        };
        let line = Line { revision, kind: "align", frame, pose: &pose, entry, moved: &moved };
        line.write(&mut tx, site, level).await?;
        let [held, folded] = [v1::ContributionState::Held, v1::ContributionState::Folded];
        set_state(&mut tx, (site, level), &moved, held, folded).await?;
        tx.commit().await?;
        Ok(Ok(v1::Alignment {
            revision,
            frame,
            pose,
            at: mapfold_schema::instant::to_rfc3339(entry.at_us),
            author: entry.author.clone(),
            comment: entry.comment.clone(),
            contributions: moved.len() as u32,
            withdrawn: None,
        }))
    }

    /// Takes all contributions of a frame out of the map again, and holds them, as one entry of the log; answers its
    /// revision.
    ///
    /// # Errors
    /// As [`Self::revert`].
    pub async fn withdraw(
        &self,
        site: &str,
        level: &str,
        frame: Uuid,
        entry: &NewEntry,
    ) -> Result<Result<i64, AlignmentRefusal>, StoreError> {
        retried("withdraw", || self.try_withdraw(site, level, frame, entry)).await
    }

    async fn try_withdraw(
        &self,
        site: &str,
        level: &str,
        frame: Uuid,
        entry: &NewEntry,
    ) -> Result<Result<i64, AlignmentRefusal>, StoreError> {
        use v1::ContributionState::{Folded, Held, Reverted};
        let mut tx = self.begin_write().await?;
        let revision = next_revision(&mut tx, site, level).await?;
        let standing = read::standing(&mut tx, site, level, frame).await?;
        let reverted = in_state(&mut tx, site, level, frame, Reverted).await?;
        let standing = match standing {
            None => Err(AlignmentRefusal::NotAligned),
            Some(_) if !reverted.is_empty() => Err(AlignmentRefusal::Reverted(reverted.len())),
            Some(standing) => Ok(standing),
        };
        let standing = match standing {
            Ok(standing) => standing,
            Err(refusal) => {
                tx.rollback().await?;
                return Ok(Err(refusal));
            }
        };
        let moved = in_state(&mut tx, site, level, frame, Folded).await?;
        let pose = &standing.pose;
        let line = Line { revision, kind: "withdraw", frame, pose, entry, moved: &moved };
        line.write(&mut tx, site, level).await?;
        sqlx::query(
            "update alignments set withdrawn_revision = $4 where site = $1 and level = $2 \
             and frame = $3 and kind = 'align' and withdrawn_revision is null",
        )
        .bind(site)
        .bind(level)
        .bind(frame.to_string())
        .bind(revision)
        .execute(&mut *tx)
        .await?;
        set_state(&mut tx, (site, level), &moved, Folded, Held).await?;
        tx.commit().await?;
        Ok(Ok(revision))
    }
}

/// Revisions of a frame's contributions in a state, ascending; one more than may be moved, if there are.
async fn in_state(
    tx: &mut Tx,
    site: &str,
    level: &str,
    frame: Uuid,
    state: v1::ContributionState,
) -> Result<Vec<i64>, StoreError> {
    let rows = sqlx::query(
        "select revision from contributions where site = $1 and level = $2 and frame = $3 \
         and state = $4 order by revision limit $5",
    )
    .bind(site)
    .bind(level)
    .bind(frame.to_string())
    .bind(state_text(state))
    .bind(ALIGNED_MAX as i64 + 1)
    .fetch_all(&mut **tx)
    .await?;
    rows.iter().map(|row| get(row, "contributions", "revision")).collect()
}

async fn set_state(
    tx: &mut Tx,
    level: (&str, &str),
    revisions: &[i64],
    from: v1::ContributionState,
    to: v1::ContributionState,
) -> Result<(), StoreError> {
    let moved = move_contributions(tx, level, revisions, from, to).await?;
    moved.map_err(|detail| corrupt(TABLE, "moved", detail))
}

/// An entry on its way into the log.
struct Line<'a> {
    revision: i64,
    kind: &'static str,
    frame: Uuid,
    pose: &'a v1::UncertainPose,
    entry: &'a NewEntry,
    moved: &'a [i64],
}

impl Line<'_> {
    async fn write(&self, tx: &mut Tx, site: &str, level: &str) -> Result<(), StoreError> {
        let covariance = serde_json::to_string(&self.pose.covariance)
            .map_err(|e| corrupt(TABLE, "covariance", e))?;
        sqlx::query(
            "insert into alignments (site, level, revision, kind, frame, x_m, y_m, heading_rad, \
             covariance, author, at_us, comment, moved_count, moved) values \
             ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14)",
        )
        .bind(site)
        .bind(level)
        .bind(self.revision)
        .bind(self.kind)
        .bind(self.frame.to_string())
        .bind(self.pose.x_m)
        .bind(self.pose.y_m)
        .bind(self.pose.heading_rad)
        .bind(covariance)
        .bind(self.entry.author.as_str())
        .bind(self.entry.at_us)
        .bind(self.entry.comment.as_str())
        .bind(self.moved.len() as i64)
        .bind(revision_list::encode(self.moved))
        .execute(&mut **tx)
        .await?;
        Ok(())
    }
}
