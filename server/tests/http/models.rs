//! Models as files: what goes out comes in again whole, in any level; what cannot be taken changes nothing.

use std::process::Command;

use mapfold_schema::route;
use mapfold_schema::v1::{GdbDocument, ModelImport, PrototypeCollection};
use reqwest::Method;
use reqwest::header::IF_MATCH;
use serde_json::{Value, json};
use uuid::Uuid;

use crate::client::Answer;
use crate::server::Server;
use crate::world::Level;

const FG: &str = "application/fg+json";

fn id(number: u128) -> Uuid {
    Uuid::from_u128(0x0190_0000_0000_7000_8000_0000_0000_0000 + number)
}

fn feature(number: u128, properties: &Value) -> Value {
    json!({"type": "Feature", "id": id(number), "geometry": null, "properties": properties})
}

/// Every form of solid, every field of an object, an instance that stands tilted, and one of a prototype that nobody has.
fn features() -> Vec<Value> {
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let tetrahedron = json!({"polyhedron": {
        "vertices_m": [[0.1, 0.2, 0.0], [1.1, 0.2, 0.0], [0.1, 1.2, 0.0], [0.3, 0.4, 1.0]],
        "faces": [[[0, 2, 1]], [[0, 1, 3]], [[1, 2, 3]], [[2, 0, 3]]],
    }});
    let ring = json!([
        [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]],
        [[1.0, 1.0], [1.0, 2.0], [2.0, 2.0]]
    ]);
    vec![
        feature(
            1,
            &json!({"kind": "wall", "name": "Süd", "tolerance_m": 0.01, "trust": 0.9,
            "solids": [{"box": {"from_m": [0.0, 0.0, 0.0], "to_m": [6.0, 0.2, 2.5]}}]}),
        ),
        feature(
            2,
            &json!({"kind": "doorway", "door": {"type": "double_sliding"},
            "placement": {"position_m": [2.0, 0.1, 0.0], "rotation": [half, 0.0, 0.0, half]},
            "solids": [{"box": {"from_m": [-0.3, -0.5, 0.0], "to_m": [0.3, 0.5, 2.1]}}]}),
        ),
        feature(
            3,
            &json!({"kind": "corridor",
            "solids": [{"prism": {"base_m": ring, "lower_m": -0.1, "upper_m": 0.0}}]}),
        ),
        feature(
            4,
            &json!({"kind": "machine", "name": "mill", "solids": [
            {"cylinder": {"centre_m": [3.0, 2.0], "radius_m": 0.4, "lower_m": 0.0, "upper_m": 1.3}},
            tetrahedron]}),
        ),
        feature(
            5,
            &json!({"kind": "furniture", "prototype": "table",
            "placement": {"position_m": [1.0, 2.0, 0.4], "rotation": [half, half, 0.0, 0.0]}}),
        ),
        feature(
            6,
            &json!({"kind": "furniture", "prototype": "nobody has this",
            "placement": {"position_m": [1.0, 2.0, 0.0]}}),
        ),
    ]
}

fn table(width: f64) -> Value {
    let top = json!({"box": {"from_m": [0.0, 0.0, 0.7], "to_m": [width, 0.8, 0.75]}});
    let leg = json!({"box": {"from_m": [0.0, 0.0, 0.0], "to_m": [0.05, 0.05, 0.7]}});
    let properties = json!({"kind": "furniture", "solids": [top, leg]});
    json!({"type": "Feature", "id": "table", "geometry": null, "properties": properties})
}

fn collection(features: &[Value]) -> Value {
    json!({"type": "FeatureCollection", "features": features})
}

async fn put(floor: &Level, path: &str, body: &Value) -> Answer {
    let request =
        floor.client.request(Method::PUT, path).header("content-type", "application/json");
    Answer::to(request.header(IF_MATCH, "*").body(body.to_string())).await
}

async fn drawn(floor: &Level) {
    let library = route::of_site(route::PROTOTYPES, &floor.site);
    put(floor, &library, &collection(&[table(1.6)])).await.expect(200);
    put(floor, &floor.path(route::GDB), &collection(&features())).await.expect(200);
}

async fn export(floor: &Level, format: &str) -> Vec<u8> {
    let path = floor.path(route::EXPORTS).replace("{format}", format);
    floor.client.get(&path).await.expect(200).body
}

async fn import(floor: &Level, query: &str, media_type: &str, body: Vec<u8>) -> Answer {
    let path = format!("{}{query}", floor.path(route::IMPORTS));
    floor.client.post_bytes(&path, media_type, body).await
}

fn features_of<T: serde::de::DeserializeOwned>(answer: &Answer) -> T {
    serde_json::from_slice(&answer.body).unwrap()
}

