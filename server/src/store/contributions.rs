//! The append to a level's log: the one path to an acknowledgement.
//!
//! One short transaction for a whole batch: it takes the lock of the level's row and the next
//! revisions from it (never from a sequence: readers would miss rows that commit late), notes the
//! robots' poses, and adds the rows. It reads nothing of the log; that an id is there already
//! shows as a row that was not added, and only then is the log asked.

use std::collections::{BTreeMap, BTreeSet};

use mapfold_schema::v1::{ContributionState, RobotState};
use sqlx::any::AnyRow;
use uuid::Uuid;

use super::log::{parse_state, state_text};
use super::payload::Payload;
use super::row::{corrupt, get};
use super::transaction::Tx;
use super::values::{Bulk, bulk, with_values};
use super::{Store, StoreError, retried, robots};

const TABLE: &str = "contributions";

/// Contributions in one batch.
pub const BATCH_MAX: usize = 64;

/// A contribution, ready for its row.
#[derive(Debug, Clone, PartialEq)]
pub struct NewContribution {
    /// Who it is.
    pub id: Uuid,
    /// SHA-256 of its canonical CBOR, lower-case hexadecimal.
    pub digest: String,
    /// Who sends it.
    pub robot: String,
    /// When it was seen, microseconds since 1970, the robot's clock.
    pub observed_at_us: i64,
    /// When it came, microseconds since 1970, the server's clock.
    pub received_at_us: i64,
    /// Whether its readings were emulated.
    pub emulated: bool,
    /// Number of segments in it.
    pub segment_count: u32,
    /// Number of clusters in it.
    pub cluster_count: u32,
    /// Number of tiles in it, of all layers.
    pub tile_count: u32,
    /// The robot's own frame that it is in; none if that is the level's. It is held then.
    pub frame: Option<Uuid>,
    /// `level_from_robot`, or the robot's pose in its own frame: x, y (metres), heading (radians).
    pub pose: [f64; 3],
    /// Covariance of the pose.
    pub pose_covariance: [[f64; 3]; 3],
    /// What was uploaded.
    pub payload: Payload,
}

/// What stands in the log under a contribution's id.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// Its place in the log.
    pub revision: i64,
    /// When the server took it, microseconds since 1970.
    pub received_at_us: i64,
    /// What has become of it.
    pub state: ContributionState,
}

/// What the append did with one contribution.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Appended {
    /// It is in the log now.
    New(Place),
    /// It was there before, with the same content.
    Known(Place),
    /// Its id is there, with other content, at this revision. Nothing was changed.
    Conflict(i64),
    /// Its robot is not enrolled on the site. Nothing was changed.
    UnknownRobot,
}

/// What one attempt at the transaction came to.
enum Attempt {
    Committed(Vec<Place>),
    /// These robots are not enrolled; rolled back.
    UnknownRobots(BTreeSet<String>),
    /// Some id is in the log already; rolled back.
    Collided,
}

static INSERT: Bulk = bulk!(
    "insert into contributions (site, level, revision, contribution, digest, robot, state, \
     observed_at_us, received_at_us, emulated, segment_count, cluster_count, tile_count, x_m, y_m, \
     heading_rad, frame, features, evidence) values ",
    19,
    from 1,
    " on conflict (site, level, contribution) do nothing"
);

static UPDATE_ROBOTS: Bulk = bulk!(
    "update robots set \
     contributions = robots.contributions + news.column2, \
     last_level = case when last_observed_at_us >= news.column3 then last_level else $2 end, \
     last_x_m = case when last_observed_at_us >= news.column3 then last_x_m else news.column4 end, \
     last_y_m = case when last_observed_at_us >= news.column3 then last_y_m else news.column5 end, \
     last_heading_rad = case when last_observed_at_us >= news.column3 then last_heading_rad \
     else news.column6 end, \
     last_covariance = case when last_observed_at_us >= news.column3 then last_covariance \
     else news.column7 end, \
     last_observed_at_us = case when last_observed_at_us >= news.column3 then last_observed_at_us \
     else news.column3 end \
     from (values ",
    7,
    from 3,
    ") as news where site = $1 and robot = news.column1 returning robot, state"
);

static KNOWN: &str = with_values!(
    "select contribution, revision, digest, received_at_us, state from contributions \
     where site = $1 and level = $2 and contribution in ",
    1,
    BATCH_MAX,
    from 3,
    ""
);

