//! How well a cheap scanner's ranges are corrected: simulated heads measure a flat target, the
//! readings become a table, and the same heads' sweeps of walls are corrected with it.
//!
//! The heads are this crate's own ([`crate::simulation::IrHead`]); what is measured is the
//! product's calibration and correction, called as its program and its surveyor call them.

mod errors;
mod sweeps;

use std::path::Path;

pub use errors::{Errors, worst_bin};
pub use sweeps::{AT_REST, Sample, Scene, calibrated, line_errors, samples};

use crate::simulation::{IrHead, Noise};
use crate::{Error, report};

/// How much is measured.
#[derive(Debug, Clone, Copy)]
pub struct Effort {
    /// Heads, each of a seed of its own.
    pub heads: u64,
    /// Readings of the target at each node.
    pub per_node: u32,
    /// Sweeps of walls by each head.
    pub sweeps: u32,
}

/// What the evaluation does.
pub const FULL: Effort = Effort { heads: 12, per_node: 100, sweeps: 3000 };

/// Farthest distance that errors are counted at, metres, and greatest incidence, degrees.
const FARTHEST_M: f64 = 4.0;
const STEEPEST_DEG: f64 = 65.0;
/// Bins of errors: metres by degrees.
const BIN: (f64, f64) = (0.5, 10.0);
/// Bins with fewer readings say nothing about a bias of millimetres: at 3 cm of noise, the mean of
/// 3000 is certain to half a millimetre.
const BIN_READINGS_MIN: usize = 3000;

/// 99 of 100 corrected ranges of the design's walls are better than this, metres, and those of a robot at
/// rest ([`AT_REST`] sweeps) at every incidence; a single sweep cannot be where noise alone is not.
pub const P99_MAX_M: f64 = 0.045;
/// The bias of a bin is less, metres.
pub const BIAS_MAX_M: f64 = 0.003;
/// At every incidence, the p99 of corrected ranges is less than so many times that of noise alone:
/// what no correction of single readings can undo.
pub const OVER_NOISE_MAX: f64 = 1.10;
/// Mean normalised squared error of lines: the upper end of its 95 % band for 1000 lines. Less is
/// careful, for the claimed floor is that of the worst surface.
pub const NEES_MAX: f64 = 2.13;

/// All heads' readings, scene by scene.
struct Measured {
    sector: Vec<Vec<Sample>>,
    walls: Vec<Sample>,
    corners: Vec<Sample>,
    systematic: Vec<f64>,
    /// Normalised squared errors of lines, head by head, and sweeps without just one line.
    lines: Vec<(Vec<f64>, u32)>,
}

/// Runs the evaluation and rewrites the tables `range` of the report; answers what is not as it
/// must be.
///
/// # Errors
/// A calibration fails, or the report cannot be read or written.
pub fn evaluate(page: &Path, effort: &Effort) -> Result<Vec<String>, Error> {
    let mut all = Measured {
        sector: Vec::new(),
        walls: Vec::new(),
        corners: Vec::new(),
        systematic: Vec::new(),
        lines: Vec::new(),
    };
    for seed in 0..effort.heads {
        let fault = |fault| Error::Program { program: format!("range, head {seed}"), fault };
        let head = IrHead::of_seed(seed);
        let mut noise = Noise::of_seed(1000 + seed);
        let done = calibrated(&head, effort.per_node, &mut noise).map_err(fault)?;
        all.systematic.push(done.profile.systematic_sd_m);
        let mut of = |scene| samples(&head, &done, scene, effort.sweeps, &mut noise);
        all.sector.push(of(Scene::Sector).map_err(fault)?);
        all.walls.extend(of(Scene::Wall).map_err(fault)?);
        all.corners.extend(of(Scene::Corner).map_err(fault)?);
        let lines = line_errors(&head, &done, effort.sweeps, false, &mut noise);
        all.lines.push(lines.map_err(fault)?);
    }
    report::rewrite(page, "range", &all.tables())?;
    Ok(all.faults())
}

fn mm(metres: f64) -> String {
    format!("{:.1}", 1e3 * metres)
}

/// Errors as they came, corrected in the scan, and of noise alone.
fn three(samples: &[Sample]) -> [Errors; 3] {
    let mut noise = Noise::of_seed(77);
    [
        Errors::of(samples.iter().map(|s| s.raw)),
        Errors::of(samples.iter().filter_map(|s| s.in_situ)),
        Errors::of(samples.iter().map(|s| noise.normal(s.noise_sd))),
    ]
}

/// Errors of the means of a robot at rest.
fn at_rest(samples: &[Sample]) -> Errors {
    Errors::of(samples.iter().filter_map(|s| s.at_rest))
}

