//! Buildings of straight walls.

use crate::plane::{Piece, Point};

/// A building and a way through it.
#[derive(Debug, Clone)]
pub struct World {
    /// Its name in reports.
    pub name: &'static str,
    /// Its walls.
    pub walls: Vec<Piece>,
    /// The corners of a drive that sees all of it.
    pub way: Vec<Point>,
}

impl World {
    /// Metres to the nearest wall along a beam, and the cosine of the angle between the beam and
    /// the wall's normal there; nothing within `reach` metres is `None`.
    pub fn cast(&self, origin: Point, angle: f64, reach: f64) -> Option<(f64, f64)> {
        let beam = Piece { a: origin, b: origin.towards(angle, reach) };
        let hit = |wall: &Piece| {
            let share = beam.crossing(wall)?;
            let along = (wall.b.y - wall.a.y).atan2(wall.b.x - wall.a.x);
            Some((share * reach, (angle - along).sin().abs()))
        };
        self.walls.iter().filter_map(hit).min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

/// The walls of a closed chain of corners.
fn ring(corners: &[(f64, f64)]) -> impl Iterator<Item = Piece> {
    let point = |index: usize| {
        let (x, y) = corners[index % corners.len()];
        Point::new(x, y)
    };
    (0..corners.len()).map(move |index| Piece { a: point(index), b: point(index + 1) })
}

fn rectangle(left: f64, low: f64, right: f64, high: f64) -> impl Iterator<Item = Piece> {
    let corners = [(left, low), (right, low), (right, high), (left, high)];
    ring(&corners).collect::<Vec<_>>().into_iter()
}

/// A corridor of 48 m with a closed room of 6 x 5 m behind every door on both sides, thick walls,
/// and cupboards in every second room.
pub fn office() -> World {
    let (rooms, pitch, half, depth, wall) = (8, 6.0, 1.1_f64, 5.0, 0.15);
    let (door_from, door_to) = (2.4, 3.4);
    let length = f64::from(rooms) * pitch;
    let mut walls: Vec<Piece> = Vec::new();
    let mut way = vec![Point::new(1.0, 0.0)];
    for room in 0..rooms {
        let left = f64::from(room) * pitch;
        for side in [1.0_f64, -1.0] {
            let (near, far) = (side * half, side * (half + wall + depth));
            // The wall to the corridor, left and right of the door.
            for (from, to) in [(0.0, door_from), (door_to, pitch)] {
                let (low, high) = (near.min(near + side * wall), near.max(near + side * wall));
                walls.extend(rectangle(left + from, low, left + to, high));
            }
            let inner = near + side * wall;
            let corners = [inner, far, far, inner]
                .into_iter()
                .zip([0.0, 0.0, 1.0, 1.0])
                .map(|(y, share)| Point::new(left + share * (pitch - wall), y));
            let corners: Vec<Point> = corners.collect();
            walls.extend(corners.windows(2).map(|ends| Piece { a: ends[0], b: ends[1] }));
            if room % 2 == 0 {
                let (low, high) = (far.min(far - side * 0.6), far.max(far - side * 0.6));
                walls.extend(rectangle(left + 0.8, low, left + 2.0, high));
            }
            let door = left + f64::midpoint(door_from, door_to);
            way.extend([
                Point::new(door, 0.0),
                Point::new(door, side * 3.6),
                Point::new(door, 0.0),
            ]);
        }
    }
    for end in [0.0, length] {
        walls.push(Piece { a: Point::new(end, -half), b: Point::new(end, half) });
    }
    way.push(Point::new(length - 1.0, 0.0));
    World { name: "office", walls, way }
}

/// An oblique hall of 40 x 24 m with pillars and a round column of 24 sides: few walls are parallel
/// to the axes, and many things are no walls at all.
pub fn hall() -> World {
    let turned = |x: f64, y: f64| {
        let (sin, cos) = 0.35_f64.sin_cos();
        (x * cos - y * sin, x * sin + y * cos)
    };
    let at = |corners: &[(f64, f64)]| -> Vec<Piece> {
        ring(&corners.iter().map(|(x, y)| turned(*x, *y)).collect::<Vec<_>>()).collect()
    };
    let mut walls = at(&[(0.0, 0.0), (40.0, 0.0), (40.0, 18.0), (34.0, 24.0), (0.0, 24.0)]);
    for column in 1..5 {
        for row in [8.0, 16.0] {
            let (x, half) = (f64::from(column) * 8.0, 0.25);
            walls.extend(at(&[
                (x - half, row - half),
                (x + half, row - half),
                (x + half, row + half),
                (x - half, row + half),
            ]));
        }
    }
    let round: Vec<(f64, f64)> = (0..24)
        .map(|side| {
            let (sin, cos) = (f64::from(side) * std::f64::consts::TAU / 24.0).sin_cos();
            (20.0 + 2.0 * cos, 12.0 + 2.0 * sin)
        })
        .collect();
    walls.extend(at(&round));
    let way = [
        (4.0, 4.0),
        (36.0, 4.0),
        (36.0, 12.0),
        (24.0, 12.0),
        (28.0, 20.0),
        (4.0, 20.0),
        (4.0, 5.0),
    ]
    .map(|(x, y)| {
        let (x, y) = turned(x, y);
        Point::new(x, y)
    });
    World { name: "hall", walls, way: way.to_vec() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_beam_ends_at_the_nearest_wall() {
        let world = World {
            name: "two walls",
            walls: vec![
                Piece { a: Point::new(5.0, -1.0), b: Point::new(5.0, 1.0) },
                Piece { a: Point::new(3.0, -1.0), b: Point::new(4.0, 1.0) },
            ],
            way: Vec::new(),
        };
        let (range, cosine) = world.cast(Point::new(0.0, 0.0), 0.0, 10.0).unwrap_or_default();
        assert!((range - 3.5).abs() < 1e-12);
        assert!((cosine - 2.0 / 5.0_f64.sqrt()).abs() < 1e-12);
        assert!(world.cast(Point::new(0.0, 0.0), 0.0, 3.0).is_none());
        assert!(world.cast(Point::new(0.0, 0.0), 3.0, 10.0).is_none());
    }

    #[test]
    fn no_way_leads_through_a_wall() {
        for world in [office(), hall()] {
            for leg in world.way.windows(2) {
                let leg = Piece { a: leg[0], b: leg[1] };
                let hit = world.walls.iter().find(|wall| leg.crossing(wall).is_some());
                assert!(hit.is_none(), "{}: {leg:?} meets {hit:?}", world.name);
            }
        }
    }
}
