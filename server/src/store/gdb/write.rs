//! Edits and publications into a level's log.

use std::collections::BTreeMap;

use uuid::Uuid;

use super::super::acts::next_revision;
use super::super::row::get;
use super::super::transaction::Tx;
use super::super::values::{Bulk, bulk, bulk_in};
use super::super::{Store, StoreError, retried};
use super::read::{objects, state};
use super::stale::stale;
use super::{
    GdbChange, GdbOutcome, GdbState, GdbVersion, NewGdbEntry, OBJECTS, describe, entries, object_id,
};

static INSERT_OBJECTS: Bulk = bulk!(
    "insert into gdb_objects (site, level, object, revision, content) values ",
    5,
    from 1,
    ""
);

static NAMED: Bulk = bulk_in!(
    "select object, revision, content from gdb_objects where site = $1 and level = $2 \
     and object in ",
    from 3,
    " order by revision"
);

/// What an object becomes; `None` if it is no more.
type Changed = Vec<(Uuid, Option<Vec<u8>>)>;

/// A line of the log that is about to be written.
struct Line {
    revision: i64,
    kind: &'static str,
    version: GdbVersion,
    put: i64,
    removed: i64,
    objects: i64,
}

impl Store {
    /// Changes the draft of a level's GDB, as one entry of its log. When it returns, that is on disk.
    /// What is asked for and is so already is no change, whatever draft it was asked on: so an
    /// edit whose answer was lost may be sent again.
    ///
    /// # Errors
    /// [`StoreError::Missing`] for a level that is not there; otherwise nothing has changed, except that
    /// [`StoreError::Unavailable`] leaves it open: asking again does no harm.
    pub async fn edit_gdb(
        &self,
        site: &str,
        level: &str,
        new: &NewGdbEntry,
        change: &GdbChange,
        objects_max: i64,
    ) -> Result<GdbOutcome, StoreError> {
        retried("edit_gdb", || self.try_edit_gdb(site, level, new, change, objects_max)).await
    }

    async fn try_edit_gdb(
        &self,
        site: &str,
        level: &str,
        new: &NewGdbEntry,
        change: &GdbChange,
        objects_max: i64,
    ) -> Result<GdbOutcome, StoreError> {
        let mut tx = self.begin_write().await?;
        let revision = next_revision(&mut tx, site, level).await?;
        let state = state(&mut tx, site, level).await?;
        let (changed, put, added) = differences(&mut tx, site, level, &state, change).await?;
        let objects = state.objects + added;
        let refusal = if changed.is_empty() {
            Some(GdbOutcome::Same(state))
        } else if !new.expected.allows(state.draft) {
            let stale = stale(&mut tx, site, level, &new.expected, state.draft).await?;
            Some(GdbOutcome::Stale(stale))
        } else if objects > objects_max {
            Some(GdbOutcome::TooMany { objects })
        } else {
            None
        };
        if let Some(refusal) = refusal {
            tx.rollback().await?;
            return Ok(refusal);
        }
        for (statement, piece) in INSERT_OBJECTS.statements(&changed) {
            let mut query = sqlx::query(statement);
            for (object, content) in piece {
                query = query
                    .bind(site)
                    .bind(level)
                    .bind(object.to_string())
                    .bind(revision)
                    .bind(content.as_deref());
            }
            query.execute(&mut *tx).await?;
        }
        let line = Line {
            revision,
            kind: "edit",
            version: GdbVersion { draft: revision, library: state.draft.library },
            put,
            removed: changed.len() as i64 - put,
            objects,
        };
        finish(tx, site, level, new, &line).await
    }

    /// Publishes the draft of a level's GDB, as one entry of its log. When it returns, that is on disk.
    /// What is published already stays so.
    ///
    /// # Errors
    /// As for [`Self::edit_gdb`].
    pub async fn publish_gdb(
        &self,
        site: &str,
        level: &str,
        new: &NewGdbEntry,
    ) -> Result<GdbOutcome, StoreError> {
        retried("publish_gdb", || self.try_publish_gdb(site, level, new)).await
    }

