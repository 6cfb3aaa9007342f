//! Dependencies against deny.toml: licences, bans, sources. `make deny` asks the real tool, which
//! also knows advisories; this needs no network and no tool.

use std::collections::BTreeSet;
use std::path::Path;
use std::process::Command;

/// The part of deny.toml that is checked here.
#[derive(Debug, Default)]
pub(crate) struct Policy {
    allowed: BTreeSet<String>,
    banned: BTreeSet<String>,
}

impl Policy {
    /// Reads deny.toml.
    pub(crate) fn parse(text: &str) -> Result<Self, toml::de::Error> {
        let table = text.parse::<toml::Table>()?;
        let list = |section: &str, key: &str| -> Vec<toml::Value> {
            let values = table.get(section).and_then(|section| section.get(key));
            values.and_then(toml::Value::as_array).cloned().unwrap_or_default()
        };
        let text = |value: &toml::Value| value.as_str().map(str::to_owned);
        Ok(Self {
            allowed: list("licenses", "allow").iter().filter_map(text).collect(),
            banned: list("bans", "deny")
                .iter()
                .filter_map(|ban| ban.get("crate").and_then(text))
                .collect(),
        })
    }

    /// Whether an SPDX expression can be met with allowed licences only.
    fn allows(&self, expression: &str) -> bool {
        let spaced = expression.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
        let words: Vec<&str> = spaced.split_whitespace().collect();
        let mut at = 0;
        self.any_of(&words, &mut at) && at == words.len()
    }

    fn any_of(&self, words: &[&str], at: &mut usize) -> bool {
        let mut met = self.all_of(words, at);
        while words.get(*at) == Some(&"OR") {
            *at += 1;
            met |= self.all_of(words, at);
        }
        met
    }

    fn all_of(&self, words: &[&str], at: &mut usize) -> bool {
        let mut met = self.one(words, at);
        while words.get(*at) == Some(&"AND") {
            *at += 1;
            met &= self.one(words, at);
        }
        met
    }

    fn one(&self, words: &[&str], at: &mut usize) -> bool {
        let Some(word) = words.get(*at) else { return false };
        *at += 1;
        if *word == "(" {
            let met = self.any_of(words, at);
            *at += 1;
            return met;
        }
        let mut licence = (*word).to_owned();
        if let (Some(&"WITH"), Some(exception)) = (words.get(*at), words.get(*at + 1)) {
            licence = format!("{licence} WITH {exception}");
            *at += 2;
        }
        self.allowed.contains(&licence)
    }
}

/// A package of others and its licence expression; empty if it names none.
pub(crate) type Listed = (String, String);

/// What this platform builds, tests and build scripts included.
pub(crate) fn list(root: &Path) -> std::io::Result<Vec<Listed>> {
    let output = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .current_dir(root)
        .args(["tree", "--workspace", "--locked", "--offline", "--prefix", "none"])
        .args(["--edges", "normal,build,dev", "--format", "{p}|{l}"])
        .output()?;
    if !output.status.success() {
        return Err(std::io::Error::other(String::from_utf8_lossy(&output.stderr).into_owned()));
    }
    let text = String::from_utf8_lossy(&output.stdout);
    let listed: BTreeSet<Listed> = text
        .lines()
        .filter_map(|line| line.split_once('|'))
        // Marks of repetition and of procedural macros follow the name.
        .map(|(package, licence)| {
            let name = package.split(" (").next().unwrap_or(package);
            (name.to_owned(), licence.trim_end_matches(" (*)").to_owned())
        })
        .collect();
    Ok(listed.into_iter().collect())
}

/// Packages whose licence is not allowed.
pub(crate) fn refused(policy: &Policy, listed: &[Listed]) -> Vec<String> {
    listed
        .iter()
        .filter(|(_, licence)| !policy.allows(licence))
        .map(|(package, licence)| format!("{package}: licence {licence:?}"))
        .collect()
}

/// Banned crates, and crates from elsewhere than the registry, in Cargo.lock.
pub(crate) fn locked(policy: &Policy, lock: &str) -> Vec<String> {
    let table = match lock.parse::<toml::Table>() {
        Ok(table) => table,
        Err(error) => return vec![format!("Cargo.lock: {error}")],
    };
    let packages = table.get("package").and_then(toml::Value::as_array);
    let mut violations = Vec::new();
    for package in packages.into_iter().flatten() {
        let text = |key: &str| package.get(key).and_then(toml::Value::as_str);
        let name = text("name").unwrap_or_default();
        if policy.banned.contains(name) {
            violations.push(format!("{name} is banned by deny.toml"));
        }
        match text("source") {
            Some(source) if !source.starts_with("registry+") => {
                violations.push(format!("{name} comes from {source}"));
            }
            None if !name.starts_with("mapfold-") => {
                violations.push(format!("{name} lies beside the workspace"));
            }
            _ => {}
        }
    }
    violations
}

fn policy() -> Policy {
    let text = "[licenses]\nallow = ['MIT', 'ISC', 'Apache-2.0 WITH LLVM-exception']\n\
                [bans]\ndeny = [{ crate = 'openssl', reason = 'rustls' }]";
    Policy::parse(text).expect("a readable policy")
}

#[test]
fn licence_expressions_are_read_as_spdx_means_them() {
    let policy = policy();
    for met in [
        "MIT",
        "MIT/GPL-3.0",
        "GPL-3.0 OR MIT",
        "MIT AND ISC",
        "(GPL-3.0 OR MIT) AND ISC",
        "Apache-2.0 WITH LLVM-exception OR GPL-3.0",
    ] {
        assert!(policy.allows(met), "{met}");
    }
    for unmet in
        ["", "GPL-3.0", "MIT AND GPL-3.0", "Apache-2.0", "(MIT OR ISC) AND GPL-3.0", "MIT ISC"]
    {
        assert!(!policy.allows(unmet), "{unmet}");
    }
}

#[test]
fn bans_and_strange_sources_are_found() {
    let lock = "[[package]]\nname = 'openssl'\nsource = 'registry+x'\n\
                [[package]]\nname = 'forked'\nsource = 'git+y'\n\
                [[package]]\nname = 'stray'\n\
                [[package]]\nname = 'mapfold-map'\n\
                [[package]]\nname = 'fine'\nsource = 'registry+x'";
    assert_eq!(
        locked(&policy(), lock),
        [
            "openssl is banned by deny.toml",
            "forked comes from git+y",
            "stray lies beside the workspace"
        ]
    );
    let listed = [("a v1".to_owned(), "MIT".to_owned()), ("b v2".to_owned(), String::new())];
    assert_eq!(refused(&policy(), &listed), ["b v2: licence \"\""]);
}