impl Store {
    /// Appends up to [`BATCH_MAX`] contributions to a level's log and answers for each, in their
    /// order. When it returns, what is new is on disk. An id that is in the log (or twice in the
    /// batch) is appended once: with the same content it is known, with other content refused;
    /// neither that nor an unknown robot disturbs the others.
    ///
    /// # Errors
    /// [`StoreError::Missing`] for a level that is not there; otherwise nothing is appended,
    /// except that [`StoreError::Unavailable`] leaves it open: asking again tells.
    pub async fn append(
        &self,
        site: &str,
        level: &str,
        batch: &[NewContribution],
    ) -> Result<Vec<Appended>, StoreError> {
        let mut answers: BTreeMap<usize, Appended> = BTreeMap::new();
        let mut standing: BTreeMap<Uuid, Standing> = BTreeMap::new();
        let mut pending: Vec<usize> = (0..batch.len()).collect();
        // Each turn answers one at least, or learns of one that stands in the log.
        loop {
            pending.retain(|i| match standing.get(&batch[*i].id) {
                Some(standing) => {
                    answers.insert(*i, standing.answer(&batch[*i].digest));
                    false
                }
                None => true,
            });
            let mut ids: BTreeSet<Uuid> = BTreeSet::new();
            let fresh: Vec<usize> =
                pending.iter().copied().filter(|i| ids.insert(batch[*i].id)).collect();
            if fresh.is_empty() {
                return Ok(answers.into_values().collect());
            }
            let rows: Vec<&NewContribution> = fresh.iter().map(|i| &batch[*i]).collect();
            match retried("append", || self.try_append(site, level, &rows)).await? {
                Attempt::Committed(places) => {
                    for (i, place) in fresh.into_iter().zip(places) {
                        answers.insert(i, Appended::New(place));
                        let NewContribution { id, digest, .. } = &batch[i];
                        standing.insert(*id, Standing { place, digest: digest.clone() });
                    }
                    pending.retain(|i| !answers.contains_key(i));
                }
                Attempt::UnknownRobots(unknown) => pending.retain(|i| {
                    let known = !unknown.contains(&batch[*i].robot);
                    if !known {
                        answers.insert(*i, Appended::UnknownRobot);
                    }
                    known
                }),
                Attempt::Collided => {
                    let known = self.known(site, level, &rows).await?;
                    if known.is_empty() {
                        return Err(corrupt(TABLE, level, "what is not there was in the way"));
                    }
                    standing.extend(known);
                }
            }
        }
    }

    async fn try_append(
        &self,
        site: &str,
        level: &str,
        rows: &[&NewContribution],
    ) -> Result<Attempt, StoreError> {
        let mut tx = self.begin_write().await?;
        let head = sqlx::query(
            "update levels set revision = revision + $3 where site = $1 and level = $2 \
             returning revision",
        )
        .bind(site)
        .bind(level)
        .bind(rows.len() as i64)
        .fetch_optional(&mut *tx)
        .await?;
        let Some(head) = head else {
            return Err(StoreError::Missing { kind: "level", name: level.to_owned() });
        };
        let head: i64 = get(&head, "levels", "revision")?;

        let mut states: BTreeMap<String, RobotState> = BTreeMap::new();
        let Shares { placed, lost } = robot_shares(rows);
        count_lost(&mut tx, site, &lost, &mut states).await?;
        for (statement, piece) in UPDATE_ROBOTS.statements(&placed) {
            let mut query = sqlx::query(statement).bind(site).bind(level);
            for (newest, count) in piece {
                let covariance = serde_json::to_string(&newest.pose_covariance)
                    .map_err(|e| corrupt(TABLE, "pose covariance", e))?;
                let [x, y, heading] = newest.pose;
                query = query
                    .bind(newest.robot.as_str())
                    .bind(*count)
                    .bind(newest.observed_at_us)
                    .bind(x)
                    .bind(y)
                    .bind(heading)
                    .bind(covariance);
            }
            for row in query.fetch_all(&mut *tx).await? {
                states.insert(get(&row, "robots", "robot")?, robots::state(&row)?);
            }
        }
        if states.len() < placed.len() + lost.len() {
            tx.rollback().await?;
            let robots = rows.iter().map(|row| row.robot.clone());
            return Ok(Attempt::UnknownRobots(
                robots.filter(|robot| !states.contains_key(robot)).collect(),
            ));
        }

        let places: Vec<Place> = (head - rows.len() as i64 + 1..)
            .zip(rows)
            .map(|(revision, row)| Place {
                revision,
                received_at_us: row.received_at_us,
                state: match states.get(&row.robot) {
                    Some(RobotState::Active) if row.frame.is_none() => ContributionState::Folded,
                    Some(RobotState::Active | RobotState::Held) | None => ContributionState::Held,
                },
            })
            .collect();
        let placed: Vec<(&NewContribution, Place)> =
            rows.iter().copied().zip(places.iter().copied()).collect();
        let mut added = 0;
        for (statement, piece) in INSERT.statements(&placed) {
            let mut query = sqlx::query(statement);
            for (row, place) in piece {
                let [x, y, heading] = row.pose;
                query = query
                    .bind(site)
                    .bind(level)
                    .bind(place.revision)
                    .bind(row.id.to_string())
                    .bind(row.digest.as_str())
                    .bind(row.robot.as_str())
                    .bind(state_text(place.state))
                    .bind(row.observed_at_us)
                    .bind(row.received_at_us)
                    .bind(i64::from(row.emulated))
                    .bind(i64::from(row.segment_count))
                    .bind(i64::from(row.cluster_count))
                    .bind(i64::from(row.tile_count))
                    .bind(x)
                    .bind(y)
                    .bind(heading)
                    .bind(row.frame.map(|frame| frame.to_string()))
                    .bind(row.payload.features.as_slice())
                    .bind(row.payload.evidence.as_slice());
            }
            added += query.execute(&mut *tx).await?.rows_affected();
        }
        if added < rows.len() as u64 {
            tx.rollback().await?;
            return Ok(Attempt::Collided);
        }
        tx.commit().await?;
        Ok(Attempt::Committed(places))
    }

