//! How good a correction table is.

use std::fmt;

use super::grid::Grid;
use super::{CalibrationConfig, TargetReadings};
use crate::sensor::RangeTable;

/// Errors of readings, metres.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Errors {
    /// Mean.
    pub bias: f64,
    /// Root mean square.
    pub rms: f64,
    /// 99 of 100 are smaller than this.
    pub p99: f64,
    /// The greatest.
    pub max: f64,
}

impl Errors {
    fn of(errors: &[f64]) -> Self {
        if errors.is_empty() {
            return Self::default();
        }
        let count = errors.len() as f64;
        let mut sizes: Vec<f64> = errors.iter().map(|e| e.abs()).collect();
        sizes.sort_unstable_by(f64::total_cmp);
        Self {
            bias: errors.iter().sum::<f64>() / count,
            rms: (errors.iter().map(|e| e * e).sum::<f64>() / count).sqrt(),
            p99: sizes[((0.99 * count) as usize).min(sizes.len() - 1)],
            max: sizes[sizes.len() - 1],
        }
    }
}

/// What is left at one node after correction.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Node {
    /// Its distance, metres.
    pub distance: f64,
    /// Its incidence, radians.
    pub incidence: f64,
    /// Mean error of its corrected readings.
    pub bias: f64,
    /// Root mean square of them.
    pub rms: f64,
}

/// The parts of what more readings do not average out, metres.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Systematic {
    /// Uncertainty of the nodes' means.
    pub means: f64,
    /// What lines between distances leave.
    pub distances: f64,
    /// What lines between incidences leave.
    pub incidences: f64,
    /// How far surfaces disagree.
    pub surfaces: f64,
}

impl Systematic {
    /// All of it.
    pub fn total(&self, config: &CalibrationConfig) -> f64 {
        let Self { means, distances, incidences, surfaces } = self;
        means.hypot(*distances).hypot(*incidences).hypot(*surfaces).max(config.systematic_min)
    }
}

/// Something that the person who calibrates should know.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Warning {
    /// Nodes with few readings.
    FewReadings {
        /// The fewest of a node.
        fewest: usize,
        /// How many nodes.
        nodes: usize,
        /// How many readings would be good.
        wanted: usize,
    },
    /// Nodes that were not measured.
    Holes {
        /// How many.
        filled: usize,
    },
    /// The response falls back.
    NotMonotone {
        /// At this incidence, degrees.
        incidence_deg: f64,
        /// From this distance, metres.
        from: f64,
        /// To this one.
        to: f64,
    },
    /// Readings that were left out.
    Outliers {
        /// How many.
        count: usize,
        /// Of how many.
        of: usize,
    },
    /// Nothing is known of other surfaces.
    OneSurface,
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::FewReadings { fewest, nodes, wanted } => write!(
                f,
                "{nodes} nodes have few readings (down to {fewest}): {wanted} at each make good means"
            ),
            Self::Holes { filled } => write!(
                f,
                "{filled} nodes were not measured and are filled from their neighbours: measure them"
            ),
            Self::NotMonotone { incidence_deg, from, to } => write!(
                f,
                "at {incidence_deg:.0} degrees readings do not grow from {from:.2} to {to:.2} m: \
                 distances there cannot be told apart, and their deviation is claimed accordingly"
            ),
            Self::Outliers { count, of } => write!(
                f,
                "{count} of {of} readings are far from the others of their node and were left out"
            ),
            Self::OneSurface => write!(
                f,
                "one surface only: how far bright and dark surfaces disagree is not in the \
                 systematic part; measure a second one"
            ),
        }
    }
}

/// How good a table is.
#[derive(Debug, Clone, PartialEq)]
pub struct Quality {
    /// Readings that went into it.
    pub readings: usize,
    /// Readings without a return.
    pub lost: usize,
    /// Nodes that were measured.
    pub measured: usize,
    /// Nodes of the grid.
    pub nodes: usize,
    /// Errors of the readings as they came.
    pub raw: Errors,
    /// Errors after correction with the true incidence.
    pub corrected: Errors,
    /// The node with the greatest mean error after correction.
    pub worst: Node,
    /// What more readings do not average out.
    pub systematic: Systematic,
    /// What is doubtful.
    pub warnings: Vec<Warning>,
}

