//! The figures that Criterion leaves behind, gathered into a table.

use std::path::Path;

use serde::Deserialize;

use crate::{Error, report};

/// What Criterion writes about one benchmark, as far as it is used here; nanoseconds.
#[derive(Debug, Deserialize)]
struct Estimates {
    mean: Estimate,
    /// Not moved by what else ran for a moment.
    median: Estimate,
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

/// Rewrites the tables `benches` and `ratios` of the report from Criterion's folder; answers what is
/// missing.
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
    let mut faults = beside_the_bare_loop(page, criterion)?;
    faults.extend(beside_rays(page, criterion)?);
    Ok(faults)
}

/// Rewrites the table `insertion`: how many times as fast as the bare ray loop scans enter cells, and what
/// adding tiles comes to beside plain addition.
fn beside_rays(page: &Path, criterion: &Path) -> Result<Vec<String>, Error> {
    let median = |group: &str, name: &str| {
        Ok::<_, Error>(latest(&criterion.join(group).join(name))?.map(|e| e.median.point_estimate))
    };
    let mut rows = Vec::new();
    let mut faults = Vec::new();
    let mut compare = |what: String, limit: Option<f64>, own: Option<f64>| match (limit, own) {
        (Some(limit), Some(own)) => {
            rows.push(vec![what, time(limit), time(own), format!("{:.2}", limit / own)]);
        }
        _ => faults.push(format!("no figures of {what}")),
    };
    for beams in ["361", "682", "1081"] {
        let of = |name: &str| median("insertion", &format!("{name}/{beams}"));
        compare(format!("a scan of {beams} beams, bare rays"), of("bare rays")?, of("Mapfold")?);
    }
    let of = |name: &str| median("tiles", name);
    compare("adding a tile, saturating".to_owned(), of("saturating addition")?, of("a tile")?);
    compare("adding a tile, plain".to_owned(), of("plain addition")?, of("a tile")?);
    compare("adding a full patch, plain".to_owned(), of("plain addition")?, of("a patch")?);
    let header = ["what, beside what", "that", "Mapfold", "times as fast"];
    report::rewrite(page, "insertion", &report::table(&header, &rows))?;
    Ok(faults)
}

/// Rewrites the table `ratios`: what extraction costs in times of the bare loop.
fn beside_the_bare_loop(page: &Path, criterion: &Path) -> Result<Vec<String>, Error> {
    let mut rows = Vec::new();
    let mut faults = Vec::new();
    for beams in ["361", "682", "1081"] {
        let median = |name: &str| {
            let folder = criterion.join("lines").join(name).join(beams);
            Ok(latest(&folder)?.map(|estimates| estimates.median.point_estimate))
        };
        let (Some(bare), Some(plain), Some(with_table)) =
            (median("bare loop")?, median("Mapfold")?, median("Mapfold with a table")?)
        else {
            faults.push(format!("no figures of extraction with {beams} beams"));
            continue;
        };
        let ratio = |own: f64| format!("{:.2}", own / bare);
        let times = [bare, plain, with_table].map(time);
        rows.push([&[beams.to_owned()], &times[..], &[ratio(plain), ratio(with_table)]].concat());
    }
    let header = ["beams", "bare loop", "Mapfold", "with a table", "ratio", "ratio with a table"];
    report::rewrite(page, "ratios", &report::table(&header, &rows))?;
    Ok(faults)
}

/// What Criterion last wrote into a benchmark's folder, if anything.
fn latest(folder: &Path) -> Result<Option<Estimates>, Error> {
    let file = folder.join("new/estimates.json");
    if !file.is_file() {
        return Ok(None);
    }
    let text = std::fs::read(&file).map_err(|e| Error::file(&file, e))?;
    let estimates =
        serde_json::from_slice(&text).map_err(|e| Error::file(&file, std::io::Error::other(e)))?;
    Ok(Some(estimates))
}

/// Criterion nests folders by group, function and parameter; the latest figures are in `new`.
fn gather(root: &Path, folder: &Path, rows: &mut Vec<Vec<String>>) -> Result<(), Error> {
    if let Some(estimates) = latest(folder)? {
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
        let write = |name: &str, nanoseconds: &str| {
            let place = criterion.join(name).join("new");
            std::fs::create_dir_all(&place).expect("folders");
            let figures = r#"{"confidence_interval":{"confidence_level":0.95,
                "lower_bound":1500.0,"upper_bound":2.5e6},"point_estimate":MEAN,"standard_error":1.0}"#
                .replace("MEAN", nanoseconds);
            let figures = format!(r#"{{"mean":{figures},"median":{figures}}}"#);
            std::fs::write(place.join("estimates.json"), figures).expect("figures");
        };
        write("fold/one look", "2.0e9");
        for beams in ["361", "682", "1081"] {
            write(&format!("lines/bare loop/{beams}"), "10000.0");
            write(&format!("lines/Mapfold/{beams}"), "19000.0");
            write(&format!("lines/Mapfold with a table/{beams}"), "25000.0");
            write(&format!("insertion/bare rays/{beams}"), "30000.0");
            write(&format!("insertion/Mapfold/{beams}"), "20000.0");
        }
        for name in ["saturating addition", "plain addition", "a tile", "a patch"] {
            write(&format!("tiles/{name}"), "400.0");
        }
        let page = folder.path().join("page.md");
        let markers = ["benches", "ratios", "insertion"]
            .map(|name| format!("<!-- begin: {name} -->\n<!-- end: {name} -->\n"));
        std::fs::write(&page, markers.concat()).expect("a page");
        assert!(benches(&page, &criterion).expect("a table").is_empty());
        let text = std::fs::read_to_string(&page).expect("the page");
        assert!(text.contains("| fold/one look | 2.000 s | 1.500 µs | 2.500 ms |"), "{text}");
        let ratios = "| 361 | 10.000 µs | 19.000 µs | 25.000 µs | 1.90 | 2.50 |";
        assert!(text.contains(ratios), "{text}");
        let insertion = "| a scan of 682 beams, bare rays | 30.000 µs | 20.000 µs | 1.50 |";
        assert!(text.contains(insertion), "{text}");
        assert_eq!(benches(&page, &folder.path().join("nothing")).expect("an answer").len(), 1);
    }
}
