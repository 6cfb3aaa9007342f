//! Convex hulls of a few points.

use super::Point;

/// The convex hull, counter-clockwise from the lowest-leftmost point, without collinear points
/// (Andrew's monotone chain, O(n log n)). One or two distinct points give themselves.
pub fn convex_hull(points: &[Point]) -> Vec<Point> {
    let mut hull = Vec::new();
    convex_hull_into(&mut points.to_vec(), &mut hull);
    hull
}

/// The convex hull of `points`, which are left sorted, in place of what `hull` holds.
pub fn convex_hull_into(points: &mut Vec<Point>, hull: &mut Vec<Point>) {
    hull.clear();
    for p in points.iter_mut() {
        // Adding 0 makes -0 into 0: two names of one coordinate would sort apart and lose points.
        *p = p.add_scalar(0.0);
    }
    // Equal points are the same bits: a sort that is not stable gives the same order.
    points.sort_unstable_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    points.dedup();
    if points.len() < 3 {
        hull.extend_from_slice(points);
        return;
    }
    half_hull(points.iter(), hull);
    half_hull(points.iter().rev(), hull);
}

/// The convex hull of points that lie counter-clockwise about the origin in their order, less than half a turn from the
/// first to the last, in place of what `hull` holds: as [`convex_hull`], without a sort.
pub fn convex_hull_of_sweep(points: &[Point], hull: &mut Vec<Point>) {
    hull.clear();
    if points.len() < 3 {
        // A chain leaves out its last point, which is the first of the other one.
        hull.extend_from_slice(points);
    } else {
        // Seen from the origin, one chain is the far side and one the near side.
        half_hull(points.iter(), hull);
        half_hull(points.iter().rev(), hull);
    }
    hull.dedup();
    for p in hull.iter_mut() {
        *p = p.add_scalar(0.0);
    }
    let order = |a: &Point, b: &Point| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y));
    if let Some(first) = (0..hull.len()).min_by(|a, b| order(&hull[*a], &hull[*b])) {
        hull.rotate_left(first);
    }
}

/// One half of the hull: the turns to the left, without the last point.
fn half_hull<'a>(points: impl Iterator<Item = &'a Point>, hull: &mut Vec<Point>) {
    let start = hull.len();
    for p in points {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::unit_normal;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_sweep_needs_no_sort(
            ranges in prop::collection::vec(0.2..3.0, 1..40), first in -4.0..4.0, turn in 0.001..0.07,
        ) {
            let points: Vec<Point> =
                ranges.iter().enumerate().map(|(i, r)| unit_normal(first + turn * i as f64) * *r).collect();
            let mut hull = Vec::new();
            convex_hull_of_sweep(&points, &mut hull);
            prop_assert_eq!(hull, convex_hull(&points));
        }
    }
}
