//! What the server tells of its own work: an id per request, a line per request in the log, and
//! figures for Prometheus.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderValue, Method, StatusCode};
use axum::middleware::Next;
use axum::response::Response;
use metrics::{counter, gauge, histogram};
use metrics_exporter_prometheus::{
    BuildError, Matcher, PrometheusBuilder, PrometheusHandle, PrometheusRecorder,
};

use super::state::App;

const REQUESTS: &str = "mapfold_http_requests_total";
const DURATION: &str = "mapfold_http_request_duration_seconds";
const STREAMS: &str = "mapfold_http_streams";
const BUILD: &str = "mapfold_build_info";
/// Upper bounds of the histograms of durations, seconds.
const SECONDS: [f64; 12] =
    [0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1.0, 5.0, 30.0];
/// Upper bounds of the histograms of batches.
const ITEMS: [f64; 8] = [1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 128.0];

/// Header that names the request.
const REQUEST_ID_HEADER: &str = "x-request-id";

/// The id of a request, for problems and logs.
#[derive(Debug, Clone)]
pub(super) struct RequestId(pub(super) String);

/// Figures of one server: of its HTTP side, and (if the program says so, since a process has only
/// one place for them) of all else.
pub(super) struct Metrics {
    recorder: Arc<PrometheusRecorder>,
    handle: PrometheusHandle,
}

impl std::fmt::Debug for Metrics {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("Metrics")
    }
}

impl Default for Metrics {
    fn default() -> Self {
        let builder = Self::builder().unwrap_or_else(|error| {
            // Only an empty list of buckets is refused; without it the figures are summaries.
            tracing::error!(%error, "no histogram buckets");
            PrometheusBuilder::new()
        });
        let recorder = builder.build_recorder();
        Self { handle: recorder.handle(), recorder: Arc::new(recorder) }
    }
}

impl Metrics {
    fn builder() -> Result<PrometheusBuilder, BuildError> {
        PrometheusBuilder::new()
            .set_buckets_for_metric(Matcher::Suffix("_seconds".to_owned()), &SECONDS)?
            .set_buckets_for_metric(Matcher::Suffix("_batch".to_owned()), &ITEMS)
    }

    /// Takes in the figures of the whole process from now on.
    pub(super) fn take_process(&self) {
        if metrics::set_global_recorder(Arc::clone(&self.recorder)).is_err() {
            tracing::warn!("somebody else records this process's figures already");
        }
    }

    fn request(&self, method: &'static str, route: &str, status: StatusCode, took: Duration) {
        metrics::with_local_recorder(&self.recorder, || {
            let (route, status) = (route.to_owned(), status.as_str().to_owned());
            counter!(REQUESTS, "method" => method, "route" => route.clone(), "status" => status)
                .increment(1);
            histogram!(DURATION, "method" => method, "route" => route).record(took.as_secs_f64());
        });
    }

    /// All figures in the text format of Prometheus.
    pub(super) fn render(&self, streams: usize) -> String {
        metrics::with_local_recorder(&self.recorder, || {
            metrics::describe_counter!(REQUESTS, "Requests answered, by route and status.");
            metrics::describe_histogram!(DURATION, "Time to the head of the answer, by route.");
            metrics::describe_gauge!(STREAMS, "Live event streams that are open.");
            metrics::describe_gauge!(BUILD, "Always 1; the version of the server.");
            gauge!(BUILD, "version" => env!("CARGO_PKG_VERSION")).set(1.0);
            gauge!(STREAMS).set(streams as f64);
        });
        self.handle.render()
    }

    /// Takes the newest durations into their buckets, so that they do not pile up between two
    /// readings.
    pub(super) fn upkeep(&self) {
        self.handle.run_upkeep();
    }
}

/// The outermost layer: names the request, and notes how it went.
pub(super) async fn observe(State(app): State<App>, mut request: Request, next: Next) -> Response {
    let id = RequestId(app.parts.chance.uuid().simple().to_string());
    request.extensions_mut().insert(id.clone());
    let route = request.extensions().get::<MatchedPath>().cloned();
    let method = name(request.method());
    let started = app.parts.clock.elapsed();
    let mut response = next.run(request).await;
    let took = app.parts.clock.elapsed().saturating_sub(started);
    // The template of the route, never the path: paths are endless, and hold names.
    let route = route.as_ref().map_or("none", MatchedPath::as_str);
    let status = response.status();
    app.metrics.request(method, route, status, took);
    let took_us = took.as_micros() as u64;
    tracing::debug!(method, route, status = status.as_u16(), took_us, request_id = id.0, "request");
    if let Ok(value) = HeaderValue::from_str(&id.0) {
        response.headers_mut().insert(REQUEST_ID_HEADER, value);
    }
    response
}

/// The method as one of a few words: clients may invent methods without end.
fn name(method: &Method) -> &'static str {
    match *method {
        Method::GET => "GET",
        Method::HEAD => "HEAD",
        Method::POST => "POST",
        Method::PUT => "PUT",
        Method::PATCH => "PATCH",
        Method::DELETE => "DELETE",
        Method::OPTIONS => "OPTIONS",
        _ => "other",
    }
}
