//! The a-priori model over HTTP: drawn, corrected by several people, published, and read as plans and landmarks.

use mapfold_schema::route;
use mapfold_schema::v1::{
    BuildingImport, GdbAnswer, GdbCollection, GdbEntryKind, GdbEntryPage, GdbFindings, GdbPlan,
    GdbPreview, Import, ImportReport, LandmarkKind, LandmarkTable, PrototypeCollection,
    RasterChanges, Scope,
};
use reqwest::Method;
use reqwest::header::{ACCEPT, IF_MATCH, IF_NONE_MATCH};
use serde_json::{Value, json};
use uuid::Uuid;

use crate::access::token;
use crate::client::{Answer, Client};
use crate::server::Server;
use crate::world::Level;

fn id(number: u128) -> Uuid {
    Uuid::from_u128(0x0190_0000_0000_7000_8000_0000_0000_0000 + number)
}

fn feature(number: u128, kind: &str, [x, y, width, depth]: [f64; 4], upper: f64) -> Value {
    let to = [x + width, y + depth, upper];
    let solid = json!({"box": {"from_m": [x, y, 0.0], "to_m": to}});
    let properties = json!({"kind": kind, "solids": [solid]});
    json!({"type": "Feature", "id": id(number), "geometry": null, "properties": properties})
}

/// A room of 6 by 4 m with a doorway in its lower wall.
fn room() -> Vec<Value> {
    vec![
        feature(1, "wall", [-0.2, -0.2, 6.4, 0.2], 2.5),
        feature(2, "wall", [-0.2, 4.0, 6.4, 0.2], 2.5),
        feature(3, "wall", [-0.2, 0.0, 0.2, 4.0], 2.5),
        feature(4, "wall", [6.0, 0.0, 0.2, 4.0], 2.5),
        feature(5, "doorway", [2.0, -0.3, 0.9, 0.4], 2.1),
    ]
}

fn collection(features: &[Value]) -> Value {
    json!({"type": "FeatureCollection", "features": features})
}

async fn send(
    client: &Client,
    method: Method,
    path: &str,
    tag: Option<&str>,
    body: &Value,
) -> Answer {
    let mut request = client.request(method, path).header("content-type", "application/json");
    if let Some(tag) = tag {
        request = request.header(IF_MATCH, tag);
    }
    Answer::to(request.body(body.to_string())).await
}

async fn put(floor: &Level, tag: &str, features: &[Value]) -> Answer {
    let path = floor.path(route::GDB);
    send(&floor.client, Method::PUT, &path, Some(tag), &collection(features)).await
}

async fn patch(floor: &Level, tag: &str, body: &Value) -> Answer {
    send(&floor.client, Method::PATCH, &floor.path(route::GDB), Some(tag), body).await
}

async fn publish(floor: &Level, tag: &str) -> Answer {
    let path = floor.path(route::GDB_PUBLICATIONS);
    send(&floor.client, Method::POST, &path, Some(tag), &Value::Null).await
}

async fn landmarks(floor: &Level, query: &str) -> LandmarkTable {
    let path = format!("{}{query}", floor.path(route::LANDMARKS));
    floor.client.get(&path).await.expect(200).data()
}

