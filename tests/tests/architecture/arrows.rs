//! Who may know whom: crates by their manifests, modules by the paths that they name.

use std::collections::BTreeSet;

use super::paths;
use super::sources::Sources;

/// A crate of ours, the crates of ours that it may know, and crates of others that it must not
/// be built of (its own tests may use them).
struct CrateRule {
    folder: &'static str,
    may_know: &'static [&'static str],
    never: &'static [&'static str],
}

const WIRE_AND_STORAGE: &[&str] = &[
    "axum",
    "hyper",
    "indicatif",
    "metrics",
    "rand",
    "reqwest",
    "serde",
    "sqlx",
    "tokio",
    "tracing",
];

const CRATES: &[CrateRule] = &[
    CrateRule { folder: "map", may_know: &[], never: WIRE_AND_STORAGE },
    CrateRule {
        folder: "schema",
        may_know: &["map"],
        never: &["axum", "hyper", "rand", "reqwest", "sqlx", "tokio", "tower", "tracing"],
    },
    CrateRule { folder: "client", may_know: &["map", "schema"], never: &["axum", "sqlx"] },
    CrateRule { folder: "server", may_know: &["map", "schema"], never: &["indicatif", "reqwest"] },
    CrateRule { folder: "tests", may_know: &["map", "schema", "client", "server"], never: &[] },
];

