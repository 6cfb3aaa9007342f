//! The operators' page in headless Chromium against a real server: it shows segments and pictures,
//! follows what robots send within two seconds, and logs no error.

use std::path::Path;

use mapfold_tests::Error;
use mapfold_tests::carmen::Log;
use mapfold_tests::database::Database;
use mapfold_tests::level::Level;
use mapfold_tests::page;
use mapfold_tests::robot::{Robot, Target};
use mapfold_tests::server::Server;
use serde_json::Value;

/// How long the page is watched while a robot sends, seconds.
const WATCH_S: u32 = 15;

/// How long a contribution may take from its receipt to the screen, milliseconds.
const DELAY_MAX_MS: f64 = 2000.0;

#[tokio::test]
async fn the_page_shows_the_map_and_follows_it() -> Result<(), Error> {
    let server = Server::start(Database::Sqlite).await?;
    let folder = server.folder();
    let log = Log::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("data/killian.log.gz"))?;
    let (before, during) = (folder.join("before.log.gz"), folder.join("during.log.gz"));
    log.write_part(0, 200, &before)?;
    log.write_part(200, 300, &during)?;
    let target = Target {
        url: server.url(),
        token: server.admin_token().to_owned(),
        site: "mit".to_owned(),
        level: "floor".to_owned(),
    };
    Robot::new("anna", &before).start(&target, folder)?.finish().await?;
    Level::new(server.api()?, "mit", "floor").folded().await?;

    // About two scans a second come in while the page is watched.
    let _bruno = Robot::new("bruno", &during).with(&["--speed", "4"]).start(&target, folder)?;
    let watch_s = WATCH_S.to_string();
    let settings = [("WATCH_S", watch_s.as_str())];
    let said = page::play(&server, "page.mjs", ["mit", "floor"], &settings).await?;
    let event = |name: &str| said.event(name);
    let (shown, end) = (event("shown"), event("end"));
    let number = |event: &Value, name: &str| event[name].as_f64().unwrap_or(-1.0);
    println!("{shown}\n{end}");
    assert!(number(&shown, "revision") >= 200.0, "{shown}");
    assert!(number(&shown, "segments") > 10.0, "{shown}");
    assert!(number(&shown, "pieces_painted") > 10.0, "{shown}");
    assert!(number(&shown, "tiles_loaded") > 0.0, "{shown}");
    assert!(number(&end, "robots") >= 2.0, "{end}");
    assert!(number(&end, "revision") > number(&shown, "revision"), "{end}");
    assert!(number(&end, "revisions_seen") >= 10.0, "{end}");
    assert!(number(&end, "revisions_missed").abs() < 0.5, "{end}");
    assert!((0.0..DELAY_MAX_MS).contains(&number(&end, "delay_ms_max")), "{end}");
    for complaints in ["console_errors", "failed_requests"] {
        assert_eq!(end[complaints].as_array().map(Vec::len), Some(0), "{end}");
    }
    Ok(())
}