#[tokio::test(flavor = "multi_thread")]
async fn a_room_is_drawn_published_and_read_as_plan_and_landmarks() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let empty = floor.client.get(&floor.path(route::GDB)).await.expect(200);
    assert_eq!(empty.header("etag"), "\"0.0\"");
    assert_eq!(empty.header("content-type"), "application/geo+json");
    let drawn = put(&floor, "\"0.0\"", &room()).await.expect(200);
    assert_eq!(drawn.header("etag"), "\"1.0\"");
    let drawn: GdbAnswer = drawn.data();
    let entry = drawn.entry.unwrap();
    assert_eq!((drawn.draft, entry.revision, entry.put, entry.removed), (1, 1, 5, 0));
    floor.folded(1).await;

    // What is read can be put again, and is then no change.
    let path = format!("{}?state=draft", floor.path(route::GDB));
    let answer = floor.client.get_with(&path, ACCEPT, "application/json").await.expect(200);
    assert_eq!(answer.header("etag"), "\"1.0j\"");
    let model: GdbCollection = answer.data();
    assert_eq!((model.revision, model.library, model.features.len()), (Some(1), Some(0), 5));
    assert!(model.features.iter().all(|feature| feature.place.is_some()));
    let again: Vec<Value> =
        model.features.iter().map(|f| serde_json::to_value(f).unwrap()).collect();
    let same: GdbAnswer = put(&floor, "\"1.0j-zstd\"", &again).await.expect(200).data();
    assert_eq!((same.draft, same.entry), (1, None));
    let tag = "\"1.0\"";
    floor.client.get_with(&floor.path(route::GDB), IF_NONE_MATCH, tag).await.expect(304);

    let path = format!("{}?height_m=0.3", floor.path(route::GDB_PLAN));
    let plan: GdbPlan = floor.client.get(&path).await.expect(200).data();
    assert_eq!((plan.draft, plan.height_m), (1, 0.3));
    // The walls are one piece all round, with a gap: one outline.
    assert_eq!((plan.outlines.len(), plan.openings.len()), (1, 1));
    assert!((plan.openings[0].width_m - 0.9).abs() < 1e-9);
    // Above the doorway the wall is closed: one outline outside, one inside.
    let path = format!("{}?height_m=2.2", floor.path(route::GDB_PLAN));
    let plan: GdbPlan = floor.client.get(&path).await.expect(200).data();
    assert_eq!((plan.outlines.len(), plan.openings.len()), (2, 0));

    // Robots get nothing before it is published.
    let none = landmarks(&floor, "").await;
    assert_eq!((none.revision, none.publication, none.landmarks.len()), (1, 0, 0));
    let published = publish(&floor, tag).await.expect(201);
    let entry = published.data::<GdbAnswer>().entry.unwrap();
    assert_eq!((entry.kind, entry.revision, entry.draft), (GdbEntryKind::Publication, 2, 1));
    let once: GdbAnswer = publish(&floor, tag).await.expect(200).data();
    assert_eq!(once.entry, None);
    let table = landmarks(&floor, "").await;
    let count = |kind| table.landmarks.iter().filter(|landmark| landmark.kind == kind).count();
    assert_eq!((table.revision, table.publication), (2, 2));
    assert_eq!(count(LandmarkKind::ConcaveCorner), 4);
    assert_eq!(count(LandmarkKind::ConvexCorner), 4);
    assert_eq!(count(LandmarkKind::Doorway), 1);
    let corner = table.landmarks.iter().find(|l| l.at_m == [0.0, 0.0]).unwrap();
    assert!((corner.heading_rad - std::f64::consts::FRAC_PI_4).abs() < 1e-9);
    assert!(corner.covariance[0][0] > 0.0);
    let sonar = landmarks(&floor, "?competence=sonar").await;
    assert!(sonar.landmarks.iter().all(|l| l.kind == LandmarkKind::ConcaveCorner));
    assert_eq!(sonar.landmarks.len(), 4);
    let near = landmarks(&floor, "?near=0,0&radius_m=1").await;
    assert_eq!(near.landmarks.len(), 2);
    let since = landmarks(&floor, "?since=2").await;
    assert_eq!((since.landmarks.len(), since.removed.len()), (0, 0));
}

