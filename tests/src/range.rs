//! How well a cheap scanner's ranges are corrected: simulated heads measure a flat target, the
//! readings become a table, and the same heads' sweeps of walls are corrected with it.
//!
//! The heads are this crate's own ([`crate::simulation::IrHead`]); what is measured is the
//! product's calibration and correction, called as its program and its surveyor call them.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use mapfold_client::perception::BeamState;
use mapfold_client::perception::correction::{CorrectionConfig, Corrector};
use mapfold_client::perception::plausibility::{PlausibilityConfig, judge};
use mapfold_client::sensor::calibration::{
    Calibration, CalibrationConfig, TargetReadings, calibrate,
};
use mapfold_client::sensor::{RangeTable, Scan, ScanGeometry, preset};
use mapfold_map::geometry::Pose as SensorPose;

use crate::plane::{Piece, Point};
use crate::simulation::{IrBeam, IrHead, IrScanner, Noise, World};
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

/// 99 of 100 corrected ranges of the design's walls are better than this, metres.
pub const P99_MAX_M: f64 = 0.045;
/// The bias of a bin is less, metres.
pub const BIAS_MAX_M: f64 = 0.003;
/// At every incidence, the p99 of corrected ranges is less than so many times that of noise alone:
/// what no correction of single readings can undo.
pub const OVER_NOISE_MAX: f64 = 1.10;

/// One counted reading of a wall.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// True distance along the beam, metres.
    pub distance: f64,
    /// True incidence, degrees.
    pub incidence_deg: f64,
    /// Error of the reading as it came.
    pub raw: f64,
    /// Error after correction with the true incidence.
    pub known: Option<f64>,
    /// Error after correction as in a robot: with the incidence that the scan itself tells.
    pub in_situ: Option<f64>,
    /// Deviation claimed for that: noise, shared and systematic parts.
    pub claimed: f64,
    /// What noise alone, without any systematic error, would have deviated by.
    pub noise_sd: f64,
}

/// A straight wall 0.8 to 2.2 m away, turned by up to 30 degrees.
fn wall(noise: &mut Noise) -> World {
    let away = 0.8 + 1.4 * noise.share();
    let turn = (noise.share() - 0.5) * 60f64.to_radians();
    let (left, right) = (4.0, -4.0);
    let place = |along: f64| {
        let (sin, cos) = turn.sin_cos();
        Point::new(away * cos - along * sin, away * sin + along * cos)
    };
    let walls = vec![Piece { a: place(left), b: place(right) }];
    World { name: "a wall", walls, way: Vec::new() }
}

/// A corner of two walls, and a cupboard of half a metre before one of them.
fn corner(noise: &mut Noise) -> World {
    let (x, y) = (0.8 + 1.8 * noise.share(), 0.8 + 1.8 * noise.share());
    let from = -2.0 + 1.5 * noise.share();
    let piece =
        |a: (f64, f64), b: (f64, f64)| Piece { a: Point::new(a.0, a.1), b: Point::new(b.0, b.1) };
    let walls = vec![
        piece((x, -4.0), (x, y)),
        piece((x, y), (-4.0, y)),
        piece((x - 0.4, from), (x - 0.4, from + 0.6)),
        piece((x - 0.4, from), (x, from)),
        piece((x - 0.4, from + 0.6), (x, from + 0.6)),
    ];
    World { name: "a corner", walls, way: Vec::new() }
}

/// Measures a target with a head and makes a table of it.
///
/// # Errors
/// Words for what the calibration refuses.
pub fn calibrated(head: &IrHead, per_node: u32, noise: &mut Noise) -> Result<Calibration, String> {
    let mut text = "distance_m,incidence_deg,reading_m\n".to_owned();
    for incidence in [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 55.0, 60.0, 65.0, 70.0_f64] {
        for step in 3..=41 {
            let distance = 0.1 * f64::from(step);
            for _ in 0..per_node {
                let read = head.target(distance, incidence.to_radians(), noise).unwrap_or(0.0);
                // Writing to a String cannot fail.
                let _ = writeln!(text, "{distance:.1},{incidence},{read:.4}");
            }
        }
    }
    let base = preset("ir-led").and_then(|s| s.scanner).ok_or("no preset ir-led")?;
    let readings = TargetReadings::parse(&text).map_err(|e| e.to_string())?;
    calibrate(&readings, &base, &CalibrationConfig::STANDARD).map_err(|e| e.to_string())
}

