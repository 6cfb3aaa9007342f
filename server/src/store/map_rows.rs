//! The folded map on disk: for each thing that ever was in it, what it is and since when.
//!
//! Written behind the log, each changed row once however many revisions touched it, together with
//! the revision up to which the map is folded. Whoever opens the level reads it back.

use mapfold_map::raster::{SensorClass, Slice, SliceKey, TileIndex, TileKey};
use sqlx::any::AnyRow;

use super::row::{corrupt, get};
use super::transaction::Tx;
use super::values::{Bulk, bulk};
use super::{Store, StoreError, retried};

/// A segment's, a cluster's or a chain's row.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FeatureRow {
    /// Its identity as text.
    pub feature: String,
    /// Revision of its last change.
    pub revision: i64,
    /// CBOR as published; `None` if it is no more.
    pub content: Option<Vec<u8>>,
}

/// A tile's row: since when it reads as it does. What it reads as, its slices tell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TileRow {
    /// Its layer and place.
    pub key: TileKey,
    /// Revision of its last change.
    pub revision: i64,
    /// Whether it is no more.
    pub is_gone: bool,
}

/// The row of a tile's evidence in one slice of time.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct SliceRow {
    /// Its layer, place and time.
    pub at: SliceKey,
    /// Revision of its last change.
    pub revision: i64,
    /// Its sums, see [`super::tile_cells`]; `None` if there are no more.
    pub content: Option<Vec<u8>>,
}

/// Rows of a level's map.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct MapRows {
    /// Segments.
    pub segments: Vec<FeatureRow>,
    /// Clusters.
    pub clusters: Vec<FeatureRow>,
    /// Chains.
    pub chains: Vec<FeatureRow>,
    /// Tiles.
    pub tiles: Vec<TileRow>,
    /// Their evidence.
    pub slices: Vec<SliceRow>,
}

impl MapRows {
    /// Number of rows.
    pub fn len(&self) -> usize {
        self.segments.len()
            + self.clusters.len()
            + self.chains.len()
            + self.tiles.len()
            + self.slices.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// A level's map as it is on disk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredMap {
    /// Revision up to which it is folded.
    pub folded_revision: i64,
    /// All of it.
    pub rows: MapRows,
}

/// What became of an attempt to write behind.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WriteBehind {
    /// It is on disk.
    Written,
    /// Nothing was written: meanwhile another replica has written up to this revision.
    Overtaken(i64),
}

static UPSERT_SEGMENTS: Bulk = bulk!(
    "insert into segments (site, level, feature, revision, content) values ",
    5,
    from 1,
    " on conflict (site, level, feature) do update set revision = excluded.revision, \
     content = excluded.content"
);

static UPSERT_CLUSTERS: Bulk = bulk!(
    "insert into clusters (site, level, feature, revision, content) values ",
    5,
    from 1,
    " on conflict (site, level, feature) do update set revision = excluded.revision, \
     content = excluded.content"
);

static UPSERT_CHAINS: Bulk = bulk!(
    "insert into chains (site, level, feature, revision, content) values ",
    5,
    from 1,
    " on conflict (site, level, feature) do update set revision = excluded.revision, \
     content = excluded.content"
);

static UPSERT_TILES: Bulk = bulk!(
    "insert into tiles (site, level, sensor, x, y, revision, is_gone) values ",
    7,
    from 1,
    " on conflict (site, level, sensor, x, y) do update set revision = excluded.revision, \
     is_gone = excluded.is_gone"
);

static UPSERT_SLICES: Bulk = bulk!(
    "insert into slices (site, level, sensor, x, y, slice, revision, content) values ",
    8,
    from 1,
    " on conflict (site, level, sensor, x, y, slice) do update set revision = excluded.revision, \
     content = excluded.content"
);

impl Store {
    /// Writes all that changed in a level's map after `from_revision` up to `to_revision`, and
    /// that it is folded so far; all or nothing.
    ///
    /// # Errors
    /// The store fails.
    pub async fn write_map(
        &self,
        site: &str,
        level: &str,
        from_revision: i64,
        to_revision: i64,
        rows: &MapRows,
    ) -> Result<WriteBehind, StoreError> {
        retried("write behind", || {
            self.try_write_map(site, level, from_revision, to_revision, rows)
        })
        .await
    }

    async fn try_write_map(
        &self,
        site: &str,
        level: &str,
        from_revision: i64,
        to_revision: i64,
        rows: &MapRows,
    ) -> Result<WriteBehind, StoreError> {
        let mut tx = self.begin_write().await?;
        upsert_features(&mut tx, site, level, &UPSERT_SEGMENTS, &rows.segments).await?;
        upsert_features(&mut tx, site, level, &UPSERT_CLUSTERS, &rows.clusters).await?;
        upsert_features(&mut tx, site, level, &UPSERT_CHAINS, &rows.chains).await?;
        for (statement, piece) in UPSERT_TILES.statements(&rows.tiles) {
            let mut query = sqlx::query(statement);
            for row in piece {
                query = query
                    .bind(site)
                    .bind(level)
                    .bind(sensor_text(row.key.class))
                    .bind(i64::from(row.key.tile.x))
                    .bind(i64::from(row.key.tile.y))
                    .bind(row.revision)
                    .bind(i64::from(row.is_gone));
            }
            query.execute(&mut *tx).await?;
        }
        for (statement, piece) in UPSERT_SLICES.statements(&rows.slices) {
            let mut query = sqlx::query(statement);
            for row in piece {
                query = query
                    .bind(site)
                    .bind(level)
                    .bind(sensor_text(row.at.key.class))
                    .bind(i64::from(row.at.key.tile.x))
                    .bind(i64::from(row.at.key.tile.y))
                    .bind(row.at.slice.0)
                    .bind(row.revision)
                    .bind(row.content.as_deref());
            }
            query.execute(&mut *tx).await?;
        }
        // Last, because appends wait for this row's lock. If the revision is not the one that
        // these rows start from, another replica was faster and all of it is taken back.
        let moved = sqlx::query(
            "update levels set folded_revision = $4 \
             where site = $1 and level = $2 and folded_revision = $3",
        )
        .bind(site)
        .bind(level)
        .bind(from_revision)
        .bind(to_revision)
        .execute(&mut *tx)
        .await?;
        if moved.rows_affected() == 0 {
            tx.rollback().await?;
            let revisions = self.revisions(site, level).await?;
            return revisions.map_or_else(
                || Err(StoreError::Missing { kind: "level", name: level.to_owned() }),
                |revisions| Ok(WriteBehind::Overtaken(revisions.folded)),
            );
        }
        tx.commit().await?;
        Ok(WriteBehind::Written)
    }

