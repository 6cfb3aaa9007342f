//! Made-up offices for scans of which every wall is known: rooms on both sides of a corridor of
//! 40 m, doors of 0.9 m in walls of 12 cm, a box at an odd angle in every room, and, if asked for,
//! round clutter.

use super::Noise;
use crate::plane::{Piece, Point};

const CORRIDOR_M: f64 = 40.0;
const CORRIDOR_HALF_M: f64 = 0.9;
const ROOM_PITCH_M: f64 = 4.0;
const ROOM_DEPTH_M: f64 = 3.8;
const WALL_M: f64 = 0.12;
const DOOR_M: f64 = 0.9;
/// Nearer to a wall no scan is taken.
const CLEARANCE_M: f64 = 0.35;
/// Sides of the polygon that stands for a round thing.
const ROUND_SIDES: u32 = 16;

/// An office, its walls first.
#[derive(Debug, Clone)]
pub struct Plan {
    /// All that beams can hit.
    pub pieces: Vec<Piece>,
    /// So many of them are walls or sides of boxes; the rest is round clutter.
    pub walls: usize,
}

impl Plan {
    /// An office by chance, with so many round things in every room and before every door.
    pub fn office(round_things: u32, noise: &mut Noise) -> Self {
        let mut walls = Vec::new();
        let mut round = Vec::new();
        let count = (CORRIDOR_M / ROOM_PITCH_M) as u32;
        for room in 0..count {
            for side in [1.0, -1.0] {
                let left = f64::from(room) * ROOM_PITCH_M;
                let right = left + ROOM_PITCH_M - WALL_M;
                let (near, far) =
                    (CORRIDOR_HALF_M + WALL_M, CORRIDOR_HALF_M + WALL_M + ROOM_DEPTH_M);
                let door = left + 0.4 + noise.share() * (right - left - 0.8 - DOOR_M);
                let at = |x: f64, y: f64| Point::new(x, side * y);
                let (c, d) = (CORRIDOR_HALF_M, door + DOOR_M);
                // The room and, through its door, the corridor's wall.
                let inside = [
                    at(door, c),
                    at(door, near),
                    at(left, near),
                    at(left, far),
                    at(right, far),
                    at(right, near),
                    at(d, near),
                    at(d, c),
                ];
                walls.extend(inside.windows(2).map(|ends| Piece { a: ends[0], b: ends[1] }));
                walls.push(Piece { a: at(left, c), b: at(door, c) });
                walls.push(Piece { a: at(d, c), b: at(right + WALL_M, c) });
                let (x, y) = (left + 1.0 + 1.8 * noise.share(), near + 1.6 + 1.2 * noise.share());
                walls.extend(turned_box(at(x, y), noise));
                for _ in 0..round_things {
                    let (x, y) = (left + 0.4 + 3.0 * noise.share(), near + 3.4 * noise.share());
                    round.extend(round_thing(at(x, y), noise));
                }
                if round_things > 0 {
                    let x = left + 4.0 * noise.share();
                    round.extend(round_thing(at(x, c - 0.2), noise));
                }
            }
        }
        for end in [0.0, CORRIDOR_M] {
            let c = CORRIDOR_HALF_M;
            walls.push(Piece { a: Point::new(end, -c), b: Point::new(end, c) });
        }
        let joined = join_collinear(walls);
        let count = joined.len();
        Self { pieces: joined.into_iter().chain(round).collect(), walls: count }
    }

