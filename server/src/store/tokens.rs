//! Bearer tokens. Only the SHA-256 of a secret is ever stored.

use mapfold_schema::v1;
use sqlx::any::AnyRow;

use super::row::{corrupt, get};
use super::{Store, StoreError};

const TABLE: &str = "tokens";

/// A token as it is on disk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TokenRow {
    /// Public identity.
    pub id: String,
    /// SHA-256 of the secret.
    pub secret_sha256: [u8; 32],
    /// The site that it is bound to; none for all sites.
    pub site: Option<String>,
    /// The robot that it speaks for, if it speaks for one.
    pub robot: Option<String>,
    /// What it allows, ascending.
    pub scopes: Vec<v1::Scope>,
    /// When it was made, microseconds since 1970.
    pub created_at_us: i64,
    /// When it ends, microseconds since 1970; none for never.
    pub expires_at_us: Option<i64>,
    /// When it was revoked, microseconds since 1970.
    pub revoked_at_us: Option<i64>,
}

impl Store {
    /// Stores a new token.
    ///
    /// # Errors
    /// [`StoreError::AlreadyExists`] for an id that is taken, [`StoreError::Missing`] for a site
    /// or a robot that is not there.
    pub async fn create_token(&self, token: &TokenRow) -> Result<(), StoreError> {
        let scopes =
            serde_json::to_string(&token.scopes).map_err(|e| corrupt(TABLE, "scopes", e))?;
        let made = sqlx::query(
            "insert into tokens (token, secret_sha256, site, robot, scopes, created_at_us, \
             expires_at_us, revoked_at_us) values ($1, $2, $3, $4, $5, $6, $7, $8) \
             on conflict (token) do nothing",
        )
        .bind(token.id.as_str())
        .bind(token.secret_sha256.as_slice())
        .bind(token.site.as_deref())
        .bind(token.robot.as_deref())
        .bind(scopes)
        .bind(token.created_at_us)
        .bind(token.expires_at_us)
        .bind(token.revoked_at_us)
        .execute(self.writes())
        .await
        .map_err(|error| match (&token.robot, &token.site) {
            (Some(robot), _) if StoreError::is_missing_reference(&error) => {
                StoreError::Missing { kind: "robot", name: robot.clone() }
            }
            (None, Some(site)) if StoreError::is_missing_reference(&error) => {
                StoreError::Missing { kind: "site", name: site.clone() }
            }
            _ => error.into(),
        })?;
        if made.rows_affected() == 0 {
            return Err(StoreError::AlreadyExists { kind: "token", name: token.id.clone() });
        }
        Ok(())
    }

    /// A token, also an expired or revoked one.
    ///
    /// # Errors
    /// The store fails.
    pub async fn token_by_id(&self, id: &str) -> Result<Option<TokenRow>, StoreError> {
        sqlx::query(
            "select token, secret_sha256, site, robot, scopes, created_at_us, expires_at_us, \
             revoked_at_us from tokens where token = $1",
        )
        .bind(id)
        .fetch_optional(self.reads())
        .await?
        .map(|row| TokenRow::try_from(&row))
        .transpose()
    }

    /// All tokens, by the time they were made.
    ///
    /// # Errors
    /// The store fails.
    pub async fn tokens(&self) -> Result<Vec<TokenRow>, StoreError> {
        let rows = sqlx::query(
            "select token, secret_sha256, site, robot, scopes, created_at_us, expires_at_us, \
             revoked_at_us from tokens",
        )
        .fetch_all(self.reads())
        .await?;
        let mut tokens = rows.iter().map(TokenRow::try_from).collect::<Result<Vec<_>, _>>()?;
        tokens.sort_by(|a, b| (a.created_at_us, &a.id).cmp(&(b.created_at_us, &b.id)));
        Ok(tokens)
    }

    /// Revokes a token; whether there was one to revoke. One that is revoked stays as it was.
    ///
    /// # Errors
    /// The store fails.
    pub async fn revoke_token(&self, id: &str, revoked_at_us: i64) -> Result<bool, StoreError> {
        let revoked = sqlx::query(
            "update tokens set revoked_at_us = $2 where token = $1 and revoked_at_us is null",
        )
        .bind(id)
        .bind(revoked_at_us)
        .execute(self.writes())
        .await?;
        Ok(revoked.rows_affected() > 0)
    }
}

impl TryFrom<&AnyRow> for TokenRow {
    type Error = StoreError;

    fn try_from(row: &AnyRow) -> Result<Self, StoreError> {
        let secret: Vec<u8> = get(row, TABLE, "secret_sha256")?;
        let scopes: String = get(row, TABLE, "scopes")?;
        Ok(Self {
            id: get(row, TABLE, "token")?,
            secret_sha256: secret
                .as_slice()
                .try_into()
                .map_err(|e| corrupt(TABLE, "secret_sha256", e))?,
            site: get(row, TABLE, "site")?,
            robot: get(row, TABLE, "robot")?,
            scopes: serde_json::from_str(&scopes).map_err(|e| corrupt(TABLE, "scopes", e))?,
            created_at_us: get(row, TABLE, "created_at_us")?,
            expires_at_us: get(row, TABLE, "expires_at_us")?,
            revoked_at_us: get(row, TABLE, "revoked_at_us")?,
        })
    }
}