    /// A level's map as it is on disk, all of one moment; `None` if there is no such level.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn stored_map(
        &self,
        site: &str,
        level: &str,
    ) -> Result<Option<StoredMap>, StoreError> {
        let mut tx = self.begin_read().await?;
        let row = sqlx::query("select folded_revision from levels where site = $1 and level = $2")
            .bind(site)
            .bind(level)
            .fetch_optional(&mut *tx)
            .await?;
        let Some(row) = row else { return Ok(None) };
        let folded_revision = get(&row, "levels", "folded_revision")?;
        let segments = sqlx::query(
            "select feature, revision, content from segments where site = $1 and level = $2",
        )
        .bind(site)
        .bind(level)
        .fetch_all(&mut *tx)
        .await?;
        let clusters = sqlx::query(
            "select feature, revision, content from clusters where site = $1 and level = $2",
        )
        .bind(site)
        .bind(level)
        .fetch_all(&mut *tx)
        .await?;
        let chains = sqlx::query(
            "select feature, revision, content from chains where site = $1 and level = $2",
        )
        .bind(site)
        .bind(level)
        .fetch_all(&mut *tx)
        .await?;
        let tiles = sqlx::query(
            "select sensor, x, y, revision, is_gone from tiles where site = $1 and level = $2",
        )
        .bind(site)
        .bind(level)
        .fetch_all(&mut *tx)
        .await?;
        let slices = sqlx::query(
            "select sensor, x, y, slice, revision, content from slices \
             where site = $1 and level = $2",
        )
        .bind(site)
        .bind(level)
        .fetch_all(&mut *tx)
        .await?;
        tx.rollback().await?;
        let features = |rows: &[AnyRow], table| {
            rows.iter().map(|row| feature_row(row, table)).collect::<Result<Vec<_>, _>>()
        };
        Ok(Some(StoredMap {
            folded_revision,
            rows: MapRows {
                segments: features(&segments, "segments")?,
                clusters: features(&clusters, "clusters")?,
                chains: features(&chains, "chains")?,
                tiles: tiles.iter().map(tile_row).collect::<Result<_, _>>()?,
                slices: slices.iter().map(slice_row).collect::<Result<_, _>>()?,
            },
        }))
    }
}

async fn upsert_features(
    tx: &mut Tx,
    site: &str,
    level: &str,
    upsert: &Bulk,
    rows: &[FeatureRow],
) -> Result<(), StoreError> {
    for (statement, piece) in upsert.statements(rows) {
        let mut query = sqlx::query(statement);
        for row in piece {
            query = query
                .bind(site)
                .bind(level)
                .bind(row.feature.as_str())
                .bind(row.revision)
                .bind(row.content.as_deref());
        }
        query.execute(&mut **tx).await?;
    }
    Ok(())
}

fn feature_row(row: &AnyRow, table: &'static str) -> Result<FeatureRow, StoreError> {
    Ok(FeatureRow {
        feature: get(row, table, "feature")?,
        revision: get(row, table, "revision")?,
        content: get(row, table, "content")?,
    })
}

fn tile_row(row: &AnyRow) -> Result<TileRow, StoreError> {
    const TABLE: &str = "tiles";
    let is_gone: i64 = get(row, TABLE, "is_gone")?;
    Ok(TileRow {
        key: tile_key(row, TABLE)?,
        revision: get(row, TABLE, "revision")?,
        is_gone: is_gone != 0,
    })
}

fn slice_row(row: &AnyRow) -> Result<SliceRow, StoreError> {
    const TABLE: &str = "slices";
    Ok(SliceRow {
        at: SliceKey { key: tile_key(row, TABLE)?, slice: Slice(get(row, TABLE, "slice")?) },
        revision: get(row, TABLE, "revision")?,
        content: get(row, TABLE, "content")?,
    })
}

fn tile_key(row: &AnyRow, table: &'static str) -> Result<TileKey, StoreError> {
    let sensor: String = get(row, table, "sensor")?;
    let place = |column| {
        let value: i64 = get(row, table, column)?;
        i32::try_from(value).map_err(|e| corrupt(table, column, e))
    };
    Ok(TileKey {
        class: SensorClass::ALL
            .into_iter()
            .find(|class| sensor_text(*class) == sensor)
            .ok_or_else(|| corrupt(table, "sensor", format!("{sensor:?} is no layer")))?,
        tile: TileIndex { x: place("x")?, y: place("y")? },
    })
}

fn sensor_text(class: SensorClass) -> &'static str {
    match class {
        SensorClass::Scanner => "scanner",
        SensorClass::Sonar => "sonar",
    }
}
