//! The program itself, on the command line: what it writes and with which status it ends.
#![expect(clippy::unwrap_used, reason = "tests stop at the first surprise")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

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
