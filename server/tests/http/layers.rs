//! What clients that mean harm, or are broken, can do: bombs, endless and slow bodies, idle
//! connections, floods.

use std::convert::Infallible;
use std::io::Write;
use std::time::Duration;

use bytes::Bytes;
use flate2::Compression;
use flate2::write::GzEncoder;
use futures_util::stream;
use mapfold_schema::codec::{self, JSON};
use mapfold_schema::route;
use mapfold_schema::v1::Receipt;
use reqwest::Method;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;

use crate::client::Answer;
use crate::server::Server;
use crate::world::Level;

/// What a bomb unpacks to, bytes.
const BOMB_BYTES: usize = 200 << 20;
/// What a refused bomb may cost, kB: the limit of 16 MB, a few times over, as buffers double.
const COST_MAX_KB: u64 = 64 << 10;

fn gzip(bytes: &[u8], times: usize) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    for _ in 0..times {
        encoder.write_all(bytes).unwrap();
    }
    encoder.finish().unwrap()
}

fn zstd(bytes: &[u8], times: usize) -> Vec<u8> {
    let mut encoder = zstd::Encoder::new(Vec::new(), 3).unwrap();
    // A window of 128 MB, which the sender may ask for, and which is not to be granted in memory.
    encoder.window_log(27).unwrap();
    for _ in 0..times {
        encoder.write_all(bytes).unwrap();
    }
    encoder.finish().unwrap()
}

/// A figure of this process's memory, kB.
fn memory_kb(name: &str) -> u64 {
    let status = std::fs::read_to_string("/proc/self/status").unwrap();
    let line = status.lines().find(|line| line.starts_with(name)).unwrap();
    line.split_whitespace().nth(1).unwrap().parse().unwrap()
}

