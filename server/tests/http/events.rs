//! Live streams.

use std::time::Duration;

use mapfold_schema::route;
use mapfold_schema::v1::{LevelEvent, NewSession};
use reqwest::Method;
use reqwest::header::{COOKIE, ORIGIN};

use crate::client::Answer;
use crate::server::{ADMIN, Server};
use crate::world::Level;

const PATIENCE: Duration = Duration::from_secs(10);

/// A stream as a browser reads it.
struct Stream {
    response: reqwest::Response,
    text: String,
}

#[derive(Debug, Default, PartialEq)]
struct Event {
    id: Option<i64>,
    name: String,
    data: Option<LevelEvent>,
    comment: bool,
    retry_ms: Option<u64>,
}

impl Stream {
    async fn open(request: reqwest::RequestBuilder) -> Self {
        let response = request.send().await.unwrap();
        assert_eq!(response.status(), 200);
        assert_eq!(response.headers()["content-type"], "text/event-stream");
        assert_eq!(response.headers()["x-accel-buffering"], "no");
        assert!(!response.headers().contains_key("content-encoding"));
        Self { response, text: String::new() }
    }

    async fn of(level: &Level, query: &str) -> Self {
        let path = format!("{}{query}", level.path(route::EVENTS));
        Self::open(level.client.request(Method::GET, &path)).await
    }

    /// The next event; `None` at the end of the stream.
    async fn next(&mut self) -> Option<Event> {
        loop {
            if let Some((event, rest)) = self.text.split_once("\n\n") {
                let event = parsed(event);
                self.text = String::from(rest);
                return Some(event);
            }
            let chunk = tokio::time::timeout(PATIENCE, self.response.chunk()).await;
            let chunk = chunk.expect("something happens in time").unwrap()?;
            self.text.push_str(std::str::from_utf8(&chunk).unwrap());
        }
    }

    /// The next event that is not a comment.
    async fn next_named(&mut self) -> Option<Event> {
        loop {
            let event = self.next().await?;
            if !event.comment {
                return Some(event);
            }
        }
    }
}

fn parsed(text: &str) -> Event {
    let mut event = Event::default();
    for line in text.lines() {
        match line.split_once(':').unwrap() {
            ("", _) => event.comment = true,
            ("id", id) => event.id = Some(id.trim().parse().unwrap()),
            ("event", name) => name.trim().clone_into(&mut event.name),
            ("data", data) => event.data = Some(serde_json::from_str(data).unwrap()),
            ("retry", ms) => event.retry_ms = Some(ms.trim().parse().unwrap()),
            (other, _) => panic!("unknown field {other:?}"),
        }
    }
    event
}

#[tokio::test(flavor = "multi_thread")]
async fn a_contribution_is_told_of_at_once_with_its_revision() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let mut stream = Stream::of(&floor, "").await;
    let first = stream.next().await.unwrap();
    assert_eq!((first.id, first.retry_ms), (Some(0), Some(3000)));
    assert_eq!(first.name, "revision");
    floor.contribute("r1", 1).await;
    let event = stream.next_named().await.unwrap();
    assert_eq!((event.id, event.name.as_str()), (Some(1), "revision"));
    let data = event.data.unwrap();
    assert_eq!((data.revision, data.robots), (1, vec!["r1".to_owned()]));
    assert!(data.features >= 1 && data.tiles >= 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_was_away_is_told_what_it_missed() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    for number in 1..=3 {
        floor.contribute("r1", number).await;
    }
    let mut stream = Stream::of(&floor, "?since=1").await;
    let missed = stream.next_named().await.unwrap();
    assert_eq!((missed.id, missed.name.as_str()), (Some(3), "revision"));
    assert!(missed.data.unwrap().features >= 1);
    // The header of a browser that reconnects goes before the address it was given.
    let request =
        floor.client.request(Method::GET, &format!("{}?since=1", floor.path(route::EVENTS)));
    let mut stream = Stream::open(request.header("last-event-id", "3")).await;
    assert!(stream.next().await.unwrap().comment, "there is nothing newer");
    floor.contribute("r1", 4).await;
    assert_eq!(stream.next_named().await.unwrap().id, Some(4));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_knows_what_the_server_does_not_is_told_to_read_again() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    floor.contribute("r1", 1).await;
    let mut stream = Stream::of(&floor, "?since=99").await;
    let event = stream.next_named().await.unwrap();
    assert_eq!((event.id, event.name.as_str()), (Some(1), "resync"));
}

#[tokio::test(flavor = "multi_thread")]
async fn silence_is_filled_and_ends_for_those_who_may_no_longer_read() {
    let server = Server::start_with(|config| config.http.heartbeat_ms = 100).await;
    let floor = Level::create(&server.admin()).await;
    let session = NewSession { token: ADMIN.to_owned() };
    let answer = server.anybody().post(route::SESSION, &session).await.expect(201);
    let cookie = answer.header("set-cookie").split(';').next().unwrap().to_owned();
    let request = server.anybody().request(Method::GET, &floor.path(route::EVENTS));
    let mut stream = Stream::open(request.header(COOKIE, &cookie)).await;
    stream.next().await.unwrap();
    assert!(stream.next().await.unwrap().comment);
    assert!(stream.next().await.unwrap().comment);
    let sign_out = server.anybody().request(Method::DELETE, route::SESSION);
    let sign_out = sign_out.header(COOKIE, &cookie);
    let sign_out = sign_out.header(ORIGIN, format!("http://{}", server.address()));
    Answer::to(sign_out).await.expect(204);
    while let Some(event) = stream.next().await {
        assert!(event.comment);
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_beyond_the_cap_are_refused_until_one_ends() {
    let server = Server::start_with(|config| {
        config.http.streams_max = 1;
        config.http.heartbeat_ms = 50;
    })
    .await;
    let floor = Level::create(&server.admin()).await;
    let stream = Stream::of(&floor, "").await;
    let answer = server.admin().get(&floor.path(route::EVENTS)).await;
    assert_eq!(answer.header("retry-after"), "1");
    let problem = answer.problem(429);
    assert_eq!((problem.code.as_str(), problem.retryable), ("streams_exhausted", true));
    drop(stream);
    let begin = tokio::time::Instant::now();
    loop {
        let request = server.admin().request(Method::GET, &floor.path(route::EVENTS));
        if request.send().await.unwrap().status() == 200 {
            break;
        }
        assert!(begin.elapsed() < PATIENCE, "the place is never given free");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn streams_end_when_the_server_stops() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let mut stream = Stream::of(&floor, "").await;
    stream.next().await.unwrap();
    let begin = tokio::time::Instant::now();
    let stopping = tokio::spawn(server.shutdown());
    assert_eq!(stream.next().await, None);
    stopping.await.unwrap();
    assert!(begin.elapsed() < Duration::from_secs(5), "{:?}", begin.elapsed());
}
