//! The figures that Criterion leaves behind, gathered into a table.

use std::path::Path;

use serde::Deserialize;

use crate::{Error, report};

/// What Criterion writes about one benchmark, as far as it is used here; nanoseconds.
#[derive(Debug, Deserialize)]
struct Estimates {
    mean: Estimate,
}

#[derive(Debug, Deserialize)]
struct Estimate {
    point_estimate: f64,
    confidence_interval: Interval,
}

#[derive(Debug, Deserialize)]
struct Interval {
    lower_bound: f64,
    upper_bound: f64,
}

/// Rewrites the table `benches` of the report from Criterion's folder; answers what is missing.
///
/// # Errors
/// A file that cannot be read or written.
pub fn benches(page: &Path, criterion: &Path) -> Result<Vec<String>, Error> {
    let mut rows = Vec::new();
    gather(criterion, criterion, &mut rows)?;
    if rows.is_empty() {
        return Ok(vec![format!("{} holds no figures", criterion.display())]);
    }
    rows.sort();
    let header = ["benchmark", "mean", "95 % from", "to"];
    report::rewrite(page, "benches", &report::table(&header, &rows))?;
    Ok(Vec::new())
}

/// Criterion nests folders by group, function and parameter; the latest figures are in `new`.
fn gather(root: &Path, folder: &Path, rows: &mut Vec<Vec<String>>) -> Result<(), Error> {
    let latest = folder.join("new/estimates.json");
    if latest.is_file() {
        let text = std::fs::read(&latest).map_err(|e| Error::file(&latest, e))?;
        let estimates: Estimates = serde_json::from_slice(&text)
            .map_err(|e| Error::file(&latest, std::io::Error::other(e)))?;
        let name = folder.strip_prefix(root).unwrap_or(folder).display().to_string();
        let Estimate { point_estimate, confidence_interval } = estimates.mean;
        let Interval { lower_bound, upper_bound } = confidence_interval;
        rows.push(vec![name, time(point_estimate), time(lower_bound), time(upper_bound)]);
        return Ok(());
    }
    let Ok(entries) = std::fs::read_dir(folder) else { return Ok(()) };
    for entry in entries.flatten() {
        if entry.path().is_dir() && entry.file_name() != "report" {
            gather(root, &entry.path(), rows)?;
        }
    }
    Ok(())
}

/// Nanoseconds in a unit that people read.
fn time(nanoseconds: f64) -> String {
    let (scale, unit) = match nanoseconds {
        n if n < 1e3 => (1.0, "ns"),
        n if n < 1e6 => (1e3, "µs"),
        n if n < 1e9 => (1e6, "ms"),
        _ => (1e9, "s"),
    };
    format!("{:.3} {unit}", nanoseconds / scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_are_found_in_nested_folders_and_written_in_readable_units() {
        let folder = tempfile::tempdir().expect("a folder");
        let criterion = folder.path().join("criterion");
        let place = criterion.join("fold/one look/new");
        std::fs::create_dir_all(&place).expect("folders");
        let figures = r#"{"mean":{"confidence_interval":{"confidence_level":0.95,
            "lower_bound":1500.0,"upper_bound":2.5e6},"point_estimate":2.0e9,"standard_error":1.0}}"#;
        std::fs::write(place.join("estimates.json"), figures).expect("figures");
        let page = folder.path().join("page.md");
        std::fs::write(&page, "<!-- begin: benches -->\n<!-- end: benches -->\n").expect("a page");
        assert!(benches(&page, &criterion).expect("a table").is_empty());
        let text = std::fs::read_to_string(&page).expect("the page");
        assert!(text.contains("| fold/one look | 2.000 s | 1.500 µs | 2.500 ms |"), "{text}");
        assert_eq!(benches(&page, &folder.path().join("nothing")).expect("an answer").len(), 1);
    }
}
