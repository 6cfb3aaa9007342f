//! What operators do to a level's log: reverts, and the restores that undo them.
//!
//! An act is one entry of the log, with a revision of its own from the level's row. It stands there
//! with the exact contributions that it moved out of the map or back into it, as they were found
//! under the lock of that row: whoever reads the log needs nothing else to do the same.

mod read;
mod targets;

use std::collections::{BTreeMap, BTreeSet};

use mapfold_schema::v1;
use uuid::Uuid;

pub(super) use read::first_after as first_act_after;
use targets::{Found, resolve, still_covered};
pub use targets::{Plan, REVERT_MAX, Span, Targets};

use super::log::state_text;
use super::revision_list;
use super::row::{corrupt, get};
use super::transaction::Tx;
use super::values::{Bulk, bulk_in};
use super::{Store, StoreError, retried};

const TABLE: &str = "acts";

/// What an act does.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ActKind {
    /// Takes contributions out of the map.
    Revert,
    /// Puts back what a revert took out.
    Restore,
    /// Puts in what was held of a robot's own frame.
    Align,
    /// Takes out what alignments have put in.
    Withdraw,
}

/// An act or an alignment, as the fold reads it. Both lists ascend.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ActRow {
    /// Its place in the log.
    pub revision: i64,
    /// What it does.
    pub kind: ActKind,
    /// Contributions that a revert keeps out for as long as it stands; of a restore, those of the
    /// revert that it undoes. Of an alignment or its withdrawal, what it moved.
    pub covered: Vec<i64>,
    /// Those of them that it moved out of the map, or back into it.
    pub moved: Vec<i64>,
}

/// Who acts, and why.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct NewAct {
    /// The act.
    pub id: Uuid,
    /// SHA-256 of what is asked for, lower-case hexadecimal.
    pub digest: String,
    /// Public id of the token.
    pub author: String,
    /// In the author's words.
    pub reason: String,
    /// Now, microseconds since 1970.
    pub at_us: i64,
}

/// Why contributions are not reverted. Nothing has changed then.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RevertRefusal {
    /// The id stands in the log for something else.
    #[error("The id stands in the log already, as revision {0}, for something else.")]
    Conflict(i64),
    /// This very revert is in the log, and was undone since.
    #[error("This revert was undone at revision {0}; send it under a new id to revert again.")]
    Undone(i64),
    /// Contributions that are not in the log, by their place in the list.
    #[error("Some of the contributions are not in this level's log.")]
    Unknown(Vec<usize>),
    /// Contributions that are held, and so not in the map, by their place in the list.
    #[error("Some of the contributions are held, and so not in the map.")]
    Held(Vec<usize>),
    /// None of them is in the map.
    #[error("None of these contributions is in the map: there are none, or they are out already.")]
    Nothing,
    /// More than one revert takes.
    #[error("These are more than {0} contributions; name a shorter span.")]
    TooMany(usize),
}

/// What became of a revert that was asked for.
pub type RevertOutcome = Result<v1::Revert, RevertRefusal>;

static SET_STATE: Bulk = bulk_in!(
    "update contributions set state = $3 where site = $1 and level = $2 and state = $4 \
     and revision in ",
    from 5,
    ""
);

impl Store {
    /// Takes contributions out of the map, as one entry of the log. When it returns, that is on
    /// disk. The same id with the same digest is answered as it was the first time.
    ///
    /// # Errors
    /// [`StoreError::Missing`] for a level that is not there; otherwise nothing has changed,
    /// except that [`StoreError::Unavailable`] leaves it open: asking again with the same id tells.
    pub async fn revert(
        &self,
        site: &str,
        level: &str,
        act: &NewAct,
        targets: &Targets,
    ) -> Result<RevertOutcome, StoreError> {
        retried("revert", || self.try_revert(site, level, act, targets)).await
    }

    async fn try_revert(
        &self,
        site: &str,
        level: &str,
        act: &NewAct,
        targets: &Targets,
    ) -> Result<RevertOutcome, StoreError> {
        let mut tx = self.begin_write().await?;
        let revision = next_revision(&mut tx, site, level).await?;
        if let Some(known) = standing(&mut tx, site, level, act).await? {
            tx.rollback().await?;
            return Ok(known);
        }
        let found = match resolve(&mut tx, site, level, targets).await? {
            Ok(found) if found.moved.is_empty() => Err(RevertRefusal::Nothing),
            other => other,
        };
        let found = match found {
            Ok(found) => found,
            Err(refusal) => {
                tx.rollback().await?;
                return Ok(Err(refusal));
            }
        };
        let span = match targets {
            Targets::Span(span) => Some(span),
            Targets::Contributions(_) => None,
        };
        let entry = Entry { revision, kind: ActKind::Revert, act, span, found: &found };
        entry.write(&mut tx, site, level).await?;
        let revert = read::revert(&mut tx, site, level, act.id).await?;
        tx.commit().await?;
        revert.map(Ok).ok_or_else(|| corrupt(TABLE, act.id.to_string(), "it is not there"))
    }

