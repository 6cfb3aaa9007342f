//! Replays against a server that fails as servers do.
#![expect(clippy::unwrap_used, reason = "tests stop at the first surprise")]

#[path = "worlds/server.rs"]
mod server;

use std::path::{Path, PathBuf};
use std::time::Duration;

use mapfold_client::replay::{
    self, Cut, ReplayError, ReplayOptions, ReplayProgress, Report, SensorChoice, Window,
};
use mapfold_client::sync::{Api, ApiOptions, BackoffConfig, LevelAddress, UploadConfig, tls};
use mapfold_schema::v1;
use rand::SeedableRng;
use rand::rngs::StdRng;
use server::Server;
use tokio::sync::watch;

const TOKEN: &str = "secret";
/// Beginning of the committed log that the tests play.
const SCANS: usize = 150;

fn log(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/data").join(name)
}

fn options(folder: &Path) -> ReplayOptions {
    let level = LevelAddress { site: "mit".to_owned(), level: "floor".to_owned() };
    let share = SCANS as f64 / 3873.0;
    ReplayOptions {
        create: true,
        window: Window { from: None, to: Some(Cut::Share(share)) },
        outbox: Some(folder.to_owned()),
        upload: UploadConfig {
            backoff: BackoffConfig {
                base: Duration::from_millis(5),
                cap: Duration::from_millis(50),
                server_cap: Duration::from_secs(1),
            },
            ..UploadConfig::STANDARD
        },
        ..ReplayOptions::new(log("killian.log.gz"), level, "anna")
    }
}

async fn play(options: ReplayOptions, url: &str, token: &str) -> Result<Report, ReplayError> {
    tls::install_provider();
    let api = Api::new(url, token, ApiOptions::STANDARD).unwrap();
    let progress = watch::Sender::new(ReplayProgress::default());
    replay::run(options, api, StdRng::seed_from_u64(1), &progress).await
}

#[tokio::test]
async fn a_replay_makes_what_is_missing_and_delivers_every_scan_once() {
    let (server, folder) = (Server::start(TOKEN).await, tempfile::tempdir().unwrap());
    let report = play(options(folder.path()), &server.url, TOKEN).await.unwrap();
    assert!(report.complete, "{report:?}");
    let expected = SCANS as u64;
    assert_eq!((report.readings, report.acknowledged, report.known), (expected, expected, 0));
    assert!(report.bytes_up_per_contribution > 100.0);
    let world = server.world.lock().unwrap();
    assert_eq!(world.taken.len(), SCANS);
    let anna = &world.robots["anna"];
    assert_eq!(anna.sensors[0].kind, v1::SensorKind::Scanner);
    assert!(world.batches.iter().all(|n| *n <= 64) && world.batches.iter().any(|n| *n > 1));
    let frame = world.levels[&("mit".to_owned(), "floor".to_owned())].frame;
    for contribution in world.contributions.values() {
        assert_eq!((contribution.frame, contribution.robot.as_str()), (frame, "anna"));
        assert!(!contribution.emulated && !contribution.evidence.is_empty());
    }
}

#[tokio::test]
async fn all_scans_of_a_stop_are_one_contribution() {
    let (server, folder) = (Server::start(TOKEN).await, tempfile::tempdir().unwrap());
    let log = folder.path().join("stop.log");
    // Three scans on the way, five at rest, two on the way.
    let places = [0.0, 0.5, 1.0, 1.5, 1.5, 1.5, 1.5, 1.5, 2.0, 2.5];
    let ranges = vec!["3.0"; 180].join(" ");
    let line = |(i, x): (usize, &f64)| {
        format!("FLASER 180 {ranges} {x} 0 0 {x} 0 0 {}.5 robot {i}.5\n", 100 + i)
    };
    std::fs::write(&log, places.iter().enumerate().map(line).collect::<String>()).unwrap();
    let options =
        ReplayOptions { log, window: Window::default(), ..options(&folder.path().join("outbox")) };
    let report = play(options, &server.url, TOKEN).await.unwrap();
    assert!(report.complete, "{report:?}");
    assert_eq!((report.readings, report.acknowledged), (6, 6));
    let world = server.world.lock().unwrap();
    let mut seen: Vec<(f64, &str)> =
        world.contributions.values().map(|c| (c.pose.x_m, c.observed_at.as_str())).collect();
    seen.sort_by(|a, b| a.0.total_cmp(&b.0));
    let places: Vec<f64> = seen.iter().map(|(x, _)| *x).collect();
    assert_eq!(places, [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]);
    assert!(seen[3].1.starts_with("1970-01-01T00:01:47.5"), "{}", seen[3].1);
}