/// What is swept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scene {
    /// One wall, in a sector of 60 degrees: the set-up of the design.
    Sector,
    /// One wall, in half a turn: from square to grazing every time.
    Wall,
    /// Two walls and a cupboard, in half a turn.
    Corner,
}

/// Sweeps a scene again and again and corrects what comes.
///
/// # Errors
/// The profile has no table.
pub fn samples(
    head: &IrHead,
    done: &Calibration,
    scene: Scene,
    sweeps: u32,
    noise: &mut Noise,
) -> Result<Vec<Sample>, String> {
    let half_turn = IrScanner::new(*head);
    let scanner = match scene {
        Scene::Sector => IrScanner { first_rad: -30f64.to_radians(), beams: 61, ..half_turn },
        Scene::Wall | Scene::Corner => half_turn,
    };
    let correction = done.profile.correction.as_ref().ok_or("the profile has no table")?;
    let table = RangeTable::new(correction);
    let mut corrector = Corrector::for_scanner(&done.profile, CorrectionConfig::STANDARD)
        .ok_or("the profile has no table")?;
    let plausibility = PlausibilityConfig::for_scanner(&done.profile);
    let mut samples = Vec::new();
    for _ in 0..sweeps {
        let world = match scene {
            Scene::Sector | Scene::Wall => wall(noise),
            Scene::Corner => corner(noise),
        };
        let heading = 0.3 * (noise.share() - 0.5);
        let beams = scanner.sweep(&world, (Point::new(0.0, 0.0), heading), noise);
        let scan = Scan {
            geometry: ScanGeometry {
                first_bearing: scanner.first_rad,
                increment: scanner.increment_rad,
            },
            ranges: beams.iter().map(|b| b.reading_m.unwrap_or(f64::INFINITY)).collect(),
            range_max: f64::INFINITY,
            robot_from_sensor: SensorPose::identity(),
        };
        let states = judge(&scan, &plausibility);
        let corrected = corrector.correct(&scan, &states);
        for (beam, read) in beams.iter().enumerate() {
            let IrBeam { reading_m: Some(reading), truth: Some((distance, incidence)) } = *read
            else {
                continue;
            };
            let counted = states[beam] == BeamState::Hit
                && distance <= FARTHEST_M
                && incidence.to_degrees() <= STEEPEST_DEG;
            if !counted {
                continue;
            }
            let used = corrected.states[beam] == BeamState::Hit;
            let part = &corrected.noise[beam];
            let systematic = done.profile.systematic_sd_m.powi(2);
            samples.push(Sample {
                distance,
                incidence_deg: incidence.to_degrees(),
                raw: reading - distance,
                known: table.correct(reading, incidence).map(|c| c.range - distance),
                in_situ: used.then(|| corrected.scan.ranges[beam] - distance),
                claimed: (part.variance + part.shared + systematic).sqrt(),
                noise_sd: head.deviation(distance, incidence),
            });
        }
    }
    Ok(samples)
}

/// Errors in short, metres.
#[derive(Debug, Clone, Copy, Default)]
pub struct Errors {
    /// How many.
    pub count: usize,
    /// Mean.
    pub bias: f64,
    /// Standard deviation.
    pub sd: f64,
    /// 99 of 100 are smaller.
    pub p99: f64,
    /// The greatest.
    pub max: f64,
}