impl Quality {
    pub(super) fn new(
        all: &TargetReadings,
        grid: &Grid,
        table: &RangeTable,
        config: &CalibrationConfig,
    ) -> Self {
        let columns = grid.distances.len();
        let (mut raw, mut corrected) = (Vec::new(), Vec::new());
        let mut at_node = vec![Vec::new(); columns * grid.incidences.len()];
        for reading in &all.readings {
            let (row, column) = grid.node(reading);
            let cell = &grid.cells[row][column];
            let error = reading.reading - reading.distance;
            // Outliers were left out of the nodes and are left out here.
            let spread = cell.sd.hypot(cell.between_surfaces.unwrap_or(0.0)).max(0.001);
            if (error - cell.bias).abs() > 1.5 * config.outlier_sds * spread {
                continue;
            }
            if let Some(found) = table.correct(reading.reading, reading.incidence) {
                raw.push(error);
                corrected.push(found.range - reading.distance);
                at_node[row * columns + column].push(found.range - reading.distance);
            }
        }
        let nodes = at_node.iter().enumerate().filter(|(_, errors)| !errors.is_empty());
        let worst = nodes
            .map(|(index, errors)| {
                let Errors { bias, rms, .. } = Errors::of(errors);
                let distance = grid.distances[index % columns];
                Node { distance, incidence: grid.incidences[index / columns], bias, rms }
            })
            .max_by(|a, b| a.bias.abs().total_cmp(&b.bias.abs()));
        let cells = grid.cells.iter().flatten();
        Self {
            readings: cells.clone().map(|cell| cell.count).sum(),
            lost: all.lost,
            measured: cells.clone().filter(|cell| cell.count > 0).count(),
            nodes: cells.count(),
            raw: Errors::of(&raw),
            corrected: Errors::of(&corrected),
            worst: worst.unwrap_or_default(),
            systematic: systematic(grid),
            warnings: warnings(all, grid, config),
        }
    }
}

fn rms(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0.0), |(sum, count), v| (sum + v * v, count + 1.0));
    if count > 0.0 { f64::sqrt(sum / count) } else { 0.0 }
}

fn systematic(grid: &Grid) -> Systematic {
    let measured = || grid.cells.iter().flatten().filter(|cell| cell.count > 0);
    let means = rms(measured().map(|cell| cell.sd / (cell.count as f64).sqrt()));
    let along = |lines: &mut dyn Iterator<Item = Vec<(f64, f64)>>| {
        let left: Vec<f64> = lines
            .flat_map(|line| {
                line.windows(3)
                    .map(|w| {
                        let share = (w[1].0 - w[0].0) / (w[2].0 - w[0].0);
                        w[1].1 - (w[0].1 + share * (w[2].1 - w[0].1))
                    })
                    .collect::<Vec<_>>()
            })
            .collect();
        // A middle node and half of each neighbour bring their own uncertainty along.
        let bare = (rms(left.into_iter()).powi(2) - 1.5 * means * means).max(0.0).sqrt();
        // Half the spacing leaves a quarter; over a parabola's arch, the rms is sqrt(8/15) of its
        // height.
        0.25 * (8.0_f64 / 15.0).sqrt() * bare
    };
    let row = |cells: &[super::grid::Cell]| -> Vec<(f64, f64)> {
        grid.distances.iter().zip(cells).map(|(d, cell)| (*d, cell.bias)).collect()
    };
    let column = |at: usize| -> Vec<(f64, f64)> {
        grid.incidences.iter().zip(&grid.cells).map(|(i, row)| (*i, row[at].bias)).collect()
    };
    Systematic {
        means,
        distances: along(&mut grid.cells.iter().map(|cells| row(cells))),
        incidences: along(&mut (0..grid.distances.len()).map(column)),
        surfaces: rms(measured().filter_map(|cell| cell.between_surfaces)),
    }
}

fn warnings(all: &TargetReadings, grid: &Grid, config: &CalibrationConfig) -> Vec<Warning> {
    let counts = grid.cells.iter().flatten().map(|cell| cell.count);
    let few: Vec<usize> =
        counts.clone().filter(|c| (1..config.readings_wanted).contains(c)).collect();
    let holes = counts.filter(|count| *count == 0).count();
    let mut warnings = Vec::new();
    if let Some(&fewest) = few.iter().min() {
        let wanted = config.readings_wanted;
        warnings.push(Warning::FewReadings { fewest, nodes: few.len(), wanted });
    }
    if holes > 0 {
        warnings.push(Warning::Holes { filled: holes });
    }
    for (cells, incidence) in grid.cells.iter().zip(&grid.incidences) {
        let reads = |i: usize| grid.distances[i] + cells[i].bias;
        let falls: Vec<usize> = (1..cells.len()).filter(|i| reads(*i) <= reads(i - 1)).collect();
        if let (Some(first), Some(last)) = (falls.first(), falls.last()) {
            warnings.push(Warning::NotMonotone {
                incidence_deg: incidence.to_degrees(),
                from: grid.distances[first - 1],
                to: grid.distances[*last],
            });
        }
    }
    if grid.outliers > 0 {
        warnings.push(Warning::Outliers { count: grid.outliers, of: all.readings.len() });
    }
    if all.surfaces.len() < 2 {
        warnings.push(Warning::OneSurface);
    }
    warnings
}