#[tokio::test(flavor = "multi_thread")]
async fn the_next_table_has_what_changed_and_what_is_no_more() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    put(&floor, "*", &room()).await.expect(200);
    publish(&floor, "\"1.0\"").await.expect(201);
    // The right wall moves, a pillar comes, the doorway goes.
    let edit = json!({
        "put": [feature(4, "wall", [5.0, 0.0, 0.2, 4.0], 2.5), feature(9, "other", [2.0, 2.0, 0.5, 0.5], 3.0)],
        "remove": [id(5), id(77)],
    });
    let edited: GdbAnswer = patch(&floor, "\"1.0\"", &edit).await.expect(200).data();
    let entry = edited.entry.unwrap();
    assert_eq!((edited.draft, entry.put, entry.removed), (3, 2, 1));
    let unpublished = landmarks(&floor, "?since=2").await;
    assert_eq!((unpublished.landmarks.len(), unpublished.removed.len()), (0, 0));
    publish(&floor, "\"3.0\"").await.expect(201);
    let change = landmarks(&floor, "?since=2").await;
    assert_eq!((change.revision, change.publication), (4, 4));
    let places: Vec<[f64; 2]> = change.landmarks.iter().map(|l| l.at_m).collect();
    for new in [[5.0, 0.0], [5.0, 4.0], [2.0, 2.0], [2.5, 2.5]] {
        assert!(places.contains(&new), "{places:?}");
    }
    // Whoever applies the change has the whole table.
    let before = {
        let entries = floor.path(route::GDB_ENTRIES);
        let page: GdbEntryPage =
            floor.client.get(&format!("{entries}?limit=3")).await.expect(200).data();
        assert_eq!(page.entries.iter().map(|e| e.revision).collect::<Vec<_>>(), [4, 3, 2]);
        assert_eq!(page.next.as_deref(), Some("2"));
        floor.client.get(&format!("{entries}?cursor=2")).await.expect(200).data::<GdbEntryPage>()
    };
    assert_eq!(before.entries[0].revision, 1);
    assert!(change.removed.iter().any(|id| id.starts_with("doorway:")));
    let whole = landmarks(&floor, "").await;
    let ids: Vec<&str> = whole.landmarks.iter().map(|l| l.id.as_str()).collect();
    assert!(change.removed.iter().all(|id| !ids.contains(&id.as_str())));
    let ahead = floor.client.get(&format!("{}?since=99", floor.path(route::LANDMARKS))).await;
    assert_eq!(ahead.code(410), "cursor_expired");
    for query in ["?near=1,2", "?near=a,b&radius_m=1", "?height_m=1e9", "?competence=nose", "?x=1"]
    {
        let refused = floor.client.get(&format!("{}{query}", floor.path(route::LANDMARKS))).await;
        assert_eq!(refused.code(400), "query_invalid", "{query}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_stale_edit_is_refused_with_who_changed_what_and_loses_nothing() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    put(&floor, "\"0.0\"", &room()).await.expect(200);
    let moved = feature(4, "wall", [5.0, 0.0, 0.2, 4.0], 2.5);
    let edit = json!({"put": [moved], "remove": [id(5)]});
    let path = format!("{}?comment=the%20wall%20was%20moved", floor.path(route::GDB));
    send(&floor.client, Method::PATCH, &path, Some("\"1.0\""), &edit).await.expect(200);

    let late = json!({"put": [
        feature(9, "other", [2.0, 2.0, 0.5, 0.5], 3.0),
        feature(4, "wall", [5.5, 0.0, 0.2, 4.0], 2.5),
    ]});
    let problem = patch(&floor, "\"1.0\"", &late).await.problem(412);
    assert_eq!(problem.code, "gdb_moved_on");
    assert!(problem.detail.contains("the wall was moved"), "{}", problem.detail);
    let told: Vec<_> = problem.errors.iter().map(|e| (&*e.pointer, &*e.code)).collect();
    assert_eq!(told, [("/put/1", "object_changed"), ("", "object_removed")]);
    assert!(problem.errors[1].detail.contains(&id(5).to_string()));
    let refused = put(&floor, "\"1.0\"", &room()).await.problem(412);
    assert_eq!(refused.errors[0].pointer, "/features/3");
    assert_eq!(publish(&floor, "\"1.0\"").await.code(412), "gdb_moved_on");
    let path = floor.path(route::GDB);
    let without = send(&floor.client, Method::PUT, &path, None, &collection(&room())).await;
    assert_eq!(without.code(428), "precondition_required");
    assert_eq!(floor.describe().await.revision, 2, "nothing of it was taken");

    // The first one's answer was lost: asked again, it is there already.
    let again: GdbAnswer = patch(&floor, "\"1.0\"", &edit).await.expect(200).data();
    assert_eq!((again.draft, again.entry), (2, None));
    let merged: GdbAnswer = patch(&floor, "\"2.0\"", &late).await.expect(200).data();
    assert_eq!(merged.draft, 3);
}

