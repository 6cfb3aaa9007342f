//! Robots of a site, their sensors, and where they last were.

use std::collections::BTreeSet;

use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::v1;
use sqlx::any::AnyRow;

use super::row::{corrupt, get};
use super::{Store, StoreError};

const TABLE: &str = "robots";

/// The columns that make a description.
macro_rules! columns {
    () => {
        "robot, name, sensors, state, reported_revision, queue_length, contributions, reverted, last_level, \
         last_x_m, last_y_m, last_heading_rad, last_covariance, last_observed_at_us, fix"
    };
}

impl Store {
    /// Enrols a robot, active.
    ///
    /// # Errors
    /// [`StoreError::AlreadyExists`] for a slug that is taken on this site,
    /// [`StoreError::Missing`] for a site that is not there.
    pub async fn create_robot(
        &self,
        site: &str,
        robot: &v1::NewRobot,
        created_at_us: i64,
    ) -> Result<v1::RobotDescription, StoreError> {
        let made = sqlx::query(concat!(
            "insert into robots (site, robot, name, sensors, state, contributions, created_at_us) \
             values ($1, $2, $3, $4, 'active', 0, $5) \
             on conflict (site, robot) do nothing returning ",
            columns!()
        ))
        .bind(site)
        .bind(robot.robot.as_str())
        .bind(robot.name.as_deref().unwrap_or(&robot.robot))
        .bind(sensors_text(&robot.sensors)?)
        .bind(created_at_us)
        .fetch_optional(self.writes())
        .await
        .map_err(|error| {
            if StoreError::is_missing_reference(&error) {
                StoreError::Missing { kind: "site", name: site.to_owned() }
            } else {
                error.into()
            }
        })?;
        match made {
            Some(row) => describe(&row),
            None => Err(StoreError::AlreadyExists { kind: "robot", name: robot.robot.clone() }),
        }
    }

    /// A robot.
    ///
    /// # Errors
    /// The store fails.
    pub async fn robot(
        &self,
        site: &str,
        robot: &str,
    ) -> Result<Option<v1::RobotDescription>, StoreError> {
        sqlx::query(concat!("select ", columns!(), " from robots where site = $1 and robot = $2"))
            .bind(site)
            .bind(robot)
            .fetch_optional(self.reads())
            .await?
            .map(|row| describe(&row))
            .transpose()
    }

    /// All robots of a site, by slug.
    ///
    /// # Errors
    /// The store fails.
    pub async fn robots(&self, site: &str) -> Result<Vec<v1::RobotDescription>, StoreError> {
        let rows = sqlx::query(concat!("select ", columns!(), " from robots where site = $1"))
            .bind(site)
            .fetch_all(self.reads())
            .await?;
        let mut robots = rows.iter().map(describe).collect::<Result<Vec<_>, _>>()?;
        robots.sort_unstable_by(|a, b| a.robot.cmp(&b.robot));
        Ok(robots)
    }

    /// Changes what `update` names and answers the robot as it is then; `None` if it is not there.
    /// Once this returns with the state `held`, nothing that is appended later is folded.
    ///
    /// # Errors
    /// The store fails.
    pub async fn update_robot(
        &self,
        site: &str,
        robot: &str,
        update: &v1::RobotUpdate,
    ) -> Result<Option<v1::RobotDescription>, StoreError> {
        let sensors = update.sensors.as_deref().map(sensors_text).transpose()?;
        let fix = update.fix.as_ref().map(serde_json::to_string).transpose();
        let fix = fix.map_err(|e| corrupt(TABLE, "fix", e))?;
        sqlx::query(concat!(
            "update robots set name = coalesce($3, name), sensors = coalesce($4, sensors), \
             state = coalesce($5, state), reported_revision = coalesce($6, reported_revision), \
             queue_length = coalesce($7, queue_length), fix = coalesce($8, fix) where site = $1 and robot = $2 returning ",
            columns!()
        ))
        .bind(site)
        .bind(robot)
        .bind(update.name.as_deref())
        .bind(sensors)
        .bind(update.state.map(state_text))
        .bind(update.revision)
        .bind(update.queue_length)
        .bind(fix)
        .fetch_optional(self.writes())
        .await?
        .map(|row| describe(&row))
        .transpose()
    }
}

fn sensors_text(sensors: &[v1::SensorProfile]) -> Result<String, StoreError> {
    serde_json::to_string(sensors).map_err(|e| corrupt(TABLE, "sensors", e))
}

fn state_text(state: v1::RobotState) -> &'static str {
    match state {
        v1::RobotState::Active => "active",
        v1::RobotState::Held => "held",
    }
}

/// The state in a row.
pub(super) fn state(row: &AnyRow) -> Result<v1::RobotState, StoreError> {
    let text: String = get(row, TABLE, "state")?;
    match text.as_str() {
        "active" => Ok(v1::RobotState::Active),
        "held" => Ok(v1::RobotState::Held),
        _ => Err(corrupt(TABLE, "state", format!("{text:?} is no state of a robot"))),
    }
}

fn describe(row: &AnyRow) -> Result<v1::RobotDescription, StoreError> {
    let sensors: String = get(row, TABLE, "sensors")?;
    let sensors: Vec<v1::SensorProfile> =
        serde_json::from_str(&sensors).map_err(|e| corrupt(TABLE, "sensors", e))?;
    let fix: Option<String> = get(row, TABLE, "fix")?;
    let kinds: BTreeSet<v1::SensorKind> = sensors.iter().map(|sensor| sensor.kind).collect();
    Ok(v1::RobotDescription {
        robot: get(row, TABLE, "robot")?,
        name: get(row, TABLE, "name")?,
        competence: kinds.into_iter().collect(),
        sensors,
        state: state(row)?,
        last_pose: last_pose(row)?,
        revision: get(row, TABLE, "reported_revision")?,
        queue_length: get(row, TABLE, "queue_length")?,
        fix: fix
            .map(|text| serde_json::from_str(&text))
            .transpose()
            .map_err(|e| corrupt(TABLE, "fix", e))?,
        contributions: get(row, TABLE, "contributions")?,
        reverted: get(row, TABLE, "reverted")?,
    })
}

fn last_pose(row: &AnyRow) -> Result<Option<v1::LastPose>, StoreError> {
    let level: Option<String> = get(row, TABLE, "last_level")?;
    let Some(level) = level else { return Ok(None) };
    let covariance: String = get(row, TABLE, "last_covariance")?;
    Ok(Some(v1::LastPose {
        level,
        x_m: get(row, TABLE, "last_x_m")?,
        y_m: get(row, TABLE, "last_y_m")?,
        heading_rad: get(row, TABLE, "last_heading_rad")?,
        covariance: serde_json::from_str(&covariance)
            .map_err(|e| corrupt(TABLE, "last_covariance", e))?,
        observed_at: to_rfc3339(get(row, TABLE, "last_observed_at_us")?),
    }))
}
