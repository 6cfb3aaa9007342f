//! A grid over one floor, what is truly there, and how well the one tells the other.

use std::collections::VecDeque;

use mapfold_map::raster::EvidencePatch;

use crate::plane::{Piece, Point};

/// What is read is clamped to plus or minus this many nats.
const READ_LIMIT_NAT: f64 = 5.0;
/// Log scores are of probabilities at least this far from 0 and 1.
const PROBABILITY_LEAST: f64 = 1e-4;
/// Cells with more than this count as occupied in F1, nats.
const OCCUPIED_NAT: f64 = 0.4;

/// Evidence on a rectangle of cells, nats, row by row from below.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Column and row of the lower left cell, from the level's origin.
    corner: (i32, i32),
    columns: usize,
    rows: usize,
    /// Edge of a cell, metres.
    pub resolution_m: f64,
    /// The cells.
    pub nats: Vec<f64>,
}

impl Grid {
    /// An empty grid that holds these pieces and a margin of two cells.
    pub fn about(pieces: &[Piece], resolution_m: f64) -> Self {
        let cell = |metres: f64| (metres / resolution_m).floor() as i32;
        let points = || pieces.iter().flat_map(|piece| [piece.a, piece.b]);
        let least = |of: fn(&Point) -> f64| points().map(|p| of(&p)).fold(f64::INFINITY, f64::min);
        let most = |of: fn(&Point) -> f64| points().map(|p| of(&p)).fold(-f64::INFINITY, f64::max);
        let corner = (cell(least(|p| p.x)) - 2, cell(least(|p| p.y)) - 2);
        let columns = (cell(most(|p| p.x)) + 3 - corner.0).max(0) as usize;
        let rows = (cell(most(|p| p.y)) + 3 - corner.1).max(0) as usize;
        Self { corner, columns, rows, resolution_m, nats: vec![0.0; columns * rows] }
    }

    /// The cell of a column and row of the level; `None` outside of the grid.
    pub fn index(&self, column: i32, row: i32) -> Option<usize> {
        let (x, y) = ((column - self.corner.0) as usize, (row - self.corner.1) as usize);
        (x < self.columns && y < self.rows).then(|| y * self.columns + x)
    }

    /// The cell that holds a point.
    pub fn holding(&self, p: Point) -> Option<usize> {
        let cell = |metres: f64| (metres / self.resolution_m).floor() as i32;
        self.index(cell(p.x), cell(p.y))
    }

    /// The centre of a cell.
    pub fn centre(&self, index: usize) -> Point {
        let middle =
            |at: usize, corner: i32| (at as f64 + f64::from(corner) + 0.5) * self.resolution_m;
        Point::new(
            middle(index % self.columns, self.corner.0),
            middle(index / self.columns, self.corner.1),
        )
    }

    /// Columns and rows.
    pub fn size(&self) -> (usize, usize) {
        (self.columns, self.rows)
    }

    /// Adds a patch, each cell by `weight`.
    pub fn add(&mut self, patch: &EvidencePatch, weight: f64) {
        for (tile, cells) in &patch.tiles {
            for run in cells.runs() {
                for offset in run.range() {
                    let cell = tile.cell(offset);
                    if let Some(index) = self.index(cell.column, cell.row) {
                        self.nats[index] += weight * f64::from(run.value) / 100.0;
                    }
                }
            }
        }
    }

    /// Adds another grid of the same floor, cell by cell.
    pub fn add_grid(&mut self, other: &Self) {
        for (sum, more) in self.nats.iter_mut().zip(&other.nats) {
            *sum += more;
        }
    }

    /// The four neighbours of a cell.
    fn neighbours(&self, index: usize) -> impl Iterator<Item = usize> {
        let (x, y) = (index % self.columns, index / self.columns);
        let (columns, rows) = (self.columns, self.rows);
        [
            (x > 0).then(|| index - 1),
            (x + 1 < columns).then(|| index + 1),
            (y > 0).then(|| index - columns),
            (y + 1 < rows).then(|| index + columns),
        ]
        .into_iter()
        .flatten()
    }

