//! The house rules, as checks of this repository's own files: arrows between crates and modules,
//! names, sizes, migrations, what may be said in a tracked file, licences of dependencies.
//!
//! Each rule is a pure function from texts to violations, and has tests on small inputs that break
//! it; the tests at the end of this file hold the repository to all of them.

#![expect(clippy::expect_used, reason = "tests may stop at the first surprise")]

mod arrows;
mod licences;
mod paths;
mod sources;
mod tidy;

use sources::Sources;

fn repository() -> Sources {
    Sources::read(&sources::root()).expect("the repository's files can be read")
}

fn assert_none(rule: &str, violations: &[String]) {
    assert!(violations.is_empty(), "{rule}:\n  {}\n", violations.join("\n  "));
}

#[test]
fn arrows_between_crates_point_down() {
    assert_none("crates", &arrows::between_crates(&repository()));
}

#[test]
fn arrows_between_modules_point_down() {
    assert_none("modules", &arrows::between_modules(&repository()));
}

#[test]
fn modules_name_no_crate_that_is_not_their_business() {
    assert_none("foreign crates", &arrows::to_foreign_crates(&repository()));
}

#[test]
fn files_are_named_after_what_they_are() {
    assert_none("names", &tidy::names(&repository()));
}

#[test]
fn files_have_one_subject_and_say_which() {
    assert_none("files", &tidy::sizes_and_headers(&repository()));
}

#[test]
fn both_engines_have_the_same_migrations() {
    assert_none("migrations", &tidy::migrations(&repository()));
}

#[test]
fn no_file_names_what_lies_outside_the_repository() {
    assert_none("outside", &tidy::outside(&repository()));
}

#[test]
fn nothing_is_left_for_later_and_no_test_is_left_out() {
    assert_none("unfinished", &tidy::unfinished(&repository()));
}

#[test]
fn the_pages_that_a_stranger_looks_for_are_there() {
    assert_none("pages", &tidy::expected_pages(&repository()));
}

#[test]
fn committed_data_has_its_licence_beside_it() {
    assert_none("data", &tidy::data_licences(&repository()));
}

#[test]
fn dependencies_are_permissive_and_from_the_registry() {
    let sources = repository();
    let policy = licences::Policy::parse(sources.text("deny.toml").expect("deny.toml"));
    let policy = policy.expect("deny.toml is readable");
    assert_none(
        "bans and sources",
        &licences::locked(&policy, sources.text("Cargo.lock").expect("Cargo.lock")),
    );
    let listed = licences::list(&sources::root()).expect("cargo tree lists the dependencies");
    assert!(listed.len() > 50, "cargo tree listed only {} packages", listed.len());
    assert_none("licences", &licences::refused(&policy, &listed));
}
