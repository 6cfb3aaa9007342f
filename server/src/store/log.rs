//! Reading a level's log.

use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::v1;
use sqlx::any::AnyRow;
use uuid::Uuid;

use super::acts::{ActRow, first_act_after};
use super::gdb::first_gdb_entry_after;
use super::imports::first_import_after;
use super::pages::next_page;
use super::payload::{self, Payload};
use super::row::{corrupt, count, get};
use super::transaction::Tx;
use super::values::{Bulk, bulk_in};
use super::{Store, StoreError};

const TABLE: &str = "contributions";

/// Which lines of a log are asked for; what is absent does not matter.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct LogFilter {
    /// Only of this robot.
    pub robot: Option<String>,
    /// Only in this state.
    pub state: Option<v1::ContributionState>,
    /// Only after this revision.
    pub since: Option<i64>,
    /// Only from poses in this rectangle.
    pub bbox: Option<v1::Bounds>,
}

/// A row of the log as the fold reads it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogRow {
    /// Its place in the log.
    pub revision: i64,
    /// What has become of it.
    pub state: v1::ContributionState,
    /// When it came, microseconds since 1970, the server's clock.
    pub received_at_us: i64,
    /// SHA-256 of its canonical CBOR, lower-case hexadecimal.
    pub digest: String,
    /// What was uploaded.
    pub payload: Payload,
}

/// A row of the log as opening a level reads it: without its evidence.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FeaturesRow {
    /// Its place in the log.
    pub revision: i64,
    /// What has become of it.
    pub state: v1::ContributionState,
    /// When it came, microseconds since 1970, the server's clock.
    pub received_at_us: i64,
    /// CBOR of the contribution without its evidence.
    pub features: Vec<u8>,
}

/// The next entries of a log: contributions, and the act, import or entry about the GDB that follows them, if one
/// does.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LogStretch {
    /// Contributions, oldest first.
    pub contributions: Vec<LogRow>,
    /// The act after them; `None` if they are not all that comes before one.
    pub act: Option<ActRow>,
    /// Revision of the import after them, likewise; there is never an act too.
    pub import: Option<i64>,
    /// Revision of the entry about the GDB after them, likewise.
    pub gdb: Option<i64>,
}

impl LogStretch {
    /// Revision of its last entry; `None` if the log has ended.
    pub fn end(&self) -> Option<i64> {
        let last = self.contributions.last().map(|row| row.revision);
        self.act.as_ref().map(|act| act.revision).or(self.import).or(self.gdb).or(last)
    }
}

static ROWS: Bulk = bulk_in!(
    "select revision, state, received_at_us, digest, features, evidence from contributions \
     where site = $1 and level = $2 and revision in ",
    from 3,
    ""
);

/// The columns that make a [`v1::ContributionEntry`].
macro_rules! entry_columns {
    () => {
        "contribution, revision, robot, observed_at_us, received_at_us, emulated, segment_count, \
         cluster_count, tile_count, x_m, y_m, heading_rad, frame, state"
    };
}

/// The conditions of a page, but for the robot's.
macro_rules! page_conditions {
    () => {
        " from contributions where site = $1 and level = $2 and revision < $3 and revision > $4 \
         and ($6 is null or state = $6) and x_m >= $7 and y_m >= $8 and x_m <= $9 and y_m <= $10"
    };
}