    /// Cells among these or beside one of them.
    fn grown(&self, cells: &[bool]) -> Vec<bool> {
        let beside = |index| cells[index] || self.neighbours(index).any(|at| cells[at]);
        (0..cells.len()).map(beside).collect()
    }
}

/// What is truly there: occupied cells, and the free ones that can be reached from some place.
#[derive(Debug, Clone)]
pub struct Truth {
    occupied: Vec<bool>,
    known: Vec<bool>,
}

impl Truth {
    /// The truth about the cells of `grid`: walls occupy the cells that they run through.
    pub fn of(grid: &Grid, walls: &[Piece], inside: Point) -> Self {
        let mut occupied = vec![false; grid.nats.len()];
        for wall in walls {
            let steps = (wall.length() / grid.resolution_m * 20.0).ceil().max(1.0);
            for step in 0..=steps as u32 {
                if let Some(index) = grid.holding(wall.at(f64::from(step) / steps)) {
                    occupied[index] = true;
                }
            }
        }
        let mut known = occupied.clone();
        let mut next: VecDeque<usize> = grid.holding(inside).into_iter().collect();
        while let Some(index) = next.pop_front() {
            if !std::mem::replace(&mut known[index], true) {
                next.extend(grid.neighbours(index).filter(|at| !known[*at]));
            }
        }
        Self { occupied, known }
    }

    /// The truth as given: what is occupied among what is known.
    pub fn given(occupied: Vec<bool>, known: Vec<bool>) -> Self {
        Self { occupied, known }
    }

    /// Leaves out all cells but these.
    pub fn only(&mut self, cells: &[bool]) {
        for (known, cell) in self.known.iter_mut().zip(cells) {
            *known &= cell;
        }
    }

    /// Share of the known cells that are occupied.
    pub fn base_rate(&self) -> f64 {
        let known = self.known.iter().filter(|known| **known).count();
        let both = self.known.iter().zip(&self.occupied).filter(|(k, o)| **k && **o).count();
        both as f64 / known as f64
    }

    /// Scores of the predictor that knows nothing but the base rate.
    pub fn base_scores(&self) -> Scores {
        let b = self.base_rate();
        let entropy = -(b * b.log2() + (1.0 - b) * (1.0 - b).log2());
        Scores { log_bits: entropy, brier: b * (1.0 - b), auc: 0.5, f1: 0.0 }
    }

    /// How well a grid tells the truth, over the known cells.
    pub fn scores(&self, grid: &Grid) -> Scores {
        let mut cells: Vec<(f64, bool)> = Vec::new();
        let (mut bits, mut squares) = (0.0, 0.0);
        for (index, nat) in grid.nats.iter().enumerate().filter(|(index, _)| self.known[*index]) {
            let nat = nat.clamp(-READ_LIMIT_NAT, READ_LIMIT_NAT);
            let p = 1.0 / (1.0 + (-nat).exp());
            let is = self.occupied[index];
            let told = (if is { p } else { 1.0 - p }).clamp(PROBABILITY_LEAST, 1.0);
            bits -= told.log2();
            squares += (p - f64::from(u8::from(is))).powi(2);
            cells.push((nat, is));
        }
        let count = cells.len() as f64;
        Scores {
            log_bits: bits / count,
            brier: squares / count,
            auc: auc(&mut cells),
            f1: self.f1(grid),
        }
    }

