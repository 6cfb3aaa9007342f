//! What every request passes on its way in, and every answer on its way out.
//!
//! From the outside in:
//! 1. `observe` names the request and notes how it went;
//! 2. security headers, on every answer whatever made it;
//! 3. problems are written: from here on inwards an error is a status and what it means;
//! 4. a panic becomes a problem without details;
//! 5. compression of answers, and validators that tell the codings apart;
//! 6. a cap on requests at a time, and on the time of one;
//! 7. a deadline for the body, and a cap on its bytes as they come;
//! 8. decompression of the body; and only inside of that
//! 9. the cap on its bytes that counts, those that come out: a bomb is cut off while it swells.

use std::any::Any;
use std::sync::Arc;

use axum::Router;
use axum::extract::{DefaultBodyLimit, Request, State};
use axum::http::header::{
    CACHE_CONTROL, CONTENT_ENCODING, CONTENT_LENGTH, CONTENT_TYPE, ETAG, HeaderName, IF_NONE_MATCH,
    RETRY_AFTER, WWW_AUTHENTICATE,
};
use axum::http::{HeaderValue, StatusCode};
use axum::middleware::{self, Next};
use axum::response::{IntoResponse, Response};
use mapfold_schema::problem::{PROBLEM_JSON, Problem};
use tokio::sync::Semaphore;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::predicate::{NotForContentType, Predicate};
use tower_http::compression::{CompressionLayer, DefaultPredicate};
use tower_http::decompression::RequestDecompressionLayer;
use tower_http::timeout::{RequestBodyDeadlineLayer, TimeoutLayer};

use super::batch;
use super::cap::cap;
use super::exports;
use super::observe::{RequestId, observe};
use super::problem::{self, ApiError, Outgoing};
use super::state::App;

/// Header that says what a page may load, and from where.
pub(super) const POLICY_HEADER: &str = "content-security-policy";
const POLICY: &str = "default-src 'none'; script-src 'self'; worker-src 'self' blob:; \
    style-src 'self'; img-src 'self' data: blob:; font-src 'self'; connect-src 'self'; \
    base-uri 'none'; form-action 'self'; frame-ancestors 'none'";