#[tokio::test(flavor = "multi_thread")]
async fn drafts_may_hold_faults_that_are_named_and_are_not_published() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let mut faulty = room();
    faulty.push(feature(6, "wall", [1.0, 1.0, 0.0, 1.0], 2.5));
    faulty.push(feature(7, "doorway", [3.0, 1.5, 0.9, 0.4], 2.1));
    let path = format!("{}?preview=true", floor.path(route::GDB));
    let told: GdbPreview = send(&floor.client, Method::PUT, &path, None, &collection(&faulty))
        .await
        .expect(200)
        .data();
    assert_eq!((told.draft, told.new, told.changed, told.removed), (0, 7, 0, 0));
    let codes: Vec<&str> = told.findings.iter().map(|finding| finding.code.as_str()).collect();
    assert_eq!(codes, ["no_extent", "doorway_outside_wall"]);
    assert_eq!(floor.describe().await.revision, 0);

    put(&floor, "\"0.0\"", &faulty).await.expect(200);
    let refused = publish(&floor, "*").await.problem(409);
    assert_eq!(refused.code, "gdb_has_errors");
    let places: Vec<&str> = refused.errors.iter().map(|e| e.pointer.as_str()).collect();
    assert_eq!(places, ["/features/5/properties/solids/0"], "a doorway in no wall opens nothing");
    let path = floor.path(route::GDB_FINDINGS);
    let findings: GdbFindings = floor.client.get(&path).await.expect(200).data();
    assert_eq!((findings.draft, findings.findings.len()), (1, 2));
    assert_eq!(findings.findings[0].object, Some(id(6)));

    for (body, pointer) in [
        (json!({"type": "FeatureCollection"}), ""),
        (json!({"type": "FeatureCollection", "features": [{"type": "Feature"}]}), "/features/0"),
        (
            collection(&[json!({"type": "Feature", "id": id(1), "geometry": null,
            "properties": {"kind": "castle"}})]),
            "/features/0/properties/kind",
        ),
        (
            collection(&[feature(1, "wall", [0.0, 0.0, 1e9, 1.0], 1.0)]),
            "/features/0/properties/solids/0/box/to_m/0",
        ),
    ] {
        let problem = send(&floor.client, Method::PUT, &floor.path(route::GDB), Some("*"), &body)
            .await
            .problem(422);
        assert_eq!((&*problem.code, &*problem.errors[0].pointer), ("body_invalid", pointer));
    }
    let path = format!("{}?comment={}", floor.path(route::GDB), "x".repeat(501));
    let refused = send(&floor.client, Method::PATCH, &path, Some("*"), &json!({})).await;
    assert_eq!(refused.code(400), "query_invalid");
}

