//! `mapfold-robot locate` on what a server holds: scans that are in no map find their places.

use std::path::Path;
use std::process::Output;

use mapfold_tests::carmen::Log;
use mapfold_tests::database::Database;
use mapfold_tests::level::Level;
use mapfold_tests::robot::{Robot, Target};
use mapfold_tests::server::Server;
use mapfold_tests::{Error, programs};
use serde_json::Value;

async fn locate(
    log: &Path,
    target: &Target,
    mirror: &Path,
    more: &[&str],
) -> Result<Output, Error> {
    tokio::process::Command::new(programs::path("mapfold-robot")?)
        .arg("locate")
        .arg(log)
        .args(["--server", &target.url, "--token", &target.token])
        .args(["--site", &target.site, "--level", &target.level, "--mirror"])
        .arg(mirror)
        .args(more)
        .output()
        .await
        .map_err(|e| Error::file(log, e))
}

#[tokio::test]
async fn scans_that_are_in_no_map_find_their_places_or_say_that_they_do_not() -> Result<(), Error> {
    let mut server = Server::start(Database::Sqlite).await?;
    let folder = server.folder().to_owned();
    let log = Log::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("data/killian.log.gz"))?;
    let target = Target {
        url: server.url(),
        token: server.admin_token().to_owned(),
        site: "mit".to_owned(),
        level: "floor".to_owned(),
    };
    // Two robots map what lies before and behind; ten scans between are in no map, and ten are from far away.
    for (name, from, to) in [("anna", 3640, 3795), ("berta", 3806, 3873)] {
        let part = folder.join(format!("{name}.log.gz"));
        log.write_part(from, to, &part)?;
        Robot::new(name, &part).start(&target, &folder)?.finish().await?;
    }
    Level::new(server.api()?, "mit", "floor").folded().await?;
    let mirror = folder.join("mirror");

    let between = folder.join("between.log.gz");
    log.write_part(3795, 3806, &between)?;
    let output = locate(&between, &target, &mirror, &[]).await?;
    let told = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert_eq!(told.lines().count(), 11, "{told}");
    let mut found = 0;
    for (line, scan) in told.lines().zip(&log.scans[3795..3806]) {
        let fix: Value = serde_json::from_str(line).unwrap_or_default();
        assert!(fix["kind"].is_string(), "{line}");
        let number = |of: &Value| of.as_f64().unwrap_or(f64::NAN);
        if fix["kind"] == "unique" {
            let off = (number(&fix["x"]) - scan.origin.x).hypot(number(&fix["y"]) - scan.origin.y);
            assert!(off < 0.2, "{off} m off: {line}");
            let variance = number(&fix["covariance"][0][0]);
            assert!(variance > 0.0 && variance < 0.1, "{line}");
            assert!(number(&fix["matched"]) > 20.0, "{line}");
            found += 1;
        }
    }
    assert!(found >= 4, "{told}");

    let away = folder.join("away.log.gz");
    log.write_part(1000, 1010, &away)?;
    let told = locate(&away, &target, &mirror, &[]).await?.stdout;
    let told = String::from_utf8_lossy(&told).into_owned();
    assert!(told.lines().count() == 10 && !told.contains("unique"), "{told}");

    // The mirror suffices when the server is gone; what cannot be is said.
    server.stop().await?;
    let one = locate(&between, &target, &mirror, &["--scan", "5"]).await?;
    assert_eq!(String::from_utf8_lossy(&one.stdout).lines().count(), 1);
    let refused = locate(&between, &target, &mirror, &["--scan", "99"]).await?;
    let said = String::from_utf8_lossy(&refused.stderr).into_owned();
    assert!(!refused.status.success() && said.contains("the log has 11"), "{said}");
    Ok(())
}
