//! Whether lines and their ends claim no more than they know, whatever the errors of the scanner: sets of
//! scans drawn from several seeds, judged together and one by one.

use super::score::Score;
use super::set::{FANS, Set};
use super::verdict::{nees_band, within_two_sd};
use crate::simulation::Errors;
use crate::statistics::{mean, quantile};

/// Seeds of each scanner.
const SEEDS: u64 = 5;
/// Scans of each seed.
const SCANS: usize = 100;

/// Head of the table.
pub(super) const HEADER: [&str; 8] = [
    "errors",
    "lines",
    "NEES",
    "of the sets",
    "worst line",
    "false/scan",
    "corners within 2 sd",
    "jumps within 2 sd",
];

/// The rows of the table, and what is not as it must be.
pub(super) fn rows() -> (Vec<Vec<String>>, Vec<String>) {
    let (mut rows, mut faults) = (Vec::new(), Vec::new());
    for cm in [1, 3, 5, 8] {
        let name = format!("noise of {cm} cm");
        let errors = |_| Errors { range_sd_m: 0.01 * f64::from(cm), ..Errors::default() };
        let (row, fault) = row(&name, errors);
        rows.push(row);
        faults.extend(fault);
    }
    (rows, faults)
}

/// One kind of errors, told of the angle from beam to beam.
fn row(name: &str, errors: impl Fn(f64) -> Errors) -> (Vec<String>, Option<String>) {
    let mut all = Score::default();
    let mut sets = Vec::new();
    for fan in FANS {
        for seed in 0..SEEDS {
            let errors = errors(fan.increment());
            let set = Set::drawn(name.to_owned(), fan, &errors, 0, (SCANS, seed));
            let [ours, _] = set.scores();
            sets.push(mean(&ours.nees));
            all.append(ours);
        }
    }
    let nees = mean(&all.nees);
    let within =
        |errors: &[f64]| format!("{:.1} % of {}", 100.0 * within_two_sd(errors), errors.len());
    let row = vec![
        name.to_owned(),
        all.nees.len().to_string(),
        format!("{nees:.2}"),
        format!("{:.2} to {:.2}", quantile(&sets, 0.0), quantile(&sets, 1.0)),
        format!("{:.0}", quantile(&all.nees, 1.0)),
        format!("{:.3}", all.false_lines as f64 / all.scans as f64),
        within(&all.corners),
        within(&all.jumps),
    ];
    let bold = nees > 2.0 + nees_band(&all.nees);
    (row, bold.then(|| format!("{name}: lines are surer than they may be: {nees}")))
}
