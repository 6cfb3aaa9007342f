//! Levels: one floor of a site each, and the row from which its revisions come.

use sqlx::any::AnyRow;
use uuid::Uuid;

use super::row::{corrupt, get};
use super::{Store, StoreError};

const TABLE: &str = "levels";

/// A level as it is on disk.
#[derive(Debug, Clone, PartialEq)]
pub struct LevelRow {
    /// Slug of its site.
    pub site: String,
    /// Slug.
    pub level: String,
    /// Name for people.
    pub name: String,
    /// UUID of its frame.
    pub frame: Uuid,
    /// Edge of a cell, metres.
    pub resolution_m: f64,
    /// Height of the floor, metres.
    pub elevation_m: f64,
    /// Length of the slices of its evidence, seconds.
    pub slice_s: u32,
    /// Newest revision of its log; 0 for an empty one.
    pub revision: i64,
    /// Revision up to which the stored map is folded; the map in memory may be ahead of it.
    pub folded_revision: i64,
    /// When it was made, microseconds since 1970.
    pub created_at_us: i64,
}

/// A level to be made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NewLevelRow<'a> {
    /// Slug.
    pub level: &'a str,
    /// Name for people.
    pub name: &'a str,
    /// UUID of its frame, new.
    pub frame: Uuid,
    /// Edge of a cell, metres.
    pub resolution_m: f64,
    /// Height of the floor, metres.
    pub elevation_m: f64,
    /// Length of the slices of its evidence, seconds.
    pub slice_s: u32,
    /// Now, microseconds since 1970.
    pub created_at_us: i64,
}

impl Store {
    /// Makes a level.
    ///
    /// # Errors
    /// [`StoreError::AlreadyExists`] for a slug that is taken on this site,
    /// [`StoreError::Missing`] for a site that is not there.
    pub async fn create_level(
        &self,
        site: &str,
        level: &NewLevelRow<'_>,
    ) -> Result<LevelRow, StoreError> {
        let made = sqlx::query(
            "insert into levels (site, level, name, frame, resolution_m, elevation_m, slice_s, \
             revision, folded_revision, created_at_us) values ($1, $2, $3, $4, $5, $6, $7, 0, 0, $8) \
             on conflict (site, level) do nothing",
        )
        .bind(site)
        .bind(level.level)
        .bind(level.name)
        .bind(level.frame.to_string())
        .bind(level.resolution_m)
        .bind(level.elevation_m)
        .bind(i64::from(level.slice_s))
        .bind(level.created_at_us)
        .execute(self.writes())
        .await
        .map_err(|error| {
            if StoreError::is_missing_reference(&error) {
                StoreError::Missing { kind: "site", name: site.to_owned() }
            } else {
                error.into()
            }
        })?;
        if made.rows_affected() == 0 {
            return Err(StoreError::AlreadyExists { kind: "level", name: level.level.to_owned() });
        }
        Ok(LevelRow {
            site: site.to_owned(),
            level: level.level.to_owned(),
            name: level.name.to_owned(),
            frame: level.frame,
            resolution_m: level.resolution_m,
            elevation_m: level.elevation_m,
            slice_s: level.slice_s,
            revision: 0,
            folded_revision: 0,
            created_at_us: level.created_at_us,
        })
    }

    /// A level.
    ///
    /// # Errors
    /// The store fails.
    pub async fn level(&self, site: &str, level: &str) -> Result<Option<LevelRow>, StoreError> {
        sqlx::query(
            "select site, level, name, frame, resolution_m, elevation_m, slice_s, \
             revision, folded_revision, created_at_us from levels where site = $1 and level = $2",
        )
        .bind(site)
        .bind(level)
        .fetch_optional(self.reads())
        .await?
        .map(|row| LevelRow::try_from(&row))
        .transpose()
    }

    /// All levels of a site, by slug.
    ///
    /// # Errors
    /// The store fails.
    pub async fn levels(&self, site: &str) -> Result<Vec<LevelRow>, StoreError> {
        let rows = sqlx::query(
            "select site, level, name, frame, resolution_m, elevation_m, slice_s, \
             revision, folded_revision, created_at_us from levels where site = $1",
        )
        .bind(site)
        .fetch_all(self.reads())
        .await?;
        let mut levels = rows.iter().map(LevelRow::try_from).collect::<Result<Vec<_>, _>>()?;
        levels.sort_unstable_by(|a, b| a.level.cmp(&b.level));
        Ok(levels)
    }

    /// Newest revision of a level's log and the revision up to which its stored map is folded;
    /// `None` if there is no such level.
    ///
    /// # Errors
    /// The store fails.
    pub async fn revisions(
        &self,
        site: &str,
        level: &str,
    ) -> Result<Option<Revisions>, StoreError> {
        sqlx::query("select revision, folded_revision from levels where site = $1 and level = $2")
            .bind(site)
            .bind(level)
            .fetch_optional(self.reads())
            .await?
            .map(|row| {
                Ok(Revisions {
                    log: get(&row, TABLE, "revision")?,
                    folded: get(&row, TABLE, "folded_revision")?,
                })
            })
            .transpose()
    }
}

/// How far a level has come on disk.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Revisions {
    /// Newest revision of the log.
    pub log: i64,
    /// Revision up to which the stored map is folded.
    pub folded: i64,
}

impl TryFrom<&AnyRow> for LevelRow {
    type Error = StoreError;

    fn try_from(row: &AnyRow) -> Result<Self, StoreError> {
        let frame: String = get(row, TABLE, "frame")?;
        let slice_s: i64 = get(row, TABLE, "slice_s")?;
        Ok(Self {
            site: get(row, TABLE, "site")?,
            level: get(row, TABLE, "level")?,
            name: get(row, TABLE, "name")?,
            frame: frame.parse().map_err(|e| corrupt(TABLE, "frame", e))?,
            resolution_m: get(row, TABLE, "resolution_m")?,
            elevation_m: get(row, TABLE, "elevation_m")?,
            slice_s: u32::try_from(slice_s).map_err(|e| corrupt(TABLE, "slice_s", e))?,
            revision: get(row, TABLE, "revision")?,
            folded_revision: get(row, TABLE, "folded_revision")?,
            created_at_us: get(row, TABLE, "created_at_us")?,
        })
    }
}
