//! Which contributions an act is about, as the log stands at one moment.

use std::collections::{BTreeMap, BTreeSet};

use mapfold_schema::v1::{ContributionState, RobotShare};
use sqlx::any::AnyRow;
use uuid::Uuid;

use super::{RevertRefusal, TABLE};
use crate::store::log::parse_state;
use crate::store::revision_list;
use crate::store::row::{corrupt, get};
use crate::store::transaction::Tx;
use crate::store::values::{Bulk, bulk_in};
use crate::store::{Store, StoreError};

/// Contributions that one revert may cover.
pub const REVERT_MAX: usize = 20_000;

/// Which contributions are meant.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Targets {
    /// These.
    Contributions(Vec<Uuid>),
    /// What a robot sent.
    Span(Span),
}

/// What a robot saw within a time span.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Span {
    /// The robot.
    pub robot: String,
    /// First instant, microseconds since 1970, the robot's clock.
    pub from_us: Option<i64>,
    /// First instant after it.
    pub to_us: Option<i64>,
}

/// What an act would be about if it were taken now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Plan {
    /// Newest revision of the log.
    pub revision: i64,
    /// Contributions that it covers.
    pub covered: u32,
    /// Revisions of those that it would move, ascending.
    pub moved: Vec<i64>,
    /// Whose the covered ones are.
    pub shares: Vec<RobotShare>,
}

/// What an act is about.
#[derive(Debug, Default)]
pub(super) struct Found {
    /// Revisions of the contributions that it covers, ascending.
    pub(super) covered: Vec<i64>,
    /// Those that it moves, and whose they are.
    pub(super) moved: BTreeMap<i64, String>,
    /// Whose the covered ones are, by robot.
    pub(super) shares: Vec<RobotShare>,
}

/// A contribution, as far as an act looks at it.
struct Line {
    id: String,
    revision: i64,
    robot: String,
    state: ContributionState,
}

static BY_ID: Bulk = bulk_in!(
    "select contribution, revision, robot, state from contributions \
     where site = $1 and level = $2 and contribution in ",
    from 3,
    ""
);

static BY_REVISION: Bulk = bulk_in!(
    "select contribution, revision, robot, state from contributions \
     where site = $1 and level = $2 and revision in ",
    from 3,
    ""
);

impl Store {
    /// What a revert of these contributions would be about, without taking it.
    ///
    /// # Errors
    /// [`StoreError::Missing`] for a level that is not there.
    pub async fn plan_revert(
        &self,
        site: &str,
        level: &str,
        targets: &Targets,
    ) -> Result<Result<Plan, RevertRefusal>, StoreError> {
        let mut tx = self.begin_read().await?;
        let revision = head(&mut tx, site, level).await?;
        let found = resolve(&mut tx, site, level, targets).await?;
        tx.rollback().await?;
        Ok(found.map(|found| found.into_plan(revision)))
    }

    /// What undoing a revert would be about, without doing it; `None` if there is no such revert.
    ///
    /// # Errors
    /// [`StoreError::Missing`] for a level that is not there.
    pub async fn plan_restore(
        &self,
        site: &str,
        level: &str,
        revert: Uuid,
    ) -> Result<Option<Plan>, StoreError> {
        let mut tx = self.begin_read().await?;
        let revision = head(&mut tx, site, level).await?;
        let Some(known) = super::read::revert(&mut tx, site, level, revert).await? else {
            tx.rollback().await?;
            return Ok(None);
        };
        let mut found = still_covered(&mut tx, site, level, revert).await?;
        if known.undone.is_some() {
            found.moved.clear();
        }
        tx.rollback().await?;
        Ok(Some(found.into_plan(revision)))
    }
}

impl Found {
    fn of(lines: Vec<Line>, is_moved: impl Fn(&Line) -> bool) -> Self {
        let mut shares: BTreeMap<String, u32> = BTreeMap::new();
        let mut found = Self::default();
        for line in lines {
            *shares.entry(line.robot.clone()).or_default() += 1;
            found.covered.push(line.revision);
            if is_moved(&line) {
                found.moved.insert(line.revision, line.robot);
            }
        }
        found.covered.sort_unstable();
        found.shares = shares
            .into_iter()
            .map(|(robot, contributions)| RobotShare { robot, contributions })
            .collect();
        found
    }

    fn into_plan(self, revision: i64) -> Plan {
        Plan {
            revision,
            covered: self.covered.len() as u32,
            moved: self.moved.into_keys().collect(),
            shares: self.shares,
        }
    }
}

/// The contributions that are meant, as they stand now.
pub(super) async fn resolve(
    tx: &mut Tx,
    site: &str,
    level: &str,
    targets: &Targets,
) -> Result<Result<Found, RevertRefusal>, StoreError> {
    let lines = match targets {
        Targets::Contributions(ids) => match named(tx, site, level, ids).await? {
            Ok(lines) => lines,
            Err(refusal) => return Ok(Err(refusal)),
        },
        Targets::Span(span) => spanned(tx, site, level, span).await?,
    };
    if lines.len() > REVERT_MAX {
        return Ok(Err(RevertRefusal::TooMany(REVERT_MAX)));
    }
    Ok(Ok(Found::of(lines, |line| line.state == ContributionState::Folded)))
}

