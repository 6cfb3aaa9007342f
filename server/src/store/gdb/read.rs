//! Reading the GDB of a level: how far it has come, what it holds, who changed it.

use mapfold_schema::v1;
use uuid::Uuid;

use super::super::library::library_revision;
use super::super::row::get;
use super::super::transaction::Tx;
use super::super::{Store, StoreError};
use super::{ENTRIES, GdbState, GdbVersion, OBJECTS, Publication, describe, entries, object_id};

impl Store {
    /// How far the GDB of a level has come.
    ///
    /// # Errors
    /// The store fails.
    pub async fn gdb_state(&self, site: &str, level: &str) -> Result<GdbState, StoreError> {
        let mut tx = self.begin_read().await?;
        let state = state(&mut tx, site, level).await?;
        tx.rollback().await?;
        Ok(state)
    }

    /// The latest publication at revision `until`.
    ///
    /// # Errors
    /// The store fails.
    pub async fn gdb_publication(
        &self,
        site: &str,
        level: &str,
        until: i64,
    ) -> Result<Option<Publication>, StoreError> {
        let mut tx = self.begin_read().await?;
        let publication = publication(&mut tx, site, level, until).await?;
        tx.rollback().await?;
        Ok(publication)
    }

    /// The objects of a draft, as their columns, in no order.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn gdb_objects(
        &self,
        site: &str,
        level: &str,
        draft: i64,
    ) -> Result<Vec<(Uuid, Vec<u8>)>, StoreError> {
        let mut tx = self.begin_read().await?;
        let objects = objects(&mut tx, site, level, draft).await?;
        tx.rollback().await?;
        Ok(objects)
    }

    /// The objects that the entry at `revision` put, as their columns.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn gdb_objects_put(
        &self,
        site: &str,
        level: &str,
        revision: i64,
    ) -> Result<Vec<(Uuid, Vec<u8>)>, StoreError> {
        let rows = sqlx::query(
            "select object, content from gdb_objects where site = $1 and level = $2 \
             and revision = $3 and content is not null",
        )
        .bind(site)
        .bind(level)
        .bind(revision)
        .fetch_all(self.reads())
        .await?;
        rows.iter().map(|row| Ok((object_id(row)?, get(row, OBJECTS, "content")?))).collect()
    }

    /// A page of the entries about a level's GDB, newest first: at most `limit`, older than revision
    /// `before` if there is one. The answer's `next` is the `before` of the next page.
    ///
    /// # Errors
    /// The store fails.
    pub async fn gdb_page(
        &self,
        site: &str,
        level: &str,
        before: Option<i64>,
        limit: u32,
    ) -> Result<v1::GdbEntryPage, StoreError> {
        let select = entries!("and revision < $3 order by revision desc limit $4");
        let (entries, next) =
            self.page(select, (site, level), before, limit, describe, |last| last.revision).await?;
        Ok(v1::GdbEntryPage { entries, next })
    }

    /// One entry about a level's GDB.
    ///
    /// # Errors
    /// The store fails.
    pub async fn gdb_entry(
        &self,
        site: &str,
        level: &str,
        revision: i64,
    ) -> Result<Option<v1::GdbEntry>, StoreError> {
        let row = sqlx::query(entries!("and revision = $3"))
            .bind(site)
            .bind(level)
            .bind(revision)
            .fetch_optional(self.reads())
            .await?;
        row.map(|row| describe(&row)).transpose()
    }

    /// How many entries about the GDB there are up to revision `until`.
    ///
    /// # Errors
    /// The store fails.
    pub async fn gdb_entry_count(
        &self,
        site: &str,
        level: &str,
        until: i64,
    ) -> Result<i64, StoreError> {
        let row = sqlx::query(
            "select count(*) as entries from gdb_entries where site = $1 and level = $2 \
             and revision <= $3",
        )
        .bind(site)
        .bind(level)
        .bind(until)
        .fetch_one(self.reads())
        .await?;
        get(&row, ENTRIES, "entries")
    }
}

/// Revision of the first entry about the GDB after revision `after`.
pub(in super::super) async fn first_entry_after(
    tx: &mut Tx,
    site: &str,
    level: &str,
    after: i64,
) -> Result<Option<i64>, StoreError> {
    let row = sqlx::query(
        "select revision from gdb_entries where site = $1 and level = $2 and revision > $3 \
         order by revision limit 1",
    )
    .bind(site)
    .bind(level)
    .bind(after)
    .fetch_optional(&mut **tx)
    .await?;
    row.map(|row| get(&row, ENTRIES, "revision")).transpose()
}

pub(super) async fn state(tx: &mut Tx, site: &str, level: &str) -> Result<GdbState, StoreError> {
    let row = sqlx::query(
        "select draft, object_count from gdb_entries where site = $1 and level = $2 \
         and kind = 'edit' order by revision desc limit 1",
    )
    .bind(site)
    .bind(level)
    .fetch_optional(&mut **tx)
    .await?;
    let (draft, objects) = match row {
        Some(row) => (get(&row, ENTRIES, "draft")?, get(&row, ENTRIES, "object_count")?),
        None => (0, 0),
    };
    Ok(GdbState {
        draft: GdbVersion { draft, library: library_revision(tx, site).await? },
        objects,
        published: publication(tx, site, level, i64::MAX).await?,
    })
}

async fn publication(
    tx: &mut Tx,
    site: &str,
    level: &str,
    until: i64,
) -> Result<Option<Publication>, StoreError> {
    let row = sqlx::query(
        "select revision, draft, library from gdb_entries where site = $1 and level = $2 \
         and kind = 'publication' and revision <= $3 order by revision desc limit 1",
    )
    .bind(site)
    .bind(level)
    .bind(until)
    .fetch_optional(&mut **tx)
    .await?;
    let publication = row.map(|row| {
        let version = GdbVersion {
            draft: get(&row, ENTRIES, "draft")?,
            library: get(&row, ENTRIES, "library")?,
        };
        Ok(Publication { revision: get(&row, ENTRIES, "revision")?, version })
    });
    publication.transpose()
}

pub(super) async fn objects(
    tx: &mut Tx,
    site: &str,
    level: &str,
    draft: i64,
) -> Result<Vec<(Uuid, Vec<u8>)>, StoreError> {
    let rows = sqlx::query(
        "select o.object, o.content from gdb_objects o where o.site = $1 and o.level = $2 \
         and o.content is not null and o.revision = (select max(p.revision) from gdb_objects p \
         where p.site = o.site and p.level = o.level and p.object = o.object and p.revision <= $3)",
    )
    .bind(site)
    .bind(level)
    .bind(draft)
    .fetch_all(&mut **tx)
    .await?;
    rows.iter().map(|row| Ok((object_id(row)?, get(row, OBJECTS, "content")?))).collect()
}
