//! Points on a grid of micrometres, and the questions about them that have exact answers.

use crate::geometry::Point;

/// Micrometres in a metre: the step of the grid on which all abstraction is done.
pub const MICROMETRES: f64 = 1e6;

/// Coordinates reach this far from the level's origin, in micrometres (10 km). Products of three
/// differences then stay far within 128 bits.
pub(super) const REACH: i64 = 10_000_000_000;

/// A point of a plan, in micrometres from the level's origin. The order is by x, then by y.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default)]
pub struct PlanPoint {
    /// To the right, micrometres.
    pub x: i64,
    /// Up, micrometres.
    pub y: i64,
}

impl PlanPoint {
    /// The same point in metres.
    pub fn metres(self) -> Point {
        Point::new(self.x as f64 / MICROMETRES, self.y as f64 / MICROMETRES)
    }

    /// The nearest point of the grid; `None` beyond 10 km from the origin.
    pub fn nearest(p: &Point) -> Option<Self> {
        Some(Self { x: micrometres(p.x)?, y: micrometres(p.y)? })
    }

    /// Distance to another point, metres.
    pub fn distance(self, other: Self) -> f64 {
        (other.metres() - self.metres()).norm()
    }
}

/// A length in micrometres; `None` beyond the grid's reach, and for what is not a number.
pub(super) fn micrometres(metres: f64) -> Option<i64> {
    let steps = (metres * MICROMETRES).round();
    (steps.abs() <= REACH as f64).then_some(steps as i64)
}

/// Twice the signed area of the triangle `a`, `b`, `c`: positive if `c` is to the left of a walk from
/// `a` to `b`.
pub(super) fn side(a: PlanPoint, b: PlanPoint, c: PlanPoint) -> i128 {
    let (ux, uy) = (i128::from(b.x - a.x), i128::from(b.y - a.y));
    let (vx, vy) = (i128::from(c.x - a.x), i128::from(c.y - a.y));
    ux * vy - uy * vx
}

/// Scalar product of the steps from `a` to `b` and from `a` to `c`.
pub(super) fn along(a: PlanPoint, b: PlanPoint, c: PlanPoint) -> i128 {
    i128::from(b.x - a.x) * i128::from(c.x - a.x) + i128::from(b.y - a.y) * i128::from(c.y - a.y)
}

/// The integer nearest to `numerator / denominator` (positive); halves go up.
pub(super) fn nearest_quotient(numerator: i128, denominator: i128) -> i64 {
    (2 * numerator + denominator).div_euclid(2 * denominator) as i64
}

/// Where the open insides of two segments cross in one point, on the grid; `None` if they only touch
/// or lie on one line.
pub(super) fn crossing(a: [PlanPoint; 2], b: [PlanPoint; 2]) -> Option<PlanPoint> {
    let (from, to) = (side(b[0], b[1], a[0]), side(b[0], b[1], a[1]));
    let (left, right) = (side(a[0], a[1], b[0]), side(a[0], a[1], b[1]));
    if from.signum() * to.signum() != -1 || left.signum() * right.signum() != -1 {
        return None;
    }
    // The share of `a` before the crossing is from / (from - to). Said from its smaller end, so that the
    // direction of neither segment matters.
    let ((from, to), [start, end]) =
        if a[0] < a[1] { ((from, to), a) } else { ((to, from), [a[1], a[0]]) };
    let sign = from.signum();
    let (share, whole) = (from * sign, (from - to) * sign);
    let at = |p: i64, q: i64| p + scaled(i128::from(q - p), share, whole);
    Some(PlanPoint { x: at(start.x, end.x), y: at(start.y, end.y) })
}

/// The integer nearest to `length * share / whole`, for `0 <= share <= whole`.
///
/// `share` has up to 70 bits and `length` 35: the product fits.
fn scaled(length: i128, share: i128, whole: i128) -> i64 {
    nearest_quotient(length * share, whole)
}

