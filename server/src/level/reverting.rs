//! Taking contributions out of a level's map, and putting them back.
//!
//! An act goes into the log past the queue of contributions, under the same lock of the level's
//! row; the folder then finds it there, like what another replica has put in.

use std::time::Duration;

use mapfold_schema::v1;
use tokio::sync::oneshot;
use uuid::Uuid;

use super::trial::{Outcome, Trial};
use super::{LevelHandle, recall};
use crate::store::StoreError;
use crate::store::acts::{ActKind, NewAct, Plan, RevertRefusal, Targets};

/// How long a preview waits until the map has reached the newest entry of the log.
const PREVIEW_PATIENCE: Duration = Duration::from_secs(10);

/// Why contributions were not taken out or put back.
#[derive(Debug, thiserror::Error)]
pub enum RevertError {
    /// They must not be. Nothing has changed.
    #[error(transparent)]
    Refused(#[from] RevertRefusal),
    /// The store failed. After [`StoreError::Unavailable`] it is open whether it has happened;
    /// asking again with the same id tells.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// A preview came to no end: another act was faster, or the level is closing. Asking again may
    /// help.
    #[error("The map went on meanwhile; ask again.")]
    Overtaken,
    /// Nothing can be tried out on a map that is too far behind its log.
    #[error("The map is still at revision {folded_revision} of {revision}; ask again in a moment.")]
    Behind {
        /// What the map has reached.
        folded_revision: i64,
        /// What it would have to reach.
        revision: i64,
    },
}

impl LevelHandle {
    /// Takes contributions out of the map; resolves when that is on disk. The map follows, here
    /// and on every replica, like after a contribution.
    ///
    /// # Errors
    /// Why not.
    pub async fn revert(&self, act: &NewAct, targets: &Targets) -> Result<v1::Revert, RevertError> {
        let reverted = self.shared.store.revert(self.site(), self.level(), act, targets).await;
        let reverted = self.watched(reverted)??;
        metrics::counter!("mapfold_acts_total", "kind" => "revert").increment(1);
        self.look_for(reverted.revision);
        Ok(reverted)
    }

    /// Undoes a revert; resolves when that is on disk. One that is undone already stays so. `None`
    /// if there is no such revert.
    ///
    /// # Errors
    /// Why not.
    pub async fn undo(
        &self,
        revert: Uuid,
        act: &NewAct,
    ) -> Result<Option<v1::Revert>, RevertError> {
        let undone = self.shared.store.restore(self.site(), self.level(), revert, act).await;
        let undone = self.watched(undone)?;
        if let Some(undone) = undone.as_ref().and_then(|revert| revert.undone.as_ref()) {
            metrics::counter!("mapfold_acts_total", "kind" => "restore").increment(1);
            self.look_for(undone.revision);
        }
        Ok(undone)
    }

    /// What [`Self::revert`] would change.
    ///
    /// # Errors
    /// Why it would be refused, or nothing can be said.
    pub async fn preview(&self, targets: &Targets) -> Result<v1::RevertPreview, RevertError> {
        let plan = self.shared.store.plan_revert(self.site(), self.level(), targets).await??;
        self.try_out(ActKind::Revert, plan).await
    }

    /// What [`Self::undo`] would change; `None` if there is no such revert.
    ///
    /// # Errors
    /// Nothing can be said.
    pub async fn preview_undo(
        &self,
        revert: Uuid,
    ) -> Result<Option<v1::RevertPreview>, RevertError> {
        match self.shared.store.plan_restore(self.site(), self.level(), revert).await? {
            Some(plan) => self.try_out(ActKind::Restore, plan).await.map(Some),
            None => Ok(None),
        }
    }

    async fn try_out(&self, kind: ActKind, plan: Plan) -> Result<v1::RevertPreview, RevertError> {
        let Plan { revision, covered, moved, shares } = plan;
        let snapshot = self.snapshot_at(revision, PREVIEW_PATIENCE).await;
        let folded_revision = snapshot.folded_revision();
        if folded_revision < revision {
            return Err(RevertError::Behind { folded_revision, revision });
        }
        let count = moved.len() as u32;
        let outcome = if moved.is_empty() {
            Outcome { revision, ..Outcome::default() }
        } else {
            let moved =
                recall::batch(&self.shared.store, &self.shared.row, &moved, revision).await?;
            let (answer, outcome) = oneshot::channel();
            let trial = Trial { kind, moved, answer };
            if self.shared.trials.send(trial).await.is_err() {
                return Err(RevertError::Overtaken);
            }
            outcome.await.ok().flatten().ok_or(RevertError::Overtaken)?
        };
        let Outcome {
            revision,
            segments,
            clusters,
            chains,
            tiles,
            bounds,
            features,
            more_features,
        } = outcome;
        Ok(v1::RevertPreview {
            revision,
            contributions: covered,
            moved: count,
            robots: shares,
            segments,
            clusters,
            chains,
            tiles,
            bounds,
            features,
            more_features,
        })
    }
}
