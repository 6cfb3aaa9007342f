//! Calibration: readings of a flat target at known distances and incidences become a correction
//! table, and figures that say how good it is.
//!
//! Each node of the grid (distance by incidence) gets the mean and the deviation of its readings'
//! errors; of several surfaces, the mean of their means. What more readings do not average out,
//! the systematic part, is the root of the squares of four: how uncertain the nodes' means are;
//! what a straight line between nodes leaves of the head's true response, along the distance and
//! along the incidence (leaving every other node out leaves four times as much); and how far
//! surfaces disagree.

mod grid;
mod quality;
mod readings;

use mapfold_schema::v1::RangeCorrection;

use super::{RangeTable, ScannerProfile};
use grid::Grid;
pub use quality::{Errors, Node, Quality, Systematic, Warning};
pub use readings::{ReadingsError, TargetReading, TargetReadings};

/// How readings become a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CalibrationConfig {
    /// Targets nearer to each other than this are one node, metres.
    pub distance_merge: f64,
    /// Incidences nearer to each other than this are one node, radians.
    pub incidence_merge: f64,
    /// Nodes with fewer readings are as good as not measured: no deviation comes of them.
    pub readings_min: usize,
    /// Nodes with fewer readings are warned of: at 30, a mean is off by a fifth of a deviation.
    pub readings_wanted: usize,
    /// A reading farther than this many robust deviations from its node's median is no reading of
    /// the target.
    pub outlier_sds: f64,
    /// Greatest incidence that scans will be used at, radians, if it was measured.
    pub incidence_max: f64,
    /// Least share of the grid that must have been measured.
    pub coverage_min: f64,
    /// Least systematic part, metres: what a tape measure is off.
    pub systematic_min: f64,
}

impl CalibrationConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        distance_merge: 0.02,
        incidence_merge: 1.5 * std::f64::consts::PI / 180.0,
        readings_min: 5,
        readings_wanted: 30,
        outlier_sds: 6.0,
        incidence_max: 65.0 * std::f64::consts::PI / 180.0,
        coverage_min: 0.5,
        systematic_min: 0.001,
    };
}

/// Readings of which no table can be made.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CalibrationError {
    /// Nothing there.
    #[error("there are no readings: put one on each line, under the heading")]
    NoReadings,
    /// Too small a grid.
    #[error(
        "at {incidence_deg:.0} degrees the target was measured at {distances} distance(s) with at \
         least {readings} readings each: two are the least, one every 10 cm is good"
    )]
    FewDistances {
        /// The incidence.
        incidence_deg: f64,
        /// How many distances it has.
        distances: usize,
        /// How many readings a node needs.
        readings: usize,
    },
    /// A grid that is mostly holes.
    #[error(
        "only {measured} of the {nodes} nodes ({distances} distances x {incidences} incidences) \
         were measured: use the same distances at every incidence"
    )]
    Sparse {
        /// Nodes with readings.
        measured: usize,
        /// Nodes of the grid.
        nodes: usize,
        /// Distances of the grid.
        distances: usize,
        /// Incidences of the grid.
        incidences: usize,
    },
    /// A table that a profile cannot hold.
    #[error("the table cannot be used: {pointer}: {detail}")]
    Table {
        /// Where in the table.
        pointer: String,
        /// What is wrong.
        detail: String,
    },
}

/// What a calibration comes to.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// The profile it began with, with the table, its deviations and its limits.
    pub profile: ScannerProfile,
    /// How good the table is.
    pub quality: Quality,
}

/// Makes a table of readings and puts it into a profile.
///
/// # Errors
/// Too few readings for a table, or readings that no table can hold.
pub fn calibrate(
    readings: &TargetReadings,
    base: &ScannerProfile,
    config: &CalibrationConfig,
) -> Result<Calibration, CalibrationError> {
    let grid = Grid::new(readings, config)?;
    let last = grid.incidences[grid.incidences.len() - 1];
    let correction = RangeCorrection {
        distances_m: grid.distances.clone(),
        incidences_rad: grid.incidences.clone(),
        bias_m: grid.rows(|node| node.bias),
        sd_m: grid.rows(|node| node.sd),
        incidence_max_rad: config.incidence_max.min(last),
    };
    if let Some(wrong) = mapfold_schema::border::check_correction(&correction).into_iter().next() {
        return Err(CalibrationError::Table { pointer: wrong.pointer, detail: wrong.detail });
    }
    let table = RangeTable::new(&correction);
    let quality = Quality::new(readings, &grid, &table, config);
    let (sd, sd_per_m) = grid.noise(correction.incidence_max_rad);
    let edge = super::EXTRAPOLATED_M;
    let (nearest, farthest) = (grid.distances[0], grid.distances[grid.distances.len() - 1]);
    let profile = ScannerProfile {
        range_min_m: base.range_min_m.max(nearest - edge),
        range_max_m: base.range_max_m.min(farthest + edge).max(nearest),
        range_sd_m: sd,
        range_sd_per_m: sd_per_m,
        systematic_sd_m: quality.systematic.total(config),
        correction: Some(correction),
        ..base.clone()
    };
    Ok(Calibration { profile, quality })
}

#[cfg(test)]
mod tests {
    use std::fmt::Write as _;

    use super::*;
    use crate::sensor::preset;

    /// Deterministic "noise" of mean 0 and deviation 1.
    fn noise(i: usize, of: usize) -> f64 {
        let step = (i as f64 + 0.5) / of as f64 - 0.5;
        step * 12f64.sqrt()
    }