impl Store {
    /// A page of a level's log, newest first: at most `limit` lines that pass the filter, older
    /// than revision `before` if there is one. The answer's `next` is the `before` of the next page.
    ///
    /// # Errors
    /// The store fails.
    pub async fn log_page(
        &self,
        site: &str,
        level: &str,
        filter: &LogFilter,
        before: Option<i64>,
        limit: u32,
    ) -> Result<v1::ContributionPage, StoreError> {
        // Two texts, so that the engine takes the index of the robot where there is one.
        let text = if filter.robot.is_some() {
            concat!(
                "select ",
                entry_columns!(),
                page_conditions!(),
                " and robot = $5 order by revision desc limit $11"
            )
        } else {
            concat!(
                "select ",
                entry_columns!(),
                page_conditions!(),
                " and $5 is null order by revision desc limit $11"
            )
        };
        let everywhere = v1::Bounds {
            min_x_m: f64::NEG_INFINITY,
            min_y_m: f64::NEG_INFINITY,
            max_x_m: f64::INFINITY,
            max_y_m: f64::INFINITY,
        };
        let bbox = filter.bbox.unwrap_or(everywhere);
        let rows = sqlx::query(text)
            .bind(site)
            .bind(level)
            .bind(before.unwrap_or(i64::MAX))
            .bind(filter.since.unwrap_or(0))
            .bind(filter.robot.as_deref())
            .bind(filter.state.map(state_text))
            .bind(bbox.min_x_m)
            .bind(bbox.min_y_m)
            .bind(bbox.max_x_m)
            .bind(bbox.max_y_m)
            .bind(i64::from(limit) + 1)
            .fetch_all(self.reads())
            .await?;
        let mut contributions = rows.iter().map(entry).collect::<Result<Vec<_>, _>>()?;
        let next = next_page(&mut contributions, limit, |last| last.revision);
        Ok(v1::ContributionPage { contributions, next })
    }

    /// One contribution of a level's log, whole.
    ///
    /// # Errors
    /// The store fails, or the row is spoilt.
    pub async fn contribution(
        &self,
        site: &str,
        level: &str,
        id: Uuid,
    ) -> Result<Option<v1::ContributionRecord>, StoreError> {
        let row = sqlx::query(concat!(
            "select ",
            entry_columns!(),
            ", digest, features, evidence from contributions \
             where site = $1 and level = $2 and contribution = $3"
        ))
        .bind(site)
        .bind(level)
        .bind(id.to_string())
        .fetch_optional(self.reads())
        .await?;
        let Some(row) = row else { return Ok(None) };
        let LogRow { digest, payload, .. } = log_row(&row)?;
        let contribution = payload::join(&payload.features, &payload.evidence)
            .map_err(|e| corrupt(TABLE, id.to_string(), e))?;
        Ok(Some(v1::ContributionRecord { entry: entry(&row)?, digest, contribution }))
    }

    /// The next entries of a level's log after revision `after`: at most `limit` contributions, and
    /// the act, import or entry about the GDB that follows them, all of one moment.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn stretch_after(
        &self,
        site: &str,
        level: &str,
        after: i64,
        limit: u32,
    ) -> Result<LogStretch, StoreError> {
        let mut tx = self.begin_read().await?;
        let act = first_act_after(&mut tx, site, level, after).await?;
        let import = first_import_after(&mut tx, site, level, after).await?;
        let act_revision = act.as_ref().map_or(i64::MAX, |act| act.revision);
        let gdb = first_gdb_entry_after(&mut tx, site, level, after).await?;
        let until = act_revision.min(import.unwrap_or(i64::MAX)).min(gdb.unwrap_or(i64::MAX));
        let contributions = log_rows_between(&mut tx, site, level, after, until, limit).await?;
        tx.rollback().await?;
        let reached = |revision| contributions.len() < limit as usize && revision == until;
        let act = act.filter(|act| reached(act.revision));
        let import = import.filter(|import| reached(*import));
        let gdb = gdb.filter(|entry| reached(*entry));
        Ok(LogStretch { contributions, act, import, gdb })
    }

    /// The rows of these revisions, in no order; one that is not there is left out.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn log_rows(
        &self,
        site: &str,
        level: &str,
        revisions: &[i64],
    ) -> Result<Vec<LogRow>, StoreError> {
        let mut rows = Vec::with_capacity(revisions.len());
        for (statement, piece) in ROWS.statements(revisions) {
            let mut query = sqlx::query(statement).bind(site).bind(level);
            for revision in piece {
                query = query.bind(*revision);
            }
            for row in query.fetch_all(self.reads()).await? {
                rows.push(log_row(&row)?);
            }
        }
        Ok(rows)
    }

    /// The next contributions of a level's log after revision `after`, oldest first, at most
    /// `limit`.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn log_after(
        &self,
        site: &str,
        level: &str,
        after: i64,
        limit: u32,
    ) -> Result<Vec<LogRow>, StoreError> {
        let mut tx = self.begin_read().await?;
        let rows = log_rows_between(&mut tx, site, level, after, i64::MAX, limit).await?;
        tx.rollback().await?;
        Ok(rows)
    }

    /// The next rows of a level's log after revision `after` and up to revision `until`, oldest
    /// first, at most `limit`, without their evidence.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn features_after(
        &self,
        site: &str,
        level: &str,
        after: i64,
        until: i64,
        limit: u32,
    ) -> Result<Vec<FeaturesRow>, StoreError> {
        let rows = sqlx::query(
            "select revision, state, received_at_us, features from contributions \
             where site = $1 and level = $2 and revision > $3 and revision <= $4 order by revision limit $5",
        )
        .bind(site)
        .bind(level)
        .bind(after)
        .bind(until)
        .bind(i64::from(limit))
        .fetch_all(self.reads())
        .await?;
        rows.iter()
            .map(|row| {
                Ok(FeaturesRow {
                    revision: get(row, TABLE, "revision")?,
                    state: state(row)?,
                    received_at_us: get(row, TABLE, "received_at_us")?,
                    features: get(row, TABLE, "features")?,
                })
            })
            .collect()
    }
}