async fn named(
    tx: &mut Tx,
    site: &str,
    level: &str,
    ids: &[Uuid],
) -> Result<Result<Vec<Line>, RevertRefusal>, StoreError> {
    let texts: Vec<String> = ids.iter().map(Uuid::to_string).collect();
    let wanted: BTreeSet<&str> = texts.iter().map(String::as_str).collect();
    let wanted: Vec<&str> = wanted.into_iter().collect();
    let mut lines = Vec::with_capacity(wanted.len());
    for (statement, piece) in BY_ID.statements(&wanted) {
        let mut query = sqlx::query(statement).bind(site).bind(level);
        for id in piece {
            query = query.bind(*id);
        }
        for row in query.fetch_all(&mut **tx).await? {
            lines.push(line(&row)?);
        }
    }
    let states: BTreeMap<&str, ContributionState> =
        lines.iter().map(|line| (line.id.as_str(), line.state)).collect();
    let places = |is_wrong: &dyn Fn(Option<&ContributionState>) -> bool| -> Vec<usize> {
        let wrong = texts.iter().enumerate().filter(|(_, id)| is_wrong(states.get(id.as_str())));
        wrong.map(|(place, _)| place).collect()
    };
    let unknown = places(&|state| state.is_none());
    if !unknown.is_empty() {
        return Ok(Err(RevertRefusal::Unknown(unknown)));
    }
    let held = places(&|state| state == Some(&ContributionState::Held));
    if !held.is_empty() {
        return Ok(Err(RevertRefusal::Held(held)));
    }
    Ok(Ok(lines))
}

/// What a robot sent within a span, but for what is held; one more than may be, if there are.
async fn spanned(
    tx: &mut Tx,
    site: &str,
    level: &str,
    span: &Span,
) -> Result<Vec<Line>, StoreError> {
    let rows = sqlx::query(
        "select contribution, revision, robot, state from contributions \
         where site = $1 and level = $2 and robot = $3 and observed_at_us >= $4 \
         and observed_at_us < $5 and state <> 'held' order by revision limit $6",
    )
    .bind(site)
    .bind(level)
    .bind(span.robot.as_str())
    .bind(span.from_us.unwrap_or(i64::MIN))
    .bind(span.to_us.unwrap_or(i64::MAX))
    .bind(REVERT_MAX as i64 + 1)
    .fetch_all(&mut **tx)
    .await?;
    rows.iter().map(line).collect()
}

/// What a revert covers; what would move if it were undone is what no other revert that stands
/// covers too.
pub(super) async fn still_covered(
    tx: &mut Tx,
    site: &str,
    level: &str,
    revert: Uuid,
) -> Result<Found, StoreError> {
    let rows = sqlx::query(
        "select act, covered from acts where site = $1 and level = $2 and kind = 'revert' \
         and (undone_revision is null or act = $3)",
    )
    .bind(site)
    .bind(level)
    .bind(revert.to_string())
    .fetch_all(&mut **tx)
    .await?;
    let (mut own, mut others) = (Vec::new(), BTreeSet::new());
    for row in &rows {
        let act: String = get(row, TABLE, "act")?;
        let covered: Vec<u8> = get(row, TABLE, "covered")?;
        let covered = revision_list::decode(&covered).map_err(|e| corrupt(TABLE, &*act, e))?;
        if act == revert.to_string() {
            own = covered;
        } else {
            others.extend(covered);
        }
    }
    let mut lines = Vec::with_capacity(own.len());
    for (statement, piece) in BY_REVISION.statements(&own) {
        let mut query = sqlx::query(statement).bind(site).bind(level);
        for revision in piece {
            query = query.bind(*revision);
        }
        for row in query.fetch_all(&mut **tx).await? {
            lines.push(line(&row)?);
        }
    }
    Ok(Found::of(lines, |line| !others.contains(&line.revision)))
}

async fn head(tx: &mut Tx, site: &str, level: &str) -> Result<i64, StoreError> {
    let row = sqlx::query("select revision from levels where site = $1 and level = $2")
        .bind(site)
        .bind(level)
        .fetch_optional(&mut **tx)
        .await?;
    match row {
        Some(row) => get(&row, "levels", "revision"),
        None => Err(StoreError::Missing { kind: "level", name: level.to_owned() }),
    }
}

fn line(row: &AnyRow) -> Result<Line, StoreError> {
    const LOG: &str = "contributions";
    let state: String = get(row, LOG, "state")?;
    Ok(Line {
        id: get(row, LOG, "contribution")?,
        revision: get(row, LOG, "revision")?,
        robot: get(row, LOG, "robot")?,
        state: parse_state(&state)?,
    })
}
