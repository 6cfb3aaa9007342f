//! Convex hulls of a few points.

use super::Point;

/// The convex hull, counter-clockwise from the lowest-leftmost point, without collinear points
/// (Andrew's monotone chain, O(n log n)). One or two distinct points give themselves.
pub fn convex_hull(points: &[Point]) -> Vec<Point> {
    // Adding 0 makes -0 into 0: two names of one coordinate would sort apart and lose points.
    let mut sorted: Vec<Point> = points.iter().map(|p| p.add_scalar(0.0)).collect();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    sorted.dedup();
    if sorted.len() < 3 {
        return sorted;
    }
    let mut hull: Vec<Point> = Vec::with_capacity(2 * sorted.len());
    for half in 0..2 {
        let start = hull.len();
        let chain: &mut dyn Iterator<Item = &Point> =
            if half == 0 { &mut sorted.iter() } else { &mut sorted.iter().rev() };
        for p in chain {
            while hull.len() >= start + 2
                && (hull[hull.len() - 1] - hull[hull.len() - 2]).perp(&(p - hull[hull.len() - 1]))
                    <= 0.0
            {
                hull.pop();
            }
            hull.push(*p);
        }
        hull.pop();
    }
    hull
}

/// Distance of `p` from a convex counter-clockwise hull; 0 inside. Infinite for an empty hull.
pub fn distance_to_hull(p: &Point, hull: &[Point]) -> f64 {
    if hull.len() == 1 {
        return (p - hull[0]).norm();
    }
    let mut inside = hull.len() >= 3;
    let mut nearest = f64::INFINITY;
    for (i, a) in hull.iter().enumerate() {
        let b = hull[(i + 1) % hull.len()];
        let edge = b - a;
        let length_sq = edge.norm_squared();
        let t =
            if length_sq > 0.0 { ((p - a).dot(&edge) / length_sq).clamp(0.0, 1.0) } else { 0.0 };
        nearest = nearest.min((p - (a + edge * t)).norm());
        inside &= edge.perp(&(p - a)) >= 0.0;
    }
    if inside { 0.0 } else { nearest }
}
