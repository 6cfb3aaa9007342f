//! Who makes a request, and whether they may: extractors, one per scope.
//!
//! What a token does not reach does not exist for it: another site's things are not found, like
//! things that never were.

use std::marker::PhantomData;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::{FromRequestParts, RawPathParams};
use axum::http::header::{AUTHORIZATION, COOKIE, HOST, ORIGIN};
use axum::http::request::Parts;
use axum::http::{HeaderMap, Method};
use mapfold_schema::v1::Scope;

use super::problem::ApiError;
use super::state::App;
use crate::auth::{self, Principal, Token};
use crate::level::{LevelHandle, SinceError, Snapshot};

/// Name of the cookie that bears a session's token.
pub(super) const SESSION_COOKIE: &str = "mapfold_session";
/// How long a read waits for a revision that another replica has shown already.
pub(super) const REPLICA_PATIENCE: Duration = Duration::from_secs(2);

/// A scope that a handler needs, as a type.
pub(super) trait Needs: Send + 'static {
    const SCOPE: Scope;
}

/// Needs `map:read`.
pub(super) struct Read;
/// Needs `map:contribute`.
pub(super) struct Contribute;
/// Needs `map:edit`.
pub(super) struct Edit;
/// Needs `map:publish`.
pub(super) struct Publish;
/// Needs `admin`.
pub(super) struct Admin;

impl Needs for Read {
    const SCOPE: Scope = Scope::MapRead;
}

impl Needs for Contribute {
    const SCOPE: Scope = Scope::MapContribute;
}

impl Needs for Edit {
    const SCOPE: Scope = Scope::MapEdit;
}

impl Needs for Publish {
    const SCOPE: Scope = Scope::MapPublish;
}

impl Needs for Admin {
    const SCOPE: Scope = Scope::Admin;
}

/// Somebody with a valid token, whatever it allows.
pub(super) struct Caller(pub(super) Principal);

impl FromRequestParts<App> for Caller {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self, ApiError> {
        let (text, from_cookie) = match bearer(&parts.headers) {
            Some(text) => (text, false),
            None => (
                cookie(&parts.headers).ok_or(ApiError::Unauthenticated { presented: false })?,
                true,
            ),
        };
        let invalid = ApiError::Unauthenticated { presented: true };
        let Some(token) = Token::parse(text) else { return Err(invalid) };
        let principal = auth::authenticate(app.store(), &token, app.now_us()).await?;
        if from_cookie && !is_safe(&parts.method) && !is_own_origin(&parts.headers) {
            return Err(ApiError::ForeignOrigin);
        }
        principal.map(Self).ok_or(invalid)
    }
}

fn bearer(headers: &HeaderMap) -> Option<&str> {
    let value = headers.get(AUTHORIZATION)?.to_str().ok()?;
    let (scheme, token) = value.split_once(' ')?;
    scheme.eq_ignore_ascii_case("bearer").then_some(token.trim())
}

fn cookie(headers: &HeaderMap) -> Option<&str> {
    let pairs = headers.get_all(COOKIE).iter().filter_map(|value| value.to_str().ok());
    pairs
        .flat_map(|value| value.split(';'))
        .filter_map(|pair| pair.trim().split_once('='))
        .find_map(|(name, value)| (name == SESSION_COOKIE).then_some(value))
}

fn is_safe(method: &Method) -> bool {
    matches!(*method, Method::GET | Method::HEAD | Method::OPTIONS)
}

/// Whether the page that sent the request came from here. Browsers name the origin in every
/// request that changes something, and no page can forge it.
pub(super) fn is_own_origin(headers: &HeaderMap) -> bool {
    let text = |name| headers.get(name).and_then(|value| value.to_str().ok());
    let (Some(origin), Some(host)) = (text(ORIGIN), text(HOST)) else { return false };
    origin.split_once("://").is_some_and(|(_, authority)| authority.eq_ignore_ascii_case(host))
}

/// Somebody who may do what needs the scope of `S`.
pub(super) struct Allowed<S> {
    pub(super) caller: Principal,
    scope: PhantomData<S>,
}

impl<S: Needs> FromRequestParts<App> for Allowed<S> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self, ApiError> {
        let Caller(caller) = Caller::from_request_parts(parts, app).await?;
        if caller.allows(S::SCOPE) {
            Ok(Self { caller, scope: PhantomData })
        } else {
            Err(ApiError::MissingScope(S::SCOPE))
        }
    }
}

