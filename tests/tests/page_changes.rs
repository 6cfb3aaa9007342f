//! The page's card of changes in headless Chromium against a real server: robots drive through a simulated hall whose model
//! lacks a pillar, has a machine that is not there, and another pillar in the wrong place; an operator answers.

use mapfold_schema::route;
use mapfold_schema::v1::{
    GdbCollection, GdbPlacement, ModelChangeKind, ModelChangeState, ModelChanges,
};
use mapfold_tests::Error;
use mapfold_tests::carmen::Log;
use mapfold_tests::database::Database;
use mapfold_tests::fleet;
use mapfold_tests::level::Level;
use mapfold_tests::page;
use mapfold_tests::server::Server;
use mapfold_tests::simulation::{Recording, Scanner, hall, record};
use serde_json::{Value, json};
use uuid::Uuid;

/// How the hall is turned in its level, radians, and half the side of its pillars, metres.
const TURN_RAD: f64 = 0.35;
const HALF_M: f64 = 0.25;

fn turned([x, y]: [f64; 2]) -> [f64; 2] {
    let (s, c) = TURN_RAD.sin_cos();
    [c * x - s * y, s * x + c * y]
}

fn object(number: u128, kind: &str, name: &str, solid: &Value) -> Value {
    let id = Uuid::from_u128(0x0190_0000_0000_7000_8000_0000_0000_0000 + number);
    let properties = json!({"kind": kind, "name": name, "solids": [solid]});
    json!({"type": "Feature", "id": id, "geometry": null, "properties": properties})
}

fn prism(base: &[[f64; 2]]) -> Value {
    let base: Vec<[f64; 2]> = base.iter().copied().map(turned).collect();
    json!({"prism": {"base_m": [base], "lower_m": 0.0, "upper_m": 3.0}})
}

fn square(x: f64, y: f64) -> Value {
    prism(&[
        [x - HALF_M, y - HALF_M],
        [x + HALF_M, y - HALF_M],
        [x + HALF_M, y + HALF_M],
        [x - HALF_M, y + HALF_M],
    ])
}

/// The hall without the pillar at (8, 8), with the one at (16, 8) drawn 40 cm off, and with a machine at (30, 12).
fn model() -> Value {
    let corners = [[0.0, 0.0], [40.0, 0.0], [40.0, 18.0], [34.0, 24.0], [0.0, 24.0]];
    let walls = (0..corners.len()).map(|k| {
        let (a, b): ([f64; 2], [f64; 2]) = (corners[k], corners[(k + 1) % corners.len()]);
        let length = (b[0] - a[0]).hypot(b[1] - a[1]);
        // Outwards of a hall that is walked round counter-clockwise.
        let out = [0.2 * (b[1] - a[1]) / length, -0.2 * (b[0] - a[0]) / length];
        let base = [a, [a[0] + out[0], a[1] + out[1]], [b[0] + out[0], b[1] + out[1]], b];
        object(k as u128, "wall", "", &prism(&base))
    });
    let mut features: Vec<Value> = walls.collect();
    for (number, (x, y)) in
        [(24.0, 8.0), (32.0, 8.0), (8.0, 16.0), (16.0, 16.0), (24.0, 16.0), (32.0, 16.0)]
            .into_iter()
            .enumerate()
    {
        features.push(object(10 + number as u128, "other", "pillar", &square(x, y)));
    }
    features.push(object(30, "other", "pillar by the gate", &square(16.4, 8.0)));
    features.push(object(31, "machine", "lathe", &square(30.0, 12.0)));
    let round = json!({"cylinder": {"centre_m": turned([20.0, 12.0]), "radius_m": 2.0, "lower_m": 0.0, "upper_m": 3.0}});
    features.push(object(32, "other", "column", &round));
    json!({"type": "FeatureCollection", "features": features})
}

#[tokio::test]
async fn the_page_tells_what_robots_found_and_takes_answers() -> Result<(), Error> {
    let server = Server::start(Database::Sqlite).await?;
    let folder = server.folder();
    let log = folder.join("hall.log");
    record(&hall(), 0.5, &Recording::Scanner(Scanner::default()), 20, &log)?;
    let robots = fleet::cut(&Log::read(&log)?, folder)?;
    fleet::play(&server, "plant", "hall", &robots, folder).await?;
    let level = Level::new(server.api()?, "plant", "hall");
    level.folded().await?;
    level.api.put_json(&level.path(route::GDB), "*", &model()).await?.expect(200)?;
    let scopes = ["--scope", "map:read"];
    let reader =
        server.command(&[&["token", "create", "--site", "plant"], &scopes[..]].concat()).await?;

    let settings = [("READER", reader.trim())];
    let told = page::play(&server, "changes.mjs", ["plant", "hall"], &settings).await?;
    let said = &told.text;
    let event = |name: &str| told.event(name);
    let text = |name: &str, field: &str| told.words(name, field);

    assert!(text("unpublished", "text").contains("Nothing is published"), "{said}");
    assert_eq!(event("reader")["answers"], 0, "{said}");
    assert_eq!(event("told")["open"], 3, "{said}");
    let list = text("told", "list");
    assert!(list.contains("lathe is not there"), "{said}");
    assert!(list.contains("pillar by the gate stands"), "{said}");
    assert!(list.contains("that the model does not know"), "{said}");
    assert!(text("accepted", "done").contains("Taken into the draft"), "{said}");
    assert_eq!(event("dismissed")["open"], 0, "{said}");
    assert_eq!(event("published")["left"], 1, "what was dismissed is told apart: {said}");

    // The draft has the pillar where it is, to within the scanner's noise, and the lathe no more.
    let draft: GdbCollection = level.api.fetch(&level.path(route::GDB)).await?;
    assert!(draft.features.iter().all(|f| f.properties.name != "lathe"));
    let moved = draft.features.iter().find(|f| f.properties.name == "pillar by the gate");
    let nowhere = GdbPlacement { position_m: [f64::NAN; 3], rotation: None };
    let placement = moved.and_then(|f| f.properties.placement).unwrap_or(nowhere);
    let (x, y) = (placement.position_m[0], placement.position_m[1]);
    let (s, c) = TURN_RAD.sin_cos();
    // Its corners were drawn in the level: the placement is the motion, by 40 cm along the hall.
    let turn = placement.rotation.map_or(0.0, |[w, _, _, z]| 2.0 * z.atan2(w));
    assert!(turn.sin().abs() < 0.05, "{placement:?}");
    let at = turned([16.4, 8.0]);
    let (ts, tc) = turn.sin_cos();
    let there = [x + tc * at[0] - ts * at[1], y + ts * at[0] + tc * at[1]];
    let off = [there[0] - at[0] + 0.4 * c, there[1] - at[1] + 0.4 * s];
    assert!(off[0].hypot(off[1]) < 0.03, "{off:?}");
    let left: ModelChanges = level.api.fetch(&level.path(route::CHANGES)).await?;
    let left: Vec<(ModelChangeKind, ModelChangeState)> =
        left.changes.iter().map(|change| (change.kind, change.state)).collect();
    assert_eq!(left, [(ModelChangeKind::New, ModelChangeState::Dismissed)]);
    Ok(())
}
