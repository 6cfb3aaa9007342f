//! How well and how fast lines are found in scans of which every wall is known: extraction and the
//! bare loop on the same scans, in the same run.

mod labelled;
pub mod score;
mod seeds;
mod set;
pub mod verdict;

use std::hint::black_box;
use std::path::Path;

use mapfold_client::perception::Extractor;

use crate::statistics::{mean, quantile};
use crate::{Error, report};
use score::Score;
use verdict::{nees_band, within_two_sd};

pub use set::{FANS, Set};

/// Scans of a set.
const SCANS: usize = 200;
/// Passes over a set for its time.
const PASSES: usize = 40;

/// Microseconds a scan of two ways, turn about, so that both have the machine in the same state. Of
/// each scan's passes the least disturbed counts: what the code takes, not who else is running.
pub fn times(mut one: impl FnMut(usize), mut other: impl FnMut(usize)) -> [f64; 2] {
    let mut sums = [0.0, 0.0];
    for scan in 0..SCANS {
        let mut least = [f64::INFINITY; 2];
        for _ in 0..PASSES {
            let ways = [&mut one as &mut dyn FnMut(usize), &mut other];
            for (way, least) in ways.into_iter().zip(&mut least) {
                let start = tokio::time::Instant::now();
                way(scan);
                *least = least.min(start.elapsed().as_secs_f64() * 1e6);
            }
        }
        sums = [sums[0] + least[0], sums[1] + least[1]];
    }
    sums.map(|sum| sum / SCANS as f64)
}

/// Rewrites the tables `extraction`, `lines` and `seeds` of the report, and `labelled` if there is a map with
/// lines that people drew in `data`; answers what is not as it must be.
///
/// # Errors
/// A page or a map that cannot be read or written.
pub fn extraction(page: &Path, data: Option<&Path>) -> Result<Vec<String>, Error> {
    let mut rows = Vec::new();
    let mut honesty = Vec::new();
    let mut faults = Vec::new();
    let plain =
        [0.01, 0.03, 0.05].into_iter().flat_map(|sd| FANS.map(|fan| Set::plain(fan, sd, SCANS)));
    let cluttered =
        [0.01, 0.03].into_iter().flat_map(|sd| FANS.map(|fan| Set::cluttered(fan, sd, SCANS)));
    for set in plain.chain(cluttered) {
        let scans = set.scans();
        let [ours, theirs] = set.scores();
        let (bare, mut lines) = (set.bare_loop(), Vec::new());
        let mut extractor = Extractor::new(set.config());
        let [our_time, bare_time] = times(
            |i| {
                black_box(extractor.extract(&scans[i]));
            },
            |i| {
                bare.lines(&set.fan, &scans[i].ranges, &mut lines);
                black_box(&lines);
            },
        );
        report::say(&format!("{} mean range {:.2}", set.name, set.mean_range_m()));
        for (name, time, score) in [("bare loop", bare_time, &theirs), ("Mapfold", our_time, &ours)]
        {
            let other = if name == "Mapfold" { &theirs } else { &ours };
            let row = row(name, &set.name, time, score, other);
            report::say(&row.join(" | "));
            rows.push(row);
        }
        honesty.push(honesty_row(&set.name, &ours));
        report::say(&honesty_row(&set.name, &ours).join(" | "));
        faults.extend(verdict::faults(&set.name, set.is_cluttered, &ours, &theirs));
    }
    report::rewrite(page, "extraction", &report::table(&HEADER, &rows))?;
    report::rewrite(page, "lines", &report::table(&HONESTY, &honesty))?;
    let (seeds, bold) = seeds::rows();
    report::rewrite(page, "seeds", &report::table(&seeds::HEADER, &seeds))?;
    faults.extend(bold);
    let map = data.map(|data| data.join("plans/aria/columbia.map")).filter(|map| map.is_file());
    match map {
        Some(map) => faults.extend(labelled::labelled(page, &map)?),
        None => {
            report::say("no plans/aria/columbia.map: the table of drawn lines is left as it is");
        }
    }
    Ok(faults)
}

const HEADER: [&str; 9] = [
    "extractor",
    "data",
    "µs/scan",
    "seg/scan",
    "recall",
    "false/scan",
    "angle med / p95 deg",
    "p95 on same walls",
    "offset med / p95 mm",
];

fn row(name: &str, data: &str, time: f64, score: &Score, other: &Score) -> Vec<String> {
    let scans = score.scans as f64;
    let pair = |values: &[f64], scale: f64, digits: usize| {
        let (a, b) = (quantile(values, 0.5) * scale, quantile(values, 0.95) * scale);
        format!("{a:.digits$} / {b:.digits$}")
    };
    vec![
        name.to_owned(),
        data.to_owned(),
        format!("{time:.1}"),
        format!("{:.1}", score.lines as f64 / scans),
        format!("{:.3}", score.recall()),
        format!("{:.3}", score.false_lines as f64 / scans),
        pair(&score.angles, 1f64.to_degrees(), 3),
        format!("{:.3}", quantile(&score.angles_on_same_walls(other).0, 0.95).to_degrees()),
        pair(&score.offsets, 1e3, 2),
    ]
}

const HONESTY: [&str; 9] = [
    "data",
    "lines",
    "NEES",
    "band",
    "beyond 99 %",
    "corners within 2 sd",
    "jumps within 2 sd",
    "rms corner / jump sd",
    "ends astray",
];

fn honesty_row(data: &str, score: &Score) -> Vec<String> {
    let within =
        |errors: &[f64]| format!("{:.1} % of {}", 100.0 * within_two_sd(errors), errors.len());
    let rms = |values: &[f64]| mean(&values.iter().map(|x| x * x).collect::<Vec<_>>()).sqrt();
    let beyond = score.nees.iter().filter(|x| **x > 9.210).count();
    let band = nees_band(&score.nees);
    vec![
        data.to_owned(),
        score.nees.len().to_string(),
        format!("{:.2}", mean(&score.nees)),
        format!("{:.2} to {:.2}", 2.0 - band, 2.0 + band),
        format!("{:.2} %", 100.0 * beyond as f64 / score.nees.len().max(1) as f64),
        within(&score.corners),
        within(&score.jumps),
        format!("{:.2} / {:.2}", rms(&score.corners), rms(&score.jumps)),
        score.astray.to_string(),
    ]
}
