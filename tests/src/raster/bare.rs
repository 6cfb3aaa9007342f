//! The bare ray loop: the least code that enters a scan into a grid, as a measure of what a machine
//! allows.
//!
//! Each beam steps from cell to cell in fixed point and adds to each with saturation, one byte a cell; no
//! covariance, no profile, no patch that could be taken out again. What insertion costs is held
//! against this, on the same scans and cells, in the same run.

/// A grid of bytes about the scanner.
#[derive(Debug)]
pub struct BareGrid {
    cells: Vec<i8>,
    /// Cells along a side, a power of two.
    side: usize,
    resolution_m: f64,
}

/// What a beam adds to the cells that it crosses, and to the one in which it ends.
const FREE: i8 = -4;
const OCCUPIED: i8 = 9;

impl BareGrid {
    /// An empty grid that holds beams of `reach_m` metres about its middle.
    pub fn new(reach_m: f64, resolution_m: f64) -> Self {
        let side = ((2.0 * reach_m / resolution_m) as usize + 4).next_power_of_two();
        Self { cells: vec![0; side * side], side, resolution_m }
    }

    /// Enters a scan that was taken in the middle of the grid; `directions` are those of the beams.
    pub fn enter(&mut self, directions: &[[f64; 2]], ranges: &[f64]) {
        const ONE: f64 = 65536.0;
        let middle = (self.side / 2) as f64 + 0.5;
        let per_metre = self.resolution_m.recip();
        for ([cos, sin], range) in directions.iter().zip(ranges).filter(|(_, r)| r.is_finite()) {
            let (dx, dy) = (range * cos * per_metre, range * sin * per_metre);
            let steps = dx.abs().max(dy.abs()) as usize;
            let per_step = ONE / (steps.max(1)) as f64;
            let (step_x, step_y) = ((dx * per_step) as i32, (dy * per_step) as i32);
            let (mut x, mut y) = ((middle * ONE) as i32, (middle * ONE) as i32);
            for _ in 0..steps {
                let cell = &mut self.cells[(y >> 16) as usize * self.side + (x >> 16) as usize];
                *cell = cell.saturating_add(FREE);
                x += step_x;
                y += step_y;
            }
            let cell = &mut self.cells[(y >> 16) as usize * self.side + (x >> 16) as usize];
            *cell = cell.saturating_add(OCCUPIED);
        }
    }

    /// Cells that hold anything.
    pub fn touched(&self) -> usize {
        self.cells.iter().filter(|cell| **cell != 0).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_beam_frees_what_it_crosses_and_marks_where_it_ends() {
        let mut grid = BareGrid::new(2.0, 0.05);
        let slant = std::f64::consts::FRAC_1_SQRT_2;
        grid.enter(&[[1.0, 0.0], [-slant, slant], [0.0, 1.0]], &[1.01, 1.01, f64::INFINITY]);
        assert_eq!(grid.touched(), 21 + 14);
        let at = |x: i32, y: i32| {
            let middle = (grid.side / 2) as i32;
            grid.cells[(middle + y) as usize * grid.side + (middle + x) as usize]
        };
        assert_eq!([at(1, 0), at(19, 0), at(20, 0), at(21, 0)], [FREE, FREE, OCCUPIED, 0]);
        assert_eq!([at(-13, 13), at(-14, 14), at(0, 0)], [FREE, OCCUPIED, 2 * FREE]);
    }
}