async fn library(floor: &Level) -> PrototypeCollection {
    let path = route::of_site(route::PROTOTYPES, &floor.site);
    features_of(&floor.client.get(&path).await.expect(200))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_model_goes_out_as_json_fg_and_comes_whole_into_another_site_once() {
    let server = Server::start().await;
    let here = Level::create(&server.admin()).await;
    drawn(&here).await;
    let file = export(&here, "jsonfg").await;
    let there = Level::create_at(&server.admin(), "other", "hall").await;

    let told: ModelImport =
        import(&there, "?preview=true", FG, file.clone()).await.expect(200).data();
    let preview = told.preview.unwrap();
    assert_eq!((preview.new, preview.removed, told.answer.is_none()), (6, 0, true));
    assert_eq!(told.report.prototypes, ["table"]);
    assert!(told.report.warnings[0].contains("another frame"), "{:?}", told.report.warnings);
    assert_eq!((there.describe().await.revision, library(&there).await.features.len()), (0, 0));

    let made = import(&there, "", FG, file.clone()).await.expect(201);
    assert_eq!(made.header("etag"), "\"1.1\"");
    let again: ModelImport = import(&there, "", FG, file.clone()).await.expect(200).data();
    assert_eq!(again.answer.unwrap().entry, None);
    // All of it is there, to the bit, and nothing else.
    let document = |bytes: &[u8]| -> GdbDocument { serde_json::from_slice(bytes).unwrap() };
    let (mut sent, back) = (document(&file), document(&export(&there, "jsonfg").await));
    sent.coord_ref_sys.clone_from(&back.coord_ref_sys);
    (sent.revision, sent.library) = (back.revision, back.library);
    assert_eq!(sent, back);
    assert_eq!(back.features.len(), 6);

    // As a file of the same form, as JSON, and on the command line.
    let path = here.path(route::EXPORTS).replace("{format}", "jsonfg");
    for accept in ["application/json", "application/geo+json"] {
        let answer = here.client.get_with(&path, reqwest::header::ACCEPT, accept).await.expect(200);
        assert_eq!((answer.header("content-type"), &answer.body), (accept, &file));
    }
    let folder = server.shutdown().await;
    let run = |words: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_mapfold-server"));
        command.args(words).arg("--data-dir").arg(folder.path().join("data"));
        let output = command.current_dir(folder.path()).output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    };
    run(&["export", "jsonfg", "--site", "plant", "--level", "floor", "--out", "a.json"]);
    assert_eq!(std::fs::read(folder.path().join("a.json")).unwrap(), file);
    let told = run(&["import", "a.json", "--site", "other", "--level", "hall", "--replace"]);
    assert!(told.contains("had all of it already"), "{told}");
    run(&[
        "export",
        "geojson",
        "--of",
        "gdb",
        "--site",
        "other",
        "--level",
        "hall",
        "--out",
        "b.geojson",
    ]);
    let plan = std::fs::read_to_string(folder.path().join("b.geojson")).unwrap();
    assert!(plan.contains("\"landmark\""), "{plan}");
}

