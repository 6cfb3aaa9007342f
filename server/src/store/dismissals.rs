//! Changes against the GDB that operators dismissed.

use std::collections::BTreeMap;

use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::v1::Dismissal;
use sqlx::any::AnyRow;

use super::row::get;
use super::{Store, StoreError};

const TABLE: &str = "dismissals";

impl Store {
    /// The dismissals of a level, by the identities of changes.
    ///
    /// # Errors
    /// The store fails, or a row is spoilt.
    pub async fn dismissals(
        &self,
        site: &str,
        level: &str,
    ) -> Result<BTreeMap<String, Dismissal>, StoreError> {
        let rows = sqlx::query(
            "select change, author, at_us, comment from dismissals where site = $1 and level = $2",
        )
        .bind(site)
        .bind(level)
        .fetch_all(self.reads())
        .await?;
        let dismissal = |row: &AnyRow| {
            let dismissal = Dismissal {
                author: get(row, TABLE, "author")?,
                at: to_rfc3339(get(row, TABLE, "at_us")?),
                comment: get(row, TABLE, "comment")?,
            };
            Ok((get(row, TABLE, "change")?, dismissal))
        };
        rows.iter().map(dismissal).collect()
    }

    /// Dismisses a change. One that is dismissed already stays as it is.
    ///
    /// # Errors
    /// The store fails. After [`StoreError::Unavailable`] it is open whether it has happened; asking
    /// again does no harm.
    pub async fn dismiss(
        &self,
        [site, level, change]: [&str; 3],
        author: &str,
        at_us: i64,
        comment: &str,
    ) -> Result<(), StoreError> {
        sqlx::query(
            "insert into dismissals (site, level, change, author, at_us, comment) \
             values ($1, $2, $3, $4, $5, $6) on conflict (site, level, change) do nothing",
        )
        .bind(site)
        .bind(level)
        .bind(change)
        .bind(author)
        .bind(at_us)
        .bind(comment)
        .execute(self.writes())
        .await?;
        Ok(())
    }

    /// Takes a dismissal back.
    ///
    /// # Errors
    /// As for [`Self::dismiss`].
    pub async fn reopen(&self, [site, level, change]: [&str; 3]) -> Result<(), StoreError> {
        sqlx::query("delete from dismissals where site = $1 and level = $2 and change = $3")
            .bind(site)
            .bind(level)
            .bind(change)
            .execute(self.writes())
            .await?;
        Ok(())
    }
}