impl Errors {
    /// Of these.
    pub fn of(errors: impl Iterator<Item = f64>) -> Self {
        let errors: Vec<f64> = errors.collect();
        let count = errors.len() as f64;
        if errors.is_empty() {
            return Self::default();
        }
        let bias = errors.iter().sum::<f64>() / count;
        let mut sizes: Vec<f64> = errors.iter().map(|e| e.abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        Self {
            count: errors.len(),
            bias,
            sd: (errors.iter().map(|e| (e - bias).powi(2)).sum::<f64>() / count).sqrt(),
            p99: sizes[((0.99 * count) as usize).min(sizes.len() - 1)],
            max: sizes[sizes.len() - 1],
        }
    }
}

/// The bin of greatest bias after correction in the scan, of those with readings enough: distance
/// and incidence (degrees) of its middle, its errors.
pub fn worst_bin(samples: &[Sample], enough: usize) -> Option<(f64, f64, Errors)> {
    let mut bins: BTreeMap<(u32, u32), Vec<f64>> = BTreeMap::new();
    for sample in samples {
        if let Some(error) = sample.in_situ {
            let bin = ((sample.distance / BIN.0) as u32, (sample.incidence_deg / BIN.1) as u32);
            bins.entry(bin).or_default().push(error);
        }
    }
    bins.into_iter()
        .filter(|(_, errors)| errors.len() >= enough)
        .map(|((d, beta), errors)| {
            let middle = (BIN.0 * (f64::from(d) + 0.5), BIN.1 * (f64::from(beta) + 0.5));
            (middle.0, middle.1, Errors::of(errors.into_iter()))
        })
        .max_by(|a, b| a.2.bias.abs().total_cmp(&b.2.bias.abs()))
}

/// All heads' readings, scene by scene.
struct Measured {
    sector: Vec<Vec<Sample>>,
    walls: Vec<Sample>,
    corners: Vec<Sample>,
    systematic: Vec<f64>,
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
    }
    let text = std::fs::read_to_string(page).map_err(|e| Error::file(page, e))?;
    let text = report::replace(&text, "range", &all.tables())?;
    std::fs::write(page, text).map_err(|e| Error::file(page, e))?;
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

impl Measured {
    /// Readings of half turns by incidence: from, to, readings.
    fn bands(&self) -> impl Iterator<Item = (f64, f64, Vec<Sample>)> {
        (0..7).map(|band| {
            let from = BIN.1 * f64::from(band);
            let inside = |s: &&Sample| (from..from + BIN.1).contains(&s.incidence_deg);
            let of = self.walls.iter().filter(inside).copied().collect();
            (from, (from + BIN.1).min(STEEPEST_DEG), of)
        })
    }

    /// What misses the bounds.
    fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        let sector: Vec<Sample> = self.sector.iter().flatten().copied().collect();
        let [_, corrected, _] = three(&sector);
        if corrected.p99 > P99_MAX_M {
            faults.push(format!("p99 of corrected ranges is {} mm", mm(corrected.p99)));
        }
        for (from, to, of) in self.bands() {
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
        let heads = format!(
            "{} heads; the tables' systematic part is {} to {} mm.",
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
            [vec![head.to_string()], cells.to_vec(), vec![format!("{honest:.2}")]].concat()
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
        ];
        report::table(&header, &rows)
    }

    fn by_incidence(&self) -> String {
        let row = |(from, to, of): (f64, f64, Vec<Sample>)| {
            let [raw, corrected, noise] = three(&of);
            let worst = worst_bin(&of, BIN_READINGS_MIN)
                .map_or_else(String::new, |(d, _, e)| format!("{} at {d:.2} m", mm(e.bias)));
            let cells = [raw.p99, corrected.bias, corrected.p99, noise.p99].map(mm);
            [vec![format!("{from:.0} to {to:.0}")], cells.to_vec(), vec![worst]].concat()
        };
        let rows: Vec<_> = self.bands().map(row).collect();
        let header = [
            "degrees",
            "raw p99 mm",
            "bias mm",
            "p99 mm",
            "p99 of noise alone mm",
            "greatest bias of a bin mm",
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
        // The means of bins of 1500 readings are off by a millimetre themselves.
        let (d, beta, errors) = worst_bin(&sector, 1500).unwrap();
        assert!(errors.bias.abs() < BIAS_MAX_M, "{d} m, {beta} degrees: {errors:?}");
    }
}
