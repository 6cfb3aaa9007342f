//! The gap that a joint bridges: whether scanners have looked through it.

use super::VectorConfig;
use super::piece::Piece;
use super::seen_through::{Evidence, Reader};
use crate::geometry::Point;
use crate::raster::{Blocks, LogOdds, TileIndex};

/// What lies between two ends and their vertex, where neither wall was seen: straight stretches,
/// only those that are long enough to be looked through.
#[derive(Debug, Clone, Default)]
pub(super) struct Gap {
    stretches: Vec<(Point, Point)>,
}

impl Gap {
    /// The gap that the joint at `vertex` from the head of `a` to the tail of `b` bridges.
    pub(super) fn new(a: &Piece, b: &Piece, vertex: &Point, config: &VectorConfig) -> Self {
        let least = config.seen_through_min;
        let before = (vertex - a.head.at).dot(&a.direction) >= least;
        let after = (b.tail.at - vertex).dot(&b.direction) >= least;
        let mut stretches = Vec::new();
        if before {
            stretches.push((a.head.at, *vertex));
        }
        if after {
            stretches.push((*vertex, b.tail.at));
        }
        // Halfway along a straight gap there is no corner that beams could not pass.
        if !before && !after && (b.tail.at - a.head.at).dot(&a.direction) >= least {
            stretches.push((a.head.at, b.tail.at));
        }
        Self { stretches }
    }

    /// Whether some `config.seen_through_min` of it in a row lie in free cells only, as for walls.
    pub(super) fn is_seen_through<E: Evidence>(&self, grid: &E, config: &VectorConfig) -> bool {
        let free_below = LogOdds::from_nat(config.free_below).0;
        let resolution = grid.resolution();
        let mut reader = Reader::new(grid);
        self.stretches.iter().any(|(from, to)| {
            let (mut open, step) = (0.0, 0.5 * resolution);
            samples(from, to, step).any(|p| {
                let beside = beside(from, to, &p, resolution);
                let free = beside.iter().all(|q| reader.value(q) < free_below);
                open = if free { open + step } else { 0.0 };
                open >= config.seen_through_min
            })
        })
    }

    /// The blocks of cells whose evidence it depends on.
    pub(super) fn blocks(&self, resolution: f64) -> Vec<(TileIndex, Blocks)> {
        let places = self.stretches.iter().flat_map(|(from, to)| {
            samples(from, to, 0.5 * resolution).flat_map(|p| beside(from, to, &p, resolution))
        });
        Blocks::under(places, resolution)
    }
}

/// The middles of steps from `from` to `to`.
fn samples(from: &Point, to: &Point, step: f64) -> impl Iterator<Item = Point> {
    let (from, way) = (*from, to - from);
    let length = way.norm();
    let count = (length / step).floor() as u32;
    (0..count).map(move |i| from + way * ((f64::from(i) + 0.5) * step / length))
}

/// A place and the cells to either side of it: a wall may lie a cell off its estimate.
fn beside(from: &Point, to: &Point, p: &Point, resolution: f64) -> [Point; 3] {
    let across = (to - from).normalize() * resolution;
    let across = Point::new(-across.y, across.x);
    [p - across, *p, p + across]
}