/// Whether a segment meets the half-open square of side 1 about `pixel` (left and lower sides
/// included). Everything is doubled, so that the square's corners are whole numbers.
pub(super) fn meets_pixel(segment: [PlanPoint; 2], pixel: PlanPoint) -> bool {
    let [p, q] = if segment[0].x <= segment[1].x { segment } else { [segment[1], segment[0]] };
    let within = |low: i64, high: i64, v: i64| low <= v && v <= high;
    if !within(p.x, q.x, pixel.x) || !within(p.y.min(q.y), p.y.max(q.y), pixel.y) {
        return false;
    }
    if p.x == q.x || p.y == q.y {
        return true;
    }
    let double = |v: PlanPoint| PlanPoint { x: 2 * v.x, y: 2 * v.y };
    let (p2, q2) = (double(p), double(q));
    let corner = |dx: i64, dy: i64| {
        side(p2, q2, PlanPoint { x: 2 * pixel.x + dx, y: 2 * pixel.y + dy }).signum()
    };
    let (ul, ur, ll, lr) = (corner(-1, 1), corner(1, 1), corner(-1, -1), corner(1, -1));
    // Through the lower left corner, the only one that belongs to the square, or through its inside:
    // then it parts one of the diagonals.
    ll == 0 || ul * lr < 0 || ll * ur < 0
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(x: i64, y: i64) -> PlanPoint {
        PlanPoint { x, y }
    }

    #[test]
    fn halves_go_up() {
        assert_eq!(nearest_quotient(1, 2), 1);
        assert_eq!(nearest_quotient(-1, 2), 0);
        assert_eq!(nearest_quotient(-3, 2), -1);
        assert_eq!(nearest_quotient(4, 3), 1);
    }

    #[test]
    fn what_only_touches_does_not_cross() {
        assert_eq!(crossing([at(0, 0), at(4, 4)], [at(0, 4), at(4, 0)]), Some(at(2, 2)));
        assert_eq!(crossing([at(0, 0), at(4, 0)], [at(2, 0), at(2, 5)]), None);
        assert_eq!(crossing([at(0, 0), at(4, 0)], [at(1, 0), at(9, 0)]), None);
    }

    proptest! {
        /// By sampling: the segment is cut into so many parts that it cannot slip past a square of a few.
        #[test]
        fn a_pixel_is_met_where_a_fine_walk_along_the_segment_enters_it(
            ax in -6_i64..6, ay in -6_i64..6, bx in -6_i64..6, by in -6_i64..6, px in -6_i64..6, py in -6_i64..6,
        ) {
            // A multiple of every denominator at which a segment of at most 12 steps crosses x or y = k/2.
            const PARTS: i64 = 2 * 27720;
            let inside = (0..=PARTS).any(|k| {
                let x = 2 * (ax * (PARTS - k) + bx * k);
                let y = 2 * (ay * (PARTS - k) + by * k);
                let (x, y) = (x - 2 * px * PARTS, y - 2 * py * PARTS);
                (-PARTS..PARTS).contains(&x) && (-PARTS..PARTS).contains(&y)
            });
            prop_assert_eq!(meets_pixel([at(ax, ay), at(bx, by)], at(px, py)), inside);
        }

        #[test]
        fn a_crossing_does_not_depend_on_directions(
            v in prop::array::uniform8(-1_000_000_000_i64..1_000_000_000),
        ) {
            let (a, b) = ([at(v[0], v[1]), at(v[2], v[3])], [at(v[4], v[5]), at(v[6], v[7])]);
            let there = crossing(a, b);
            prop_assert_eq!(there, crossing([a[1], a[0]], b));
            prop_assert_eq!(there, crossing(a, [b[1], b[0]]));
            if let Some(p) = there {
                // Within half a step of both lines: |side| <= length * sqrt(2) / 2.
                for [s, e] in [a, b] {
                    let off = side(s, e, p) as f64 / (s.distance(e) * MICROMETRES);
                    prop_assert!(off.abs() < 0.7072);
                }
            }
        }
    }
}
