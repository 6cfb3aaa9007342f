//! Who may do what: bearer tokens, their scopes, and the site and robot they are bound to.
//! Knows the store; knows no HTTP.
//!
//! A token reads `mapd_<id>_<secret>`: a public id of 12 characters by which it is listed and
//! revoked, and 43 base62 characters (256 bits) that only its holder knows. Only the SHA-256 of
//! the whole text is stored, which suffices for a secret that nobody can guess. A token that people chose
//! themselves (`MAPFOLD_ADMIN_TOKEN`) has an id made from its digest.
//!
//! An operator's session is a token too: it ends by itself, and its id, `<parent>-<8 characters>`,
//! names the token it was made from, with which it is revoked. Replicas need nothing else.

mod token;

use mapfold_schema::v1::Scope;
use subtle::ConstantTimeEq;

use crate::chance::Chance;
use crate::store::tokens::TokenRow;
use crate::store::{Store, StoreError};

pub use token::Token;

/// How long an operator stays signed in, microseconds.
pub const SESSION_US: i64 = 12 * 3600 * 1_000_000;

/// Who makes a request, and what they may do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Principal {
    /// Public id of the token.
    pub token_id: String,
    /// The only site they reach; all if none.
    pub site: Option<String>,
    /// The only robot they speak for; any if none.
    pub robot: Option<String>,
    /// What they may do.
    pub scopes: Vec<Scope>,
    /// When it ends, microseconds since 1970.
    pub expires_at_us: Option<i64>,
}

impl Principal {
    /// Whether they may do what needs `scope`.
    pub fn allows(&self, scope: Scope) -> bool {
        self.scopes.contains(&scope) || self.scopes.contains(&Scope::Admin)
    }

    /// Whether `site` exists for them. What they do not reach they are not told of either.
    pub fn reaches(&self, site: &str) -> bool {
        self.site.as_deref().is_none_or(|own| own == site)
    }

    /// Whether they may speak for `robot`.
    pub fn speaks_for(&self, robot: &str) -> bool {
        self.robot.as_deref().is_none_or(|own| own == robot)
    }
}

/// Whom a new token is for, and what it allows.
#[derive(Debug, Clone, Default)]
pub struct Grant {
    /// The site it is bound to; all sites if none.
    pub site: Option<String>,
    /// The robot it speaks for.
    pub robot: Option<String>,
    /// What it allows.
    pub scopes: Vec<Scope>,
    /// When it ends, microseconds since 1970; never if none.
    pub expires_at_us: Option<i64>,
}

fn row(token: &Token, grant: &Grant, now_us: i64) -> TokenRow {
    let mut scopes = grant.scopes.clone();
    scopes.sort_unstable();
    scopes.dedup();
    TokenRow {
        id: token.id().to_owned(),
        secret_sha256: token.digest(),
        site: grant.site.clone(),
        robot: grant.robot.clone(),
        scopes,
        created_at_us: now_us,
        expires_at_us: grant.expires_at_us,
        revoked_at_us: None,
    }
}

/// Makes a token and stores all of it but its secret.
///
/// # Errors
/// The store fails, or the site or the robot is not there.
pub async fn issue(
    store: &Store,
    chance: &Chance,
    grant: &Grant,
    now_us: i64,
) -> Result<Token, StoreError> {
    let token = chance.with(|rng| Token::generate(rng));
    store.create_token(&row(&token, grant, now_us)).await?;
    Ok(token)
}

/// On the very first start, when there is no token at all: makes the admin token, from `chosen`
/// if people chose one. Answers the token only when it was made up here, and so must be shown.
///
/// # Errors
/// The store fails.
pub async fn admit_first_admin(
    store: &Store,
    chance: &Chance,
    chosen: Option<Token>,
    now_us: i64,
) -> Result<Option<Token>, StoreError> {
    if !store.tokens().await?.is_empty() {
        return Ok(None);
    }
    let grant = Grant { scopes: vec![Scope::Admin], ..Grant::default() };
    match chosen {
        Some(token) => {
            store.create_token(&row(&token, &grant, now_us)).await?;
            Ok(None)
        }
        None => issue(store, chance, &grant, now_us).await.map(Some),
    }
}

/// Makes a session from the token of `parent`: the same rights for [`SESSION_US`], or for as long
/// as the parent lasts.
///
/// # Errors
/// The store fails.
pub async fn open_session(
    store: &Store,
    chance: &Chance,
    parent: &Principal,
    now_us: i64,
) -> Result<(Token, Principal), StoreError> {
    let under = token::parent_id(&parent.token_id);
    let token = chance.with(|rng| Token::generate_under(rng, under));
    let ends = now_us.saturating_add(SESSION_US);
    let ends = parent.expires_at_us.map_or(ends, |parent_ends| parent_ends.min(ends));
    let grant = Grant {
        site: parent.site.clone(),
        robot: parent.robot.clone(),
        scopes: parent.scopes.clone(),
        expires_at_us: Some(ends),
    };
    store.create_token(&row(&token, &grant, now_us)).await?;
    let session =
        Principal { token_id: token.id().to_owned(), expires_at_us: Some(ends), ..parent.clone() };
    Ok((token, session))
}

/// Public id of the token that people gave the principal: a session's is the one that it was
/// opened with.
pub fn granted_by(principal: &Principal) -> &str {
    token::parent_id(&principal.token_id)
}

/// Whether the principal's token is a session's.
pub fn is_session(principal: &Principal) -> bool {
    token::parent_id(&principal.token_id) != principal.token_id
}

/// Whose token this is; `None` if it is nobody's, has ended or was revoked (or, for a session, if
/// that is true of the token it was made from).
///
/// # Errors
/// The store fails.
pub async fn authenticate(
    store: &Store,
    token: &Token,
    now_us: i64,
) -> Result<Option<Principal>, StoreError> {
    let Some(row) = live_row(store, token.id(), now_us).await? else { return Ok(None) };
    if !bool::from(row.secret_sha256.ct_eq(&token.digest())) {
        return Ok(None);
    }
    let parent = token::parent_id(token.id());
    if parent != token.id() && live_row(store, parent, now_us).await?.is_none() {
        return Ok(None);
    }
    Ok(Some(Principal {
        token_id: row.id,
        site: row.site,
        robot: row.robot,
        scopes: row.scopes,
        expires_at_us: row.expires_at_us,
    }))
}

/// Whether the principal's token still stands: for streams, which outlive the request that opened
/// them.
///
/// # Errors
/// The store fails.
pub async fn still_stands(
    store: &Store,
    principal: &Principal,
    now_us: i64,
) -> Result<bool, StoreError> {
    let id = principal.token_id.as_str();
    let parent = token::parent_id(id);
    Ok(live_row(store, id, now_us).await?.is_some()
        && (parent == id || live_row(store, parent, now_us).await?.is_some()))
}

async fn live_row(store: &Store, id: &str, now_us: i64) -> Result<Option<TokenRow>, StoreError> {
    Ok(store.token_by_id(id).await?.filter(|row| {
        row.revoked_at_us.is_none() && row.expires_at_us.is_none_or(|ends| now_us < ends)
    }))
}
