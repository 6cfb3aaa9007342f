//! What others did to a draft since somebody looked at it.

use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::v1;
use uuid::Uuid;

use super::super::StoreError;
use super::super::row::get;
use super::super::transaction::Tx;
use super::{ENTRIES, Expected, GdbVersion, OBJECTS, describe, entries, object_id};

/// Entries and changes that are told one by one.
const TOLD_MAX: i64 = 32;

/// An object that is another than it was.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ObjectChange {
    /// Which.
    pub object: Uuid,
    /// The edit that changed it last.
    pub revision: i64,
    /// Whether it is no more.
    pub is_removed: bool,
    /// Public id of the token that asked for it.
    pub author: String,
    /// When.
    pub at: String,
}

/// A draft has moved on.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Stale {
    /// The newest draft that the author may have seen.
    pub seen: GdbVersion,
    /// The draft as it is.
    pub now: GdbVersion,
    /// The edits since, newest first, at most 32.
    pub entries: Vec<v1::GdbEntry>,
    /// Objects that changed since, latest first, at most 32.
    pub changes: Vec<ObjectChange>,
}

pub(super) async fn stale(
    tx: &mut Tx,
    site: &str,
    level: &str,
    expected: &Expected,
    now: GdbVersion,
) -> Result<Stale, StoreError> {
    let seen = match expected {
        Expected::OneOf(versions) => versions.iter().max().copied(),
        Expected::Any => None,
    };
    let seen = seen.unwrap_or(now);
    let rows = sqlx::query(entries!(
        "and kind = 'edit' and revision > $3 order by revision desc limit $4"
    ))
    .bind(site)
    .bind(level)
    .bind(seen.draft)
    .bind(TOLD_MAX)
    .fetch_all(&mut **tx)
    .await?;
    let entries = rows.iter().map(describe).collect::<Result<Vec<_>, _>>()?;
    let rows = sqlx::query(
        "select o.object, o.revision, case when o.content is null then 1 else 0 end as removed, \
         e.author, e.at_us from gdb_objects o join gdb_entries e on e.site = o.site \
         and e.level = o.level and e.revision = o.revision where o.site = $1 and o.level = $2 \
         and o.revision > $3 and o.revision = (select max(p.revision) from gdb_objects p \
         where p.site = o.site and p.level = o.level and p.object = o.object) \
         order by o.revision desc, o.object limit $4",
    )
    .bind(site)
    .bind(level)
    .bind(seen.draft)
    .bind(TOLD_MAX)
    .fetch_all(&mut **tx)
    .await?;
    let change = |row| {
        // Engines differ in how wide a number they make of a `case`.
        let removed: i64 = match get::<i64>(row, OBJECTS, "removed") {
            Ok(wide) => wide,
            Err(_) => i64::from(get::<i32>(row, OBJECTS, "removed")?),
        };
        Ok(ObjectChange {
            object: object_id(row)?,
            revision: get(row, OBJECTS, "revision")?,
            is_removed: removed != 0,
            author: get(row, ENTRIES, "author")?,
            at: to_rfc3339(get(row, ENTRIES, "at_us")?),
        })
    };
    let changes = rows.iter().map(change).collect::<Result<Vec<_>, StoreError>>()?;
    Ok(Stale { seen, now, entries, changes })
}