/// A module at the root of a crate and what else there it may name: modules, or items of modules.
type ModuleRule = (&'static str, &'static [&'static str]);

/// Everything at a crate's root; `lib` and `main` may name all of it.
const MODULES: &[(&str, &[ModuleRule])] = &[
    (
        "map",
        &[
            // For unit tests only.
            ("chance", &[]),
            ("geometry", &[]),
            (
                "landmarks",
                &["chance", "geometry", "vector", "level::FeatureId", "level::RobotName"],
            ),
            ("raster", &["chance", "geometry"]),
            ("gdb", &["geometry", "landmarks::Landmark", "landmarks::LandmarkKind", "raster"]),
            // Features bear the identities that contributions give them; of the fold they know nothing.
            (
                "vector",
                &[
                    "chance",
                    "geometry",
                    "raster",
                    "level::Contribution",
                    "level::ContributionId",
                    "level::FeatureId",
                    "level::Provenance",
                    "level::RobotName",
                ],
            ),
            ("level", &["geometry", "raster", "vector"]),
            ("changes", &["gdb", "geometry", "level", "raster", "vector"]),
            ("alignment", &["geometry", "landmarks", "level", "places", "raster", "vector"]),
            ("places", &["geometry", "level", "raster", "vector"]),
        ],
    ),
    (
        "schema",
        &[
            ("slug", &[]),
            ("instant", &[]),
            ("route", &[]),
            ("v1", &["problem::Problem"]),
            ("problem", &["border::Violation"]),
            ("border", &["instant", "slug", "v1"]),
            ("codec", &["border::Violation", "v1"]),
            ("digest", &["codec", "v1"]),
            ("geojson", &["border", "v1"]),
            ("malformed", &["border", "v1"]),
        ],
    ),
    (
        "client",
        &[
            ("sensor", &[]),
            ("emulation", &["sensor"]),
            ("evidence", &["sensor"]),
            ("perception", &["sensor"]),
            ("log", &["sensor"]),
            ("sync", &[]),
            ("geojson", &["perception"]),
            ("odometry", &[]),
            // Of emulation its chance only, for unit tests.
            ("localization", &["emulation::Chance", "perception", "odometry", "sensor"]),
            (
                "robot",
                &[
                    "emulation",
                    "evidence",
                    "localization",
                    "log",
                    "odometry",
                    "perception",
                    "sensor",
                ],
            ),
            ("replay", &["localization", "log", "robot", "sensor", "sync"]),
            (
                "cli",
                &[
                    "geojson",
                    "localization",
                    "log",
                    "perception",
                    "replay",
                    "robot",
                    "sensor",
                    "sync",
                ],
            ),
        ],
    ),
    (
        "server",
        &[
            ("clock", &[]),
            ("chance", &[]),
            ("config", &["level::LevelOptions", "store::sqlite_url"]),
            ("page", &[]),
            ("exchange", &[]),
            ("store", &[]),
            ("auth", &["chance", "store"]),
            ("level", &["clock", "store"]),
            ("maintenance", &["level", "store"]),
            ("http", &["auth", "chance", "clock", "config", "exchange", "level", "page", "store"]),
            ("running", &["auth", "chance", "clock", "config", "http", "level", "store"]),
            (
                "cli",
                &[
                    "auth",
                    "chance",
                    "clock",
                    "config",
                    "exchange",
                    "level",
                    "maintenance",
                    "running",
                    "store",
                ],
            ),
        ],
    ),
];

/// Crates of others that a module must not name, because its subject is another.
const FOREIGN: &[(&str, &[&str])] = &[
    ("server/src/level", &["axum", "hyper", "sqlx", "tower", "tower_http", "utoipa"]),
    ("server/src/store", &["axum", "hyper", "tower", "tower_http", "utoipa"]),
    ("server/src/exchange", &["axum", "hyper", "sqlx", "tokio", "tower", "utoipa"]),
    ("server/src/http", &["sqlx"]),
    ("client/src/perception", &["reqwest", "serde_json", "tokio"]),
    ("client/src/evidence", &["reqwest", "serde_json", "tokio"]),
];

/// Violations among the manifests.
pub(crate) fn between_crates(sources: &Sources) -> Vec<String> {
    let mut violations = Vec::new();
    for (path, text) in sources.within("", "Cargo.toml") {
        let Some((folder, _)) = path.split_once('/') else { continue };
        let Some(rule) = CRATES.iter().find(|rule| path == format!("{}/Cargo.toml", rule.folder))
        else {
            violations.push(format!("{path}: a crate without a row in the table"));
            continue;
        };
        let manifest = match text.parse::<toml::Table>() {
            Ok(manifest) => manifest,
            Err(error) => {
                violations.push(format!("{path}: {error}"));
                continue;
            }
        };
        for (name, for_tests_only) in dependencies(&manifest) {
            let ours = name.strip_prefix("mapfold-");
            if ours.is_some_and(|ours| ours != folder && !rule.may_know.contains(&ours)) {
                violations.push(format!("{folder} must not know {name}"));
            }
            if !for_tests_only && rule.never.contains(&name.as_str()) {
                violations.push(format!("{folder} must not use {name}"));
            }
        }
    }
    violations
}

/// Names in every table of dependencies, those of targets included, and whether the table is one
/// for tests.
fn dependencies(table: &toml::Table) -> BTreeSet<(String, bool)> {
    let mut names = BTreeSet::new();
    for (key, value) in table {
        let Some(inner) = value.as_table() else { continue };
        if key == "dependencies" || key == "dev-dependencies" || key == "build-dependencies" {
            for (name, detail) in inner {
                let package = detail.get("package").and_then(toml::Value::as_str);
                names.insert((package.unwrap_or(name).to_owned(), key == "dev-dependencies"));
            }
        } else if key == "target" || key.starts_with("cfg(") {
            names.extend(dependencies(inner));
        }
    }
    names
}

/// Violations among the modules at the root of each crate that has a table.
pub(crate) fn between_modules(sources: &Sources) -> Vec<String> {
    MODULES.iter().flat_map(|(folder, rules)| within_crate(sources, folder, rules)).collect()
}

fn within_crate(sources: &Sources, folder: &str, rules: &[ModuleRule]) -> Vec<String> {
    let prefix = format!("{folder}/src/");
    let mut violations = Vec::new();
    let mut seen = BTreeSet::new();
    for (path, text) in sources.within(&prefix, ".rs") {
        let module: Vec<String> =
            path[prefix.len()..path.len() - ".rs".len()].split('/').map(str::to_owned).collect();
        let root = module[0].as_str();
        if root == "lib" || root == "main" || root == "bin" {
            continue;
        }
        seen.insert(root.to_owned());
        let Some((_, may_name)) = rules.iter().find(|(name, _)| *name == root) else {
            violations.push(format!("{path}: module {root} has no row in the table"));
            continue;
        };
        for named in paths::named(text, &module) {
            let Some(head) =
                named.first().filter(|head| rules.iter().any(|(name, _)| name == head))
            else {
                continue;
            };
            let named = named.join("::");
            let allows = |allowed: &&str| {
                named
                    .strip_prefix(*allowed)
                    .is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
            };
            if head != root && !may_name.iter().any(allows) {
                violations.push(format!("{path}: {root} must not know {named}"));
            }
        }
    }
    let gone = rules.iter().filter(|(name, _)| !seen.contains(*name));
    violations.extend(gone.map(|(name, _)| format!("{folder}: no module {name} any more")));
    violations
}

/// Crates of others in places where they have no business.
pub(crate) fn to_foreign_crates(sources: &Sources) -> Vec<String> {
    foreign(sources, FOREIGN)
}

fn foreign(sources: &Sources, rules: &[(&str, &[&str])]) -> Vec<String> {
    let mut violations = Vec::new();
    for (folder, never) in rules {
        let inside = format!("{folder}/");
        let file = format!("{folder}.rs");
        let of_folder = |path: &str| path == file || path.starts_with(&inside);
        for (path, text) in sources.within(folder, ".rs").filter(|(path, _)| of_folder(path)) {
            let named = paths::roots(text);
            for name in never.iter().filter(|name| named.contains(**name)) {
                violations.push(format!("{path}: must not name {name}"));
            }
        }
    }
    violations
}

#[test]
fn a_client_that_knows_the_server_is_found() {
    let sources = Sources::of([
        (
            "client/Cargo.toml",
            "[dependencies]\nmapfold-map.workspace = true\nmapfold-server = { path = '../server' }",
        ),
        (
            "server/Cargo.toml",
            "[target.'cfg(unix)'.dependencies]\nreqwest = '1'\n[dev-dependencies]\nindicatif = '1'",
        ),
        ("map/Cargo.toml", "[dependencies]\nwire = { package = 'serde', version = '1' }"),
        ("tools/Cargo.toml", ""),
    ]);
    assert_eq!(
        between_crates(&sources),
        [
            "client must not know mapfold-server",
            "map must not use serde",
            "server must not use reqwest",
            "tools/Cargo.toml: a crate without a row in the table",
        ]
    );
}

#[test]
fn an_arrow_that_points_up_is_found() {
    let rules: &[ModuleRule] = &[("low", &[]), ("high", &["low"]), ("gone", &[])];
    let sources = Sources::of([
        ("x/src/lib.rs", "pub use high::A;"),
        ("x/src/low.rs", "use crate::high::A;"),
        ("x/src/low/part.rs", "use super::super::high; use super::fine; use crate::Error;"),
        ("x/src/high.rs", "use crate::low::B;"),
        ("x/src/new.rs", ""),
    ]);
    assert_eq!(
        within_crate(&sources, "x", rules),
        [
            "x/src/low.rs: low must not know high::A",
            "x/src/low/part.rs: low must not know high",
            "x/src/new.rs: module new has no row in the table",
            "x: no module gone any more",
        ]
    );
}

#[test]
fn an_item_may_be_named_where_its_module_may_not() {
    let rules: &[ModuleRule] = &[("low", &["high::Id"]), ("high", &["low"])];
    let sources = Sources::of([
        ("x/src/low.rs", "use crate::high::{Id, Idle, Act}; fn f() { crate::high::Id::new(); }"),
        ("x/src/high.rs", ""),
    ]);
    assert_eq!(
        within_crate(&sources, "x", rules),
        ["x/src/low.rs: low must not know high::Idle", "x/src/low.rs: low must not know high::Act",]
    );
}

#[test]
fn a_foreign_crate_in_the_wrong_place_is_found() {
    let sources = Sources::of([
        ("server/src/level.rs", "use sqlx::Row;"),
        ("server/src/level/fold.rs", "fn f() { let axum = 1; my::sqlx::f(); }"),
        ("server/src/levels.rs", "use sqlx::Row;"),
    ]);
    assert_eq!(
        foreign(&sources, &[("server/src/level", &["axum", "sqlx"])]),
        ["server/src/level.rs: must not name sqlx"]
    );
}
