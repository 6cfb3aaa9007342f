//! The scanner's evidence ray by ray: what each beam says of every cell that it crosses, written from the
//! published formulas alone; and the exact posterior of one beam.

use super::Grid;
use crate::plane::Point;

/// What the model of a beam needs to know.
#[derive(Debug, Clone, Copy)]
pub struct BeamModel {
    /// Evidence for "free", nats.
    pub free_nat: f64,
    /// Evidence for "occupied" of a beam that is known to have ended in a cell, nats.
    pub occupied_nat: f64,
    /// Deviation of the distance from where a beam ended to a cell, metres.
    pub sd_m: f64,
}

/// The posterior log-odds of a row of cells after one reading `z_m`, less those before it: every cell is
/// occupied with probability `prior` by itself, and the beam ends in the first that is, with a
/// Gaussian error of `sd_m`. In closed form, equal to going through all 2^n rows of cells.
pub fn posterior(z_m: f64, sd_m: f64, cells: usize, resolution_m: f64, prior: f64) -> Vec<f64> {
    let first: Vec<f64> = (0..cells)
        .map(|k| {
            let d = (k as f64 + 0.5) * resolution_m;
            prior * (1.0 - prior).powi(k as i32) * (-0.5 * ((z_m - d) / sd_m).powi(2)).exp()
        })
        .collect();
    let total: f64 = first.iter().sum();
    let logit = |p: f64| (p / (1.0 - p)).ln();
    let mut before = 0.0;
    first
        .iter()
        .map(|here| {
            let p = (prior * before + here) / total;
            before += here;
            logit(p) - logit(prior)
        })
        .collect()
}

/// Enters the beams of one look, ray by ray: free once a look, ends add up and outdo "free".
pub fn enter(
    grid: &mut Grid,
    eye: Point,
    beams: impl Iterator<Item = (f64, f64)>,
    model: &BeamModel,
) {
    let res = grid.resolution_m;
    let mut free = vec![0.0_f64; grid.nats.len()];
    let mut occupied = vec![0.0_f64; grid.nats.len()];
    for (angle, z) in beams {
        let length = z + 2.0 * model.sd_m;
        // All distances at which the beam crosses a line of the grid.
        let mut cuts = vec![0.0, length];
        for (start, along) in [(eye.x, angle.cos()), (eye.y, angle.sin())] {
            let end = start + along * length;
            let (low, high) = (start.min(end), start.max(end));
            let lines = (low / res).ceil() as i64..=(high / res).floor() as i64;
            cuts.extend(lines.map(|line| (line as f64 * res - start) / along));
        }
        cuts.sort_by(f64::total_cmp);
        for cut in cuts.windows(2).filter(|cut| cut[1] - cut[0] > 1e-12) {
            let d = f64::midpoint(cut[0], cut[1]);
            let Some(index) = grid.holding(eye.towards(angle, d)) else { continue };
            let before = (z - d) / model.sd_m;
            free[index] = free[index].min(model.free_nat * (before - 1.0).clamp(0.0, 1.0));
            if before.abs() <= 2.0 {
                let spread = res / (model.sd_m * std::f64::consts::TAU.sqrt());
                let share = ((cut[1] - cut[0]) / res).min(1.0);
                let bell = (-0.5 * before * before).exp();
                occupied[index] += model.occupied_nat * spread.min(1.0) * share * bell;
            }
        }
    }
    for (index, nat) in grid.nats.iter_mut().enumerate() {
        *nat += if occupied[index] > 0.0 { occupied[index].min(3.0) } else { free[index] };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_posterior_equals_going_through_all_rows_of_cells() {
        let (z, sd, res, cells, prior) = (0.52, 0.05, 0.1, 10, 0.2_f64);
        let mut occupied = [0.0; 10];
        let mut total = 0.0;
        for row in 1..1_u32 << cells {
            let ones = row.count_ones();
            let odds = prior.powi(ones as i32) * (1.0 - prior).powi(10 - ones as i32);
            let d = (f64::from(row.trailing_zeros()) + 0.5) * res;
            let likelihood = odds * (-0.5 * ((z - d) / sd).powi(2)).exp();
            total += likelihood;
            for (cell, sum) in occupied.iter_mut().enumerate() {
                *sum += f64::from(row >> cell & 1) * likelihood;
            }
        }
        let logit = |p: f64| (p / (1.0 - p)).ln();
        let closed = posterior(z, sd, cells, res, prior);
        for (cell, sum) in occupied.iter().enumerate() {
            let exact = logit(sum / total) - logit(prior);
            assert!((closed[cell] - exact).abs() < 1e-9, "{cell}: {} {exact}", closed[cell]);
        }
    }
}
