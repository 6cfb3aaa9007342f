//! The grid of a calibration: its nodes' distances and incidences, and what was measured there.

use super::{CalibrationConfig, CalibrationError, TargetReading, TargetReadings};
use crate::sensor::robust::{SD_PER_MEDIAN_DEVIATION, median};

/// What the readings of one node say.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cell {
    /// Mean reading less distance, metres.
    pub(super) bias: f64,
    /// Deviation of a reading, within one surface.
    pub(super) sd: f64,
    /// Deviation of the surfaces' means, if there were several.
    pub(super) between_surfaces: Option<f64>,
    /// Readings, outliers left out; 0 where the node was filled from its neighbours.
    pub(super) count: usize,
}

/// The measured grid.
#[derive(Debug)]
pub(super) struct Grid {
    /// Ascending, metres.
    pub(super) distances: Vec<f64>,
    /// Ascending, radians.
    pub(super) incidences: Vec<f64>,
    /// A row for each incidence, in it a node for each distance.
    pub(super) cells: Vec<Vec<Cell>>,
    /// Readings of nodes that were no readings of the target.
    pub(super) outliers: usize,
}

impl Grid {
    pub(super) fn new(
        all: &TargetReadings,
        config: &CalibrationConfig,
    ) -> Result<Self, CalibrationError> {
        if all.readings.is_empty() {
            return Err(CalibrationError::NoReadings);
        }
        let distances = nodes(all.readings.iter().map(|r| r.distance), config.distance_merge);
        let incidences = nodes(all.readings.iter().map(|r| r.incidence), config.incidence_merge);
        let mut gathered: Vec<Vec<Vec<&TargetReading>>> =
            vec![vec![Vec::new(); distances.len()]; incidences.len()];
        for reading in &all.readings {
            let row = nearest(&incidences, reading.incidence);
            gathered[row][nearest(&distances, reading.distance)].push(reading);
        }
        let mut outliers = 0;
        let measured: Vec<Vec<Option<Cell>>> = gathered
            .iter()
            .map(|row| {
                row.iter()
                    .map(|readings| {
                        let (cell, left_out) = cell(readings, all.surfaces.len(), config);
                        outliers += left_out;
                        cell
                    })
                    .collect()
            })
            .collect();
        for (row, &incidence) in measured.iter().zip(&incidences) {
            let count = row.iter().flatten().count();
            if count < 2 {
                return Err(CalibrationError::FewDistances {
                    incidence_deg: incidence.to_degrees(),
                    distances: count,
                    readings: config.readings_min,
                });
            }
        }
        let count = measured.iter().flatten().flatten().count();
        let of = distances.len() * incidences.len();
        if (count as f64) < config.coverage_min * of as f64 {
            return Err(CalibrationError::Sparse {
                measured: count,
                nodes: of,
                distances: distances.len(),
                incidences: incidences.len(),
            });
        }
        let cells = measured.iter().map(|row| filled(row, &distances)).collect();
        Ok(Self { distances, incidences, cells, outliers })
    }

    /// One figure of all nodes.
    pub(super) fn rows(&self, figure: impl Fn(&Cell) -> f64) -> Vec<Vec<f64>> {
        self.cells.iter().map(|row| row.iter().map(&figure).collect()).collect()
    }

    /// The node of a reading: row and column.
    pub(super) fn node(&self, reading: &TargetReading) -> (usize, usize) {
        (nearest(&self.incidences, reading.incidence), nearest(&self.distances, reading.distance))
    }

    /// The deviation at zero distance and its growth that come nearest to the nodes' deviations
    /// up to an incidence: least squares of `sd^2 = a^2 + (b d)^2`.
    pub(super) fn noise(&self, incidence_max: f64) -> (f64, f64) {
        let used = self.incidences.iter().zip(&self.cells).filter(|(i, _)| **i <= incidence_max);
        let pairs: Vec<(f64, f64)> = used
            .flat_map(|(_, row)| self.distances.iter().zip(row))
            .map(|(d, cell)| (d * d, cell.sd * cell.sd))
            .collect();
        let count = pairs.len() as f64;
        let x = pairs.iter().map(|(x, _)| x).sum::<f64>() / count;
        let y = pairs.iter().map(|(_, y)| y).sum::<f64>() / count;
        let xx: f64 = pairs.iter().map(|(px, _)| (px - x).powi(2)).sum();
        let xy: f64 = pairs.iter().map(|(px, py)| (px - x) * (py - y)).sum();
        let growth = if xx > 0.0 { (xy / xx).clamp(0.0, y / x) } else { 0.0 };
        // A tenth of the mean deviation at the least: no scanner is exact at its window.
        ((y - growth * x).max(0.01 * y).sqrt(), growth.sqrt())
    }
}

