//! Points and straight pieces in the plane: the little geometry that the measures need, written
//! for them alone.

/// A point, or a vector.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Point {
    /// To the right, metres.
    pub x: f64,
    /// Up, metres.
    pub y: f64,
}

impl Point {
    /// The point (x, y).
    pub const fn new(x: f64, y: f64) -> Self {
        Self { x, y }
    }

    /// The point at `range` metres under `angle` radians, seen from here.
    #[must_use]
    pub fn towards(self, angle: f64, range: f64) -> Self {
        Self { x: self.x + range * angle.cos(), y: self.y + range * angle.sin() }
    }

    /// From `self` to `other`.
    fn to(self, other: Self) -> Self {
        Self { x: other.x - self.x, y: other.y - self.y }
    }

    fn dot(self, other: Self) -> f64 {
        self.x * other.x + self.y * other.y
    }

    fn cross(self, other: Self) -> f64 {
        self.x * other.y - self.y * other.x
    }

    /// Metres between two points.
    pub fn distance(self, other: Self) -> f64 {
        self.to(other).dot(self.to(other)).sqrt()
    }
}

/// A straight piece between two points.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Piece {
    /// One end.
    pub a: Point,
    /// The other.
    pub b: Point,
}

impl Piece {
    /// Metres from end to end.
    pub fn length(&self) -> f64 {
        self.a.distance(self.b)
    }

    /// The point at this share of the way from `a` to `b`.
    pub fn at(&self, share: f64) -> Point {
        let along = self.a.to(self.b);
        Point::new(self.a.x + share * along.x, self.a.y + share * along.y)
    }

    /// Metres from a point to the nearest point of the piece.
    pub fn distance(&self, point: Point) -> f64 {
        let along = self.a.to(self.b);
        let length_sq = along.dot(along);
        let share = if length_sq > 0.0 {
            (self.a.to(point).dot(along) / length_sq).clamp(0.0, 1.0)
        } else {
            0.0
        };
        point.distance(self.at(share))
    }

    /// Where this piece crosses `other`: the share of its own length from `a`, if it does.
    /// Pieces that lie along each other do not cross.
    pub fn crossing(&self, other: &Self) -> Option<f64> {
        let (own, across) = (self.a.to(self.b), other.a.to(other.b));
        let turn = own.cross(across);
        if turn == 0.0 {
            return None;
        }
        let between = self.a.to(other.a);
        let (share, other_share) = (between.cross(across) / turn, between.cross(own) / turn);
        ((0.0..=1.0).contains(&share) && (0.0..=1.0).contains(&other_share)).then_some(share)
    }
}

/// Metres from a point to a convex hull (counter-clockwise, at least one point); 0 inside it.
pub fn distance_to_hull(hull: &[Point], point: Point) -> f64 {
    let edges = || (0..hull.len()).map(|i| Piece { a: hull[i], b: hull[(i + 1) % hull.len()] });
    let inside =
        hull.len() > 2 && edges().all(|edge| edge.a.to(edge.b).cross(edge.a.to(point)) >= 0.0);
    if inside {
        return 0.0;
    }
    edges().map(|edge| edge.distance(point)).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
#[expect(clippy::float_cmp, reason = "these numbers have no rounding")]
mod tests {
    use super::*;

    fn piece(ax: f64, ay: f64, bx: f64, by: f64) -> Piece {
        Piece { a: Point::new(ax, ay), b: Point::new(bx, by) }
    }

    #[test]
    fn distances_to_a_piece_are_to_its_side_or_to_its_ends() {
        let wall = piece(0.0, 0.0, 4.0, 0.0);
        assert_eq!(wall.distance(Point::new(1.0, 2.0)), 2.0);
        assert_eq!(wall.distance(Point::new(7.0, 4.0)), 5.0);
        assert_eq!(wall.distance(Point::new(-3.0, 0.0)), 3.0);
        assert_eq!(piece(1.0, 1.0, 1.0, 1.0).distance(Point::new(1.0, 3.0)), 2.0);
    }

    #[test]
    fn pieces_cross_within_both_or_not_at_all() {
        let beam = piece(0.0, 0.0, 10.0, 0.0);
        assert_eq!(beam.crossing(&piece(4.0, -1.0, 4.0, 1.0)), Some(0.4));
        assert_eq!(beam.crossing(&piece(4.0, 1.0, 4.0, 2.0)), None);
        assert_eq!(beam.crossing(&piece(11.0, -1.0, 11.0, 1.0)), None);
        assert_eq!(beam.crossing(&piece(2.0, 0.0, 3.0, 0.0)), None);
    }

    #[test]
    fn the_inside_of_a_hull_is_at_no_distance() {
        let square =
            [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)].map(|(x, y)| Point::new(x, y));
        assert_eq!(distance_to_hull(&square, Point::new(1.0, 1.0)), 0.0);
        assert_eq!(distance_to_hull(&square, Point::new(3.0, 1.0)), 1.0);
        assert_eq!(distance_to_hull(&square[..1], Point::new(0.0, 3.0)), 3.0);
        assert_eq!(distance_to_hull(&square[..2], Point::new(1.0, 1.0)), 1.0);
    }
}
