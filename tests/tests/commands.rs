//! The programs' other commands, on the data of a server that has run.

use std::path::Path;

use mapfold_tests::carmen::Log;
use mapfold_tests::database::Database;
use mapfold_tests::level::Level;
use mapfold_tests::robot::{Robot, Target};
use mapfold_tests::server::Server;
use mapfold_tests::{Error, programs};

#[tokio::test]
async fn exports_backups_and_mirrors_hold_what_the_server_showed() -> Result<(), Error> {
    let mut server = Server::start(Database::Sqlite).await?;
    let folder = server.folder().to_owned();
    let log = Log::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("data/killian.log.gz"))?;
    let part = folder.join("part.log.gz");
    log.write_part(0, 60, &part)?;
    let target = Target {
        url: server.url(),
        token: server.admin_token().to_owned(),
        site: "mit".to_owned(),
        level: "floor".to_owned(),
    };
    Robot::new("anna", &part).start(&target, &folder)?.finish().await?;
    let level = Level::new(server.api()?, "mit", "floor");
    level.folded().await?;
    let shown = level.export("geojson").await?;

    // A robot's mirror, written out, is the export: both are made of the same map.
    let mirror = folder.join("mirror");
    let output = tokio::process::Command::new(programs::path("mapfold-robot")?)
        .args(["mirror", "--once", "--server", &target.url, "--token", &target.token])
        .args(["--site", "mit", "--level", "floor", "--out"])
        .arg(&mirror)
        .output()
        .await
        .map_err(|e| Error::file(&mirror, e))?;
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let read = |path: &Path| std::fs::read(path).map_err(|e| Error::file(path, e));
    assert!(read(&mirror.join("map.geojson"))? == shown, "the mirror differs from the export");

    // A backup may be taken while the server runs.
    let copy = folder.join("copy.db");
    server.command(&["backup", &copy.to_string_lossy()]).await?;
    server.stop().await?;

    let file = folder.join("floor.geojson");
    let export = |format: &'static str, file: &Path| {
        let file = file.to_string_lossy().into_owned();
        let server = &server;
        async move {
            let place = ["--site", "mit", "--level", "floor", "--out"];
            server.command(&[&["export", format], &place[..], &[file.as_str()]].concat()).await
        }
    };
    export("geojson", &file).await?;
    assert!(read(&file)? == shown, "the export on the command line differs from the one over HTTP");

    let yaml = folder.join("my.yaml");
    export("nav2", &yaml).await?;
    let text = String::from_utf8_lossy(&read(&yaml)?).into_owned();
    assert!(text.contains("image: my.pgm") && text.contains("resolution: 0.05"), "{text}");
    let image = read(&folder.join("my.pgm"))?;
    assert!(image.starts_with(b"P5") && image.len() > 10_000, "{} bytes", image.len());

    let of_copy = format!("sqlite://{}", copy.display());
    let verdict = server.command(&["verify", "--database", &of_copy]).await?;
    let digest = server.verify().await?;
    assert!(verdict.contains("sound") && verdict.contains(&digest), "{verdict}, not {digest}");
    Ok(())
}
