//! The description of the API, and the page that shows it.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use mapfold_schema::route;

use crate::server::Server;

const UPDATE: &str = "UPDATE=1 cargo test -p mapfold-server --test http description";

fn committed() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../schema/openapi.json")
}

#[test]
fn the_committed_description_is_what_the_handlers_say() {
    let path = committed();
    let generated = mapfold_server::http::openapi().to_pretty_json().unwrap() + "\n";
    if std::env::var_os("UPDATE").is_some() {
        std::fs::write(&path, &generated).unwrap();
    }
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(committed == generated, "schema/openapi.json is out of date; run `{UPDATE}`");
}

#[test]
fn every_path_of_the_schema_is_described() {
    let described = mapfold_server::http::openapi();
    let described: BTreeSet<&str> = described.paths.paths.keys().map(String::as_str).collect();
    for path in [
        route::SITES,
        route::LEVELS,
        route::LEVEL,
        route::ROBOTS,
        route::ROBOT,
        route::ROBOT_TOKENS,
        route::CONTRIBUTIONS,
        route::CONTRIBUTION,
        route::VECTOR,
        route::RASTER,
        route::RASTER_TILE,
        &format!("{}.png", route::TILES),
        route::PATCHES,
        route::REVERTS,
        route::REVERT,
        route::EVENTS,
        route::EXPORTS,
        route::IMPORTS,
        route::GDB,
        route::GDB_PUBLICATIONS,
        route::GDB_ENTRIES,
        route::GDB_FINDINGS,
        route::GDB_PLAN,
        route::GDB_PRIOR,
        route::LANDMARKS,
        route::PROTOTYPES,
        route::SESSION,
        "/livez",
        "/readyz",
        "/metrics",
    ] {
        assert!(described.contains(path), "{path} is not described");
    }
}

#[test]
fn the_description_is_openapi_3_1_and_gives_every_operation_its_problems() {
    let json = serde_json::to_value(mapfold_server::http::openapi()).unwrap();
    assert!(json["openapi"].as_str().unwrap().starts_with("3.1"));
    let mut ids = BTreeSet::new();
    for (path, item) in json["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let id = operation["operationId"].as_str().unwrap().to_owned();
            assert!(ids.insert(id), "{method} {path}: its id is taken");
            let schema = "/responses/default/content/application~1problem+json/schema/$ref";
            let schema = operation.pointer(schema).unwrap();
            assert_eq!(schema, "#/components/schemas/Problem", "{method} {path}");
            assert!(operation["summary"].is_string(), "{method} {path} has no words");
            for (status, response) in operation["responses"].as_object().unwrap() {
                let words = response["description"].as_str().unwrap_or_default();
                assert!(!words.is_empty(), "{method} {path}: {status} has no description");
            }
        }
    }
    assert!(ids.len() >= 24, "{ids:?}");
    let schemas = json["components"]["schemas"].as_object().unwrap();
    for name in ["Contribution", "Receipt", "UploadAnswer", "VectorPatch", "Patch", "Problem"] {
        assert!(schemas.contains_key(name), "{name}");
    }
}

/// All that `value` refers to, at any depth.
fn references<'a>(value: &'a serde_json::Value, found: &mut BTreeSet<&'a str>) {
    match value {
        serde_json::Value::Object(fields) => {
            found.extend(fields.get("$ref").and_then(|reference| reference.as_str()));
            for field in fields.values() {
                references(field, found);
            }
        }
        serde_json::Value::Array(items) => {
            for item in items {
                references(item, found);
            }
        }
        _ => {}
    }
}

#[test]
fn all_that_the_description_refers_to_is_in_it() {
    let json = serde_json::to_value(mapfold_server::http::openapi()).unwrap();
    let mut found = BTreeSet::new();
    references(&json, &mut found);
    assert!(found.len() > 20, "{found:?}");
    for reference in found {
        let target = reference.strip_prefix('#').and_then(|pointer| json.pointer(pointer));
        assert!(target.is_some(), "{reference} leads nowhere");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_page_about_it_loads_nothing_from_elsewhere() {
    let server = Server::start().await;
    let anybody = server.anybody();
    let served = anybody.get("/openapi.json").await.expect(200);
    let committed = std::fs::read(committed()).unwrap();
    assert!(served.body == committed, "another description is served than is committed");
    anybody.get("/docs").await.expect(200);
    let index = anybody.get("/docs/").await.expect(200);
    let html = String::from_utf8(index.body.clone()).unwrap();
    assert!(!html.contains("http://") && !html.contains("https://"), "{html}");
    let files: Vec<&str> = html
        .split(['"', '\''])
        .filter(|text| text.rsplit_once('.').is_some_and(|(_, e)| e == "js" || e == "css"))
        .collect();
    assert!(files.len() >= 3, "{files:?}");
    for file in files {
        anybody.get(&format!("/docs/{}", file.trim_start_matches("./"))).await.expect(200);
    }
    let initializer = anybody.get("/docs/swagger-initializer.js").await.expect(200);
    assert!(String::from_utf8(initializer.body).unwrap().contains("/openapi.json"));
    let policy = index.header("content-security-policy");
    assert!(policy.contains("script-src 'self';"), "{policy}");
    assert_eq!(anybody.get("/docs/nothing").await.code(404), "not_found");
}