    /// F1 of occupied cells, a cell's distance forgiven.
    fn f1(&self, grid: &Grid) -> f64 {
        let marked: Vec<bool> = grid
            .nats
            .iter()
            .zip(&self.known)
            .map(|(nat, known)| *known && *nat > OCCUPIED_NAT)
            .collect();
        let truly: Vec<bool> = self
            .occupied
            .iter()
            .zip(&self.known)
            .map(|(occupied, known)| *occupied && *known)
            .collect();
        let share = |of: &[bool], near: &[bool]| {
            let all = of.iter().filter(|cell| **cell).count();
            let met = of.iter().zip(near).filter(|(a, b)| **a && **b).count();
            met as f64 / all.max(1) as f64
        };
        let precision = share(&marked, &grid.grown(&truly));
        let recall = share(&truly, &grid.grown(&marked));
        2.0 * precision * recall / (precision + recall).max(1e-9)
    }
}

/// Probability that an occupied cell has more evidence than a free one, half for ties.
fn auc(cells: &mut [(f64, bool)]) -> f64 {
    cells.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let (mut free_below, mut sum, mut occupied_all) = (0.0, 0.0, 0.0);
    for ties in cells.chunk_by(|a, b| a.0.total_cmp(&b.0).is_eq()) {
        let occupied = ties.iter().filter(|(_, is)| *is).count() as f64;
        let free = ties.len() as f64 - occupied;
        sum += occupied * (free_below + 0.5 * free);
        free_below += free;
        occupied_all += occupied;
    }
    sum / (free_below * occupied_all).max(1.0)
}

/// How well a grid tells the truth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scores {
    /// Bits a cell, less is better.
    pub log_bits: f64,
    /// Mean squared error of the probability.
    pub brier: f64,
    /// Area under the ROC curve.
    pub auc: f64,
    /// Occupied F1, a cell's distance forgiven.
    pub f1: f64,
}

impl Scores {
    /// The mean of several.
    pub fn mean(all: &[Self]) -> Self {
        let mean = |of: fn(&Self) -> f64| all.iter().map(of).sum::<f64>() / all.len() as f64;
        Self {
            log_bits: mean(|s| s.log_bits),
            brier: mean(|s| s.brier),
            auc: mean(|s| s.auc),
            f1: mean(|s| s.f1),
        }
    }

    /// As cells of a table.
    pub fn cells(&self) -> Vec<String> {
        [self.log_bits, self.brier, self.auc, self.f1].map(|v| format!("{v:.3}")).to_vec()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square() -> Vec<Piece> {
        let corners =
            [(0.05, 0.05), (1.95, 0.05), (1.95, 1.95), (0.05, 1.95)].map(|(x, y)| Point::new(x, y));
        (0..4).map(|at| Piece { a: corners[at], b: corners[(at + 1) % 4] }).collect()
    }

    #[test]
    fn what_cannot_be_reached_is_not_known() {
        let grid = Grid::about(&square(), 0.1);
        let truth = Truth::of(&grid, &square(), Point::new(1.0, 1.0));
        let known = truth.known.iter().filter(|known| **known).count();
        assert_eq!(known, 20 * 20, "the square and its walls, and nothing outside");
        assert!((truth.base_rate() - 76.0 / 400.0).abs() < 1e-12);
    }

    #[test]
    fn the_truth_scores_best_and_its_opposite_worst() {
        let mut grid = Grid::about(&square(), 0.1);
        let truth = Truth::of(&grid, &square(), Point::new(1.0, 1.0));
        let told = |right: f64| -> Vec<f64> {
            truth.occupied.iter().map(|is| if *is { right } else { -right }).collect()
        };
        grid.nats = told(9.0);
        let best = truth.scores(&grid);
        assert!(best.log_bits < 0.01 && best.brier < 1e-4 && best.auc > 0.999 && best.f1 > 0.999);
        grid.nats = told(-9.0);
        let worst = truth.scores(&grid);
        assert!(worst.log_bits > 7.0 && worst.auc < 1e-3, "{worst:?}");
        grid.nats.fill(0.0);
        let nothing = truth.scores(&grid);
        assert!((nothing.log_bits - 1.0).abs() < 1e-12 && (nothing.auc - 0.5).abs() < 1e-12);
        assert!(truth.base_scores().log_bits < 1.0);
    }
}
