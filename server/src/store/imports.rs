//! Maps of other programs in a level's log: each one entry, with a revision of its own. The latest
//! is the level's prior.

use mapfold_map::raster::{Tile, TileIndex};
use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::v1;
use sqlx::any::AnyRow;
use uuid::Uuid;

use super::acts::next_revision;
use super::payload::PayloadError;
use super::row::{corrupt, get};
use super::transaction::Tx;
use super::values::{Bulk, bulk};
use super::{Store, StoreError, retried, tile_cells};

const TABLE: &str = "imports";
const TILES: &str = "prior_tiles";

/// A map to be put into a log.
#[derive(Debug, Clone, PartialEq)]
pub struct NewImport {
    /// The import.
    pub id: Uuid,
    /// SHA-256 of what is asked for, lower-case hexadecimal; empty for a removal.
    pub digest: String,
    /// Public id of the token.
    pub author: String,
    /// Now, microseconds since 1970.
    pub at_us: i64,
    /// What was found in the map; `None` takes the prior away.
    pub report: Option<v1::ImportReport>,
    /// What it says, tile by tile: places and columns.
    pub tiles: Vec<(TileIndex, Vec<u8>)>,
}

impl NewImport {
    /// The column of a tile.
    ///
    /// # Errors
    /// No memory for it.
    pub fn column(tile: &Tile) -> Result<Vec<u8>, PayloadError> {
        tile_cells::encode(tile)
    }
}

/// What an import says, as the fold reads it.
#[derive(Debug, Clone, PartialEq)]
pub struct ImportRow {
    /// Its place in the log.
    pub revision: i64,
    /// The tiles, ascending.
    pub tiles: Vec<(TileIndex, Tile)>,
}

static INSERT_TILES: Bulk = bulk!(
    "insert into prior_tiles (site, level, revision, x, y, content) values ",
    6,
    from 1,
    ""
);

/// The columns that make a [`v1::Import`].
macro_rules! imports {
    ($conditions:literal) => {
        concat!(
            "select import, revision, at_us, author, digest, report from imports \
             where site = $1 and level = $2 ",
            $conditions
        )
    };
}

impl Store {
    /// Makes a map the prior, or takes the prior away, as one entry of the log. When it returns,
    /// that is on disk. What is the prior already stays so, with the answer it had; `None` if there
    /// is nothing to take away.
    ///
    /// # Errors
    /// [`StoreError::Missing`] for a level that is not there; otherwise nothing has changed,
    /// except that [`StoreError::Unavailable`] leaves it open: asking again does no harm.
    pub async fn import(
        &self,
        site: &str,
        level: &str,
        new: &NewImport,
    ) -> Result<Option<v1::Import>, StoreError> {
        retried("import", || self.try_import(site, level, new)).await
    }

    async fn try_import(
        &self,
        site: &str,
        level: &str,
        new: &NewImport,
    ) -> Result<Option<v1::Import>, StoreError> {
        let mut tx = self.begin_write().await?;
        let revision = next_revision(&mut tx, site, level).await?;
        let standing = latest(&mut tx, site, level).await?.filter(|last| last.report.is_some());
        let is_removal = new.report.is_none();
        if standing.as_ref().is_some_and(|standing| standing.digest == new.digest) {
            tx.rollback().await?;
            return Ok(standing);
        }
        if is_removal && standing.is_none() {
            tx.rollback().await?;
            return Ok(None);
        }
        let report = new.report.as_ref().map(serde_json::to_string).transpose();
        let report = report.map_err(|e| corrupt(TABLE, "report", e))?;
        sqlx::query(
            "insert into imports (site, level, revision, import, digest, author, at_us, report) \
             values ($1, $2, $3, $4, $5, $6, $7, $8)",
        )
        .bind(site)
        .bind(level)
        .bind(revision)
        .bind(new.id.to_string())
        .bind(new.digest.as_str())
        .bind(new.author.as_str())
        .bind(new.at_us)
        .bind(report)
        .execute(&mut *tx)
        .await?;
        for (statement, piece) in INSERT_TILES.statements(&new.tiles) {
            let mut query = sqlx::query(statement);
            for (at, content) in piece {
                query = query
                    .bind(site)
                    .bind(level)
                    .bind(revision)
                    .bind(i64::from(at.x))
                    .bind(i64::from(at.y))
                    .bind(content.as_slice());
            }
            query.execute(&mut *tx).await?;
        }
        let import = latest(&mut tx, site, level).await?;
        tx.commit().await?;
        Ok(import)
    }

