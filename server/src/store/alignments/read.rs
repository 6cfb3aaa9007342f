//! Reading alignments: for people, for the fold, and what waits for one.

use std::collections::BTreeMap;

use mapfold_map::geometry::{Covariance, Pose, UncertainPose};
use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::v1;
use sqlx::any::AnyRow;
use uuid::Uuid;

use super::{Frames, HeldFrame, TABLE};
use crate::store::acts::{ActKind, ActRow};
use crate::store::revision_list;
use crate::store::row::{corrupt, count, get};
use crate::store::transaction::Tx;
use crate::store::{Store, StoreError, robots};

/// The columns that make an alignment.
macro_rules! columns {
    () => {
        "revision, frame, x_m, y_m, heading_rad, covariance, author, at_us, comment, moved_count, \
         withdrawn_revision"
    };
}

impl Store {
    /// Frames of which contributions are held on a level, by frame.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn held_frames(&self, site: &str, level: &str) -> Result<Vec<HeldFrame>, StoreError> {
        let rows = sqlx::query(
            "select c.frame, c.robot, c.revision, r.state from contributions c \
             join robots r on r.site = c.site and r.robot = c.robot \
             where c.site = $1 and c.level = $2 and c.frame is not null and c.state = 'held' \
             order by c.frame, c.revision",
        )
        .bind(site)
        .bind(level)
        .fetch_all(self.reads())
        .await?;
        let mut frames: BTreeMap<Uuid, HeldFrame> = BTreeMap::new();
        for row in &rows {
            let frame = uuid(row, "contributions")?;
            let robot: String = get(row, "contributions", "robot")?;
            let held = frames.entry(frame).or_insert_with(|| HeldFrame {
                frame,
                robots: Vec::new(),
                is_quarantined: false,
                revisions: Vec::new(),
            });
            held.is_quarantined |= robots::state(row)? == v1::RobotState::Held;
            held.revisions.push(get(row, "contributions", "revision")?);
            if let Err(place) = held.robots.binary_search(&robot) {
                held.robots.insert(place, robot);
            }
        }
        Ok(frames.into_values().collect())
    }

    /// Alignments of a level, newest first, at most `limit`.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn alignments(
        &self,
        site: &str,
        level: &str,
        limit: u32,
    ) -> Result<Vec<v1::Alignment>, StoreError> {
        let rows = sqlx::query(concat!(
            "select ",
            columns!(),
            " from alignments where site = $1 and level = $2 \
             and kind = 'align' order by revision desc limit $3"
        ))
        .bind(site)
        .bind(level)
        .bind(i64::from(limit))
        .fetch_all(self.reads())
        .await?;
        rows.iter().map(describe).collect()
    }

    /// Where frames lay when the entry of the log at `revision` was made, or taken back by it.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn frames_at(
        &self,
        site: &str,
        level: &str,
        revision: i64,
    ) -> Result<Frames, StoreError> {
        let rows = sqlx::query(concat!(
            "select ",
            columns!(),
            " from alignments where site = $1 and level = $2 \
             and kind = 'align' and revision <= $3 \
             and (withdrawn_revision is null or withdrawn_revision >= $3)"
        ))
        .bind(site)
        .bind(level)
        .bind(revision)
        .fetch_all(self.reads())
        .await?;
        let mut frames = Frames::new();
        for row in &rows {
            let alignment = describe(row)?;
            let v1::UncertainPose { x_m, y_m, heading_rad, covariance } = alignment.pose;
            let covariance = Covariance::from_rows(covariance)
                .map_err(|e| corrupt(TABLE, format!("revision {}", alignment.revision), e))?;
            let pose = Pose::new(x_m, y_m, heading_rad);
            frames.insert(alignment.frame, UncertainPose { pose, covariance });
        }
        Ok(frames)
    }
}

/// The alignment of a frame that stands; the first, if others have followed it.
pub(super) async fn standing(
    tx: &mut Tx,
    site: &str,
    level: &str,
    frame: Uuid,
) -> Result<Option<v1::Alignment>, StoreError> {
    sqlx::query(concat!(
        "select ",
        columns!(),
        " from alignments where site = $1 and level = $2 \
             and frame = $3 and kind = 'align' and withdrawn_revision is null \
         order by revision limit 1"
    ))
    .bind(site)
    .bind(level)
    .bind(frame.to_string())
    .fetch_optional(&mut **tx)
    .await?
    .map(|row| describe(&row))
    .transpose()
}

/// The first alignment or withdrawal after revision `after`.
pub(in crate::store) async fn first_after(
    tx: &mut Tx,
    site: &str,
    level: &str,
    after: i64,
) -> Result<Option<ActRow>, StoreError> {
    sqlx::query(
        "select revision, kind, moved from alignments where site = $1 and level = $2 \
         and revision > $3 order by revision limit 1",
    )
    .bind(site)
    .bind(level)
    .bind(after)
    .fetch_optional(&mut **tx)
    .await?
    .map(|row| act(&row))
    .transpose()
}

/// All alignments and withdrawals after revision `after` and up to revision `until`, in the order of the log.
pub(in crate::store) async fn acts_between(
    store: &Store,
    site: &str,
    level: &str,
    after: i64,
    until: i64,
) -> Result<Vec<ActRow>, StoreError> {
    let rows = sqlx::query(
        "select revision, kind, moved from alignments where site = $1 and level = $2 \
         and revision > $3 and revision <= $4 order by revision",
    )
    .bind(site)
    .bind(level)
    .bind(after)
    .bind(until)
    .fetch_all(store.reads())
    .await?;
    rows.iter().map(act).collect()
}

fn act(row: &AnyRow) -> Result<ActRow, StoreError> {
    let revision: i64 = get(row, TABLE, "revision")?;
    let kind: String = get(row, TABLE, "kind")?;
    let moved: Vec<u8> = get(row, TABLE, "moved")?;
    let moved = revision_list::decode(&moved)
        .map_err(|e| corrupt(TABLE, format!("revision {revision}, moved"), e))?;
    Ok(ActRow {
        revision,
        kind: match kind.as_str() {
            "align" => ActKind::Align,
            "withdraw" => ActKind::Withdraw,
            _ => return Err(corrupt(TABLE, "kind", format!("{kind:?} is no kind of entry"))),
        },
        covered: moved.clone(),
        moved,
    })
}

fn uuid(row: &AnyRow, table: &'static str) -> Result<Uuid, StoreError> {
    let frame: String = get(row, table, "frame")?;
    frame.parse().map_err(|e| corrupt(table, &*frame, e))
}

fn describe(row: &AnyRow) -> Result<v1::Alignment, StoreError> {
    let covariance: String = get(row, TABLE, "covariance")?;
    Ok(v1::Alignment {
        revision: get(row, TABLE, "revision")?,
        frame: uuid(row, TABLE)?,
        pose: v1::UncertainPose {
            x_m: get(row, TABLE, "x_m")?,
            y_m: get(row, TABLE, "y_m")?,
            heading_rad: get(row, TABLE, "heading_rad")?,
            covariance: serde_json::from_str(&covariance)
                .map_err(|e| corrupt(TABLE, "covariance", e))?,
        },
        at: to_rfc3339(get(row, TABLE, "at_us")?),
        author: get(row, TABLE, "author")?,
        comment: get(row, TABLE, "comment")?,
        contributions: count(row, TABLE, "moved_count")?,
        withdrawn: get(row, TABLE, "withdrawn_revision")?,
    })
}
