//! `L/events`: a live stream of what is published.

use std::convert::Infallible;
use std::time::Duration;

use axum::extract::State;
use axum::http::HeaderMap;
use axum::http::header::{CACHE_CONTROL, HeaderName};
use axum::response::sse::{Event, Sse};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use mapfold_schema::route;
use mapfold_schema::v1::LevelEvent;
use serde::Deserialize;
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::{OwnedSemaphorePermit, broadcast, watch};
use tokio::time::{Interval, MissedTickBehavior};

use super::access::{LevelFor, Read};
use super::problem::ApiError;
use super::query::QueryOf;
use super::state::App;
use crate::auth::{self, Principal};
use crate::level::LevelHandle;

/// What a client waits before it connects again.
const RETRY: Duration = Duration::from_secs(3);
const LAST_EVENT_ID: &str = "last-event-id";

/// From where on.
#[derive(Debug, Deserialize, utoipa::IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(super) struct EventQuery {
    /// The revision that the client has; the header `Last-Event-ID` goes before it.
    since: Option<i64>,
}

/// A live stream (server-sent events): `event: revision` each time the published map has changed,
/// with the revision as `id` and a `LevelEvent` as data. Several revisions may come as one event.
///
/// The first event comes at once: with `since` (or `Last-Event-ID`) only if there is something
/// newer, else with the present revision. `event: resync` means that events were lost, or that
/// `since` is ahead of the log: read the map again. A comment every 15 s keeps the line open.
#[utoipa::path(
    get, path = route::EVENTS, operation_id = "follow", tag = "map",
    params(
        ("site" = String, Path), ("level" = String, Path), EventQuery,
        ("Last-Event-ID" = Option<i64>, Header, description = "As browsers send it"),
    ),
    responses(
        (status = 200, content_type = "text/event-stream", body = LevelEvent, description = "Events, for as long as the stream is open"),
        (status = 429, description = "`streams_exhausted`; see `Retry-After`"),
    )
)]
pub(super) async fn follow(
    State(app): State<App>,
    level: LevelFor<Read>,
    QueryOf(query): QueryOf<EventQuery>,
    headers: HeaderMap,
) -> Result<Response, ApiError> {
    let resumed = headers.get(LAST_EVENT_ID).and_then(|id| id.to_str().ok()?.parse().ok());
    let permit = app.streams.clone().try_acquire_owned();
    let permit = permit.ok().ok_or(ApiError::StreamsExhausted)?;
    let feed = Feed::new(app, level, resumed.or(query.since), permit);
    let events = Sse::new(stream::unfold(feed, Feed::next));
    // A proxy must neither keep nor gather what is live.
    let headers =
        [(CACHE_CONTROL, "no-store"), (HeaderName::from_static("x-accel-buffering"), "no")];
    Ok((headers, events).into_response())
}

/// One client's stream.
struct Feed {
    app: App,
    level: LevelHandle,
    caller: Principal,
    events: broadcast::Receiver<LevelEvent>,
    closing: watch::Receiver<bool>,
    heartbeat: Interval,
    /// The revision that the client has, as far as is known here.
    sent: Option<i64>,
    is_new: bool,
    _permit: OwnedSemaphorePermit,
}

/// What a stream waits for.
enum Awaited {
    Event(LevelEvent),
    /// Events were lost, because the client took too long.
    Gap,
    /// Nothing happened for as long as a heartbeat.
    Silence,
    End,
}

impl Feed {
    fn new(
        app: App,
        level: LevelFor<Read>,
        since: Option<i64>,
        permit: OwnedSemaphorePermit,
    ) -> Self {
        let mut heartbeat = tokio::time::interval(app.parts.limits.heartbeat());
        heartbeat.set_missed_tick_behavior(MissedTickBehavior::Delay);
        heartbeat.reset();
        Self {
            // Listening begins before the present revision is looked at, so none falls between.
            events: level.level.events(),
            closing: app.parts.closing.clone(),
            level: level.level,
            caller: level.caller,
            heartbeat,
            sent: since,
            is_new: true,
            app,
            _permit: permit,
        }
    }

    /// The next thing to send; `None` ends the stream.
    async fn next(mut self) -> Option<(Result<Event, Infallible>, Self)> {
        if std::mem::take(&mut self.is_new) {
            let first = self.first().retry(RETRY);
            return Some((Ok(first), self));
        }
        let event = loop {
            match self.awaited().await {
                Awaited::Event(event) if self.sent.is_none_or(|sent| event.revision > sent) => {
                    break self.revision(&event);
                }
                Awaited::Event(_) => {}
                Awaited::Gap => break self.resync(),
                Awaited::Silence if self.caller_stands().await => {
                    break Event::default().comment("here");
                }
                Awaited::Silence | Awaited::End => return None,
            }
        };
        Some((Ok(event), self))
    }

    async fn awaited(&mut self) -> Awaited {
        tokio::select! {
            biased;
            _ = self.closing.wait_for(|closing| *closing) => Awaited::End,
            received = self.events.recv() => match received {
                Ok(event) => Awaited::Event(event),
                Err(RecvError::Lagged(_)) => Awaited::Gap,
                // The level was dropped, to be read back: the client connects again.
                Err(RecvError::Closed) => Awaited::End,
            },
            _ = self.heartbeat.tick() => Awaited::Silence,
        }
    }