    /// Undoes a revert, as one entry of the log: puts back what it took out, but for what another
    /// revert that stands covers too. One that is undone already stays as it is. `None` if there
    /// is no such revert. `act` names who asks; its digest and reason are not looked at.
    ///
    /// # Errors
    /// As [`Self::revert`].
    pub async fn restore(
        &self,
        site: &str,
        level: &str,
        revert: Uuid,
        act: &NewAct,
    ) -> Result<Option<v1::Revert>, StoreError> {
        retried("restore", || self.try_restore(site, level, revert, act)).await
    }

    async fn try_restore(
        &self,
        site: &str,
        level: &str,
        id: Uuid,
        act: &NewAct,
    ) -> Result<Option<v1::Revert>, StoreError> {
        let mut tx = self.begin_write().await?;
        let revision = next_revision(&mut tx, site, level).await?;
        let revert = read::revert(&mut tx, site, level, id).await?;
        if revert.as_ref().is_none_or(|revert| revert.undone.is_some()) {
            tx.rollback().await?;
            return Ok(revert);
        }
        let found = still_covered(&mut tx, site, level, id).await?;
        let entry = Entry { revision, kind: ActKind::Restore, act, span: None, found: &found };
        entry.write(&mut tx, site, level).await?;
        sqlx::query(
            "update acts set undone_revision = $4 where site = $1 and level = $2 and act = $3",
        )
        .bind(site)
        .bind(level)
        .bind(id.to_string())
        .bind(revision)
        .execute(&mut *tx)
        .await?;
        let undone = read::revert(&mut tx, site, level, id).await?;
        tx.commit().await?;
        Ok(undone)
    }
}

/// Takes the lock of the level's row, and its next revision.
pub(super) async fn next_revision(tx: &mut Tx, site: &str, level: &str) -> Result<i64, StoreError> {
    let row = sqlx::query(
        "update levels set revision = revision + 1 where site = $1 and level = $2 \
         returning revision",
    )
    .bind(site)
    .bind(level)
    .fetch_optional(&mut **tx)
    .await?;
    match row {
        Some(row) => get(&row, "levels", "revision"),
        None => Err(StoreError::Missing { kind: "level", name: level.to_owned() }),
    }
}

/// The answer to a revert whose id stands in the log.
async fn standing(
    tx: &mut Tx,
    site: &str,
    level: &str,
    act: &NewAct,
) -> Result<Option<RevertOutcome>, StoreError> {
    let row = sqlx::query(
        "select revision, kind, digest from acts where site = $1 and level = $2 and act = $3",
    )
    .bind(site)
    .bind(level)
    .bind(act.id.to_string())
    .fetch_optional(&mut **tx)
    .await?;
    let Some(row) = row else { return Ok(None) };
    let (revision, kind): (i64, String) =
        (get(&row, TABLE, "revision")?, get(&row, TABLE, "kind")?);
    let digest: String = get(&row, TABLE, "digest")?;
    if parse_kind(&kind)? != ActKind::Revert || digest != act.digest {
        return Ok(Some(Err(RevertRefusal::Conflict(revision))));
    }
    let known = read::revert(tx, site, level, act.id).await?;
    let known = known.ok_or_else(|| corrupt(TABLE, act.id.to_string(), "it is not there"))?;
    Ok(Some(match known.undone {
        Some(undone) => Err(RevertRefusal::Undone(undone.revision)),
        None => Ok(known),
    }))
}

/// An act on its way into the log.
struct Entry<'a> {
    revision: i64,
    kind: ActKind,
    act: &'a NewAct,
    span: Option<&'a Span>,
    found: &'a Found,
}

