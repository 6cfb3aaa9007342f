//! Polygons with holes, as people draw them.

use crate::geometry::Point;

/// A region of the plane: an outer ring and the rings of its holes, in metres. Rings do not repeat
/// their first vertex, and may run either way round.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Polygon {
    /// The outer ring.
    pub outer: Vec<Point>,
    /// The rings of the holes, inside the outer one and apart from each other.
    pub holes: Vec<Vec<Point>>,
}

impl Polygon {
    /// A region without holes.
    pub fn simple(outer: impl IntoIterator<Item = [f64; 2]>) -> Self {
        Self { outer: outer.into_iter().map(Point::from).collect(), holes: Vec::new() }
    }

    /// The rings in the order in which findings count them, with the region on the left of each: the
    /// outer one counter-clockwise, holes clockwise.
    pub fn rings(&self) -> impl Iterator<Item = Vec<Point>> {
        let outer = std::iter::once((&self.outer, true));
        outer.chain(self.holes.iter().map(|hole| (hole, false))).map(|(ring, wanted)| {
            let mut ring = ring.clone();
            if (area(&ring) > 0.0) != wanted {
                ring.reverse();
            }
            ring
        })
    }
}

/// Signed area, positive for counter-clockwise rings, square metres.
fn area(ring: &[Point]) -> f64 {
    let Some(origin) = ring.first() else { return 0.0 };
    let next = ring.iter().cycle().skip(1);
    ring.iter().zip(next).map(|(p, q)| (p - origin).perp(&(q - origin))).sum::<f64>() / 2.0
}
