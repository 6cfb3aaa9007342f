//! Whether a polyline or ring meets itself, by predicates without rounding errors (Shewchuk 1997).

use robust::{Coord, orient2d};

use crate::geometry::Point;

/// On which side of the line from `a` to `b` the point `c` lies: positive on the left.
fn side(a: &Point, b: &Point, c: &Point) -> f64 {
    let coord = |p: &Point| Coord { x: p.x, y: p.y };
    orient2d(coord(a), coord(b), coord(c))
}

/// Twice the signed area of a ring: positive if it runs counter-clockwise.
pub(super) fn doubled_area(ring: &[Point]) -> f64 {
    let Some(origin) = ring.first() else { return 0.0 };
    ring.windows(2).map(|edge| (edge[0] - origin).perp(&(edge[1] - origin))).sum()
}

/// Two edges that meet elsewhere than in the vertex between them, the closest such pair by number:
/// an edge is called by the number of its first vertex. `None` if there are none, so that the
/// outline is simple. O(n log n) for outlines that do not run to and fro many times.
pub(super) fn first_crossing(vertices: &[Point], is_closed: bool) -> Option<(usize, usize)> {
    let count = vertices.len();
    let edges = if is_closed { count } else { count.saturating_sub(1) };
    let ends = |edge: usize| (vertices[edge], vertices[(edge + 1) % count]);
    // Sweep from left to right: only edges whose extents overlap are held against each other.
    let mut by_left: Vec<(f64, f64, usize)> = (0..edges)
        .map(|edge| {
            let (a, b) = ends(edge);
            (a.x.min(b.x), a.x.max(b.x), edge)
        })
        .collect();
    by_left.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
    let mut first: Option<(usize, usize)> = None;
    for (i, &(_, right, edge)) in by_left.iter().enumerate() {
        for &(_, _, other) in by_left[i + 1..].iter().take_while(|next| next.0 <= right) {
            let (a, b) = (edge.min(other), edge.max(other));
            let meet = if b == a + 1 {
                folds_back(ends(a), ends(b).1)
            } else if is_closed && a == 0 && b == edges - 1 {
                folds_back(ends(b), ends(a).1)
            } else {
                meet(ends(a), ends(b))
            };
            if meet && first.is_none_or(|(c, d)| (b - a, a) < (d - c, c)) {
                first = Some((a, b));
            }
        }
    }
    first
}

/// Whether an edge and the one from its end to `next` share more than that end.
fn folds_back((a, b): (Point, Point), next: Point) -> bool {
    a == b || b == next || (side(&a, &b, &next) == 0.0 && (a - b).dot(&(next - b)) > 0.0)
}

/// Whether two edges share a point.
fn meet((a, b): (Point, Point), (c, d): (Point, Point)) -> bool {
    let extents_overlap = a.inf(&b).x <= c.sup(&d).x
        && c.inf(&d).x <= a.sup(&b).x
        && a.inf(&b).y <= c.sup(&d).y
        && c.inf(&d).y <= a.sup(&b).y;
    let straddle = |a: &Point, b: &Point, c: &Point, d: &Point| {
        let (left, right) = (side(a, b, c), side(a, b, d));
        !((left > 0.0 && right > 0.0) || (left < 0.0 && right < 0.0))
    };
    // If all four lie on one line, overlapping extents are a shared point.
    extents_overlap && straddle(&a, &b, &c, &d) && straddle(&c, &d, &a, &b)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chance::Chance;

    fn points(list: &[(f64, f64)]) -> Vec<Point> {
        list.iter().map(|(x, y)| Point::new(*x, *y)).collect()
    }

    #[test]
    fn a_square_is_simple_and_counter_clockwise_is_positive() {
        let square = points(&[(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)]);
        assert_eq!(first_crossing(&square, true), None);
        assert_eq!(first_crossing(&square, false), None);
        assert!((doubled_area(&square) - 8.0).abs() < 1e-12);
        let turned: Vec<Point> = square.into_iter().rev().collect();
        assert!((doubled_area(&turned) + 8.0).abs() < 1e-12);
    }

    #[test]
    fn a_bow_tie_crosses_in_its_middle() {
        let tie = points(&[(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)]);
        assert_eq!(first_crossing(&tie, true), Some((0, 2)));
        assert_eq!(first_crossing(&tie, false), Some((0, 2)));
    }

    #[test]
    fn touching_and_folding_back_count_as_meeting() {
        let touching = points(&[(0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (1.0, 0.0)]);
        assert_eq!(first_crossing(&touching, false), Some((0, 2)));
        let folded = points(&[(0.0, 0.0), (2.0, 0.0), (1.0, 0.0)]);
        assert_eq!(first_crossing(&folded, false), Some((0, 1)));
        let straight = points(&[(0.0, 0.0), (2.0, 0.0), (3.0, 0.0)]);
        assert_eq!(first_crossing(&straight, false), None);
    }

    #[test]
    fn the_sweep_finds_what_comparing_all_pairs_finds() {
        let mut chance = Chance(7);
        let mut chance = || (chance.share() * 8.0).floor();
        for _ in 0..2000 {
            let outline: Vec<Point> = (0..6).map(|_| Point::new(chance(), chance())).collect();
            let ends = |edge: usize| (outline[edge], outline[edge + 1]);
            let mut crossings = Vec::new();
            for a in 0..5 {
                for b in a + 1..5 {
                    let met = if b == a + 1 {
                        folds_back(ends(a), ends(b).1)
                    } else {
                        meet(ends(a), ends(b))
                    };
                    crossings.extend(met.then_some((b - a, a)));
                }
            }
            let expected = crossings.into_iter().min().map(|(apart, a)| (a, a + apart));
            assert_eq!(first_crossing(&outline, false), expected);
        }
    }
}
