//! `/livez`, `/readyz`, `/metrics`: for those who run the server. Open to all, and without details.

use std::time::Duration;

use axum::extract::State;
use axum::http::HeaderValue;
use axum::http::header::{CACHE_CONTROL, CONTENT_TYPE};
use axum::response::{IntoResponse, Response};

use super::problem::{self, ApiError};
use super::state::App;

/// How long the database may take to say that it is there.
const PATIENCE: Duration = Duration::from_secs(3);
const TEXT: &str = "text/plain; charset=utf-8";
const PROMETHEUS: &str = "text/plain; version=0.0.4; charset=utf-8";

fn text(media_type: &'static str, body: String) -> Response {
    let headers = [
        (CONTENT_TYPE, HeaderValue::from_static(media_type)),
        (CACHE_CONTROL, HeaderValue::from_static("no-store")),
    ];
    (headers, body).into_response()
}

/// Whether the process runs.
#[utoipa::path(
    get, path = "/livez", operation_id = "livez", tag = "health", security(()),
    responses((status = 200, content_type = "text/plain", body = String, description = "It runs"))
)]
pub(super) async fn live() -> Response {
    text(TEXT, "alive\n".to_owned())
}

/// Whether requests should be sent here: the database answers, and the server is not stopping.
#[utoipa::path(
    get, path = "/readyz", operation_id = "readyz", tag = "health", security(()),
    responses(
        (status = 200, content_type = "text/plain", body = String, description = "It takes requests"),
        (status = 503, description = "`closing`, `unavailable`"),
    )
)]
pub(super) async fn ready(State(app): State<App>) -> Result<Response, ApiError> {
    if app.is_closing() {
        return Err(ApiError::Closing);
    }
    match tokio::time::timeout(PATIENCE, app.store().ping()).await {
        Ok(Ok(())) => Ok(text(TEXT, "ready\n".to_owned())),
        Ok(Err(error)) => {
            tracing::warn!(%error, "not ready");
            Ok(problem::respond(problem::not_ready()))
        }
        Err(_) => Ok(problem::respond(problem::not_ready())),
    }
}

/// Figures for Prometheus.
#[utoipa::path(
    get, path = "/metrics", operation_id = "metrics", tag = "health", security(()),
    responses((status = 200, content_type = "text/plain", body = String, description = "The figures, as Prometheus reads them"))
)]
pub(super) async fn metrics(State(app): State<App>) -> Response {
    let streams = app.parts.limits.streams_max - app.streams.available_permits();
    text(PROMETHEUS, app.metrics.render(streams))
}
