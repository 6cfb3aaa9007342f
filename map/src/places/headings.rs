//! Headings, those first that bring walls that are seen onto directions of walls that are known.

use std::f64::consts::TAU;

use crate::geometry::Point;

/// Directions are told apart in degrees.
const BINS: usize = 360;
/// A direction is one of the map's if so many metres of wall have it, or this share of all.
const COMMON: (f64, f64) = (3.0, 0.004);
/// With less wall in sight, or less of it along directions of the map, all headings are alike.
const SEEN_MIN_M: f64 = 1.0;
const SHARE_MIN: f64 = 0.5;
/// Headings are likely that bring this share of what the best one brings onto walls.
const SHARE_OF_BEST: f64 = 0.6;

/// Metres of wall by direction, free space on the left.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Directions {
    metres: Vec<f64>,
}

fn bin(direction: f64) -> usize {
    ((direction.rem_euclid(TAU) / TAU * BINS as f64) as usize).min(BINS - 1)
}

/// Direction and length, metres.
fn of_wall((from, to): &(Point, Point)) -> (f64, f64) {
    let way = to - from;
    (way.y.atan2(way.x), way.norm())
}

impl Directions {
    /// Of the walls of a map.
    pub(super) fn new(walls: impl IntoIterator<Item = (Point, Point)>) -> Self {
        let mut exact = vec![0.0; BINS];
        for wall in walls {
            let (direction, length) = of_wall(&wall);
            exact[bin(direction)] += length;
        }
        // A wall at the edge of a bin counts for its neighbour too.
        let near = |i: usize| exact[(i + BINS - 1) % BINS] + exact[i] + exact[(i + 1) % BINS];
        Self { metres: (0..BINS).map(near).collect() }
    }

    /// All headings of a robot that sees these walls, radians, a degree apart: the likely ones, or all if its walls say
    /// nothing, and the others. Walls that are seen need not be any that are known, so that those may be right as well.
    pub(super) fn headings(&self, seen: &[(Point, Point)]) -> [Vec<f64>; 2] {
        let heading = |i: usize| (i as f64) * TAU / BINS as f64;
        let seen: Vec<(f64, f64)> = seen.iter().map(of_wall).collect();
        let in_sight: f64 = seen.iter().map(|wall| wall.1).sum();
        // Each metre of wall is counted in three bins.
        let all: f64 = self.metres.iter().sum::<f64>() / 3.0;
        let common = COMMON.0.min(COMMON.1 * all);
        let onto_walls: Vec<f64> = (0..BINS)
            .map(|i| {
                let is_known = |wall: &&(f64, f64)| self.metres[bin(wall.0 + heading(i))] > common;
                seen.iter().filter(is_known).map(|wall| wall.1).sum()
            })
            .collect();
        let best = onto_walls.iter().copied().fold(0.0, f64::max);
        let says_nothing = in_sight < SEEN_MIN_M || best < SHARE_MIN * in_sight;
        let is_likely = |i: &usize| says_nothing || onto_walls[*i] >= SHARE_OF_BEST * best;
        let (likely, others): (Vec<_>, Vec<_>) = (0..BINS).partition(is_likely);
        [likely, others].map(|bins| bins.into_iter().map(heading).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wall(degrees: f64, length: f64) -> (Point, Point) {
        let (sin, cos) = degrees.to_radians().sin_cos();
        (Point::new(1.0, 2.0), Point::new(1.0 + length * cos, 2.0 + length * sin))
    }

    #[test]
    fn a_corner_fits_a_room_in_four_ways_and_a_wall_with_its_side() {
        let room = Directions::new([0.5, 90.5, 180.5, 270.5].map(|d| wall(d, 10.0)));
        let around = |headings: &[f64], degrees: f64| {
            headings.iter().any(|h| {
                let off = (h.to_degrees() - degrees).rem_euclid(360.0);
                off.min(360.0 - off) <= 1.5
            })
        };
        let [headings, others] = room.headings(&[wall(20.5, 4.0), wall(110.5, 3.0)]);
        assert!(headings.len() <= 12, "{}", headings.len());
        assert_eq!(headings.len() + others.len(), BINS);
        assert!([340.0, 70.0, 160.0, 250.0].iter().all(|d| around(&headings, *d)));
        let one_sided = Directions::new([wall(0.5, 10.0)]);
        let [headings, others] = one_sided.headings(&[wall(20.5, 4.0)]);
        assert!(around(&headings, 340.0) && !around(&headings, 160.0) && around(&others, 160.0));
    }

    #[test]
    fn without_walls_all_headings_are_alike() {
        let room = Directions::new([wall(0.5, 10.0)]);
        assert_eq!(room.headings(&[])[0].len(), BINS);
        assert_eq!(room.headings(&[wall(0.0, 0.5)])[0].len(), BINS);
        assert_eq!(Directions::new([]).headings(&[wall(0.0, 5.0)])[0].len(), BINS);
    }
}
