//! Which modules of its own crate a Rust file names: `crate::…` and `super::…` paths, in `use`
//! trees and in expressions, with inline modules followed. A reader of words, not a parser of Rust.

use std::collections::BTreeSet;

/// Paths from the crate's root, each as its segments, in the order of the text.
///
/// `module` is the file's own module path (`["level", "fold"]` for `src/level/fold.rs`).
pub(crate) fn named(source: &str, module: &[String]) -> Vec<Vec<String>> {
    let words = words(source);
    let mut here: Vec<String> = module.to_vec();
    // For every inline module that is open: the depth of braces at which it closes.
    let mut inline: Vec<usize> = Vec::new();
    let mut depth = 0;
    let mut found = Vec::new();
    let mut at = 0;
    while at < words.len() {
        match words[at].as_str() {
            "mod" if words.get(at + 2).is_some_and(|word| word == "{") => {
                here.push(words[at + 1].clone());
                inline.push(depth);
                depth += 1;
                at += 3;
                continue;
            }
            "{" => depth += 1,
            "}" => {
                depth = depth.saturating_sub(1);
                if inline.last() == Some(&depth) {
                    inline.pop();
                    here.pop();
                }
            }
            "crate" | "super" if starts_path(&words, at) => {
                at = tree(&words, at, &[], &here, &mut found);
                continue;
            }
            _ => {}
        }
        at += 1;
    }
    found
}

/// The first words of all paths: crates, modules and types that are named with `::` behind them.
pub(crate) fn roots(source: &str) -> BTreeSet<String> {
    let words = words(source);
    let firsts = (0..words.len()).filter(|at| starts_path(&words, *at));
    firsts.map(|at| words[at].clone()).collect()
}

fn starts_path(words: &[String], at: usize) -> bool {
    // `pub(crate)`, `pub(super)` and `pub(in …)` are followed by no `::`, or name nothing new.
    words.get(at + 1).is_some_and(|word| word == "::") && (at == 0 || words[at - 1] != "::")
}

/// Reads one path tree from `at`; answers the place behind it.
fn tree(
    words: &[String],
    mut at: usize,
    prefix: &[String],
    here: &[String],
    found: &mut Vec<Vec<String>>,
) -> usize {
    let mut path = prefix.to_vec();
    loop {
        match words.get(at).map(String::as_str) {
            Some("{") => {
                at += 1;
                while at < words.len() && words[at] != "}" {
                    if words[at] == "," {
                        at += 1;
                        continue;
                    }
                    let next = tree(words, at, &path, here, found);
                    at = next.max(at + 1);
                }
                return at + 1;
            }
            Some(word) => path.push(word.to_owned()),
            None => break,
        }
        at += 1;
        if words.get(at).is_none_or(|word| word != "::") {
            break;
        }
        at += 1;
    }
    found.extend(absolute(&path, here));
    if words.get(at).is_some_and(|word| word == "as") { at + 2 } else { at }
}

/// Resolves a path that starts with `crate` or with any number of `super`.
fn absolute(path: &[String], here: &[String]) -> Option<Vec<String>> {
    let ups = path.iter().take_while(|segment| *segment == "super").count();
    match path.first()?.as_str() {
        "crate" => Some(path[1..].to_vec()),
        "super" if ups <= here.len() => {
            Some(here[..here.len() - ups].iter().chain(&path[ups..]).cloned().collect())
        }
        _ => None,
    }
}

/// Words and signs without comments and the content of strings.
fn words(source: &str) -> Vec<String> {
    let chars: Vec<char> = source.chars().collect();
    let mut words = Vec::new();
    let mut at = 0;
    while at < chars.len() {
        let rest = &chars[at..];
        if rest.starts_with(&['/', '/']) {
            at += rest.iter().position(|c| *c == '\n').unwrap_or(rest.len());
        } else if rest.starts_with(&['/', '*']) {
            let end = rest.windows(2).skip(2).position(|pair| pair == ['*', '/']);
            at += end.map_or(rest.len(), |end| end + 4);
        } else if let Some(length) = string_length(rest) {
            at += length;
        } else if rest[0].is_alphanumeric() || rest[0] == '_' {
            let length = rest.iter().take_while(|c| c.is_alphanumeric() || **c == '_').count();
            words.push(rest[..length].iter().collect());
            at += length;
        } else if rest.starts_with(&[':', ':']) {
            words.push("::".to_owned());
            at += 2;
        } else {
            if !rest[0].is_whitespace() {
                words.push(rest[0].to_string());
            }
            at += 1;
        }
    }
    words
}

/// The length of the string or character literal that starts here, if one does.
fn string_length(rest: &[char]) -> Option<usize> {
    let hashes = rest.iter().skip(1).take_while(|c| **c == '#').count();
    if rest[0] == 'r' && rest.get(1 + hashes) == Some(&'"') {
        let mut close = vec!['"'];
        close.extend(std::iter::repeat_n('#', hashes));
        let body = 2 + hashes;
        let end = rest[body..].windows(close.len()).position(|window| window == close);
        return Some(end.map_or(rest.len(), |end| body + end + close.len()));
    }
    if rest[0] == '\'' {
        // A character, not a lifetime: 'x' or '\…'.
        let escaped = rest.get(1) == Some(&'\\');
        if !escaped && rest.get(2) != Some(&'\'') {
            return None;
        }
        return rest.iter().skip(2).position(|c| *c == '\'').map(|end| end + 3);
    }
    if rest[0] != '"' {
        return None;
    }
    let mut at = 1;
    while at < rest.len() && rest[at] != '"' {
        at += if rest[at] == '\\' { 2 } else { 1 };
    }
    Some((at + 1).min(rest.len()))
}

fn heads(source: &str, module: &[&str]) -> Vec<String> {
    let module: Vec<String> = module.iter().map(|name| (*name).to_owned()).collect();
    named(source, &module).into_iter().map(|path| path.join("::")).collect()
}

#[test]
fn use_trees_are_followed_into_their_braces() {
    assert_eq!(
        heads(
            "use crate::{geometry::{Point, Pose as P}, raster::Tile};\nuse std::fmt;",
            &["level"]
        ),
        ["geometry::Point", "geometry::Pose", "raster::Tile"]
    );
}

#[test]
fn super_means_the_module_above_and_inline_modules_count() {
    assert_eq!(heads("use super::store::Row;", &["level"]), ["store::Row"]);
    assert_eq!(
        heads("use super::Map; use super::super::http::State;", &["level", "fold"]),
        ["level::Map", "http::State"]
    );
    let nested =
        "fn f() { if a { b } } mod tests { use super::*; use super::super::raster::Cell; }";
    assert_eq!(heads(nested, &["level", "fold"]), ["level::fold::*", "level::raster::Cell"]);
    assert_eq!(heads("mod inner { fn f() {} } use super::x;", &["a"]), ["x"]);
}

#[test]
fn expressions_count_and_words_in_comments_and_strings_do_not() {
    let source = r#"
        // use crate::commented::Out;
        /* crate::also::Out */
        fn f<'a>(c: &'a str) -> char { let _ = "crate::text"; let _ = r"crate::raw"; '"' }
        fn g() -> u8 { crate::raster::side() }
        pub(crate) struct S;
    "#;
    assert_eq!(heads(source, &["level"]), ["raster::side"]);
}