#[tokio::test(flavor = "multi_thread")]
async fn an_import_never_changes_prototypes_that_a_site_has() {
    let server = Server::start().await;
    let here = Level::create(&server.admin()).await;
    drawn(&here).await;
    let file = export(&here, "jsonfg").await;
    let there = Level::create_at(&server.admin(), "other", "hall").await;
    let path = route::of_site(route::PROTOTYPES, "other");
    put(&there, &path, &collection(&[table(2.5)])).await.expect(200);

    // Whoever has not seen this library is told, and neither it nor the draft changes.
    let imports = there.path(route::IMPORTS);
    let request = there.client.request(Method::POST, &imports).header("content-type", FG);
    let stale = Answer::to(request.header(IF_MATCH, "\"0.0\"").body(file.clone())).await;
    assert_eq!(stale.code(412), "gdb_moved_on");
    assert_eq!(library(&there).await.features.len(), 1);

    let request = there.client.request(Method::POST, &imports).header("content-type", FG);
    let made = Answer::to(request.header(IF_MATCH, "\"0.1\"").body(file.clone())).await;
    let made: ModelImport = made.expect(201).data();
    let [name] = &made.report.prototypes[..] else { panic!("{:?}", made.report) };
    assert!(name.starts_with("table~"), "{name}");
    let now = library(&there).await;
    assert_eq!(now.features.iter().map(|p| p.id.as_str()).collect::<Vec<_>>(), ["table", name]);
    let back: GdbDocument = serde_json::from_slice(&export(&there, "jsonfg").await).unwrap();
    let instance = back.features.iter().find(|f| f.id == id(5)).unwrap();
    assert_eq!(instance.properties.prototype.as_deref(), Some(name.as_str()));
    let again: ModelImport = import(&there, "", FG, file).await.expect(200).data();
    assert_eq!(again.answer.unwrap().entry, None);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_plan_of_a_model_goes_out_as_geojson_with_its_landmarks() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    drawn(&floor).await;
    let path = floor.path(route::EXPORTS).replace("{format}", "geojson");
    let get = async |query: &str| floor.client.get(&format!("{path}{query}")).await;
    let plan: Value = features_of(&get("?of=gdb&height_m=1").await.expect(200));
    let all = plan["features"].as_array().unwrap();
    let count = |key: &str, word: &str| all.iter().filter(|f| f["properties"][key] == word).count();
    // The wall in two parts, the cylinder, and the top of the tilted table; the ends of the wall and of the table, and
    // the doorway.
    assert_eq!((count("shape", "obstacle"), count("shape", "opening")), (4, 2), "{plan}");
    assert_eq!((count("kind", "landmark"), all.len()), (5, 11), "{plan}");
    for feature in all {
        if feature["geometry"]["type"] == "Polygon" {
            let ring: Vec<[f64; 2]> =
                serde_json::from_value(feature["geometry"]["coordinates"][0].clone()).unwrap();
            let area: f64 = ring.windows(2).map(|w| w[0][0] * w[1][1] - w[1][0] * w[0][1]).sum();
            assert!(area > 0.0, "{feature}");
        }
    }
    let nothing: Value = features_of(&get("?of=gdb&state=published").await.expect(200));
    assert_eq!(nothing["features"], json!([]));
    let both: Value = features_of(&get("?of=all&height_m=1").await.expect(200));
    assert_eq!(both, plan);
    for query in ["?height_m=1", "?of=gdb&height_m=nan", "?of=gdb&mode=raw", "?state=draft"] {
        assert_eq!(get(query).await.code(400), "query_invalid", "{query}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_model_goes_out_as_a_drawing_and_comes_in_again() {
    const DXF: &str = "image/vnd.dxf";
    let server = Server::start().await;
    let here = Level::create(&server.admin()).await;
    drawn(&here).await;
    let path = here.path(route::EXPORTS).replace("{format}", "dxf");
    let answer = here.client.get(&path).await.expect(200);
    assert_eq!(answer.header("content-type"), DXF);
    assert_eq!(answer.header("content-disposition"), "attachment; filename=\"plant-floor.dxf\"");
    let there = Level::create_at(&server.admin(), "other", "hall").await;
    let told: ModelImport =
        import(&there, "?preview=true", DXF, answer.body.clone()).await.expect(200).data();
    // Not the instance of what nobody has.
    assert_eq!(told.preview.unwrap().new, 5);
    let made = import(&there, "", "application/dxf", answer.body.clone()).await.expect(201);
    let made: ModelImport = made.data();
    assert_eq!((made.report.prototypes, made.report.instances), (vec!["table".to_owned()], 1));
    let again: ModelImport = import(&there, "", DXF, answer.body).await.expect(200).data();
    assert_eq!(again.answer.unwrap().entry, None);
    let plan = |floor: &Level| {
        let path = floor.path(route::EXPORTS).replace("{format}", "geojson");
        let (client, path) = (floor.client.clone(), format!("{path}?of=gdb&height_m=1"));
        async move { features_of::<Value>(&client.get(&path).await.expect(200)) }
    };
    assert_eq!(plan(&here).await, plan(&there).await);

    let refused = import(&there, "", DXF, b"0\nSECTION\n2\nENTITIES\n0\nLINE\n".to_vec()).await;
    let problem = refused.problem(422);
    assert_eq!(problem.code, "invalid_model_file");
    assert!(problem.detail.starts_with("Line 6: "), "{}", problem.detail);
    for query in ["?layers=x", "?unit_m=-1", "?wall_height_m=1000"] {
        assert_eq!(import(&there, query, DXF, Vec::new()).await.code(400), "query_invalid");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_model_goes_out_in_three_dimensions_and_comes_in_again() {
    const GLB: &str = "model/gltf-binary";
    let server = Server::start().await;
    let here = Level::create(&server.admin()).await;
    drawn(&here).await;
    let answer = here.client.get(&here.path(route::GDB_GLB)).await.expect(200);
    assert_eq!(answer.header("content-type"), GLB);
    assert_eq!(answer.body, export(&here, "glb").await);
    let there = Level::create_at(&server.admin(), "other", "hall").await;
    import(&there, "", GLB, answer.body.clone()).await.expect(201);
    let again: ModelImport = import(&there, "", GLB, answer.body).await.expect(200).data();
    assert_eq!(again.answer.unwrap().entry, None);
    // All of it is there, to the bit: what the objects are, and the prototype that they use.
    let document = |bytes: &[u8]| -> GdbDocument { serde_json::from_slice(bytes).unwrap() };
    let (ours, theirs) =
        (document(&export(&here, "jsonfg").await), document(&export(&there, "jsonfg").await));
    assert_eq!((ours.features, ours.prototypes), (theirs.features, theirs.prototypes));
    let published = format!("{}?state=published", here.path(route::GDB_GLB));
    let empty = here.client.get(&published).await.expect(200).body;
    let told: ModelImport = import(&there, "?preview=true", GLB, empty).await.expect(200).data();
    assert_eq!(told.report.kinds, []);
    let refused = import(&there, "", GLB, b"glTF\x01\0\0\0".to_vec()).await.problem(422);
    assert!(refused.detail.starts_with("Byte 4: "), "{}", refused.detail);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_wall_with_a_door_out_of_an_ifc_model_is_one() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let file = include_bytes!("models/simple-wall.glb").to_vec();
    let made: ModelImport = import(&floor, "", "model/gltf-binary", file).await.expect(201).data();
    assert_eq!(made.report.kinds.iter().map(|kind| kind.count).collect::<Vec<_>>(), [1, 1]);
    let findings = floor.client.get(&floor.path(route::GDB_FINDINGS)).await.expect(200);
    let findings: mapfold_schema::v1::GdbFindings = findings.data();
    assert_eq!(findings.findings, []);
    let plan = floor.client.get(&floor.path(route::GDB_PLAN)).await.expect(200);
    let plan: mapfold_schema::v1::GdbPlan = plan.data();
    assert_eq!((plan.outlines.len(), plan.openings.len()), (2, 1));
    assert!((plan.openings[0].width_m - 1.0).abs() < 0.1, "{:?}", plan.openings);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_no_model_is_refused_with_its_place_and_changes_nothing() {
    let server = Server::start().await;
    let floor = Level::create(&server.admin()).await;
    let bad = |properties: &Value| collection(&[feature(1, properties)]).to_string();
    for (body, words) in [
        (String::new(), "JSON"),
        ("{\"type\": \"FeatureCollection\"".to_owned(), "line 1"),
        ("[".repeat(100_000), "line 1"),
        (bad(&json!({"kind": "tree", "solids": []})), "/features/0/properties/kind"),
        (bad(&json!({"kind": "wall"})), "/features/0/properties"),
        (
            bad(
                &json!({"kind": "wall", "solids": [{"box": {"from_m": [0, 0, 0], "to_m": [1e300, 1, 1]}}]}),
            ),
            "/features/0/properties/solids/0/box/to_m/0",
        ),
        (
            bad(&json!({"kind": "wall", "solids": []})).replace(
                "\"features\"",
                "\"coordRefSys\": \"http://www.opengis.net/def/crs/EPSG/0/25832\", \"features\"",
            ),
            "/coordRefSys",
        ),
        (
            json!({"type": "FeatureCollection", "features": [], "prototypes": [
                {"type": "Feature", "id": "", "properties": {"solids": []}}]})
            .to_string(),
            "/prototypes/0/id",
        ),
    ] {
        let problem = import(&floor, "", FG, body.into_bytes()).await.problem(422);
        assert_eq!(problem.code, "invalid_model_file");
        let errors = problem.errors.iter().map(|e| e.pointer.as_str()).collect::<Vec<_>>();
        let told = format!("{} {errors:?}", problem.detail);
        assert!(told.contains(words), "{words}: {told}");
    }
    assert_eq!(floor.describe().await.revision, 0);
    // Many instances of a large prototype are more than any model has, and are not laid out to see that.
    let ring: Vec<[f64; 2]> =
        (0..5000).map(|k| f64::from(k) / 800.0).map(|a| [a.cos(), a.sin()]).collect();
    let solid = json!({"prism": {"base_m": [ring], "lower_m": 0, "upper_m": 1}});
    let prototype = json!({"type": "Feature", "id": "p", "properties": {"solids": [solid]}});
    let many: Vec<Value> =
        (0..1000).map(|n| feature(n, &json!({"kind": "other", "prototype": "p"}))).collect();
    let body = json!({"type": "FeatureCollection", "prototypes": [prototype], "features": many});
    let refused = import(&floor, "?preview=true", FG, body.to_string().into_bytes()).await;
    assert!(refused.problem(422).detail.contains("vertices"));
    assert_eq!(floor.describe().await.revision, 0);
}