const SECURITY: [(&str, &str); 6] = [
    (POLICY_HEADER, POLICY),
    ("x-content-type-options", "nosniff"),
    ("referrer-policy", "no-referrer"),
    ("x-frame-options", "DENY"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
];
/// Seconds after which a refused request may be sent again.
const RETRY_AFTER_S: u64 = 1;

/// Puts all layers around the routes.
pub(super) fn around(routes: Router, app: &App) -> Router {
    let limits = app.parts.limits;
    let worth_it = DefaultPredicate::new()
        .and(NotForContentType::const_new(exports::ZIP))
        .and(NotForContentType::const_new(batch::TILES));
    let admission = Arc::new(Semaphore::new(limits.requests_max));
    routes
        .layer(DefaultBodyLimit::max(limits.body_bytes))
        .layer(RequestDecompressionLayer::new())
        .layer(middleware::from_fn_with_state(limits.upload_compressed_bytes, cap))
        .layer(RequestBodyDeadlineLayer::new(limits.body_timeout()))
        .layer(TimeoutLayer::with_status_code(StatusCode::GATEWAY_TIMEOUT, limits.answer_timeout()))
        .layer(middleware::from_fn_with_state(admission, admit))
        .layer(CompressionLayer::new().compress_when(worth_it))
        .layer(middleware::from_fn(tell_codings_apart))
        .layer(CatchPanicLayer::custom(after_panic))
        .layer(middleware::from_fn_with_state(limits.upload_compressed_bytes, write_problem))
        .layer(middleware::from_fn(secure))
        .layer(middleware::from_fn_with_state(app.clone(), observe))
}

/// Refuses what is more than `requests_max` at a time. Health checks and the page always pass.
async fn admit(State(room): State<Arc<Semaphore>>, request: Request, next: Next) -> Response {
    let is_api = request.uri().path().starts_with("/api/");
    match room.try_acquire() {
        Err(_) if is_api => ApiError::Overloaded.into_response(),
        _permit => next.run(request).await,
    }
}

/// A strong validator must differ between `zstd`, `gzip` and plain (RFC 9110, section 8.8.3), but
/// it is made before the coding is chosen: so the coding's name is put in here, and taken out of
/// what clients send back.
async fn tell_codings_apart(mut request: Request, next: Next) -> Response {
    let mut coding_had = None;
    if let Some(tags) = request.headers_mut().get_mut(IF_NONE_MATCH)
        && let Ok(text) = tags.to_str()
    {
        coding_had = ["zstd", "gzip"].into_iter().find(|c| text.contains(&format!("-{c}\"")));
        let plain = text.replace("-zstd\"", "\"").replace("-gzip\"", "\"");
        if let Ok(plain) = HeaderValue::from_str(&plain) {
            *tags = plain;
        }
    }
    let mut response = next.run(request).await;
    let coding = match response.headers().get(CONTENT_ENCODING).map(|c| c.to_str()) {
        Some(Ok(coding)) => Some(coding.to_owned()),
        _ if response.status() == StatusCode::NOT_MODIFIED => coding_had.map(ToOwned::to_owned),
        _ => None,
    };
    if let Some(coding) = coding
        && let Some(tag) = response.headers_mut().get_mut(ETAG)
        && let Some(plain) = tag.to_str().ok().and_then(|tag| tag.strip_suffix('"'))
        && let Ok(coded) = HeaderValue::from_str(&format!("{plain}-{coding}\""))
    {
        *tag = coded;
    }
    response
}

#[expect(clippy::needless_pass_by_value, reason = "the layer hands it over")]
fn after_panic(panic: Box<dyn Any + Send + 'static>) -> Response {
    let words = panic.downcast_ref::<String>().map(String::as_str);
    let words = words.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("(no words)");
    tracing::error!(panic = words, "a handler panicked");
    StatusCode::INTERNAL_SERVER_ERROR.into_response()
}

/// Writes the problem that an error answer bears, or makes one of its status.
async fn write_problem(State(limit_bytes): State<usize>, request: Request, next: Next) -> Response {
    let id = request.extensions().get::<RequestId>().cloned();
    let mut response = next.run(request).await;
    let status = response.status();
    let problem = match response.extensions_mut().remove::<Outgoing>() {
        Some(Outgoing(problem)) => Arc::unwrap_or_clone(problem),
        None if status.is_client_error() || status.is_server_error() => {
            problem::of_status(status, limit_bytes)
        }
        None => return response,
    };
    written(&Problem { request_id: id.map(|id| id.0), ..problem }, response)
}

fn written(problem: &Problem, response: Response) -> Response {
    let (mut head, _) = response.into_parts();
    head.headers.remove(CONTENT_LENGTH);
    head.headers.remove(CONTENT_ENCODING);
    head.headers.insert(CONTENT_TYPE, HeaderValue::from_static(PROBLEM_JSON));
    head.headers.insert(CACHE_CONTROL, HeaderValue::from_static("no-store"));
    if matches!(problem.status, 429 | 503) {
        head.headers.insert(RETRY_AFTER, HeaderValue::from(RETRY_AFTER_S));
    }
    if problem.status == 401 {
        let challenge = match problem.code.as_str() {
            "invalid_token" => "Bearer realm=\"mapfold\", error=\"invalid_token\"",
            _ => "Bearer realm=\"mapfold\"",
        };
        head.headers.insert(WWW_AUTHENTICATE, HeaderValue::from_static(challenge));
    }
    if problem.code == "insufficient_scope" {
        let challenge = "Bearer realm=\"mapfold\", error=\"insufficient_scope\"";
        head.headers.insert(WWW_AUTHENTICATE, HeaderValue::from_static(challenge));
    }
    // A problem is strings and numbers: JSON can hold it.
    let body = serde_json::to_vec(problem).unwrap_or_default();
    Response::from_parts(head, body.into())
}

async fn secure(request: Request, next: Next) -> Response {
    let mut response = next.run(request).await;
    for (name, value) in SECURITY {
        let name = HeaderName::from_static(name);
        response.headers_mut().entry(name).or_insert(HeaderValue::from_static(value));
    }
    response
}

#[cfg(test)]
mod tests {
    use axum::body::{Body, to_bytes};
    use axum::routing::get;
    use tower::ServiceExt as _;

    use super::*;
    use crate::config::HttpLimits;
    use crate::http::fixture::Fixture;

    async fn problem(routes: Router, path: &str, limits: HttpLimits) -> Problem {
        let fixture = Fixture::new(limits).await;
        let request = Request::builder().uri(path).body(Body::empty()).unwrap();
        let response = around(routes, &fixture.app).oneshot(request).await.unwrap();
        let status = response.status();
        assert_eq!(response.headers()[CONTENT_TYPE], PROBLEM_JSON);
        assert!(response.headers().contains_key(POLICY_HEADER));
        let body = to_bytes(response.into_body(), 1 << 16).await.unwrap();
        let problem: Problem = serde_json::from_slice(&body).unwrap();
        assert_eq!(problem.status, status);
        problem
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_panic_becomes_a_problem_that_tells_nothing_of_it() {
        let panics = || async { std::hint::black_box(None::<Response>).expect("the secret") };
        let routes = Router::new().route("/panics", get(panics));
        let problem = problem(routes, "/panics", HttpLimits::default()).await;
        assert_eq!((problem.status, problem.code.as_str()), (500, "internal"));
        assert!(!serde_json::to_string(&problem).unwrap().contains("secret"));
        assert!(problem.request_id.is_some());
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_handler_that_takes_too_long_is_given_up() {
        let hangs = || async { std::future::pending::<Response>().await };
        let routes = Router::new().route("/hangs", get(hangs));
        let limits = HttpLimits { answer_timeout_ms: 50, ..HttpLimits::default() };
        let problem = problem(routes, "/hangs", limits).await;
        assert_eq!((problem.status, problem.code.as_str()), (504, "timeout"));
        assert!(problem.retryable);
    }
}