#[tokio::test]
async fn a_server_that_is_busy_or_loses_answers_gets_everything_once() {
    let (server, folder) = (Server::start(TOKEN).await, tempfile::tempdir().unwrap());
    {
        let mut world = server.world.lock().unwrap();
        (world.unavailable, world.answers_lost) = (3, 2);
    }
    let report = play(options(folder.path()), &server.url, TOKEN).await.unwrap();
    assert!(report.complete && report.retries >= 5, "{report:?}");
    assert_eq!(server.world.lock().unwrap().taken.len(), SCANS);
}

#[tokio::test]
async fn a_replay_goes_on_by_itself_when_the_server_is_back() {
    let (server, folder) = (Server::start(TOKEN).await, tempfile::tempdir().unwrap());
    let (url, world) = (server.url.clone(), server.world.clone());
    let options = ReplayOptions { speed: Some(400.0), ..options(folder.path()) };
    let replay = tokio::spawn(async move { play(options, &url, TOKEN).await });
    while world.lock().unwrap().taken.len() < SCANS / 5 {
        tokio::time::sleep(Duration::from_millis(2)).await;
    }
    let server = server.restart_after(Duration::from_millis(300)).await;
    let report = replay.await.unwrap().unwrap();
    assert!(report.complete && report.retries > 0, "{report:?}");
    assert_eq!(server.world.lock().unwrap().taken.len(), SCANS);
}

#[tokio::test]
async fn a_replay_that_was_cut_off_goes_on_where_it_was() {
    let (server, folder) = (Server::start(TOKEN).await, tempfile::tempdir().unwrap());
    let world = server.world.clone();
    let (url, cut_off) = (server.url.clone(), options(folder.path()));
    let first = tokio::spawn(async move { play(cut_off, &url, TOKEN).await });
    while world.lock().unwrap().taken.is_empty() {
        tokio::time::sleep(Duration::from_millis(1)).await;
    }
    first.abort();
    assert!(first.await.is_err());
    // What the aborted replay left to its worker thread may still hold the outbox for a moment.
    let report = loop {
        match play(options(folder.path()), &server.url, TOKEN).await {
            Err(ReplayError::Outbox(mapfold_client::sync::OutboxError::InUse { .. })) => {
                tokio::time::sleep(Duration::from_millis(5)).await;
            }
            other => break other.unwrap(),
        }
    };
    assert!(report.complete, "{report:?}");
    assert_eq!(world.lock().unwrap().taken.len(), SCANS);
    // A third time there is nothing left to say.
    let again = play(options(folder.path()), &server.url, TOKEN).await.unwrap();
    assert_eq!((again.known, again.acknowledged), (SCANS as u64, 0));
    assert!(again.complete);
}

#[tokio::test]
async fn two_runs_from_nothing_send_the_same_bytes() {
    let mut sent = Vec::new();
    for _ in 0..2 {
        let (server, folder) = (Server::start(TOKEN).await, tempfile::tempdir().unwrap());
        play(options(folder.path()), &server.url, TOKEN).await.unwrap();
        sent.push(std::mem::take(&mut server.world.lock().unwrap().contributions));
    }
    assert!(sent[0] == sent[1]);
}

#[tokio::test]
async fn one_refused_contribution_is_parked_and_the_rest_gets_through() {
    let (server, folder) = (Server::start(TOKEN).await, tempfile::tempdir().unwrap());
    server.world.lock().unwrap().refuses = Some(0x42);
    let mut options = options(folder.path());
    options.window.to = Some(Cut::Share(0.25));
    let report = play(options, &server.url, TOKEN).await.unwrap();
    // One id in 256 ends so; among the first 969 of this log there are some.
    assert!(!report.complete && report.refused > 0, "{report:?}");
    assert_eq!(report.acknowledged + report.refused, report.contributions);
    assert!(report.trouble.unwrap().contains("refused"));
}

