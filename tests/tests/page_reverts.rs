//! The page's log panel in headless Chromium against a real server: a robot's contributions are
//! taken out of the map and put back with the keyboard; who may not is not asked.

use std::path::Path;

use mapfold_schema::v1::RevertPage;
use mapfold_schema::{codec, route};
use mapfold_tests::Error;
use mapfold_tests::carmen::Log;
use mapfold_tests::database::Database;
use mapfold_tests::fleet;
use mapfold_tests::level::Level;
use mapfold_tests::page;
use mapfold_tests::server::Server;

/// Scans that are played, a third by each of three robots.
const SCANS: usize = 150;

#[tokio::test]
async fn the_page_takes_contributions_out_and_puts_them_back() -> Result<(), Error> {
    let server = Server::start(Database::Sqlite).await?;
    let folder = server.folder();
    let log = Log::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("data/killian.log.gz"))?;
    let part = folder.join("part.log.gz");
    log.write_part(500, 500 + SCANS, &part)?;
    let robots = fleet::cut(&Log::read(&part)?, folder)?;
    fleet::play(&server, "mit", "floor", &robots, folder).await?;
    let level = Level::new(server.api()?, "mit", "floor");
    level.folded().await?;
    let full = level.vector(0, codec::CBOR).await?.segments;
    let reader =
        server.command(&["token", "create", "--scope", "map:read", "--site", "mit"]).await?;

    let settings = [("READER", reader.trim()), ("ROBOT", fleet::NAMES[1])];
    let told = page::play(&server, "reverts.mjs", ["mit", "floor"], &settings).await?;
    let said = &told.text;
    let event = |name: &str| told.event(name);
    let text = |name: &str, field: &str| told.words(name, field);

    assert_eq!(event("reader")["controls"], false, "{said}");
    assert!(text("reader", "text").contains("map:edit"), "{said}");
    assert!(text("preview", "text").contains("Takes 50 contributions of"), "{said}");
    assert!(text("preview", "text").contains("Segments: "), "{said}");
    assert_eq!(event("out")["revision"], SCANS as i64 + 1, "{said}");
    assert!(text("out", "done").contains("50 contributions"), "{said}");
    assert_eq!(event("out")["lines_out"], 50, "{said}");
    assert_ne!(event("out")["segments"], full.len(), "{said}");
    assert!(text("undo_preview", "text").contains("Puts 50 contributions of"), "{said}");
    assert_eq!(event("back")["revision"], SCANS as i64 + 2, "{said}");
    assert_eq!(event("back")["segments"], full.len(), "{said}");
    assert!(
        text("refused", "text").contains("None of these contributions is in the map"),
        "{said}"
    );

    let reverts: RevertPage = level.api.fetch(&level.path(route::REVERTS)).await?;
    let reasons: Vec<&str> = reverts.reverts.iter().map(|r| r.reason.as_str()).collect();
    assert_eq!(reasons, ["somebody else's", "its scanner had come loose"]);
    assert!(reverts.reverts[1].undone.is_some());
    Ok(())
}