    /// A page of a level's imports, newest first: at most `limit`, older than revision `before` if
    /// there is one. The answer's `next` is the `before` of the next page.
    ///
    /// # Errors
    /// The store fails.
    pub async fn import_page(
        &self,
        site: &str,
        level: &str,
        before: Option<i64>,
        limit: u32,
    ) -> Result<v1::ImportPage, StoreError> {
        let select = imports!("and revision < $3 order by revision desc limit $4");
        let (imports, next) =
            self.page(select, (site, level), before, limit, describe, |last| last.revision).await?;
        Ok(v1::ImportPage { imports, next })
    }

    /// The revisions of all imports up to revision `until`, in the order of the log.
    ///
    /// # Errors
    /// The store fails.
    pub async fn import_revisions(
        &self,
        site: &str,
        level: &str,
        until: i64,
    ) -> Result<Vec<i64>, StoreError> {
        let rows = sqlx::query(
            "select revision from imports where site = $1 and level = $2 and revision <= $3 \
             order by revision",
        )
        .bind(site)
        .bind(level)
        .bind(until)
        .fetch_all(self.reads())
        .await?;
        rows.iter().map(|row| get(row, TABLE, "revision")).collect()
    }

    /// Every place of which an import up to revision `until` said something.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn prior_places(
        &self,
        site: &str,
        level: &str,
        until: i64,
    ) -> Result<Vec<TileIndex>, StoreError> {
        let rows = sqlx::query(
            "select distinct x, y from prior_tiles where site = $1 and level = $2 \
             and revision <= $3",
        )
        .bind(site)
        .bind(level)
        .bind(until)
        .fetch_all(self.reads())
        .await?;
        rows.iter().map(place).collect()
    }

    /// What the import at `revision` says.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn import_row(
        &self,
        site: &str,
        level: &str,
        revision: i64,
    ) -> Result<ImportRow, StoreError> {
        let rows = sqlx::query(
            "select x, y, content from prior_tiles where site = $1 and level = $2 \
             and revision = $3 order by x, y",
        )
        .bind(site)
        .bind(level)
        .bind(revision)
        .fetch_all(self.reads())
        .await?;
        let tile = |row: &AnyRow| {
            let content: Vec<u8> = get(row, TILES, "content")?;
            let key = || format!("revision {revision}");
            let tile = tile_cells::decode(&content).map_err(|e| corrupt(TILES, key(), e))?;
            Ok((place(row)?, tile))
        };
        Ok(ImportRow { revision, tiles: rows.iter().map(tile).collect::<Result<_, StoreError>>()? })
    }
}

/// Revision of the first import after revision `after`.
pub(super) async fn first_import_after(
    tx: &mut Tx,
    site: &str,
    level: &str,
    after: i64,
) -> Result<Option<i64>, StoreError> {
    let row = sqlx::query(
        "select revision from imports where site = $1 and level = $2 and revision > $3 \
         order by revision limit 1",
    )
    .bind(site)
    .bind(level)
    .bind(after)
    .fetch_optional(&mut **tx)
    .await?;
    row.map(|row| get(&row, TABLE, "revision")).transpose()
}

async fn latest(tx: &mut Tx, site: &str, level: &str) -> Result<Option<v1::Import>, StoreError> {
    let row = sqlx::query(imports!("order by revision desc limit 1"))
        .bind(site)
        .bind(level)
        .fetch_optional(&mut **tx)
        .await?;
    row.map(|row| describe(&row)).transpose()
}

fn describe(row: &AnyRow) -> Result<v1::Import, StoreError> {
    let id: String = get(row, TABLE, "import")?;
    let report: Option<String> = get(row, TABLE, "report")?;
    let report = report.map(|report| serde_json::from_str(&report)).transpose();
    Ok(v1::Import {
        report: report.map_err(|e| corrupt(TABLE, &*id, e))?,
        id: id.parse().map_err(|e| corrupt(TABLE, &*id, e))?,
        revision: get(row, TABLE, "revision")?,
        at: to_rfc3339(get(row, TABLE, "at_us")?),
        author: get(row, TABLE, "author")?,
        digest: get(row, TABLE, "digest")?,
    })
}

fn place(row: &AnyRow) -> Result<TileIndex, StoreError> {
    let number = |column| {
        let value: i64 = get(row, TILES, column)?;
        i32::try_from(value).map_err(|e| corrupt(TILES, column, e))
    };
    Ok(TileIndex { x: number("x")?, y: number("y")? })
}
