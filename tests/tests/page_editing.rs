//! The page's editor in headless Chromium against a real server: a room with a door is drawn by mouse, furnished, undone
//! and redone, sent and published; a second operator's stale edit is refused without loss; robots get the corners.

use mapfold_schema::route;
use mapfold_schema::v1::{GdbCollection, GdbEntryPage, LandmarkKind, LandmarkTable, ObjectKind};
use mapfold_tests::Error;
use mapfold_tests::database::Database;
use mapfold_tests::level::Level;
use mapfold_tests::page;
use mapfold_tests::server::Server;
use serde_json::json;

/// Where landmarks may lie from where they were drawn, metres: the grid of the model.
const NEAR_M: f64 = 1e-5;

#[tokio::test]
async fn the_page_draws_a_room_that_robots_then_know() -> Result<(), Error> {
    let server = Server::start(Database::Sqlite).await?;
    let level = Level::create(server.api()?, "plant", "ground").await?;
    let table = json!({"type": "FeatureCollection", "features": [{
        "type": "Feature", "id": "table", "properties": {"kind": "furniture", "solids": [
            {"box": {"from_m": [-0.6, -0.4, 0.70], "to_m": [0.6, 0.4, 0.75]}},
            {"box": {"from_m": [-0.6, -0.4, 0.0], "to_m": [-0.55, -0.35, 0.70]}},
            {"box": {"from_m": [0.55, -0.4, 0.0], "to_m": [0.6, -0.35, 0.70]}},
            {"box": {"from_m": [-0.6, 0.35, 0.0], "to_m": [-0.55, 0.4, 0.70]}},
            {"box": {"from_m": [0.55, 0.35, 0.0], "to_m": [0.6, 0.4, 0.70]}},
        ]},
    }]});
    let library = route::of_site(route::PROTOTYPES, "plant");
    level.api.put_json(&library, "*", &table).await?.expect(200)?;
    let token = async |scopes: &[&str]| -> Result<String, Error> {
        let scopes = scopes.iter().flat_map(|scope| ["--scope", scope]);
        let arguments: Vec<&str> =
            ["token", "create", "--site", "plant"].into_iter().chain(scopes).collect();
        Ok(server.command(&arguments).await?.trim().to_owned())
    };
    let reader = token(&["map:read"]).await?;
    let second = token(&["map:read", "map:edit"]).await?;

    let settings = [("SECOND", second.as_str()), ("READER", reader.as_str())];
    let told = page::play(&server, "editing.mjs", ["plant", "ground"], &settings).await?;
    let said = &told.text;
    let event = |name: &str| told.event(name);
    let text = |name: &str, field: &str| told.words(name, field);

    assert_eq!(event("reader")["editor"], false, "{said}");
    assert_eq!((&event("drawn")["objects"], &event("drawn")["unsent"]), (&json!(7), &json!(7)));
    // In space the chosen table is the same one, and what is chosen there is chosen on the map.
    assert_eq!(event("space")["chosen_before"], 1, "{said}");
    assert_eq!(event("space")["chosen"], "table", "{said}");
    assert_eq!(event("space")["x_m"], 3.0, "{said}");
    assert_eq!(event("undone")["objects"], 5, "{said}");
    assert_eq!(event("redone")["objects"], 7, "{said}");
    assert_eq!(event("kept")["unsent"], 7, "{said}");
    assert!(text("kept", "text").contains("kept in this browser"), "{said}");
    assert!(text("sent", "text").contains("7 objects"), "{said}");
    assert!(text("published", "text").contains("Published"), "{said}");
    // Nothing was taken, nothing is lost: the wall fits, the table is told with both versions.
    let refused = text("refused", "text");
    assert!(refused.contains("not sent") && refused.contains("None is lost"), "{said}");
    assert!(refused.contains("table was changed"), "{said}");
    assert!(text("refused", "news").contains("table to the window"), "{said}");
    assert_eq!(event("refused")["unsent"], 1, "{said}");
    assert_eq!(event("still_there")["clashes"], 1, "{said}");
    assert_eq!(event("still_there")["unsent"], 1, "{said}");
    assert!(text("settled", "text").contains("2 objects"), "{said}");

    // By finger on a tablet: one wall drawn, chosen and dragged, and the page no wider than the screen.
    assert_eq!(event("tablet")["length_m"], 2.0, "{said}");
    assert_eq!(event("tablet")["angle_deg"], 0.0, "{said}");
    assert_eq!(event("tablet")["unsent"], 1, "{said}");
    assert_eq!(event("tablet")["scroll_width"], 834, "{said}");

    the_model_is_what_was_drawn(&level).await?;
    robots_know_the_corners(&level).await
}

async fn the_model_is_what_was_drawn(level: &Level) -> Result<(), Error> {
    let model: GdbCollection = level.api.fetch(&level.path(route::GDB)).await?;
    let of = |kind| model.features.iter().filter(move |f| f.properties.kind == kind);
    assert_eq!(of(ObjectKind::Wall).count(), 5);
    assert_eq!(of(ObjectKind::Doorway).count(), 1);
    let places: Vec<[f64; 3]> = of(ObjectKind::Furniture)
        .filter_map(|feature| Some(feature.properties.placement?.position_m))
        .collect();
    assert!(places.iter().any(|p| (p[1] - 2.3).abs() < NEAR_M), "mine was taken: {places:?}");
    let log: GdbEntryPage = level.api.fetch(&level.path(route::GDB_ENTRIES)).await?;
    let comments: Vec<&str> = log.entries.iter().map(|entry| entry.comment.as_str()).collect();
    assert_eq!(comments, ["", "table to the window", "", "the tool room"]);
    Ok(())
}

/// A room of 4 m by 3 m between the axes of walls 10 cm thick, with a door in the middle of one side.
async fn robots_know_the_corners(level: &Level) -> Result<(), Error> {
    let path = format!("{}?height_m=1.0", level.path(route::LANDMARKS));
    let table: LandmarkTable = level.api.fetch(&path).await?;
    let has = |kind: LandmarkKind, at: [f64; 2]| {
        let near = |p: [f64; 2]| (p[0] - at[0]).hypot(p[1] - at[1]) < NEAR_M;
        table.landmarks.iter().any(|landmark| landmark.kind == kind && near(landmark.at_m))
    };
    for (x, y) in [(0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0)] {
        let inwards = |v: f64, middle: f64| if v < middle { 0.05 } else { -0.05 };
        let (dx, dy) = (inwards(x, 2.0), inwards(y, 1.5));
        let (inner, outer) = ([x + dx, y + dy], [x - dx, y - dy]);
        assert!(has(LandmarkKind::ConcaveCorner, inner), "{inner:?} {:?}", table.landmarks);
        assert!(has(LandmarkKind::ConvexCorner, outer), "{outer:?} {:?}", table.landmarks);
    }
    let of = |kind| table.landmarks.iter().filter(|l| l.kind == kind).count();
    assert_eq!(of(LandmarkKind::ConcaveCorner), 4, "{:?}", table.landmarks);
    assert!(has(LandmarkKind::Doorway, [2.0, 0.0]), "{:?}", table.landmarks);
    Ok(())
}
