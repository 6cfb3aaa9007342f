//! Names, sizes, headers, migrations, and what a tracked file may say.

use std::collections::BTreeSet;

use super::sources::Sources;

/// Names that say nothing: what has no noun is not understood yet.
const NAMELESS: &[&str] = &[
    "common", "handle", "handler", "handlers", "helper", "helpers", "manager", "misc", "mod",
    "process", "stuff", "tools", "util", "utils",
];

/// Lines that one file may have: beyond it, it has two subjects.
const LINES_MAX: usize = 600;

/// Lines of ARCHITECTURE.md: two printed pages.
const ARCHITECTURE_LINES_MAX: usize = 130;

const PAGES: &[&str] = &[
    ".ci/run",
    "ARCHITECTURE.md",
    "BENCHMARKS.md",
    "CHANGELOG.md",
    "CONTRIBUTING.md",
    "LICENSE-APACHE",
    "LICENSE-MIT",
    "Makefile",
    "README.md",
    "deny.toml",
    "docs/GLOSSARY.md",
    "docs/NOTATION.md",
    "migrations/README.md",
    "rust-toolchain.toml",
    "schema/openapi.json",
];

fn extension(path: &str) -> &str {
    path.rsplit_once('.').map_or("", |(_, extension)| extension)
}

fn is_code(path: &str) -> bool {
    matches!(extension(path), "rs" | "ts" | "mjs" | "js" | "sql" | "sh" | "css")
}

/// Written by a program, not by people.
fn is_generated(path: &str) -> bool {
    path.ends_with(".gen.ts")
}

/// Files that are named after nothing.
pub(crate) fn names(sources: &Sources) -> Vec<String> {
    let nameless = |path: &&str| {
        path.split('/').any(|part| {
            let name = part.split('.').next().unwrap_or(part);
            NAMELESS.contains(&name)
        })
    };
    sources
        .iter()
        .map(|(path, _)| path)
        .filter(|path| is_code(path))
        .filter(nameless)
        .map(|path| format!("{path}: name it after its noun or verb"))
        .collect()
}

/// Files that are too long, and Rust files that do not say what they are.
pub(crate) fn sizes_and_headers(sources: &Sources) -> Vec<String> {
    let mut violations = Vec::new();
    for (path, text) in sources.iter() {
        let lines = text.lines().count();
        if is_code(path) && !is_generated(path) && lines > LINES_MAX {
            violations.push(format!("{path}: {lines} lines, at most {LINES_MAX}"));
        }
        if extension(path) == "rs" && !text.starts_with("//!") {
            violations.push(format!("{path}: starts without a //! header"));
        }
    }
    let architecture = sources.text("ARCHITECTURE.md").map_or(0, |text| text.lines().count());
    if architecture > ARCHITECTURE_LINES_MAX {
        violations.push(format!("ARCHITECTURE.md: {architecture} lines are more than two pages"));
    }
    violations
}

/// Migrations that only one engine has.
pub(crate) fn migrations(sources: &Sources) -> Vec<String> {
    let of = |engine: &str| -> BTreeSet<String> {
        let folder = format!("migrations/{engine}/");
        sources.within(&folder, "").map(|(path, _)| path[folder.len()..].to_owned()).collect()
    };
    let (sqlite, postgres) = (of("sqlite"), of("postgres"));
    let mut violations: Vec<String> = sqlite
        .symmetric_difference(&postgres)
        .map(|name| format!("migrations: {name} is there for one engine only"))
        .collect();
    if sqlite.is_empty() {
        violations.push("migrations: there are none".to_owned());
    }
    violations
}

/// Hosts of package registries and folders of somebody's machine.
pub(crate) fn outside(sources: &Sources) -> Vec<String> {
    // In two halves each, so that this file does not say them either.
    let hosts = [
        concat!("crates", ".io"),
        concat!("registry.", "npmjs.org"),
        concat!("pypi", ".org"),
        concat!("deb.", "debian.org"),
    ];
    let folders = [
        concat!("/wo", "rk/"),
        concat!("/ho", "me/"),
        concat!("/ro", "ot/"),
        concat!("/Us", "ers/"),
    ];
    let mut violations = Vec::new();
    for (path, text) in sources.iter() {
        // Cargo itself writes where the registry's index is.
        if path == "Cargo.lock" {
            continue;
        }
        for needle in hosts.iter().chain(&folders) {
            if let Some(line) = text.lines().position(|line| names_outside(line, needle)) {
                violations.push(format!("{path}:{}: says {needle}", line + 1));
            }
        }
        let product = ["map/", "schema/", "client/", "server/", "web/", "migrations/"];
        if product.iter().any(|folder| path.starts_with(folder))
            && text.contains(concat!("../sh", "ared"))
        {
            violations.push(format!("{path}: the product knows nothing beside its repository"));
        }
    }
    violations
}