/// The path's site, for somebody who may do there what needs the scope of `S`.
pub(super) struct SiteFor<S> {
    pub(super) caller: Principal,
    pub(super) site: String,
    scope: PhantomData<S>,
}

impl<S: Needs> FromRequestParts<App> for SiteFor<S> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self, ApiError> {
        let Caller(caller) = Caller::from_request_parts(parts, app).await?;
        let site = path_part(parts, app, "site").await?;
        if !caller.reaches(&site) || app.store().site(&site).await?.is_none() {
            return Err(ApiError::not_found("site", site));
        }
        if !caller.allows(S::SCOPE) {
            return Err(ApiError::MissingScope(S::SCOPE));
        }
        Ok(Self { caller, site, scope: PhantomData })
    }
}

/// The path's level, open, for somebody who may do there what needs the scope of `S`.
pub(super) struct LevelFor<S> {
    pub(super) caller: Principal,
    pub(super) level: LevelHandle,
    scope: PhantomData<S>,
}

impl<S: Needs> FromRequestParts<App> for LevelFor<S> {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, app: &App) -> Result<Self, ApiError> {
        let Caller(caller) = Caller::from_request_parts(parts, app).await?;
        let site = path_part(parts, app, "site").await?;
        let level = path_part(parts, app, "level").await?;
        if !caller.reaches(&site) {
            return Err(ApiError::not_found("site", site));
        }
        if !caller.allows(S::SCOPE) {
            return Err(ApiError::MissingScope(S::SCOPE));
        }
        match app.parts.levels.open(&site, &level).await? {
            Some(level) => {
                app.drawing.begin(app, &level);
                Ok(Self { caller, level, scope: PhantomData })
            }
            None => Err(ApiError::not_found("level", format!("{site}/{level}"))),
        }
    }
}

impl<S> LevelFor<S> {
    /// What is published, once that is not older than what the client has seen already.
    pub(super) async fn snapshot_since(&self, since: i64) -> Result<Arc<Snapshot>, ApiError> {
        let mut snapshot = self.level.snapshot();
        if snapshot.folded_revision() < since {
            snapshot = self.level.snapshot_at(since, REPLICA_PATIENCE).await;
        }
        let folded_revision = snapshot.folded_revision();
        if (0..=folded_revision).contains(&since) {
            return Ok(snapshot);
        }
        let revision = snapshot.revision();
        Err(ApiError::Since(SinceError { since, folded_revision, revision }))
    }
}

/// A named part of the path.
async fn path_part(parts: &mut Parts, app: &App, name: &str) -> Result<String, ApiError> {
    let params = RawPathParams::from_request_parts(parts, app).await;
    let found = params.ok().and_then(|params| {
        params.iter().find_map(|(key, value)| (key == name).then(|| value.to_owned()))
    });
    found.ok_or(ApiError::NoRoute)
}

#[cfg(test)]
mod tests {
    use axum::http::HeaderName;

    use super::*;

    fn headers(pairs: &[(HeaderName, &str)]) -> HeaderMap {
        pairs.iter().map(|(name, value)| (name.clone(), value.parse().unwrap())).collect()
    }

    #[test]
    fn tokens_are_found_in_either_place() {
        assert_eq!(bearer(&headers(&[(AUTHORIZATION, "bearer abc")])), Some("abc"));
        assert_eq!(bearer(&headers(&[(AUTHORIZATION, "Basic abc")])), None);
        let jar = headers(&[(COOKIE, "a=b; mapfold_session=abc; c=d")]);
        assert_eq!(cookie(&jar), Some("abc"));
        assert_eq!(cookie(&headers(&[(COOKIE, "x_mapfold_session=abc")])), None);
    }

    #[test]
    fn only_the_servers_own_page_is_of_its_origin() {
        let own = [(ORIGIN, "http://127.0.0.1:7171"), (HOST, "127.0.0.1:7171")];
        assert!(is_own_origin(&headers(&own)));
        for origin in ["http://evil.invalid", "http://127.0.0.1:7172", "null"] {
            let foreign = [(ORIGIN, origin), (HOST, "127.0.0.1:7171")];
            assert!(!is_own_origin(&headers(&foreign)), "{origin}");
        }
        assert!(!is_own_origin(&headers(&[(HOST, "127.0.0.1:7171")])));
    }
}
