//! A map as an alignment reads it.

use std::collections::BTreeSet;

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
    /// One occupied cell of each square that has any.
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
        let mut squares = BTreeSet::new();
        let occupied = field.cells().filter(|(_, known)| *known == Known::Occupied);
        let occupied = occupied.map(|(centre, _)| centre);
        let occupied = occupied.filter(|p| squares.insert(square(p, config.grain))).collect();
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

fn faces((from, to): &(Point, Point)) -> impl Iterator<Item = (Point, Point)> + use<> {
    let (from, way) = (*from, to - from);
    let length = way.norm();
    let normal = Point::new(-way.y, way.x) / length;
    let count = (length / WALL_STEP) as u32;
    (0..count).map(move |i| (from + way * ((f64::from(i) + 0.5) / f64::from(count)), normal))
}
