//! Sites: plants or buildings, the unit of tenancy and permissions.

use mapfold_schema::v1;
use sqlx::any::AnyRow;

use super::row::get;
use super::{Store, StoreError};

const TABLE: &str = "sites";

impl Store {
    /// Makes a site.
    ///
    /// # Errors
    /// [`StoreError::AlreadyExists`] for a slug that is taken.
    pub async fn create_site(
        &self,
        site: &str,
        name: &str,
        created_at_us: i64,
    ) -> Result<v1::SiteDescription, StoreError> {
        let made = sqlx::query(
            "insert into sites (site, name, created_at_us) values ($1, $2, $3) \
             on conflict (site) do nothing",
        )
        .bind(site)
        .bind(name)
        .bind(created_at_us)
        .execute(self.writes())
        .await?;
        if made.rows_affected() == 0 {
            return Err(StoreError::AlreadyExists { kind: "site", name: site.to_owned() });
        }
        Ok(v1::SiteDescription { site: site.to_owned(), name: name.to_owned(), levels: Vec::new() })
    }

    /// A site and the slugs of its levels.
    ///
    /// # Errors
    /// The store fails.
    pub async fn site(&self, site: &str) -> Result<Option<v1::SiteDescription>, StoreError> {
        let rows = sqlx::query(
            "select s.site, s.name, l.level from sites s \
             left join levels l on l.site = s.site where s.site = $1",
        )
        .bind(site)
        .fetch_all(self.reads())
        .await?;
        Ok(describe(&rows)?.pop())
    }

    /// All sites, by slug.
    ///
    /// # Errors
    /// The store fails.
    pub async fn sites(&self) -> Result<Vec<v1::SiteDescription>, StoreError> {
        let rows = sqlx::query(
            "select s.site, s.name, l.level from sites s left join levels l on l.site = s.site",
        )
        .fetch_all(self.reads())
        .await?;
        describe(&rows)
    }
}

/// Groups rows of (site, name, level or null). Sorts here, because the engines sort text by
/// different rules.
fn describe(rows: &[AnyRow]) -> Result<Vec<v1::SiteDescription>, StoreError> {
    let mut triples = Vec::with_capacity(rows.len());
    for row in rows {
        let site: String = get(row, TABLE, "site")?;
        let level: Option<String> = get(row, TABLE, "level")?;
        let name: String = get(row, TABLE, "name")?;
        triples.push((site, level, name));
    }
    triples.sort_unstable();
    let mut sites: Vec<v1::SiteDescription> = Vec::new();
    for (site, level, name) in triples {
        match sites.last_mut() {
            Some(last) if last.site == site => last.levels.extend(level),
            _ => sites.push(v1::SiteDescription { site, name, levels: Vec::from_iter(level) }),
        }
    }
    Ok(sites)
}