/// Rows after revision `after` and before revision `until`, oldest first, at most `limit`.
async fn log_rows_between(
    tx: &mut Tx,
    site: &str,
    level: &str,
    after: i64,
    until: i64,
    limit: u32,
) -> Result<Vec<LogRow>, StoreError> {
    let rows = sqlx::query(
        "select revision, state, received_at_us, digest, features, evidence from contributions \
         where site = $1 and level = $2 and revision > $3 and revision < $4 \
         order by revision limit $5",
    )
    .bind(site)
    .bind(level)
    .bind(after)
    .bind(until)
    .bind(i64::from(limit))
    .fetch_all(&mut **tx)
    .await?;
    rows.iter().map(log_row).collect()
}

pub(super) fn state_text(state: v1::ContributionState) -> &'static str {
    match state {
        v1::ContributionState::Folded => "folded",
        v1::ContributionState::Held => "held",
        v1::ContributionState::Reverted => "reverted",
    }
}

pub(super) fn parse_state(text: &str) -> Result<v1::ContributionState, StoreError> {
    match text {
        "folded" => Ok(v1::ContributionState::Folded),
        "held" => Ok(v1::ContributionState::Held),
        "reverted" => Ok(v1::ContributionState::Reverted),
        _ => Err(corrupt(TABLE, "state", format!("{text:?} is no state of a contribution"))),
    }
}

fn state(row: &AnyRow) -> Result<v1::ContributionState, StoreError> {
    let text: String = get(row, TABLE, "state")?;
    parse_state(&text)
}

fn log_row(row: &AnyRow) -> Result<LogRow, StoreError> {
    Ok(LogRow {
        revision: get(row, TABLE, "revision")?,
        state: state(row)?,
        received_at_us: get(row, TABLE, "received_at_us")?,
        digest: get(row, TABLE, "digest")?,
        payload: Payload {
            features: get(row, TABLE, "features")?,
            evidence: get(row, TABLE, "evidence")?,
        },
    })
}

fn entry(row: &AnyRow) -> Result<v1::ContributionEntry, StoreError> {
    let id: String = get(row, TABLE, "contribution")?;
    let emulated: i64 = get(row, TABLE, "emulated")?;
    let frame: Option<String> = get(row, TABLE, "frame")?;
    Ok(v1::ContributionEntry {
        id: id.parse().map_err(|e| corrupt(TABLE, id, e))?,
        revision: get(row, TABLE, "revision")?,
        robot: get(row, TABLE, "robot")?,
        observed_at: to_rfc3339(get(row, TABLE, "observed_at_us")?),
        received_at: to_rfc3339(get(row, TABLE, "received_at_us")?),
        emulated: emulated != 0,
        segments: count(row, TABLE, "segment_count")?,
        clusters: count(row, TABLE, "cluster_count")?,
        tiles: count(row, TABLE, "tile_count")?,
        pose: [get(row, TABLE, "x_m")?, get(row, TABLE, "y_m")?, get(row, TABLE, "heading_rad")?],
        frame: frame
            .map(|frame| frame.parse().map_err(|e| corrupt(TABLE, &*frame, e)))
            .transpose()?,
        state: state(row)?,
    })
}