async fn coded(server: &Server, path: &str, coding: &str, body: Vec<u8>) -> Answer {
    let request = server.admin().request(Method::POST, path);
    let request = request.header("content-type", JSON).header("content-encoding", coding);
    Answer::to(request.body(body)).await
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bomb_is_cut_off_while_it_swells_and_costs_little() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let path = floor.path(route::CONTRIBUTIONS);
    let block = vec![b' '; 1 << 20];
    for (coding, pack) in [
        ("gzip", gzip as fn(&[u8], usize) -> Vec<u8>),
        ("zstd", zstd as fn(&[u8], usize) -> Vec<u8>),
    ] {
        let bomb = pack(&block, BOMB_BYTES >> 20);
        assert!(bomb.len() < 1 << 20, "{coding}: {} bytes", bomb.len());
        // Forgets the peak so far, to which the packing has contributed.
        std::fs::write("/proc/self/clear_refs", "5").unwrap();
        let before = memory_kb("VmRSS:");
        let problem = coded(&server, &path, coding, bomb).await.problem(413);
        assert_eq!(problem.code, "body_too_large", "{coding}");
        let cost = memory_kb("VmHWM:").saturating_sub(before);
        assert!(cost < COST_MAX_KB, "{coding}: {cost} kB");
        println!("a bomb of {coding} cost {cost} kB");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn packed_uploads_are_taken_and_damaged_ones_refused() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let path = floor.path(route::CONTRIBUTIONS);
    let look = codec::to_json(&floor.look("r1", 1).await).unwrap();
    for (coding, body) in [("gzip", gzip(&look, 1)), ("zstd", zstd(&look, 1))] {
        let receipt: Receipt = coded(&server, &path, coding, body.clone()).await.expect(201).data();
        assert_eq!(receipt.revision, 1);
        let cut = body[..body.len() / 2].to_vec();
        assert_eq!(coded(&server, &path, coding, cut).await.code(400), "body_broken", "{coding}");
        let wrong = coded(&server, &path, coding, look.clone()).await;
        assert_eq!(wrong.code(400), "body_broken", "{coding}");
    }
    let twice = gzip(&gzip(&look, 1), 1);
    for coding in ["br", "gzip, gzip", "deflate"] {
        let answer = coded(&server, &path, coding, twice.clone()).await;
        assert_eq!(answer.code(415), "unsupported_coding", "{coding}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_body_without_end_is_refused_at_the_limit_whether_or_not_it_says_its_length() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let path = floor.path(route::CONTRIBUTIONS);
    let long = vec![b' '; 5 << 20];
    let answer = server.admin().post_bytes(&path, JSON, long.clone()).await;
    let problem = answer.problem(413);
    assert_eq!(problem.code, "body_too_large");
    // Packed, it might do.
    assert!(
        problem.detail.contains("4194304 bytes") && problem.detail.contains("gzip"),
        "{problem:?}"
    );

    // Chunked, and it would go on for ever: what counts is that the refusal comes.
    let chunk = Bytes::from(vec![b' '; 64 << 10]);
    let endless = stream::repeat_with(move || Ok::<_, Infallible>(chunk.clone()));
    let request = server.admin().request(Method::POST, &path).header("content-type", JSON);
    let request = request.body(reqwest::Body::wrap_stream(endless));
    match tokio::time::timeout(Duration::from_secs(20), request.send()).await.unwrap() {
        Ok(response) => assert_eq!(response.status(), 413),
        // The server hung up while the client was still writing: that is a refusal too.
        Err(error) => assert!(error.is_request() || error.is_body(), "{error:?}"),
    }
    // Other bodies have a lower limit.
    let answer = server.admin().post_bytes(route::SITES, JSON, vec![b' '; 100 << 10]).await;
    assert_eq!(answer.code(413), "body_too_large");
    assert_eq!(floor.describe().await.revision, 0);
}

/// Sends some bytes and answers what comes back until the server hangs up; nothing if it does not
/// within ten seconds.
async fn sent(server: &Server, bytes: &[u8]) -> Option<String> {
    let mut socket = TcpStream::connect(server.address()).await.unwrap();
    socket.write_all(bytes).await.unwrap();
    let mut answer = Vec::new();
    let read = tokio::time::timeout(Duration::from_secs(10), socket.read_to_end(&mut answer));
    // A reset is a way to hang up.
    let _read: Result<usize, std::io::Error> = read.await.ok()?;
    Some(String::from_utf8_lossy(&answer).into_owned())
}

#[tokio::test(flavor = "multi_thread")]
async fn connections_that_are_not_used_are_closed() {
    let server = Server::start_with(|config| {
        config.http.head_timeout_ms = 300;
        config.http.body_timeout_ms = 300;
    })
    .await;
    let begin = tokio::time::Instant::now();
    let idle = sent(&server, b"").await.expect("an idle connection is closed");
    assert!(idle.is_empty() || idle.starts_with("HTTP/1.1 408"), "{idle}");
    let half_head = sent(&server, b"GET /livez HTTP/1.1\r\nhost: x\r\nx-slow: ").await;
    let half_head = half_head.expect("half a head is not waited for");
    assert!(half_head.is_empty() || half_head.starts_with("HTTP/1.1 408"), "{half_head}");
    let kept = sent(&server, b"GET /livez HTTP/1.1\r\nhost: x\r\n\r\n").await;
    let kept = kept.expect("a connection is not kept for ever");
    assert!(kept.starts_with("HTTP/1.1 200"), "{kept}");
    // The first bytes of HTTP/2, where a server that guesses the protocol would wait.
    assert!(sent(&server, b"PRI").await.is_some());
    assert!(begin.elapsed() < Duration::from_secs(5));
}

#[tokio::test(flavor = "multi_thread")]
async fn half_a_body_is_not_waited_for() {
    let server = Server::start_with(|config| config.http.body_timeout_ms = 300).await;
    let head = format!(
        "POST /api/v1/sites HTTP/1.1\r\nhost: x\r\nauthorization: Bearer {}\r\n\
         content-type: application/json\r\ncontent-length: 100\r\nconnection: close\r\n\r\n{{\"site\":",
        crate::server::ADMIN
    );
    let answer = sent(&server, head.as_bytes()).await.expect("half a body is not waited for");
    assert!(answer.starts_with("HTTP/1.1 408"), "{answer}");
    assert!(answer.contains("\"code\":\"body_timeout\""), "{answer}");
}

#[tokio::test(flavor = "multi_thread")]
async fn requests_beyond_the_cap_are_told_to_come_back_and_health_checks_pass() {
    let server = Server::start_with(|config| config.http.requests_max = 0).await;
    let answer = server.admin().get(route::SITES).await;
    assert_eq!(answer.header("retry-after"), "1");
    let problem = answer.problem(503);
    assert_eq!((problem.code.as_str(), problem.retryable), ("overloaded", true));
    server.anybody().get("/livez").await.expect(200);
    server.anybody().get("/readyz").await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn nonsense_on_the_line_is_refused_and_does_no_harm() {
    let server = Server::start().await;
    let long_head = format!("GET / HTTP/1.1\r\nhost: x\r\nx-long: {}\r\n\r\n", "y".repeat(20_000));
    let many_heads = format!("GET / HTTP/1.1\r\nhost: x\r\n{}\r\n", "x-many: y\r\n".repeat(100));
    for bytes in [
        b"\x16\x03\x01\x02\x00\x01\x00\x01\xfc\x03\x03".as_slice(),
        b"GET / HTTP/9.9\r\n\r\n",
        b"GET / HTTP/1.1\r\nhost: x\r\ncontent-length: 5\r\ncontent-length: 6\r\n\r\n",
        b"GET / HTTP/1.1\r\nhost: x\r\nbad header\r\n\r\n",
        long_head.as_bytes(),
        many_heads.as_bytes(),
    ] {
        let answer = sent(&server, bytes).await.expect("the server hangs up");
        assert!(answer.is_empty() || answer.starts_with("HTTP/1.1 4"), "{answer}");
    }
    server.anybody().get("/livez").await.expect(200);
}

#[tokio::test(flavor = "multi_thread")]
async fn figures_name_routes_and_never_paths() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    server.admin().get(&floor.path(route::VECTOR)).await.expect(200);
    let invented = Method::from_bytes(b"INVENTED").unwrap();
    Answer::to(server.admin().request(invented, "/secret-path")).await.expect(404);
    let figures = server.anybody().get("/metrics").await.expect(200);
    let figures = String::from_utf8(figures.body).unwrap();
    let route = format!("method=\"GET\",route=\"{}\",status=\"200\"", route::VECTOR);
    assert!(figures.contains(&format!("mapfold_http_requests_total{{{route}}} 1")), "{figures}");
    assert!(figures.contains("mapfold_http_request_duration_seconds_bucket"), "{figures}");
    assert!(figures.contains("method=\"other\",route=\"none\",status=\"404\""), "{figures}");
    assert!(!figures.contains("secret-path") && !figures.contains("plant"), "{figures}");
}
