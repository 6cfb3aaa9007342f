//! Pages of what a level's log holds, newest first.

use sqlx::any::AnyRow;

use super::{Store, StoreError};

impl Store {
    /// A page: at most `limit` rows, older than revision `before` if there is one; and the `before` of the
    /// next page. `select` takes the site, the level, a revision that all rows are older than, and how many
    /// are read.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub(super) async fn page<T>(
        &self,
        select: &'static str,
        (site, level): (&str, &str),
        before: Option<i64>,
        limit: u32,
        describe: impl Fn(&AnyRow) -> Result<T, StoreError>,
        revision: impl FnOnce(&T) -> i64,
    ) -> Result<(Vec<T>, Option<String>), StoreError> {
        let rows = sqlx::query(select)
            .bind(site)
            .bind(level)
            .bind(before.unwrap_or(i64::MAX))
            .bind(i64::from(limit) + 1)
            .fetch_all(self.reads())
            .await?;
        let mut described = rows.iter().map(describe).collect::<Result<Vec<_>, _>>()?;
        let next = next_page(&mut described, limit, revision);
        Ok((described, next))
    }
}

/// Takes the row that was read beyond a page off again, and tells the `before` of the next page if there
/// was one: the revision of the last row that stays.
pub(super) fn next_page<T>(
    rows: &mut Vec<T>,
    limit: u32,
    revision: impl FnOnce(&T) -> i64,
) -> Option<String> {
    let more = rows.len() > limit as usize;
    rows.truncate(limit as usize);
    rows.last().filter(|_| more).map(|last| revision(last).to_string())
}