    async fn try_publish_gdb(
        &self,
        site: &str,
        level: &str,
        new: &NewGdbEntry,
    ) -> Result<GdbOutcome, StoreError> {
        let mut tx = self.begin_write().await?;
        let revision = next_revision(&mut tx, site, level).await?;
        let state = state(&mut tx, site, level).await?;
        if !new.expected.allows(state.draft) {
            let stale = stale(&mut tx, site, level, &new.expected, state.draft).await?;
            tx.rollback().await?;
            return Ok(GdbOutcome::Stale(stale));
        }
        if state.published.is_some_and(|published| published.version == state.draft) {
            tx.rollback().await?;
            return Ok(GdbOutcome::Same(state));
        }
        let line = Line {
            revision,
            kind: "publication",
            version: state.draft,
            put: 0,
            removed: 0,
            objects: state.objects,
        };
        finish(tx, site, level, new, &line).await
    }
}

/// Which objects a change makes others; how many it puts, and by how many the model grows.
async fn differences(
    tx: &mut Tx,
    site: &str,
    level: &str,
    state: &GdbState,
    change: &GdbChange,
) -> Result<(Changed, i64, i64), StoreError> {
    let (now, put, removed): (BTreeMap<Uuid, Vec<u8>>, _, Vec<Uuid>) = match change {
        GdbChange::Replace(put) => {
            let now = objects(tx, site, level, state.draft.draft).await?;
            let now: BTreeMap<Uuid, Vec<u8>> = now.into_iter().collect();
            let removed = now.keys().filter(|id| !put.contains_key(id)).copied().collect();
            (now, put, removed)
        }
        GdbChange::Edit { put, removed } => {
            let named: Vec<String> = put.keys().chain(removed).map(ToString::to_string).collect();
            let now = named_objects(tx, site, level, &named).await?;
            let removed = removed.iter().filter(|id| now.contains_key(id)).copied().collect();
            (now, put, removed)
        }
    };
    let mut changed: Changed = Vec::new();
    let mut new = 0;
    for (id, content) in put {
        let before = now.get(id);
        if before != Some(content) {
            new += i64::from(before.is_none());
            changed.push((*id, Some(content.clone())));
        }
    }
    let put = changed.len() as i64;
    let added = new - removed.len() as i64;
    changed.extend(removed.into_iter().map(|id| (id, None)));
    Ok((changed, put, added))
}

/// The named objects of the draft that is there now.
async fn named_objects(
    tx: &mut Tx,
    site: &str,
    level: &str,
    named: &[String],
) -> Result<BTreeMap<Uuid, Vec<u8>>, StoreError> {
    let mut latest: BTreeMap<Uuid, Option<Vec<u8>>> = BTreeMap::new();
    for (statement, piece) in NAMED.statements(named) {
        let mut query = sqlx::query(statement).bind(site).bind(level);
        for id in piece {
            query = query.bind(id.as_str());
        }
        for row in query.fetch_all(&mut **tx).await? {
            // In the order of revisions: the last one counts.
            latest.insert(object_id(&row)?, get(&row, OBJECTS, "content")?);
        }
    }
    Ok(latest.into_iter().filter_map(|(id, content)| Some((id, content?))).collect())
}

/// Writes the entry, reads it back and commits.
async fn finish(
    mut tx: Tx,
    site: &str,
    level: &str,
    new: &NewGdbEntry,
    line: &Line,
) -> Result<GdbOutcome, StoreError> {
    sqlx::query(
        "insert into gdb_entries (site, level, revision, entry, kind, draft, library, author, at_us, \
         comment, put_count, removed_count, object_count) \
         values ($1, $2, $3, $4, $5, $6, $7, $8, $9, $10, $11, $12, $13)",
    )
    .bind(site)
    .bind(level)
    .bind(line.revision)
    .bind(new.id.to_string())
    .bind(line.kind)
    .bind(line.version.draft)
    .bind(line.version.library)
    .bind(new.author.as_str())
    .bind(new.at_us)
    .bind(new.comment.as_str())
    .bind(line.put)
    .bind(line.removed)
    .bind(line.objects)
    .execute(&mut *tx)
    .await?;
    let row = sqlx::query(entries!("and revision = $3"))
        .bind(site)
        .bind(level)
        .bind(line.revision)
        .fetch_one(&mut *tx)
        .await?;
    let entry = describe(&row)?;
    tx.commit().await?;
    Ok(GdbOutcome::Done(entry))
}