#[tokio::test]
async fn a_wrong_token_and_a_missing_level_are_said_at_once() {
    let (server, folder) = (Server::start(TOKEN).await, tempfile::tempdir().unwrap());
    let error = play(options(folder.path()), &server.url, "wrong").await.unwrap_err();
    assert!(error.to_string().contains("token_unknown"), "{error}");
    let options = ReplayOptions { create: false, ..options(folder.path()) };
    let error = play(options, &server.url, TOKEN).await.unwrap_err();
    assert!(error.to_string().contains("level_not_found"), "{error}");
}

#[tokio::test]
async fn a_server_that_never_comes_is_given_up_on_when_asked() {
    let folder = tempfile::tempdir().unwrap();
    let mut options = options(folder.path());
    options.upload.deadline = Some(Duration::from_millis(200));
    // Nobody listens on the discard port.
    let error = play(options, "http://127.0.0.1:9", TOKEN).await.unwrap_err();
    assert!(matches!(error, ReplayError::GaveUp(_)), "{error}");
}

#[tokio::test]
async fn an_existing_level_of_other_cells_is_not_taken_for_the_one_asked_for() {
    let (server, folder) = (Server::start(TOKEN).await, tempfile::tempdir().unwrap());
    let of = |m| ReplayOptions { resolution_m: Some(m), ..options(folder.path()) };
    play(of(0.1), &server.url, TOKEN).await.unwrap();
    let error = play(of(0.05), &server.url, TOKEN).await.unwrap_err();
    assert!(matches!(error, ReplayError::Resolution { .. }), "{error}");
}

#[tokio::test]
async fn emulated_sonar_is_declared_and_labelled_as_such() {
    let (server, folder) = (Server::start(TOKEN).await, tempfile::tempdir().unwrap());
    let sensors = SensorChoice { emulate_sonar: true, ..SensorChoice::default() };
    let options = ReplayOptions { sensors, ..options(folder.path()) };
    assert!(play(options, &server.url, TOKEN).await.unwrap().complete);
    let world = server.world.lock().unwrap();
    let declared = &world.robots["anna"].sensors;
    assert!(declared.len() == 1 && declared[0].emulated);
    assert_eq!(declared[0].kind, v1::SensorKind::Sonar);
    assert!(world.contributions.values().all(|c| c.emulated && c.segments.is_empty()));
}

#[tokio::test]
async fn a_robot_that_comes_back_with_other_sensors_is_enrolled_with_them() {
    let (server, folder) = (Server::start(TOKEN).await, tempfile::tempdir().unwrap());
    let few = Window { from: None, to: Some(Cut::Share(0.001)) };
    let scanner = ReplayOptions { window: few, ..options(folder.path()) };
    assert!(play(scanner.clone(), &server.url, TOKEN).await.unwrap().complete);
    let sensors = SensorChoice { emulate_sonar: true, ..SensorChoice::default() };
    let sonar = ReplayOptions { sensors, ..scanner };
    assert!(play(sonar, &server.url, TOKEN).await.unwrap().complete);
    let world = server.world.lock().unwrap();
    assert_eq!(world.robots["anna"].sensors[0].kind, v1::SensorKind::Sonar);
    // What a scanner saw and what sonar heard from the same places are different contributions.
    assert_eq!(world.taken.len(), 8);
}

#[tokio::test]
async fn a_paced_replay_takes_its_time() {
    let (server, folder) = (Server::start(TOKEN).await, tempfile::tempdir().unwrap());
    let mut options = options(folder.path());
    // The first 60 s of the log, a hundred times as fast as life.
    options.window.to = Some(Cut::Seconds(60.0));
    options.speed = Some(100.0);
    let report = play(options, &server.url, TOKEN).await.unwrap();
    assert!(report.complete && report.wall_seconds > 0.5, "{report:?}");
}