/// Mean square of the errors of a robot at rest over what is claimed: 1 if the claims are right.
fn honesty_at_rest(samples: &[Sample]) -> f64 {
    let errors = samples.iter().filter_map(|s| s.at_rest.map(|e| (e / s.claimed_at_rest).powi(2)));
    Errors::of(errors).bias
}

/// Readings by incidence: from, to, readings.
fn bands(samples: &[Sample]) -> impl Iterator<Item = (f64, f64, Vec<Sample>)> {
    (0..7).map(|band| {
        let from = BIN.1 * f64::from(band);
        let inside = |s: &&Sample| (from..from + BIN.1).contains(&s.incidence_deg);
        let of = samples.iter().filter(inside).copied().collect();
        (from, (from + BIN.1).min(STEEPEST_DEG), of)
    })
}

impl Measured {
    /// What misses the bounds.
    fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        let sector: Vec<Sample> = self.sector.iter().flatten().copied().collect();
        let [_, corrected, _] = three(&sector);
        if corrected.p99 > P99_MAX_M {
            faults.push(format!("p99 of corrected ranges is {} mm", mm(corrected.p99)));
        }
        for (head, (errors, _)) in self.lines.iter().enumerate() {
            let nees = Errors::of(errors.iter().copied()).bias;
            if nees > NEES_MAX {
                faults.push(format!("head {head}: lines have a mean NEES of {nees:.2}"));
            }
        }
        for (from, to, of) in bands(&self.walls) {
            let at_rest = at_rest(&of);
            if at_rest.p99 > P99_MAX_M {
                let p99 = mm(at_rest.p99);
                faults.push(format!("{from} to {to} degrees: p99 at rest is {p99} mm"));
            }
            let [_, corrected, noise] = three(&of);
            if corrected.p99 > OVER_NOISE_MAX * noise.p99 {
                let (p99, noise) = (mm(corrected.p99), mm(noise.p99));
                faults
                    .push(format!("{from} to {to} degrees: p99 {p99} mm, of noise alone {noise}"));
            }
        }
        for samples in [&sector, &self.walls] {
            if let Some((d, beta, errors)) = worst_bin(samples, BIN_READINGS_MIN)
                && errors.bias.abs() > BIAS_MAX_M
            {
                let bias = mm(errors.bias);
                faults.push(format!("bias at {d:.2} m and {beta:.0} degrees is {bias} mm"));
            }
        }
        faults
    }

    fn tables(&self) -> String {
        let sector: Vec<Sample> = self.sector.iter().flatten().copied().collect();
        let all = self.systematic.iter();
        let lines: usize = self.lines.iter().map(|(errors, _)| errors.len()).sum();
        let others: u32 = self.lines.iter().map(|(_, others)| others).sum();
        let heads = format!(
            "{} heads; {lines} lines, and {others} sweeps of a wall that showed not just one; the \
             tables' systematic part is {} to {} mm.",
            self.sector.len(),
            mm(all.clone().copied().fold(f64::INFINITY, f64::min)),
            mm(all.copied().fold(0.0, f64::max)),
        );
        let titled = [
            ("A wall, in a sector of 60 degrees", by_stage(&sector)),
            ("A wall, in half a turn", by_stage(&self.walls)),
            ("A corner with a cupboard, in half a turn", by_stage(&self.corners)),
            ("A wall, in a sector, head by head", self.by_head()),
            ("A wall, in half a turn, by incidence", self.by_incidence()),
        ];
        let titled = titled.map(|(title, table)| format!("{title}:\n\n{table}"));
        format!("{heads}\n\n{}", titled.join("\n"))
    }

    fn by_head(&self) -> String {
        let row = |(head, samples): (usize, &Vec<Sample>)| {
            let [raw, corrected, noise] = three(samples);
            let used = samples.iter().filter_map(|s| s.in_situ.map(|e| (e / s.claimed).powi(2)));
            let honest = Errors::of(used).bias;
            let Errors { bias, sd, p99, max, .. } = corrected;
            let cells = [raw.p99, bias, sd, p99, max, noise.p99].map(mm);
            let nees = Errors::of(self.lines[head].0.iter().copied()).bias;
            let honesty = vec![format!("{honest:.2}"), format!("{nees:.2}")];
            [vec![head.to_string()], cells.to_vec(), honesty].concat()
        };
        let rows: Vec<_> = self.sector.iter().enumerate().map(row).collect();
        let header = [
            "head",
            "raw p99 mm",
            "bias mm",
            "sd mm",
            "p99 mm",
            "max mm",
            "p99 of noise alone mm",
            "mean square over claimed",
            "NEES of lines",
        ];
        report::table(&header, &rows)
    }

    fn by_incidence(&self) -> String {
        let row = |(from, to, of): (f64, f64, Vec<Sample>)| {
            let [raw, corrected, noise] = three(&of);
            let worst = worst_bin(&of, BIN_READINGS_MIN)
                .map_or_else(String::new, |(d, _, e)| format!("{} at {d:.2} m", mm(e.bias)));
            let rest = at_rest(&of);
            let cells = [raw.p99, corrected.bias, corrected.p99, noise.p99].map(mm);
            let stopped = vec![mm(rest.bias), mm(rest.p99), format!("{:.2}", honesty_at_rest(&of))];
            [vec![format!("{from:.0} to {to:.0}")], cells.to_vec(), vec![worst], stopped].concat()
        };
        let rows: Vec<_> = bands(&self.walls).map(row).collect();
        let header = [
            "degrees",
            "raw p99 mm",
            "bias mm",
            "p99 mm",
            "p99 of noise alone mm",
            "greatest bias of a bin mm",
            "at rest: bias mm",
            "at rest: p99 mm",
            "at rest: mean square over claimed",
        ];
        report::table(&header, &rows)
    }
}

