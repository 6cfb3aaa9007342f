//! `token create|list|revoke`.

use std::process::ExitCode;

use mapfold_schema::instant::to_rfc3339;
use serde_json::json;

use super::args::{TokenCommand, TokenCreate};
use super::{CommandError, say};
use crate::auth::{self, Grant};
use crate::chance::Chance;
use crate::clock::{Clock as _, SystemClock};
use crate::config::Config;
use crate::running::{StartError, open_store};
use crate::store::Store;

const DAY_US: i64 = 24 * 3600 * 1_000_000;

pub(super) async fn run(config: &Config, command: TokenCommand) -> Result<ExitCode, CommandError> {
    let store = open_store(config).await?;
    let now_us = SystemClock::start().now_us();
    let status = match command {
        TokenCommand::Create(create) => self::create(&store, create, now_us).await?,
        TokenCommand::List => list(&store).await?,
        TokenCommand::Revoke { id } => revoke(&store, &id, now_us).await?,
    };
    store.close().await;
    Ok(status)
}

async fn create(store: &Store, new: TokenCreate, now_us: i64) -> Result<ExitCode, CommandError> {
    let chance = Chance::from_system().map_err(StartError::from)?;
    let grant = Grant {
        site: new.site,
        robot: new.robot,
        scopes: new.scopes.into_iter().map(Into::into).collect(),
        expires_at_us: new.days.map(|days| now_us.saturating_add(days * DAY_US)),
    };
    let token = auth::issue(store, &chance, &grant, now_us).await?;
    say(token.reveal())?;
    Ok(ExitCode::SUCCESS)
}

/// One JSON object a line.
async fn list(store: &Store) -> Result<ExitCode, CommandError> {
    for row in store.tokens().await? {
        let line = json!({
            "id": row.id,
            "site": row.site,
            "robot": row.robot,
            "scopes": row.scopes,
            "created_at": to_rfc3339(row.created_at_us),
            "expires_at": row.expires_at_us.map(to_rfc3339),
            "revoked_at": row.revoked_at_us.map(to_rfc3339),
        });
        say(&line.to_string())?;
    }
    Ok(ExitCode::SUCCESS)
}

async fn revoke(store: &Store, id: &str, now_us: i64) -> Result<ExitCode, CommandError> {
    if store.revoke_token(id, now_us).await? {
        say(&format!("{id} is revoked"))?;
        Ok(ExitCode::SUCCESS)
    } else {
        Err(CommandError::Refused(format!("there is no token {id:?}")))
    }
}