    fn csv(surfaces: &[(&str, f64)], per_node: usize, bias: impl Fn(f64, f64) -> f64) -> String {
        let mut text = "distance_m,incidence_deg,reading_m,surface\n".to_owned();
        for distance in 3..=20 {
            for incidence in 0..=7 {
                let (d, beta) = (0.1 * f64::from(distance), 10.0 * f64::from(incidence));
                for (surface, shift) in surfaces {
                    for i in 0..per_node {
                        let z = d + bias(d, beta.to_radians()) + shift + 0.01 * noise(i, per_node);
                        writeln!(text, "{d:.1},{beta},{z:.5},{surface}").unwrap();
                    }
                }
            }
        }
        text
    }

    fn calibrated(text: &str) -> Result<Calibration, CalibrationError> {
        let base = preset("ir-led").and_then(|s| s.scanner).unwrap();
        let readings = TargetReadings::parse(text).unwrap();
        calibrate(&readings, &base, &CalibrationConfig::STANDARD)
    }

    fn ripple(d: f64, beta: f64) -> f64 {
        0.05 * (4.0 * d).sin() + 0.01 * d * (1.0 / beta.cos() - 1.0)
    }

    #[test]
    fn the_table_holds_what_was_measured_and_the_figures_say_how_well() {
        let done = calibrated(&csv(&[("white", 0.0)], 40, ripple)).unwrap();
        let quality = &done.quality;
        assert_eq!((quality.measured, quality.nodes), (18 * 8, 18 * 8));
        assert_eq!(quality.readings, 18 * 8 * 40);
        let table = done.profile.correction.as_ref().unwrap();
        assert!((table.bias_m[3][7] - ripple(1.0, 30f64.to_radians())).abs() < 1e-4);
        assert!((table.sd_m[3][7] - 0.01).abs() < 2e-4);
        assert!(quality.raw.rms > 0.03, "{quality:?}");
        assert!((quality.corrected.rms - 0.01).abs() < 1.5e-3, "{quality:?}");
        assert!(quality.worst.bias.abs() < 1e-3, "{quality:?}");
        // Means of 40, a ripple over 10 cm, secants over 10 degrees: a few millimetres.
        assert!((0.001..0.004).contains(&done.profile.systematic_sd_m), "{quality:?}");
        assert!((done.profile.range_sd_m - 0.01).abs() < 1e-3);
        assert_eq!(quality.warnings, [Warning::OneSurface]);
        assert!((done.profile.range_max_m - 2.1).abs() < 1e-9);
    }

    #[test]
    fn surfaces_that_disagree_do_not_average_out() {
        let text = csv(&[("white", 0.015), ("black", -0.015)], 30, ripple);
        let done = calibrated(&text).unwrap();
        // Two surfaces 3 cm apart deviate by 2.1 cm; within each, readings deviate by 1 cm.
        assert!((done.quality.systematic.surfaces - 0.0212).abs() < 1e-3, "{:?}", done.quality);
        assert!((0.021..0.023).contains(&done.profile.systematic_sd_m));
        assert!((done.profile.range_sd_m - 0.01).abs() < 1e-3);
        assert_eq!(done.quality.warnings, []);
    }

    #[test]
    fn what_is_doubtful_is_warned_of() {
        // A head that falls back between 1.1 and 1.4 m, six readings a node, a hole, a fly.
        let falls = |d: f64, _: f64| if d > 1.15 { -0.2 } else { 0.0 };
        let mut text = csv(&[("white", 0.0)], 6, falls);
        text = text
            .lines()
            .filter(|l| !l.starts_with("0.5,20,"))
            .fold(String::new(), |t, l| t + l + "\n");
        text += "1.0,0,0.3,white\n";
        let done = calibrated(&text).unwrap();
        let warnings = &done.quality.warnings;
        assert!(warnings.contains(&Warning::FewReadings { fewest: 6, nodes: 143, wanted: 30 }));
        assert!(warnings.contains(&Warning::Holes { filled: 1 }));
        assert!(warnings.contains(&Warning::Outliers { count: 1, of: 143 * 6 + 1 }));
        let fallen = |w: &&Warning| matches!(w, Warning::NotMonotone { .. });
        assert_eq!(warnings.iter().filter(fallen).count(), 8, "{warnings:?}");
        // The hole is filled with what its neighbours say.
        assert!(done.profile.correction.unwrap().bias_m[2][2].abs() < 1e-3);
    }

    #[test]
    fn readings_that_make_no_grid_are_refused_with_what_to_do() {
        assert_eq!(
            calibrated("distance_m,incidence_deg,reading_m\n"),
            Err(CalibrationError::NoReadings)
        );
        let one = |d: f64, beta: f64| format!("{d},{beta},{d}\n").repeat(6);
        let head = "distance_m,incidence_deg,reading_m\n";
        let error = calibrated(&format!("{head}{}{}", one(1.0, 0.0), one(1.0, 10.0))).unwrap_err();
        assert!(error.to_string().contains("at 0 degrees"), "{error}");
        let mut text = head.to_owned();
        for step in 0..5 {
            for distance in 0..2 {
                text += &one(1.0 + f64::from(2 * step + distance), 10.0 * f64::from(step));
            }
        }
        let error = calibrated(&text).unwrap_err();
        assert!(error.to_string().contains("only 10 of the 50 nodes"), "{error}");
    }
}
