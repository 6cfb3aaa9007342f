//! The page's card of model files in headless Chromium against a real server: a file that is none is refused with its
//! fault, a building is told before it is taken, then taken, published, and shown with its landmarks and in space.

use std::path::Path;

use mapfold_schema::route;
use mapfold_schema::v1::{GdbCollection, LandmarkTable};
use mapfold_tests::Error;
use mapfold_tests::database::Database;
use mapfold_tests::level::Level;
use mapfold_tests::page;
use mapfold_tests::server::Server;

#[tokio::test]
async fn the_page_takes_a_building_in_after_telling_what_is_in_it() -> Result<(), Error> {
    let server = Server::start(Database::Sqlite).await?;
    let level = Level::create(server.api()?, "plant", "ground").await?;
    let building = Path::new(env!("CARGO_MANIFEST_DIR")).join("data/office.building.yaml");
    let bad = server.folder().join("bad.dxf");
    std::fs::write(&bad, "no drawing").map_err(|e| Error::file(&bad, e))?;
    let (building, bad) = (building.display().to_string(), bad.display().to_string());
    let settings = [("FILES", building.as_str()), ("BAD", bad.as_str())];
    let told = page::play(&server, "files.mjs", ["plant", "ground"], &settings).await?;
    let said = &told.text;
    let text = |name: &str, field: &str| told.words(name, field);

    assert!(text("refused", "text").contains("Line 1"), "{said}");
    assert!(text("told", "text").contains("3 doorways"), "{said}");
    assert!(text("told", "doubts").contains("have no prototype"), "{said}");
    assert!(text("taken", "text").contains("at revision 1"), "{said}");
    let model: GdbCollection = level.api.fetch(&level.path(route::GDB)).await?;
    assert!(model.features.len() > 30, "{}", model.features.len());
    let table: LandmarkTable = level.api.fetch(&level.path(route::LANDMARKS)).await?;
    assert_eq!(told.event("published")["landmarks"], table.landmarks.len(), "{said}");
    Ok(())
}
