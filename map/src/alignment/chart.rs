//! A map as an alignment reads it.

use std::collections::BTreeMap;

use super::AlignmentConfig;
use super::structure::{Structure, structures};
use crate::geometry::Point;
use crate::landmarks::{Landmark, landmarks_of_map};
use crate::level::LevelMap;
use crate::places::{Known, LikelihoodField, STEPS, walls_of};

/// Points are taken in steps of this, which has no factor in common with their number if that is no multiple of it: so
/// that the first of them lie all over.
const STRIDE: usize = 37;
/// Walls are looked at in steps of this, metres.
const WALL_STEP: f64 = 0.2;

/// A map with its likelihood field, thinned.
#[derive(Debug, Clone)]
pub struct Chart {
    pub(super) field: LikelihoodField,
    /// The middle of what is occupied in each square that has any.
    pub(super) occupied: Vec<Point>,
    /// Points of walls with their unit normals.
    pub(super) faces: Vec<(Point, Point)>,
    pub(super) landmarks: Vec<Landmark>,
    pub(super) structures: Vec<Structure>,
}

/// The square of a side that a point lies in.
fn square(p: &Point, side: f64) -> (i64, i64) {
    ((p.x / side).floor() as i64, (p.y / side).floor() as i64)
}

impl Chart {
    /// Of a map whose cells are `resolution` metres wide.
    pub fn of_map(map: &LevelMap, resolution: f64, config: &AlignmentConfig) -> Self {
        let field = LikelihoodField::of_map(map, resolution, &config.places);
        let occupied = field.cells().filter(|(_, known)| *known == Known::Occupied);
        let occupied = thinned(occupied.map(|(centre, _)| centre), config.grain);
        let walls: Vec<(Point, Point)> = walls_of(map).collect();
        let faces = walls.iter().flat_map(faces).collect();
        let segments = map.segments.iter().map(|(id, segment)| (id, segment.as_ref()));
        let landmarks = landmarks_of_map(segments, &config.landmarks);
        let landmarks = landmarks.into_values().map(|learned| learned.landmark).collect();
        let structures = structures(&walls, config);
        Self { field, occupied, faces, landmarks, structures }
    }

    /// What is occupied about a place, from there, evenly thinned.
    pub(super) fn around(&self, place: &Point, config: &AlignmentConfig) -> Vec<Point> {
        let arms = self.occupied.iter().map(|p| p - place);
        let arms: Vec<Point> = arms.filter(|arm| arm.norm() < config.structure_range).collect();
        // In an order that takes from all of them early.
        let most = config.structure_points_max.min(arms.len());
        let of = |i: usize| arms[(i * STRIDE % most) * arms.len() / most];
        (0..most).map(of).collect()
    }

    /// How well the end of a beam fits where nothing is known, in steps.
    pub(super) fn neutral(&self, config: &AlignmentConfig) -> u8 {
        (f64::from(self.field.best) - STEPS * config.places.unknown_cost).max(0.0).round() as u8
    }
}

/// The middle of the points in each square of a side. Not any one of them: the first cell of a wall is on the same side of
/// every wall, and whole maps would be off by that.
fn thinned(points: impl Iterator<Item = Point>, side: f64) -> Vec<Point> {
    let mut squares: BTreeMap<(i64, i64), (Point, f64)> = BTreeMap::new();
    for p in points {
        let (sum, count) = squares.entry(square(&p, side)).or_default();
        *sum += p;
        *count += 1.0;
    }
    squares.into_values().map(|(sum, count)| sum / count).collect()
}

fn faces((from, to): &(Point, Point)) -> impl Iterator<Item = (Point, Point)> + use<> {
    let (from, way) = (*from, to - from);
    let length = way.norm();
    let normal = Point::new(-way.y, way.x) / length;
    let count = (length / WALL_STEP) as u32;
    (0..count).map(move |i| (from + way * ((f64::from(i) + 0.5) / f64::from(count)), normal))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_of_a_wall_lies_in_its_middle() {
        // Three cells thick, aslant to the squares: any one cell of each would be off by some 5 cm.
        let cells = (0..400).flat_map(|along| {
            let along = f64::from(along) * 0.05;
            [-0.05, 0.0, 0.05].map(|off| Point::new(along - 0.6 * off, 0.6 * along + off))
        });
        let left = thinned(cells, 0.2);
        let off = left.iter().map(|p| p.y - 0.6 * p.x).sum::<f64>() / left.len() as f64;
        assert!(left.len() > 100 && off.abs() < 0.005, "{off} {}", left.len());
    }
}
