//! The program itself, on the command line: what it writes and with which status it ends.
#![expect(clippy::unwrap_used, reason = "tests stop at the first surprise")]

#[expect(dead_code, reason = "these tests need a server that works, not one that fails")]
#[path = "worlds/server.rs"]
mod server;

use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use mapfold_client::sensor::{RangeTable, Sensors};
use server::Server;

fn robot(arguments: &[&str], folder: &Path) -> Output {
    Command::new(env!("CARGO_BIN_EXE_mapfold-robot"))
        .args(arguments)
        .env_remove("MAPFOLD_TOKEN")
        .env_remove("MAPFOLD_SERVER")
        .current_dir(folder)
        .output()
        .unwrap()
}

fn log(name: &str) -> String {
    let path = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../tests/data").join(name);
    path.to_str().unwrap().to_owned()
}

fn words(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn extract_writes_the_features_of_one_scan() {
    let folder = tempfile::tempdir().unwrap();
    let out = folder.path().join("scan.geojson");
    let arguments =
        ["extract", &log("killian.log.gz"), "--scan", "7", "--out", out.to_str().unwrap()];
    let output = robot(&arguments, folder.path());
    assert!(output.status.success(), "{}", words(&output));
    let text = std::fs::read(&out).unwrap();
    let written: serde_json::Value = serde_json::from_slice(&text).unwrap();
    let features = written["features"].as_array().unwrap();
    let of_kind = |kind: &str| {
        features.iter().filter(move |f| f["properties"]["kind"] == kind).collect::<Vec<_>>()
    };
    assert_eq!(of_kind("pose").len(), 1);
    assert!(of_kind("segment").len() >= 2);
    for segment in of_kind("segment") {
        assert_eq!(segment["properties"]["scan"], 7);
        // Both ends lie on the supporting line that the properties tell.
        let (rho, alpha) = (
            segment["properties"]["rho_m"].as_f64().unwrap(),
            segment["properties"]["alpha_rad"].as_f64().unwrap(),
        );
        for end in segment["geometry"]["coordinates"].as_array().unwrap() {
            let (x, y) = (end[0].as_f64().unwrap(), end[1].as_f64().unwrap());
            let off = x * alpha.cos() + y * alpha.sin() - rho;
            assert!(off.abs() < 1e-3, "{off}");
        }
    }
}

#[test]
fn calibrate_makes_a_profile_of_readings_and_says_how_good_it_is() {
    use std::fmt::Write as _;
    let folder = tempfile::tempdir().unwrap();
    let mut text = "distance_m,incidence_deg,reading_m,surface\n".to_owned();
    for (distance, incidence) in (3..=20).flat_map(|d| [(d, 0), (d, 30), (d, 60)]) {
        for i in 0..30 {
            let d = 0.1 * f64::from(distance);
            let reading = d + 0.04 * (3.0 * d).sin() + 0.0005 * f64::from(i % 15 - 7);
            let surface = if i < 15 { "white" } else { "grey" };
            writeln!(text, "{d:.1},{incidence},{reading:.4},{surface}").unwrap();
        }
    }
    std::fs::write(folder.path().join("readings.csv"), &text).unwrap();
    let calibrate = |readings: &str, out: &str| {
        robot(&["calibrate", readings, "--out", out, "--model", "head 7"], folder.path())
    };
    for out in ["profile.toml", "profile.json"] {
        let output = calibrate("readings.csv", out);
        assert!(output.status.success(), "{}", words(&output));
        let said = words(&output);
        assert!(said.contains("readings: 1620 at 54 of 54 nodes"), "{said}");
        assert!(said.contains("corrected:     rms 2.2 mm") && !said.contains("warning"), "{said}");
        let written = std::fs::read_to_string(folder.path().join(out)).unwrap();
        let scanner = Sensors::parse(&written).unwrap().scanner.unwrap();
        assert_eq!(scanner.model, "head 7");
        let table = RangeTable::new(scanner.correction.as_ref().unwrap());
        let found = table.correct(1.0 + 0.04 * 3f64.sin(), 0.2).unwrap();
        assert!((found.range - 1.0).abs() < 1e-3, "{found:?}");
    }
    // The profile is one that the other commands take.
    let log = log("killian.log.gz");
    let extract =
        ["extract", &log, "--scan", "0", "--sensor", "profile.toml", "--out", "scan.geojson"];
    let output = robot(&extract, folder.path());
    assert!(output.status.success(), "{}", words(&output));

    std::fs::write(folder.path().join("bad.csv"), text + "1.0,30\n").unwrap();
    let output = calibrate("bad.csv", "none.toml");
    assert_eq!(output.status.code(), Some(1));
    assert!(words(&output).contains("bad.csv, line 1622: 2 cells"), "{}", words(&output));
    assert!(!folder.path().join("none.toml").exists());
}

#[test]
fn what_cannot_be_done_is_said_with_a_status() {
    let folder = tempfile::tempdir().unwrap();
    let (killian, ring) = (log("killian.log.gz"), log("corridor-ring8.log.gz"));
    let place = ["--token", "t", "--site", "s", "--level", "l", "--robot", "r"];
    // Nobody listens on the discard port.
    let nowhere = ["--server", "http://127.0.0.1:9", "--give-up-after", "1"];
    let replay = |log: &str, more: &[&str]| {
        let arguments = [&["replay", log], &place[..], &nowhere[..], more].concat();
        robot(&arguments, folder.path())
    };
    let table = [
        (robot(&["extract", &ring, "--out", "o"], folder.path()), 1, "the log holds no scans"),
        (robot(&["extract", "no.log", "--out", "o"], folder.path()), 1, "cannot open no.log"),
        (
            robot(&["extract", &killian, "--scan", "9999", "--out", "o"], folder.path()),
            1,
            "there is no such scan",
        ),
        (robot(&["replay", &killian, "--site", "s"], folder.path()), 2, "--token"),
        (replay(&killian, &[]), 1, "gave up"),
        (replay(&killian, &["--from", "yesterday"]), 2, "no place in a log"),
        (replay(&killian, &["--speed", "0"]), 1, "a speed of 0"),
        (replay(&killian, &["--sensor", "no-such"]), 2, "it is no preset"),
        (replay(&killian, &["--competence", "sonar"]), 1, "--emulate-sonar"),
        (replay(&ring, &["--emulate-sonar"]), 1, "the log holds no scans"),
        (replay(&killian, &["--from", "50%", "--to", "40%"]), 1, "none of them between"),
    ];
    for (output, status, reason) in table {
        let said = words(&output);
        assert_eq!(output.status.code(), Some(status), "{said}");
        assert!(said.contains(reason), "{reason:?} is not in {said}");
    }
    assert!(!folder.path().join("o").exists());
}

/// Beginning of a log of scans, as text.
fn text(lines: usize) -> String {
    let file = std::fs::File::open(log("killian.log.gz")).unwrap();
    let mut whole = String::new();
    flate2::read::GzDecoder::new(file).read_to_string(&mut whole).unwrap();
    whole.lines().take(lines).map(|line| line.to_owned() + "\n").collect()
}

/// A log of which the end is missing.
fn cut_short(folder: &Path) -> PathBuf {
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    gzip.write_all(text(120).as_bytes()).unwrap();
    let mut packed = gzip.finish().unwrap();
    packed.truncate(packed.len() / 2);
    let file = folder.join("cut.log.gz");
    std::fs::write(&file, packed).unwrap();
    file
}

/// A log that ends as it should, with seven lines in it that cannot be read.
fn with_broken_lines(folder: &Path) -> PathBuf {
    let broken = "FLASER 90 1\n".repeat(7);
    let file = folder.join("broken.log");
    std::fs::write(&file, format!("{broken}{}", text(40))).unwrap();
    file
}

/// Replays `log` against a server that works; what the program said, its report, and how many
/// contributions the server then has.
async fn replayed(log: &Path, folder: &Path) -> (Output, serde_json::Value, u64) {
    let server = Server::start("secret").await;
    let arguments: [&[&str]; 3] = [
        &["replay", log.to_str().unwrap(), "--create", "--robot", "r", "--outbox", "outbox"],
        &["--server", &server.url, "--token", "secret", "--site", "s", "--level", "l"],
        &["--report", "report.json"],
    ];
    let output = robot(&arguments.concat(), folder);
    let report = std::fs::read(folder.join("report.json")).unwrap();
    let taken = server.world.lock().unwrap().taken.len() as u64;
    (output, serde_json::from_slice(&report).unwrap(), taken)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_log_that_is_cut_short_is_replayed_as_far_as_it_goes_and_is_no_success() {
    let folder = tempfile::tempdir().unwrap();
    let (output, report, taken) = replayed(&cut_short(folder.path()), folder.path()).await;
    let said = words(&output);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("the log is cut short: cannot read on after line "), "{said}");
    assert!(said.contains("so what came after is missing from the map"), "{said}");
    assert!(taken > 10, "{taken} contributions: {said}");
    assert_eq!((&report["acknowledged"], &report["waiting"]), (&taken.into(), &0.into()));
    assert_eq!(report["complete"], false);
    assert!(report["cut_short"].as_str().unwrap().starts_with("cannot read on"), "{report}");
    assert_eq!((&report["malformed_lines"], report["trouble"].is_null()), (&0.into(), true));
}

#[tokio::test(flavor = "multi_thread")]
async fn broken_lines_of_a_log_are_told_and_the_rest_is_a_success() {
    let folder = tempfile::tempdir().unwrap();
    let (output, report, taken) = replayed(&with_broken_lines(folder.path()), folder.path()).await;
    let said = words(&output);
    assert!(output.status.success(), "{said}");
    assert!(said.contains("7 of 47 lines of the log are malformed"), "{said}");
    assert!(said.contains("line 1: ") && said.contains("line 5: "), "{said}");
    assert!(!said.contains("line 6: ") && said.contains("and 2 more"), "{said}");
    assert!(taken > 10, "{taken} contributions: {said}");
    assert_eq!((&report["malformed_lines"], &report["complete"]), (&7.into(), &true.into()));
    assert!(report["cut_short"].is_null(), "{report}");
}

#[test]
fn extract_tells_of_a_damaged_log_and_writes_what_can_be_read() {
    let folder = tempfile::tempdir().unwrap();
    let table = [
        (cut_short(folder.path()), 1, "before the log was cut short"),
        (with_broken_lines(folder.path()), 0, "7 of 47 lines of the log are malformed"),
    ];
    for (log, status, reason) in table {
        let out = folder.path().join("features.geojson");
        let arguments = ["extract", log.to_str().unwrap(), "--out", out.to_str().unwrap()];
        let output = robot(&arguments, folder.path());
        let said = words(&output);
        assert_eq!(output.status.code(), Some(status), "{said}");
        assert!(said.contains(reason), "{reason:?} is not in {said}");
        let written = std::fs::read(&out).unwrap();
        let written: serde_json::Value = serde_json::from_slice(&written).unwrap();
        assert!(written["features"].as_array().unwrap().len() > 10, "{said}");
        std::fs::remove_file(out).unwrap();
    }
}
