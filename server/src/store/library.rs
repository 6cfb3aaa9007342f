//! The libraries of sites: prototypes, and what they were at each revision.

use std::collections::BTreeMap;

use sqlx::any::AnyRow;

use super::gdb::NewGdbEntry;
use super::row::get;
use super::transaction::Tx;
use super::values::{Bulk, bulk};
use super::{Store, StoreError, retried};

const LIBRARIES: &str = "libraries";
const PROTOTYPES: &str = "prototypes";

static INSERT: Bulk =
    bulk!("insert into prototypes (site, name, revision, content) values ", 4, from 1, "");

/// What became of a library that was put.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LibraryOutcome {
    /// It is so, since this revision.
    Is(i64),
    /// It is none of those that the author may have seen: nothing has changed.
    Stale {
        /// The revision that it has.
        now: i64,
    },
}

impl Store {
    /// The library of a site at revision `until`, as columns; and its revision then, 0 for one that
    /// nothing was ever put in.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn library(
        &self,
        site: &str,
        until: i64,
    ) -> Result<(i64, BTreeMap<String, Vec<u8>>), StoreError> {
        let mut tx = self.begin_read().await?;
        let revision = library_revision(&mut tx, site).await?.min(until);
        let library = prototypes(&mut tx, site, revision).await?;
        tx.rollback().await?;
        Ok((revision, library))
    }

    /// Makes a library what is given, prototypes as their columns. What is so already is no change,
    /// whatever revision it was asked on.
    ///
    /// # Errors
    /// [`StoreError::Missing`] for a site that is not there; otherwise nothing has changed, except that
    /// [`StoreError::Unavailable`] leaves it open: asking again does no harm.
    pub async fn put_library(
        &self,
        site: &str,
        new: &NewGdbEntry,
        seen: Option<&[i64]>,
        library: &BTreeMap<String, Vec<u8>>,
    ) -> Result<LibraryOutcome, StoreError> {
        retried("put_library", || self.try_put_library(site, new, seen, library)).await
    }

    async fn try_put_library(
        &self,
        site: &str,
        new: &NewGdbEntry,
        seen: Option<&[i64]>,
        library: &BTreeMap<String, Vec<u8>>,
    ) -> Result<LibraryOutcome, StoreError> {
        let mut tx = self.begin_write().await?;
        // Locks the site's row: revisions of its library come one after the other.
        let site_row = sqlx::query("update sites set name = name where site = $1")
            .bind(site)
            .execute(&mut *tx)
            .await?;
        if site_row.rows_affected() == 0 {
            return Err(StoreError::Missing { kind: "site", name: site.to_owned() });
        }
        let now = library_revision(&mut tx, site).await?;
        let standing = prototypes(&mut tx, site, now).await?;
        let put = library.iter().filter(|(name, content)| standing.get(*name) != Some(content));
        let gone = standing.keys().filter(|name| !library.contains_key(*name));
        let changed: Vec<(&String, Option<&Vec<u8>>)> = put
            .map(|(name, content)| (name, Some(content)))
            .chain(gone.map(|name| (name, None)))
            .collect();
        if changed.is_empty() {
            tx.rollback().await?;
            return Ok(LibraryOutcome::Is(now));
        }
        if seen.is_some_and(|seen| !seen.contains(&now)) {
            tx.rollback().await?;
            return Ok(LibraryOutcome::Stale { now });
        }
        let revision = now + 1;
        sqlx::query(
            "insert into libraries (site, revision, author, at_us, comment) \
             values ($1, $2, $3, $4, $5)",
        )
        .bind(site)
        .bind(revision)
        .bind(new.author.as_str())
        .bind(new.at_us)
        .bind(new.comment.as_str())
        .execute(&mut *tx)
        .await?;
        for (statement, piece) in INSERT.statements(&changed) {
            let mut query = sqlx::query(statement);
            for (name, content) in piece {
                let content = content.map(Vec::as_slice);
                query = query.bind(site).bind(name.as_str()).bind(revision).bind(content);
            }
            query.execute(&mut *tx).await?;
        }
        tx.commit().await?;
        Ok(LibraryOutcome::Is(revision))
    }
}

/// How often the library of a site has changed.
pub(super) async fn library_revision(tx: &mut Tx, site: &str) -> Result<i64, StoreError> {
    let row = sqlx::query(
        "select revision from libraries where site = $1 order by revision desc limit 1",
    )
    .bind(site)
    .fetch_optional(&mut **tx)
    .await?;
    row.map_or(Ok(0), |row| get(&row, LIBRARIES, "revision"))
}

async fn prototypes(
    tx: &mut Tx,
    site: &str,
    revision: i64,
) -> Result<BTreeMap<String, Vec<u8>>, StoreError> {
    let rows = sqlx::query(
        "select p.name, p.content from prototypes p where p.site = $1 and p.content is not null \
         and p.revision = (select max(q.revision) from prototypes q where q.site = p.site \
         and q.name = p.name and q.revision <= $2)",
    )
    .bind(site)
    .bind(revision)
    .fetch_all(&mut **tx)
    .await?;
    let prototype =
        |row: &AnyRow| Ok((get(row, PROTOTYPES, "name")?, get(row, PROTOTYPES, "content")?));
    rows.iter().map(prototype).collect()
}