/// Whether `needle` stands in `line` by itself: a folder only at the start of a path.
fn names_outside(line: &str, needle: &str) -> bool {
    line.match_indices(needle).any(|(at, _)| {
        !needle.starts_with('/')
            || !line[..at].ends_with(|c: char| {
                c.is_alphanumeric() || matches!(c, '.' | '_' | '-' | '}' | '/')
            })
    })
}

/// Words for work that is not done, and tests that do not run.
pub(crate) fn unfinished(sources: &Sources) -> Vec<String> {
    let words = [
        concat!("TO", "DO"),
        concat!("FIX", "ME"),
        concat!("#[ig", "nore"),
        concat!("test.", "skip"),
        concat!("it.", "skip"),
        concat!("describe.", "skip"),
        concat!("test.", "only"),
        concat!("it.", "only"),
    ];
    let mut violations = Vec::new();
    for (path, text) in sources.iter().filter(|(path, _)| is_code(path)) {
        for (number, line) in text.lines().enumerate() {
            if let Some(word) = words.iter().find(|word| line.contains(**word)) {
                violations.push(format!("{path}:{}: {word}", number + 1));
            }
        }
    }
    violations
}

/// Pages that must be there.
pub(crate) fn expected_pages(sources: &Sources) -> Vec<String> {
    PAGES
        .iter()
        .filter(|page| sources.text(page).is_none_or(str::is_empty))
        .map(|page| format!("{page} is missing or empty"))
        .collect()
}

/// Logs without a licence.
pub(crate) fn data_licences(sources: &Sources) -> Vec<String> {
    let licence_of = |path: &str| path.replace(".log.gz", ".LICENSE");
    let mut violations: Vec<String> = sources
        .within("tests/data/", ".log.gz")
        .filter(|(path, _)| sources.text(&licence_of(path)).is_none_or(str::is_empty))
        .map(|(path, _)| format!("{path}: no {}", licence_of(path)))
        .collect();
    if sources.within("tests/data/", ".log.gz").next().is_none() {
        violations.push("tests/data: no logs".to_owned());
    }
    violations
}

#[test]
fn a_nameless_file_is_found() {
    let sources = Sources::of([
        ("map/src/utils.rs", ""),
        ("server/src/http/mod.rs", ""),
        ("server/src/manager/start.rs", ""),
        ("map/src/module.rs", ""),
        ("docs/common.md", ""),
    ]);
    assert_eq!(names(&sources).len(), 3, "{:?}", names(&sources));
}

#[test]
fn a_long_file_and_one_without_header_are_found() {
    let long = format!("//! Long.\n{}", "x\n".repeat(LINES_MAX));
    let sources = Sources::of([
        ("a.rs", &long),
        ("b.rs", "use std::fs;"),
        ("c.rs", "//! Fine."),
        ("web/src/api.gen.ts", &long),
        ("Cargo.lock", &long),
    ]);
    assert_eq!(
        sizes_and_headers(&sources),
        ["a.rs: 601 lines, at most 600", "b.rs: starts without a //! header"]
    );
}

#[test]
fn a_migration_of_one_engine_only_is_found() {
    let sources = Sources::of([
        ("migrations/sqlite/0001_sites.sql", ""),
        ("migrations/postgres/0001_sites.sql", ""),
        ("migrations/postgres/0002_levels.sql", ""),
    ]);
    assert_eq!(migrations(&sources), ["migrations: 0002_levels.sql is there for one engine only"]);
    assert_eq!(migrations(&Sources::default()), ["migrations: there are none"]);
}

#[test]
fn hosts_and_folders_outside_are_found_and_paths_of_ours_are_not() {
    let host = concat!("https://crates", ".io/x");
    let folder = concat!("cd /wo", "rk/main");
    let neighbour = concat!("read ../sh", "ared/data");
    let fine = concat!("see framewo", "rk/notes and a/ho", "me/page");
    let sources = Sources::of([
        ("README.md", host),
        ("scripts/x.sh", folder),
        ("map/src/lib.rs", neighbour),
        ("scripts/y.sh", neighbour),
        ("Cargo.lock", host),
        ("docs/fine.md", fine),
    ]);
    let found = outside(&sources);
    assert_eq!(found.len(), 3, "{found:?}");
}

#[test]
fn unfinished_work_and_skipped_tests_are_found() {
    let left = format!("fn f() {{}} // {}: write it", concat!("TO", "DO"));
    let skipped = format!("{}]\nfn t() {{}}", concat!("#[ig", "nore"));
    let sources = Sources::of([("a.rs", &left), ("b.rs", &skipped), ("c.rs", "fn done() {}")]);
    assert_eq!(unfinished(&sources).len(), 2);
}

#[test]
fn missing_pages_and_licences_are_found() {
    assert_eq!(expected_pages(&Sources::of([("README.md", "# It")])).len(), PAGES.len() - 1);
    let sources = Sources::of([
        ("tests/data/a.log.gz", ""),
        ("tests/data/a.LICENSE", "MIT"),
        ("tests/data/b.log.gz", ""),
    ]);
    assert_eq!(data_licences(&sources), ["tests/data/b.log.gz: no tests/data/b.LICENSE"]);
}
