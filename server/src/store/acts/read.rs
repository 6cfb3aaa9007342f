//! Reading acts: for people, and for the fold.

use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::v1;
use sqlx::any::AnyRow;
use uuid::Uuid;

use super::{ActRow, TABLE, parse_kind};
use crate::store::alignments;
use crate::store::revision_list;
use crate::store::row::{corrupt, count, get};
use crate::store::transaction::Tx;
use crate::store::values::{Bulk, bulk_in};
use crate::store::{Store, StoreError};

/// Reverts, each with the restore that undid it.
macro_rules! reverts {
    ($conditions:literal) => {
        concat!(
            "select a.act, a.revision, a.at_us, a.author, a.reason, a.robot, a.from_us, a.to_us, \
             a.robots, a.covered_count, a.moved_count, a.undone_revision, u.at_us as undone_at_us, \
             u.author as undone_author, u.moved_count as undone_count from acts a \
             left join acts u on u.site = a.site and u.level = a.level \
             and u.revision = a.undone_revision \
             where a.site = $1 and a.level = $2 and a.kind = 'revert' ",
            $conditions
        )
    };
}

static IDS: Bulk = bulk_in!(
    "select revision, contribution from contributions where site = $1 and level = $2 \
     and revision in ",
    from 3,
    ""
);

impl Store {
    /// A page of a level's reverts, newest first: at most `limit`, older than revision `before` if
    /// there is one. The answer's `next` is the `before` of the next page.
    ///
    /// # Errors
    /// The store fails.
    pub async fn revert_page(
        &self,
        site: &str,
        level: &str,
        before: Option<i64>,
        limit: u32,
    ) -> Result<v1::RevertPage, StoreError> {
        let select = reverts!("and a.revision < $3 order by a.revision desc limit $4");
        let (reverts, next) =
            self.page(select, (site, level), before, limit, describe, |last| last.revision).await?;
        Ok(v1::RevertPage { reverts, next })
    }

    /// One revert, and the contributions that it covers.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn revert_record(
        &self,
        site: &str,
        level: &str,
        id: Uuid,
    ) -> Result<Option<v1::RevertRecord>, StoreError> {
        let mut tx = self.begin_read().await?;
        let Some(revert) = revert(&mut tx, site, level, id).await? else {
            tx.rollback().await?;
            return Ok(None);
        };
        let row = sqlx::query(
            "select revision, kind, covered, moved from acts \
             where site = $1 and level = $2 and revision = $3",
        )
        .bind(site)
        .bind(level)
        .bind(revert.revision)
        .fetch_one(&mut *tx)
        .await?;
        let mut ids: Vec<(i64, Uuid)> = Vec::new();
        for (statement, piece) in IDS.statements(&act(&row)?.covered) {
            let mut query = sqlx::query(statement).bind(site).bind(level);
            for revision in piece {
                query = query.bind(*revision);
            }
            for row in query.fetch_all(&mut *tx).await? {
                let id: String = get(&row, "contributions", "contribution")?;
                let uuid = id.parse().map_err(|e| corrupt("contributions", id, e))?;
                ids.push((get(&row, "contributions", "revision")?, uuid));
            }
        }
        tx.rollback().await?;
        ids.sort_unstable();
        let contributions = ids.into_iter().map(|(_, id)| id).collect();
        Ok(Some(v1::RevertRecord { revert, contributions }))
    }

    /// All acts and alignments after revision `after` and up to revision `until`, in the order of the log.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn acts_between(
        &self,
        site: &str,
        level: &str,
        after: i64,
        until: i64,
    ) -> Result<Vec<ActRow>, StoreError> {
        let rows = sqlx::query(
            "select revision, kind, covered, moved from acts where site = $1 and level = $2 \
             and revision > $3 and revision <= $4 order by revision",
        )
        .bind(site)
        .bind(level)
        .bind(after)
        .bind(until)
        .fetch_all(self.reads())
        .await?;
        let mut acts = rows.iter().map(act).collect::<Result<Vec<_>, _>>()?;
        acts.extend(alignments::acts_between(self, site, level, after, until).await?);
        acts.sort_by_key(|act| act.revision);
        Ok(acts)
    }
}

/// The first act or alignment after revision `after`.
pub(in crate::store) async fn first_after(
    tx: &mut Tx,
    site: &str,
    level: &str,
    after: i64,
) -> Result<Option<ActRow>, StoreError> {
    let act = sqlx::query(
        "select revision, kind, covered, moved from acts where site = $1 and level = $2 \
         and revision > $3 order by revision limit 1",
    )
    .bind(site)
    .bind(level)
    .bind(after)
    .fetch_optional(&mut **tx)
    .await?
    .map(|row| act(&row))
    .transpose()?;
    let alignment = alignments::first_after(tx, site, level, after).await?;
    Ok(act.into_iter().chain(alignment).min_by_key(|act| act.revision))
}

/// One revert.
pub(super) async fn revert(
    tx: &mut Tx,
    site: &str,
    level: &str,
    id: Uuid,
) -> Result<Option<v1::Revert>, StoreError> {
    sqlx::query(reverts!("and a.act = $3"))
        .bind(site)
        .bind(level)
        .bind(id.to_string())
        .fetch_optional(&mut **tx)
        .await?
        .map(|row| describe(&row))
        .transpose()
}

fn act(row: &AnyRow) -> Result<ActRow, StoreError> {
    let revision: i64 = get(row, TABLE, "revision")?;
    let list = |column| {
        let bytes: Vec<u8> = get(row, TABLE, column)?;
        revision_list::decode(&bytes)
            .map_err(|e| corrupt(TABLE, format!("revision {revision}, {column}"), e))
    };
    let kind: String = get(row, TABLE, "kind")?;
    Ok(ActRow {
        revision,
        kind: parse_kind(&kind)?,
        covered: list("covered")?,
        moved: list("moved")?,
    })
}

fn describe(row: &AnyRow) -> Result<v1::Revert, StoreError> {
    let id: String = get(row, TABLE, "act")?;
    let robots: String = get(row, TABLE, "robots")?;
    let instant = |column| -> Result<Option<String>, StoreError> {
        let us: Option<i64> = get(row, TABLE, column)?;
        Ok(us.map(to_rfc3339))
    };
    let undone_revision: Option<i64> = get(row, TABLE, "undone_revision")?;
    let undone = match undone_revision {
        Some(revision) => Some(v1::Undone {
            revision,
            at: to_rfc3339(get(row, TABLE, "undone_at_us")?),
            author: get(row, TABLE, "undone_author")?,
            put_back: count(row, TABLE, "undone_count")?,
        }),
        None => None,
    };
    Ok(v1::Revert {
        id: id.parse().map_err(|e| corrupt(TABLE, &*id, e))?,
        revision: get(row, TABLE, "revision")?,
        at: to_rfc3339(get(row, TABLE, "at_us")?),
        author: get(row, TABLE, "author")?,
        reason: get(row, TABLE, "reason")?,
        robot: get(row, TABLE, "robot")?,
        from: instant("from_us")?,
        to: instant("to_us")?,
        contributions: count(row, TABLE, "covered_count")?,
        taken_out: count(row, TABLE, "moved_count")?,
        robots: serde_json::from_str(&robots).map_err(|e| corrupt(TABLE, "robots", e))?,
        undone,
    })
}
