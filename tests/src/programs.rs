//! Where the real programs lie: beside the one that asks, as cargo builds them.

use std::path::PathBuf;

use crate::Error;

/// The path of a program of this workspace, built with the same profile as the caller.
///
/// # Errors
/// It has not been built.
pub fn path(name: &str) -> Result<PathBuf, Error> {
    let fault = |fault: String| Error::Program { program: name.to_owned(), fault };
    let own = std::env::current_exe().map_err(|e| fault(e.to_string()))?;
    // Tests lie in `deps`, a folder below the programs.
    let folder = own.parent().map(|folder| match folder.file_name() {
        Some(last) if last == "deps" => folder.parent().unwrap_or(folder),
        _ => folder,
    });
    let path = folder.map(|folder| folder.join(name)).unwrap_or_default();
    if !path.is_file() {
        return Err(fault(format!(
            "not at {}: run `cargo build --workspace --bins` first, as `make test` does",
            path.display()
        )));
    }
    Ok(path)
}

/// The last lines that a program wrote into a file.
pub fn last_words(log: &std::path::Path) -> String {
    let text = std::fs::read_to_string(log).unwrap_or_default();
    let lines: Vec<&str> = text.lines().collect();
    lines[lines.len().saturating_sub(12)..].join("\n")
}