#[tokio::test(flavor = "multi_thread")]
async fn instances_follow_the_library_in_drafts_and_stay_in_what_is_published() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let path = route::of_site(route::PROTOTYPES, &floor.site);
    let shelf = |width: f64| {
        let solid = json!({"box": {"from_m": [0, 0, 0], "to_m": [width, 0.5, 2.0]}});
        let prototype = json!({"type": "Feature", "id": "shelf", "geometry": null,
            "properties": {"kind": "furniture", "solids": [solid]}});
        collection(&[prototype])
    };
    let empty = floor.client.get(&path).await.expect(200);
    assert_eq!(empty.header("etag"), "\"0.0\"");
    let unsure = send(&floor.client, Method::PUT, &path, None, &shelf(1.0)).await;
    assert_eq!(unsure.code(428), "precondition_required");
    let made = send(&floor.client, Method::PUT, &path, Some("\"0.0\""), &shelf(1.0)).await;
    let made = made.expect(200);
    assert_eq!(made.header("etag"), "\"1.0\"");
    assert_eq!(made.data::<PrototypeCollection>().revision, Some(1));

    let instance = json!({"type": "Feature", "id": id(1), "geometry": null, "properties": {
        "kind": "furniture", "prototype": "shelf", "placement": {"position_m": [4.0, 2.0, 0.0]}}});
    put(&floor, "\"0.1\"", &[instance]).await.expect(200);
    publish(&floor, "\"1.1\"").await.expect(201);
    let stale = send(&floor.client, Method::PUT, &path, Some("\"0.0\""), &shelf(3.0)).await;
    assert_eq!(stale.code(412), "library_moved_on");
    send(&floor.client, Method::PUT, &path, Some("\"1.0\""), &shelf(3.0)).await.expect(200);
    let right = async |state: &str| {
        let path = format!("{}?height_m=1&state={state}", floor.path(route::GDB_PLAN));
        let plan: GdbPlan = floor.client.get(&path).await.expect(200).data();
        plan.outlines[0].iter().map(|corner| corner.at_m[0]).fold(0.0, f64::max)
    };
    assert_eq!((right("draft").await, right("published").await), (7.0, 5.0));
    let stale = patch(&floor, "\"1.1\"", &json!({"remove": [id(1)]})).await.problem(412);
    assert_eq!(stale.errors[0].code, "library_changed");
    publish(&floor, "\"1.2\"").await.expect(201);
    assert_eq!((right("draft").await, right("published").await), (7.0, 7.0));
    let faulty = send(
        &floor.client,
        Method::PUT,
        &path,
        Some("*"),
        &collection(&[json!({
        "type": "Feature", "id": " ", "geometry": null, "properties": {"solids": []}})]),
    )
    .await
    .problem(422);
    assert_eq!(faulty.errors[0].pointer, "/features/0/id");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_published_model_becomes_the_prior_of_the_raster() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let path = floor.path(route::GDB_PRIOR);
    let early = send(&floor.client, Method::POST, &path, None, &Value::Null).await;
    assert_eq!(early.code(404), "publication_not_found");
    put(&floor, "*", &room()).await.expect(200);
    publish(&floor, "*").await.expect(201);
    let preview = format!("{path}?preview=true");
    let told = send(&floor.client, Method::POST, &preview, None, &Value::Null).await;
    let told: ImportReport = told.expect(200).data();
    // The room is 120 by 80 cells, less those that a surface runs through; the doorway is free too.
    assert!((9000..=10_100).contains(&told.free), "{told:?}");
    assert!(told.occupied > 1000 && told.bounds.is_some());
    let made = send(&floor.client, Method::POST, &path, None, &Value::Null).await;
    let made: Import = made.expect(201).data();
    assert_eq!((made.revision, made.report.as_ref()), (3, Some(&told)));
    floor.folded(3).await;
    let again = send(&floor.client, Method::POST, &path, None, &Value::Null).await;
    assert_eq!(again.expect(201).data::<Import>(), made);
    let path = format!("{}?since=2", floor.path(route::RASTER));
    let changes: RasterChanges = floor.client.get(&path).await.expect(200).data();
    assert_eq!(changes.prior.len() as u32, told.tiles);
}

#[tokio::test(flavor = "multi_thread")]
async fn editors_do_not_publish_and_readers_do_not_edit() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let with = async |scopes: &[Scope]| {
        let text = token(&server, Some("plant"), None, scopes).await;
        Level { client: server.with(&text), ..floor.clone() }
    };
    let reader = with(&[Scope::MapRead]).await;
    let editor = with(&[Scope::MapRead, Scope::MapEdit]).await;
    let publisher = with(&[Scope::MapRead, Scope::MapPublish]).await;
    assert_eq!(put(&reader, "*", &room()).await.code(403), "insufficient_scope");
    assert_eq!(put(&publisher, "*", &room()).await.code(403), "insufficient_scope");
    put(&editor, "*", &room()).await.expect(200);
    assert_eq!(publish(&editor, "*").await.code(403), "insufficient_scope");
    publish(&publisher, "*").await.expect(201);
    let entries = reader.client.get(&floor.path(route::GDB_ENTRIES)).await.expect(200);
    let authors: Vec<String> =
        entries.data::<GdbEntryPage>().entries.into_iter().map(|entry| entry.author).collect();
    assert_ne!(authors[0], authors[1]);
}

