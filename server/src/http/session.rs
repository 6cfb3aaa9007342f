//! `/session`: how operators sign in on the page. The session is a cookie that scripts cannot
//! read and that other sites' pages cannot send.

use axum::extract::State;
use axum::http::header::{CACHE_CONTROL, SET_COOKIE};
use axum::http::{HeaderMap, HeaderValue, StatusCode};
use axum::response::{IntoResponse, Response};
use mapfold_schema::instant::to_rfc3339;
use mapfold_schema::route;
use mapfold_schema::v1::{NewSession, SessionDescription};

use super::access::{Caller, SESSION_COOKIE, is_own_origin};
use super::answer::{Reader, created};
use super::body::Payload;
use super::problem::ApiError;
use super::state::App;
use crate::auth::{self, Principal, SESSION_US, Token};

fn described(principal: &Principal) -> SessionDescription {
    SessionDescription {
        id: principal.token_id.clone(),
        scopes: principal.scopes.clone(),
        site: principal.site.clone(),
        robot: principal.robot.clone(),
        expires_at: principal.expires_at_us.map(to_rfc3339),
    }
}

fn set_cookie(response: &mut Response, value: &str, age_s: i64) {
    let cookie =
        format!("{SESSION_COOKIE}={value}; Path=/; HttpOnly; SameSite=Strict; Max-Age={age_s}");
    if let Ok(cookie) = HeaderValue::from_str(&cookie) {
        response.headers_mut().insert(SET_COOKIE, cookie);
    }
}

/// Signs in: a token becomes a session of 12 hours, borne by a cookie.
#[utoipa::path(
    post, path = route::SESSION, operation_id = "sign_in", tag = "session", security(()),
    request_body = NewSession,
    responses(
        (status = 201, body = SessionDescription, description = "Signed in; the cookie is the session", headers(("set-cookie" = String))),
        (status = 401, description = "`invalid_token`"),
    )
)]
pub(super) async fn sign_in(
    State(app): State<App>,
    headers: HeaderMap,
    reader: Reader,
    Payload(new): Payload<NewSession>,
) -> Result<Response, ApiError> {
    if headers.contains_key(axum::http::header::ORIGIN) && !is_own_origin(&headers) {
        return Err(ApiError::ForeignOrigin);
    }
    let unknown = || ApiError::Unauthenticated { presented: true };
    let token = Token::parse(new.token.trim()).ok_or_else(unknown)?;
    let now_us = app.now_us();
    let principal = auth::authenticate(app.store(), &token, now_us).await?.ok_or_else(unknown)?;
    let (token, session) =
        auth::open_session(app.store(), &app.parts.chance, &principal, now_us).await?;
    let mut response = created(&reader, None, &described(&session))?;
    set_cookie(&mut response, token.reveal(), SESSION_US / 1_000_000);
    Ok(response)
}

/// Who is signed in, or whose token this is.
#[utoipa::path(
    get, path = route::SESSION, operation_id = "describe_session", tag = "session",
    responses((status = 200, body = SessionDescription, description = "Whose session or token this is"))
)]
pub(super) async fn describe(caller: Caller, reader: Reader) -> Result<Response, ApiError> {
    reader.small(&described(&caller.0))
}

/// Signs out: the session ends here and everywhere. A token that is not a session's stays.
#[utoipa::path(
    delete, path = route::SESSION, operation_id = "sign_out", tag = "session",
    responses((status = 204, description = "Signed out"))
)]
pub(super) async fn sign_out(
    State(app): State<App>,
    Caller(caller): Caller,
) -> Result<Response, ApiError> {
    if auth::is_session(&caller) {
        app.store().revoke_token(&caller.token_id, app.now_us()).await?;
    }
    let mut response = StatusCode::NO_CONTENT.into_response();
    response.headers_mut().insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    set_cookie(&mut response, "", 0);
    Ok(response)
}