fn by_stage(samples: &[Sample]) -> String {
    let row = |name: &str, errors: Errors| {
        let share = 100.0 * errors.count as f64 / samples.len().max(1) as f64;
        let Errors { bias, sd, p99, max, .. } = errors;
        let figures = [bias, sd, p99, max].map(mm).to_vec();
        [vec![name.to_owned(), errors.count.to_string(), format!("{share:.2}")], figures].concat()
    };
    let [raw, corrected, noise] = three(samples);
    let known = Errors::of(samples.iter().filter_map(|s| s.known));
    let rows = [
        row("as they come", raw),
        row("true incidence", known),
        row("incidence from the scan", corrected),
        row("at rest", at_rest(samples)),
        row("noise alone", noise),
    ];
    let header = ["ranges", "readings", "% kept", "bias mm", "sd mm", "p99 mm", "max mm"];
    report::table(&header, &rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simulated_heads_are_corrected_to_the_bounds_of_the_design() {
        let (mut sector, mut walls) = (Vec::new(), Vec::new());
        for seed in [0, 1] {
            let head = IrHead::of_seed(seed);
            let mut noise = Noise::of_seed(seed);
            let done = calibrated(&head, 60, &mut noise).unwrap();
            let (errors, others) = line_errors(&head, &done, 300, false, &mut noise).unwrap();
            let nees = Errors::of(errors.iter().copied()).bias;
            // 300 lines: the band is wider.
            assert!(nees < 2.25, "head {seed}: {nees}");
            assert!(others < 6, "head {seed}: {others} sweeps showed not just one line");
            let (errors, others) = line_errors(&head, &done, 300, true, &mut noise).unwrap();
            let nees = Errors::of(errors.iter().copied()).bias;
            assert!(nees < 2.25 && others < 6, "head {seed}, at rest: {nees}, {others} others");
            sector.extend(samples(&head, &done, Scene::Sector, 400, &mut noise).unwrap());
            walls.extend(samples(&head, &done, Scene::Wall, 100, &mut noise).unwrap());
        }
        let [raw, corrected, _] = three(&sector);
        assert!(raw.p99 > 0.07, "{raw:?}");
        assert!(corrected.p99 <= P99_MAX_M, "{corrected:?}");
        assert!(corrected.count as f64 > 0.98 * sector.len() as f64);
        let [_, corrected, noise] = three(&walls);
        assert!(corrected.p99 <= OVER_NOISE_MAX * noise.p99, "{corrected:?} {noise:?}");
        assert!(corrected.count as f64 > 0.98 * walls.len() as f64);
        let claimed = walls.iter().filter_map(|s| s.in_situ.map(|e| (e / s.claimed).powi(2)));
        let honest = Errors::of(claimed).bias;
        assert!((0.8..1.15).contains(&honest), "mean square over claimed: {honest}");
        for (from, _, of) in bands(&walls) {
            let errors = at_rest(&of);
            assert!(of.len() > 500, "{from} degrees: {} readings", of.len());
            // Two heads and a thousand readings: the p99 is certain to some millimetres.
            assert!(errors.p99 <= 1.1 * P99_MAX_M, "at rest, {from} degrees: {errors:?}");
        }
        let honest = honesty_at_rest(&walls);
        assert!((0.7..1.15).contains(&honest), "at rest, mean square over claimed: {honest}");
        // The means of bins of 1500 readings are off by a millimetre themselves.
        let (d, beta, errors) = worst_bin(&sector, 1500).unwrap();
        assert!(errors.bias.abs() < BIAS_MAX_M, "{d} m, {beta} degrees: {errors:?}");
    }
}