    /// Which of `rows` stand in the log, by id.
    async fn known(
        &self,
        site: &str,
        level: &str,
        rows: &[&NewContribution],
    ) -> Result<BTreeMap<Uuid, Standing>, StoreError> {
        let mut known = BTreeMap::new();
        for piece in rows.chunks(BATCH_MAX) {
            let mut query = sqlx::query(KNOWN).bind(site).bind(level);
            // The list has a fixed length: the last id fills it up.
            for i in 0..BATCH_MAX {
                query = query.bind(piece[i.min(piece.len() - 1)].id.to_string());
            }
            for row in query.fetch_all(self.reads()).await? {
                let id: String = get(&row, TABLE, "contribution")?;
                let id = id.parse().map_err(|e| corrupt(TABLE, id, e))?;
                known.insert(id, Standing::try_from(&row)?);
            }
        }
        Ok(known)
    }
}

/// Whose a batch is. By name, so that transactions of several levels lock robots in one order.
struct Shares<'r> {
    /// For each robot the newest of its contributions on the level, and how many there are in all.
    placed: Vec<(&'r NewContribution, i64)>,
    /// Robots of which all are in frames of their own, and how many.
    lost: Vec<(&'r str, i64)>,
}

fn robot_shares<'r>(rows: &[&'r NewContribution]) -> Shares<'r> {
    let mut all: BTreeMap<&str, (Option<&NewContribution>, i64)> = BTreeMap::new();
    for row in rows {
        let (newest, count) = all.entry(row.robot.as_str()).or_default();
        *count += 1;
        let is_newer = newest.is_none_or(|newest| row.observed_at_us > newest.observed_at_us);
        if row.frame.is_none() && is_newer {
            *newest = Some(row);
        }
    }
    let mut shares = Shares { placed: Vec::new(), lost: Vec::new() };
    for (robot, (newest, count)) in all {
        match newest {
            Some(newest) => shares.placed.push((newest, count)),
            None => shares.lost.push((robot, count)),
        }
    }
    shares
}

/// Counts contributions of robots that do not know where they are: nothing is noted of their poses.
async fn count_lost(
    tx: &mut Tx,
    site: &str,
    lost: &[(&str, i64)],
    states: &mut BTreeMap<String, RobotState>,
) -> Result<(), StoreError> {
    for (robot, count) in lost {
        let row = sqlx::query(
            "update robots set contributions = contributions + $3 \
             where site = $1 and robot = $2 returning robot, state",
        )
        .bind(site)
        .bind(*robot)
        .bind(*count)
        .fetch_optional(&mut **tx)
        .await?;
        if let Some(row) = row {
            states.insert(get(&row, "robots", "robot")?, robots::state(&row)?);
        }
    }
    Ok(())
}

/// What stands in the log under an id.
struct Standing {
    place: Place,
    digest: String,
}

impl Standing {
    /// The answer to a contribution of that id.
    fn answer(&self, digest: &str) -> Appended {
        if self.digest == digest {
            Appended::Known(self.place)
        } else {
            Appended::Conflict(self.place.revision)
        }
    }
}

impl TryFrom<&AnyRow> for Standing {
    type Error = StoreError;

    fn try_from(row: &AnyRow) -> Result<Self, StoreError> {
        let state: String = get(row, TABLE, "state")?;
        Ok(Self {
            place: Place {
                revision: get(row, TABLE, "revision")?,
                received_at_us: get(row, TABLE, "received_at_us")?,
                state: parse_state(&state)?,
            },
            digest: get(row, TABLE, "digest")?,
        })
    }
}
