//! What confirmed walls say of the cells that they pass through.
//!
//! Free space across a wall counts against it in the vector fold (`seen_through`, `gap`). This is the
//! other way: a wall that enough looks saw and none to speak of went through explains its cells, also
//! where beams that pass it aslant, or sonars that it mirrors, say that they are free. It is a function
//! of the published segments and no part of any fold; a wall that scanners look through is open in the fold,
//! and says nothing any more.

use std::collections::{BTreeMap, BTreeSet};

use super::{Segment, SolidInterval};
use crate::raster::{EvidenceRun, LogOdds, TileIndex, TilePatch, crossed};

/// When a wall is confirmed, and what it then says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ConfirmedConfig {
    /// Distinct looks that must support the segment.
    pub looks_min: u32,
    /// What the log-odds that a part is there must come to.
    pub existence_min: LogOdds,
    /// What each confirmed wall says of a cell, steps of log-odds, more than 0.
    pub says: i16,
}

impl ConfirmedConfig {
    /// Three looks, and as sure as reading gets (5 nat: two looks more than went through it). It then says 2 nat
    /// (0.88): occupied for all readers, and no more than the last slices of evidence count for against a new one.
    pub const STANDARD: Self = Self { looks_min: 3, existence_min: LogOdds(500), says: 200 };

    /// The parts of a segment that are confirmed.
    pub fn parts<'a>(&self, segment: &'a Segment) -> impl Iterator<Item = &'a SolidInterval> {
        let (enough, least) = (segment.looks >= self.looks_min, self.existence_min);
        segment.solid.iter().filter(move |part| enough && part.existence >= least)
    }
}

/// What the confirmed parts of a wall say, tile by tile, on a grid of `resolution` metres a cell.
/// Patches of several walls add up and can be taken out again like any evidence.
pub fn confirmed(
    segment: &Segment,
    resolution: f64,
    config: &ConfirmedConfig,
) -> BTreeMap<TileIndex, TilePatch> {
    let mut tiles: BTreeMap<TileIndex, BTreeSet<usize>> = BTreeMap::new();
    for part in config.parts(segment) {
        let [a, b] = [part.span.from_m(), part.span.to_m()].map(|along| segment.line.at(along));
        for cell in crossed(&a, &b, resolution) {
            let (tile, offset) = cell.tile();
            tiles.entry(tile).or_default().insert(offset);
        }
    }
    tiles.into_iter().map(|(tile, offsets)| (tile, patch(offsets, config.says))).collect()
}

fn patch(offsets: BTreeSet<usize>, value: i16) -> TilePatch {
    let mut runs: Vec<EvidenceRun> = Vec::new();
    for offset in offsets {
        match runs.last_mut() {
            Some(run) if run.range().end == offset => run.length += 1,
            _ => runs.push(EvidenceRun { start: offset as u16, length: 1, value }),
        }
    }
    // Ascending, none empty, and a tile's offsets: there is nothing to refuse but a value of 0.
    TilePatch::new(runs).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Covariance, Interval, Line};
    use crate::raster::{Cell, Tile};
    use crate::vector::{EndKind, Facing, SolidInterval};

    fn wall(looks: u32, parts: &[(i64, i64, i32)]) -> Segment {
        let part = |(from, to, existence): &(i64, i64, i32)| SolidInterval {
            span: Interval { from: *from, to: *to },
            ends: [EndKind::Jump; 2],
            existence: LogOdds(*existence),
        };
        Segment {
            // y = 1.02, seen from below; along it, x grows as the coordinate falls.
            line: Line::normal_form(1.02, std::f64::consts::FRAC_PI_2).0,
            independent: Covariance::from_variances([1e-6, 1e-6]),
            dependent: Covariance::from_variances([1e-6, 1e-6]),
            facing: Facing::Origin,
            solid: parts.iter().map(part).collect(),
            looks,
            robots: vec!["ada".into()],
            first_seen_us: 0,
            last_seen_us: 0,
        }
    }

    /// Columns of row 20 of which it says something, and what.
    fn said(segment: &Segment) -> Vec<(i32, i32)> {
        let mut cells = Vec::new();
        for (tile, patch) in confirmed(segment, 0.05, &ConfirmedConfig::STANDARD) {
            let mut sums = Tile::default();
            sums.add(&patch);
            for (offset, sum) in sums.cells().iter().enumerate().filter(|(_, sum)| **sum != 0) {
                let Cell { column, row } = tile.cell(offset);
                assert_eq!(row, 20);
                cells.push((column, *sum));
            }
        }
        cells
    }

    #[test]
    fn only_sure_parts_of_walls_that_were_seen_often_say_anything() {
        let parts = [(-310, -10, 500), (10, 210, 499), (1010, 1040, 900)];
        let sure: Vec<(i32, i32)> = [-21].into_iter().chain(0..=6).map(|c| (c, 200)).collect();
        assert_eq!(said(&wall(3, &parts)), sure);
        assert_eq!(said(&wall(2, &parts)), []);
    }

    #[test]
    fn two_parts_in_one_cell_say_it_once() {
        assert_eq!(said(&wall(3, &[(-40, -30, 600), (-20, -5, 600)])), [(0, 200)]);
    }
}