/// A room of 5 by 4 m at 100 pixels a metre, with a door in its upper wall.
const BUILDING: &str = "
name: hut
levels:
  L1:
    vertices: [[0, 0, 0, ''], [200, 0, 0, ''], [300, 0, 0, ''], [500, 0, 0, ''], [500, 400, 0, ''], [0, 400, 0, '']]
    walls: [[0, 1, {}], [2, 3, {}], [3, 4, {}], [4, 5, {}], [5, 0, {}]]
    doors: [[1, 2, {name: [1, front], type: [1, sliding]}]]
    measurements: [[0, 3, {distance: [3, 5.0]}]]
    floors: [{vertices: [0, 3, 4, 5]}]
";

#[tokio::test(flavor = "multi_thread")]
async fn a_building_is_previewed_taken_once_and_published() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let post = async |query: &str, yaml: &str| {
        let path = format!("{}{query}", floor.path(route::IMPORTS));
        floor.client.post_bytes(&path, "application/yaml", yaml.to_owned()).await
    };
    let told: BuildingImport = post("?preview=true", BUILDING).await.expect(200).data();
    let report = &told.report;
    assert_eq!((report.walls, report.doorways, report.floors), (6, 1, 1));
    let preview = told.preview.as_ref().unwrap();
    assert_eq!((preview.new, preview.removed, preview.findings.len()), (8, 0, 0));
    assert_eq!((floor.describe().await.revision, told.answer.is_none()), (0, true));

    let made = post("?building_level=L1", BUILDING).await.expect(201);
    assert_eq!(made.header("etag"), "\"1.0\"");
    let made: BuildingImport = made.data();
    assert_eq!((&made.report, made.answer.unwrap().draft), (report, 1));
    let again: BuildingImport = post("", BUILDING).await.expect(200).data();
    assert_eq!(again.answer.unwrap().entry, None);
    publish(&floor, "\"1.0\"").await.expect(201);
    let table = landmarks(&floor, "").await;
    let count = |kind| table.landmarks.iter().filter(|landmark| landmark.kind == kind).count();
    let counts = [LandmarkKind::ConcaveCorner, LandmarkKind::ConvexCorner, LandmarkKind::Doorway];
    assert_eq!(counts.map(count), [4, 4, 1]);

    // What is drawn by hand stays beside it, unless the building is to be all there is.
    put_one(&floor, "\"1.0\"").await;
    let kept: BuildingImport = post("?preview=true", BUILDING).await.expect(200).data();
    assert_eq!(kept.preview.unwrap().removed, 0);
    let alone: BuildingImport =
        post("?preview=true&replace=true", BUILDING).await.expect(200).data();
    assert_eq!(alone.preview.unwrap().removed, 1);

    for (yaml, words) in [
        (BUILDING.replace("[5, 0, {}]", "[6, 0, {}]"), "ine 6, column"),
        (BUILDING.replace("distance: [3, 5.0]", "distance: [3, 1e300]"), "cannot be taken"),
        (BUILDING.replace("measurements", "other"), "no measurement"),
        ("[[[[[[".repeat(1000), "ine 1"),
        ("a: &a [1]\nlevels: *a".to_owned(), "references"),
        (String::new(), "ine 1"),
    ] {
        let problem = post("", &yaml).await.problem(422);
        assert_eq!(problem.code, "invalid_building");
        assert!(problem.detail.contains(words), "{}", problem.detail);
    }
    assert_eq!(post("?building_level=L2", BUILDING).await.code(422), "invalid_building");
    assert_eq!(floor.describe().await.revision, 3);
}

async fn put_one(floor: &Level, tag: &str) {
    let edit = json!({"put": [feature(9, "other", [2.0, -2.0, 0.5, 0.5], 3.0)]});
    patch(floor, tag, &edit).await.expect(200);
}