/// The mean of each group of values that lie within `merge` of their predecessor.
fn nodes(values: impl Iterator<Item = f64>, merge: f64) -> Vec<f64> {
    let mut values: Vec<f64> = values.collect();
    values.sort_unstable_by(f64::total_cmp);
    let mut nodes = Vec::new();
    let (mut sum, mut count, mut last) = (0.0, 0.0, f64::NEG_INFINITY);
    for value in values {
        if value - last > merge && count > 0.0 {
            nodes.push(sum / count);
            (sum, count) = (0.0, 0.0);
        }
        sum += value;
        count += 1.0;
        last = value;
    }
    nodes.push(sum / count);
    nodes
}

fn nearest(nodes: &[f64], value: f64) -> usize {
    let after = nodes.partition_point(|node| *node < value).min(nodes.len() - 1);
    let before = after.saturating_sub(1);
    if value - nodes[before] < nodes[after] - value { before } else { after }
}

/// What the readings of a node say, if they are enough, and how many were left out.
fn cell(
    readings: &[&TargetReading],
    surfaces: usize,
    config: &CalibrationConfig,
) -> (Option<Cell>, usize) {
    let error = |reading: &TargetReading| reading.reading - reading.distance;
    let mut means = Vec::new();
    let (mut squares, mut freedom, mut count, mut outliers) = (0.0, 0.0, 0, 0);
    for surface in 0..surfaces {
        let of_surface = readings.iter().filter(|r| r.surface == surface);
        let mut errors: Vec<f64> = of_surface.map(|r| error(r)).collect();
        errors.sort_unstable_by(f64::total_cmp);
        let Some(middle) = median(&errors) else { continue };
        let mut off: Vec<f64> = errors.iter().map(|e| (e - middle).abs()).collect();
        off.sort_unstable_by(f64::total_cmp);
        let sd = SD_PER_MEDIAN_DEVIATION * median(&off).unwrap_or(0.0);
        // A millimetre at the least, for readings in coarse steps may all be the same.
        let gate = config.outlier_sds * sd.max(0.001);
        let all = errors.len();
        errors.retain(|e| (e - middle).abs() <= gate);
        outliers += all - errors.len();
        let mean = errors.iter().sum::<f64>() / errors.len() as f64;
        squares += errors.iter().map(|e| (e - mean).powi(2)).sum::<f64>();
        freedom += errors.len() as f64 - 1.0;
        count += errors.len();
        means.push(mean);
    }
    if count < config.readings_min || freedom < 1.0 {
        return (None, outliers);
    }
    let bias = means.iter().sum::<f64>() / means.len() as f64;
    let spread = means.iter().map(|m| (m - bias).powi(2)).sum::<f64>();
    let between_surfaces = (means.len() > 1).then(|| (spread / (means.len() as f64 - 1.0)).sqrt());
    // A deviation of nothing would make readings that came in one step look exact.
    let sd = (squares / freedom).sqrt().max(1e-4);
    (Some(Cell { bias, sd, between_surfaces, count }), outliers)
}

/// A row without holes: linear between its measured nodes, constant beyond them.
fn filled(row: &[Option<Cell>], distances: &[f64]) -> Vec<Cell> {
    let measured = |i: usize| row[i].map(|cell| (distances[i], cell));
    let blank = Cell { bias: 0.0, sd: 1e-4, between_surfaces: None, count: 0 };
    (0..row.len())
        .map(|i| {
            if let Some(cell) = row[i] {
                return cell;
            }
            let before = (0..i).rev().find_map(measured);
            let after = (i + 1..row.len()).find_map(measured);
            match (before, after) {
                (Some((d0, a)), Some((d1, b))) => {
                    let share = (distances[i] - d0) / (d1 - d0);
                    Cell {
                        bias: a.bias + share * (b.bias - a.bias),
                        sd: a.sd + share * (b.sd - a.sd),
                        ..blank
                    }
                }
                (Some((_, only)), None) | (None, Some((_, only))) => {
                    Cell { bias: only.bias, sd: only.sd, ..blank }
                }
                (None, None) => blank,
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn targets_that_stand_nearly_alike_are_one_node() {
        let found = nodes([1.0, 0.5, 1.003, 0.499, 2.0].into_iter(), 0.02);
        assert_eq!(found.len(), 3);
        assert!((found[1] - 1.0015).abs() < 1e-12);
        assert_eq!(nearest(&found, 0.3), 0);
        assert_eq!(nearest(&found, 1.4), 1);
        assert_eq!(nearest(&found, 9.0), 2);
    }
}