    /// What a client is told that has just connected.
    fn first(&mut self) -> Event {
        let snapshot = self.level.snapshot();
        let now = snapshot.folded_revision();
        match self.sent {
            Some(since) if since == now => Event::default().comment("here"),
            Some(since) if since < now => match snapshot.since(since) {
                Ok(patch) => self.revision(&LevelEvent {
                    revision: now,
                    robots: Vec::new(),
                    features: (patch.segments.len()
                        + patch.clusters.len()
                        + patch.chains.len()
                        + patch.removed_segments.len()
                        + patch.removed_clusters.len()
                        + patch.removed_chains.len()) as u32,
                    tiles: (patch.tiles.len()
                        + patch.removed_tiles.len()
                        + patch.prior.len()
                        + patch.removed_prior.len()) as u32,
                    acts: 0,
                }),
                Err(_) => self.resync(),
            },
            Some(since) if since > snapshot.revision() => self.resync(),
            // The log holds that revision, and the fold is about to reach it.
            Some(_) => Event::default().comment("here"),
            None => self.revision(&LevelEvent {
                revision: now,
                robots: Vec::new(),
                features: 0,
                tiles: 0,
                acts: 0,
            }),
        }
    }

    fn revision(&mut self, event: &LevelEvent) -> Event {
        self.sent = Some(event.revision);
        named("revision", event)
    }

    /// Events were lost: the client must read again. What it then has is the present revision.
    fn resync(&mut self) -> Event {
        let revision = self.level.snapshot().folded_revision();
        self.sent = Some(revision);
        let event = LevelEvent { revision, robots: Vec::new(), features: 0, tiles: 0, acts: 0 };
        named("resync", &event)
    }

    /// Whether the client may still read: its token may have been revoked meanwhile.
    async fn caller_stands(&self) -> bool {
        let stands = auth::still_stands(self.app.store(), &self.caller, self.app.now_us()).await;
        // That the store does not answer just now is no reason to cut everybody off.
        stands.unwrap_or(true)
    }
}

fn named(name: &str, event: &LevelEvent) -> Event {
    // Numbers and slugs: JSON can hold them, and in one line.
    let data = serde_json::to_string(event).unwrap_or_default();
    Event::default().id(event.revision.to_string()).event(name).data(data)
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use mapfold_schema::v1::Scope;
    use tokio::sync::Semaphore;

    use super::*;
    use crate::config::HttpLimits;
    use crate::http::fixture::Fixture;

    fn event(revision: i64) -> LevelEvent {
        LevelEvent { revision, robots: Vec::new(), features: 1, tiles: 1, acts: 0 }
    }

    /// The name and the id of an event, as they go over the line.
    async fn told(feed: Feed) -> (String, Feed) {
        let (event, feed) = feed.next().await.unwrap();
        let sse = Sse::new(stream::iter([event])).into_response();
        let bytes = axum::body::to_bytes(sse.into_body(), 1 << 16).await.unwrap();
        let text = String::from_utf8(bytes.to_vec()).unwrap();
        let field = |name: &str| {
            text.lines().find_map(|line| Some(line.strip_prefix(name)?.trim().to_owned()))
        };
        let name = field("event:").unwrap_or_else(|| "comment".to_owned());
        (format!("{name} {}", field("id:").unwrap_or_default()).trim().to_owned(), feed)
    }

    #[tokio::test(flavor = "multi_thread")]
    async fn a_client_that_lags_behind_is_told_to_read_again_and_then_goes_on() {
        let fixture = Fixture::new(HttpLimits::default()).await;
        let (sender, events) = broadcast::channel(2);
        let feed = Feed {
            closing: fixture.app.parts.closing.clone(),
            app: fixture.app,
            level: fixture.level,
            caller: Principal {
                token_id: "nobody".to_owned(),
                site: None,
                robot: None,
                scopes: vec![Scope::MapRead],
                expires_at_us: None,
            },
            events,
            heartbeat: tokio::time::interval_at(
                tokio::time::Instant::now() + Duration::from_mins(1),
                Duration::from_mins(1),
            ),
            sent: None,
            is_new: true,
            _permit: Arc::new(Semaphore::new(1)).acquire_owned().await.unwrap(),
        };

        let (first, feed) = told(feed).await;
        assert_eq!(first, "revision 0");
        sender.send(event(1)).unwrap();
        let (second, feed) = told(feed).await;
        assert_eq!(second, "revision 1");
        // Five events into a channel that keeps two: three are lost.
        for revision in 2..=6 {
            sender.send(event(revision)).unwrap();
        }
        let (third, feed) = told(feed).await;
        assert_eq!(third, "resync 0", "the level here is still empty");
        let (fourth, feed) = told(feed).await;
        assert_eq!(fourth, "revision 5");
        let (fifth, feed) = told(feed).await;
        assert_eq!(fifth, "revision 6");
        fixture.closing.send(true).unwrap();
        assert!(feed.next().await.is_none());
    }
}