impl Entry<'_> {
    async fn write(&self, tx: &mut Tx, site: &str, level: &str) -> Result<(), StoreError> {
        use v1::ContributionState::{Folded, Reverted};
        let Self { revision, kind, act, span, found } = self;
        let robots =
            serde_json::to_string(&found.shares).map_err(|e| corrupt(TABLE, "robots", e))?;
        sqlx::query(
            "insert into acts (site, level, revision, act, kind, digest, author, reason, at_us, \
             robot, from_us, to_us, robots, covered_count, moved_count, covered, moved) values \
             ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13, $14, $15, $16, $17)",
        )
        .bind(site)
        .bind(level)
        .bind(revision)
        .bind(act.id.to_string())
        .bind(kind_text(*kind))
        .bind(act.digest.as_str())
        .bind(act.author.as_str())
        .bind(act.reason.as_str())
        .bind(act.at_us)
        .bind(span.map(|span| span.robot.as_str()))
        .bind(span.and_then(|span| span.from_us))
        .bind(span.and_then(|span| span.to_us))
        .bind(robots)
        .bind(found.covered.len() as i64)
        .bind(found.moved.len() as i64)
        .bind(revision_list::encode(&found.covered))
        .bind(revision_list::encode(&revisions(&found.moved)))
        .execute(&mut **tx)
        .await?;

        let (before, after, sign) = match kind {
            ActKind::Revert => (Folded, Reverted, 1),
            ActKind::Restore => (Reverted, Folded, -1),
            ActKind::Align | ActKind::Withdraw => {
                return Err(corrupt(TABLE, act.id.to_string(), "alignments are no acts"));
            }
        };
        let key = act.id.to_string();
        move_contributions(tx, (site, level), &revisions(&found.moved), before, after)
            .await?
            .map_err(|detail| corrupt(TABLE, key, detail))?;
        // By name, as appends do it: transactions of several levels lock robots in one order.
        let mut counts: BTreeMap<&str, i64> = BTreeMap::new();
        for robot in found.moved.values() {
            *counts.entry(robot).or_default() += sign;
        }
        for (robot, count) in counts {
            sqlx::query(
                "update robots set reverted = reverted + $3 where site = $1 and robot = $2",
            )
            .bind(site)
            .bind(robot)
            .bind(count)
            .execute(&mut **tx)
            .await?;
        }
        Ok(())
    }
}

/// Moves contributions that must all be in one state into another. The inner error tells that some were not, and the
/// transaction is not to be kept.
pub(super) async fn move_contributions(
    tx: &mut Tx,
    (site, level): (&str, &str),
    revisions: &[i64],
    from: v1::ContributionState,
    to: v1::ContributionState,
) -> Result<Result<(), String>, StoreError> {
    let (from, to) = (state_text(from), state_text(to));
    let mut moved = 0;
    for (statement, piece) in SET_STATE.statements(revisions) {
        let mut query = sqlx::query(statement).bind(site).bind(level).bind(to).bind(from);
        for revision in piece {
            query = query.bind(*revision);
        }
        moved += query.execute(&mut **tx).await?.rows_affected();
    }
    if moved == revisions.len() as u64 {
        return Ok(Ok(()));
    }
    Ok(Err(format!("{moved} of {} contributions were {from}", revisions.len())))
}

fn revisions(moved: &BTreeMap<i64, String>) -> Vec<i64> {
    moved.keys().copied().collect()
}

/// Which contributions are out after `acts`, in the order of the log, by revision.
fn out_after<'a>(acts: impl IntoIterator<Item = &'a ActRow>) -> BTreeSet<i64> {
    let mut out = BTreeSet::new();
    for act in acts {
        for revision in &act.moved {
            match act.kind {
                ActKind::Revert => out.insert(*revision),
                ActKind::Restore => out.remove(revision),
                ActKind::Align | ActKind::Withdraw => false,
            };
        }
    }
    out
}

/// Which contributions are in force after some acts.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Force {
    /// Taken out.
    pub out: BTreeSet<i64>,
    /// Held when they came, and put in.
    pub aligned: BTreeSet<i64>,
}

impl Force {
    /// After `acts`, in the order of the log.
    pub fn after<'a>(acts: impl IntoIterator<Item = &'a ActRow> + Clone) -> Self {
        Self { out: out_after(acts.clone()), aligned: aligned_after(acts) }
    }

    /// Whether a contribution is, that was `held` when it came.
    pub fn has(&self, revision: i64, held: bool) -> bool {
        (!held || self.aligned.contains(&revision)) && !self.out.contains(&revision)
    }
}

/// Which contributions that were held are in after `acts`, in the order of the log, by revision.
fn aligned_after<'a>(acts: impl IntoIterator<Item = &'a ActRow>) -> BTreeSet<i64> {
    let mut aligned = BTreeSet::new();
    for act in acts {
        match act.kind {
            ActKind::Align => aligned.extend(&act.moved),
            ActKind::Withdraw => {
                for revision in &act.moved {
                    aligned.remove(revision);
                }
            }
            ActKind::Revert | ActKind::Restore => {}
        }
    }
    aligned
}

fn kind_text(kind: ActKind) -> &'static str {
    match kind {
        ActKind::Revert => "revert",
        ActKind::Restore => "restore",
        ActKind::Align => "align",
        ActKind::Withdraw => "withdraw",
    }
}

fn parse_kind(text: &str) -> Result<ActKind, StoreError> {
    match text {
        "revert" => Ok(ActKind::Revert),
        "restore" => Ok(ActKind::Restore),
        _ => Err(corrupt(TABLE, "kind", format!("{text:?} is no kind of act"))),
    }
}
