//! Which cell of a table a figure falls into, without a search.

use std::f64::consts::FRAC_PI_2;

/// Cells of equal width that cover a stretch.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Cells {
    first: f64,
    width: f64,
    per_unit: f64,
    count: usize,
    /// Where the last ends, nearly.
    end: f64,
}

/// To whatever this is added is rounded to a whole number, which then stands in the lowest bits: a third of
/// the cost of a cast that minds what it is given.
const ROUNDING: f64 = 6_755_399_441_055_744.0;

impl Cells {
    /// So many cells from the first to the second figure.
    pub(super) fn new((first, last): (f64, f64), count: usize) -> Self {
        let width = (last - first) / count as f64;
        Self { first, width, per_unit: 1.0 / width, count, end: count as f64 - 1e-9 }
    }

    /// Where each cell begins and the last one ends.
    pub(super) fn begins(self) -> impl Iterator<Item = f64> {
        (0..=self.count).map(move |cell| self.first + self.width * cell as f64)
    }

    /// The cell of a figure and the share of it that is past, from 0 to 1. What is outside lies at the
    /// edge; NaN at the first. A figure between two cells may be at the end of the one or the beginning
    /// of the other.
    #[inline]
    pub(super) fn of(&self, figure: f64) -> (u32, f64) {
        let place = (figure - self.first) * self.per_unit;
        let place = if place > 0.0 { place } else { 0.0 };
        let place = if place < self.end { place } else { self.end };
        let rounded = (place - 0.5) + ROUNDING;
        (rounded.to_bits() as u32, place - (rounded - ROUNDING))
    }
}

/// The incidences of a table, at least two of them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Axis {
    steps: Vec<Step>,
    first: f64,
    last: f64,
    cells: Cells,
    /// For each cell the last step that begins at or before it.
    steps_of_cells: Vec<u32>,
}

/// From one incidence to the next, radians.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Step {
    from: f64,
    /// The last step has no end.
    to: f64,
    /// One over its length.
    per_radian: f64,
}

impl Axis {
    /// Cells of half a degree are as fine as any table.
    const CELLS: usize = 180;

    /// For incidences that ascend.
    pub(super) fn new(incidences: &[f64]) -> Self {
        let (first, last) = (incidences[0], incidences[incidences.len() - 1]);
        let mut steps: Vec<Step> = incidences
            .windows(2)
            .map(|two| Step { from: two[0], to: two[1], per_radian: 1.0 / (two[1] - two[0]) })
            .collect();
        if let Some(step) = steps.last_mut() {
            step.to = f64::INFINITY;
        }
        let cells = Cells::new((0.0, FRAC_PI_2), Self::CELLS);
        let step_at = |begin| steps.partition_point(|step| step.from <= begin).max(1) - 1;
        let steps_of_cells = cells.begins().map(|begin| step_at(begin) as u32).collect();
        Self { steps, first, last, cells, steps_of_cells }
    }

    /// How many steps there are from the first incidence to the last.
    #[inline]
    pub(super) fn steps(&self) -> usize {
        self.steps.len()
    }

    /// The step that an angle falls into, the share of it that is past, and by how much that grows with
    /// the angle. Before the first incidence and after the last as there, NaN as at the first.
    #[inline]
    pub(super) fn of(&self, angle: f64) -> (u32, f64, f64) {
        let held = if angle > self.first { angle } else { self.first };
        let held = if held < self.last { held } else { self.last };
        let mut at = self.steps_of_cells[self.cells.of(held).0 as usize];
        // One step at most, nearly always; whether it is taken is chance, so it is no branch.
        at += u32::from(self.steps[at as usize].to <= held);
        let mut step = &self.steps[at as usize];
        while step.to <= held {
            at += 1;
            step = &self.steps[at as usize];
        }
        let inside = angle >= self.first && angle < self.last;
        let per_radian = if inside { step.per_radian } else { 0.0 };
        (at, (held - step.from) * step.per_radian, per_radian)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cell_is_where_a_figure_lies_and_nothing_lies_outside() {
        let cells = Cells::new((0.5, 2.5), 8);
        assert!(cells.begins().map(|b| (4.0 * b) as u32).eq(2..=10));
        for i in -100..400 {
            let figure = 0.01 * f64::from(i);
            let (cell, past) = cells.of(figure);
            let place = (4.0 * (figure - 0.5)).clamp(0.0, 8.0);
            assert!(cell < 8 && (f64::from(cell) + past - place).abs() < 1e-8, "{figure}");
            assert!((-1e-12..=1.0 + 1e-12).contains(&past), "{figure}: {past}");
        }
        assert_eq!(cells.of(f64::NAN).0, 0);
        assert_eq!(cells.of(f64::INFINITY).0, 7);
    }

    #[test]
    fn steps_are_found_however_close_they_are() {
        // Two incidences in one cell of the axis, and none in most.
        let axis = Axis::new(&[0.1, 0.5, 0.5005, 0.501, 1.2]);
        assert_eq!(axis.steps(), 4);
        for (angle, step, share) in [
            (0.0, 0, 0.0),
            (0.1, 0, 0.0),
            (0.3, 0, 0.5),
            (0.5, 1, 0.0),
            (0.500_25, 1, 0.5),
            (0.5005, 2, 0.0),
            (0.501, 3, 0.0),
            (1.2, 3, 1.0),
            (1.5, 3, 1.0),
            (f64::NAN, 0, 0.0),
        ] {
            let (at, past, growth) = axis.of(angle);
            assert!(at == step && (past - share).abs() < 1e-9, "{angle}: {at} {past}");
            let inside = (0.1..1.2).contains(&angle);
            assert_eq!(growth > 0.0, inside, "{angle}: {growth}");
        }
    }
}