    /// The nearest thing along a beam: metres, and its index in `pieces`.
    pub fn cast(&self, origin: Point, angle: f64, reach: f64) -> Option<(f64, usize)> {
        let beam = Piece { a: origin, b: origin.towards(angle, reach) };
        let hits = self.pieces.iter().enumerate();
        hits.filter_map(|(index, piece)| Some((beam.crossing(piece)? * reach, index)))
            .min_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// A place where a robot can stand and a direction to look: the corridor and the rooms by turns.
    pub fn place(&self, number: usize, noise: &mut Noise) -> (Point, f64) {
        loop {
            let (x, heading) =
                (noise.share() * CORRIDOR_M, (noise.share() - 0.5) * std::f64::consts::TAU);
            let y = if number.is_multiple_of(2) {
                (noise.share() - 0.5) * 2.0 * CORRIDOR_HALF_M
            } else {
                let side = if noise.share() < 0.5 { 1.0 } else { -1.0 };
                side * (CORRIDOR_HALF_M + WALL_M + noise.share() * ROOM_DEPTH_M)
            };
            let at = Point::new(x, y);
            let clear = self.pieces.iter().all(|piece| piece.distance(at) > CLEARANCE_M);
            // Not inside a box either: from there, nothing but the box is seen.
            if clear && self.sees_far(at) {
                return (at, heading);
            }
        }
    }

    fn sees_far(&self, at: Point) -> bool {
        (0..36).any(|i| {
            let angle = f64::from(i) * 10f64.to_radians();
            self.cast(at, angle, 1.5).is_none()
        })
    }
}

/// The four sides of a box of 0.4 to 1 m at any angle.
fn turned_box(middle: Point, noise: &mut Noise) -> Vec<Piece> {
    let (a, b) = (0.4 + 0.6 * noise.share(), 0.4 + 0.6 * noise.share());
    let (diagonal, half) = (0.5 * a.hypot(b), b.atan2(a));
    let turn = noise.share() * std::f64::consts::TAU;
    let pi = std::f64::consts::PI;
    let corners =
        [half, pi - half, pi + half, -half].map(|angle| middle.towards(turn + angle, diagonal));
    (0..4).map(|i| Piece { a: corners[i], b: corners[(i + 1) % 4] }).collect()
}

/// A round thing of 0.1 to 0.3 m radius.
fn round_thing(middle: Point, noise: &mut Noise) -> Vec<Piece> {
    let radius = 0.1 + 0.2 * noise.share();
    let corner = |i: u32| {
        let angle = f64::from(i % ROUND_SIDES) / f64::from(ROUND_SIDES) * std::f64::consts::TAU;
        middle.towards(angle, radius)
    };
    (0..ROUND_SIDES).map(|i| Piece { a: corner(i), b: corner(i + 1) }).collect()
}

/// Pieces along the axes that continue each other are one wall.
fn join_collinear(pieces: Vec<Piece>) -> Vec<Piece> {
    let mut joined: Vec<Piece> = Vec::new();
    for piece in pieces {
        let continues = |old: &Piece| {
            let level = |p: &Piece| (p.a.y - p.b.y).abs() < 1e-9;
            level(old) && level(&piece) && old.b.distance(piece.a) < 1e-9
        };
        match joined.iter_mut().find(|old| continues(old)) {
            Some(old) => old.b = piece.b,
            None => joined.push(piece),
        }
    }
    joined
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_office_is_as_told() {
        let mut noise = Noise::of_seed(1);
        let plan = Plan::office(2, &mut noise);
        // Rooms are closed but for their doors: from anywhere, every beam hits something.
        for number in 0..50 {
            let (at, heading) = plan.place(number, &mut noise);
            for beam in 0..360 {
                let angle = heading + f64::from(beam).to_radians();
                assert!(plan.cast(at, angle, 60.0).is_some(), "{at:?} {angle}");
            }
        }
        // 20 doors of 0.9 m: the corridor's walls leave out 18 m of 80.
        let corridor: f64 = plan.pieces[..plan.walls]
            .iter()
            .filter(|w| [w.a, w.b].iter().all(|p| (p.y.abs() - CORRIDOR_HALF_M).abs() < 1e-9))
            .filter(|w| (w.a.y - w.b.y).abs() < 1e-9)
            .map(Piece::length)
            .sum();
        assert!((corridor - 62.0).abs() < 1e-9, "{corridor}");
    }
}
