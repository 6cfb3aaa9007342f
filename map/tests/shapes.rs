//! Hulls and intervals against plain definitions.

use mapfold_map::geometry::{
    Interval, Point, convex_hull, distance_to_hull, subtract_intervals, union_intervals,
    unit_normal,
};
use proptest::collection::vec;
use proptest::prelude::*;

/// Rounding of products of coordinates of up to 10 m.
const TOLERANCE_M: f64 = 1e-12;

/// Points at large, and points on a coarse lattice with many collinear and equal ones.
fn points() -> impl Strategy<Value = Vec<Point>> {
    let anywhere = (-10.0..10.0_f64, -10.0..10.0_f64).prop_map(|(x, y)| Point::new(x, y));
    let zero = prop::sample::select(vec![-2.0, -1.0, -0.0, 0.0, 1.0, 2.0]);
    let lattice = (zero.clone(), zero).prop_map(|(x, y)| Point::new(x, y));
    prop_oneof![vec(anywhere, 1..30), vec(lattice, 1..30)]
}

proptest! {
    #[test]
    fn a_hull_is_convex_holds_all_points_and_consists_of_them(points in points()) {
        let hull = convex_hull(&points);
        let n = hull.len();
        prop_assert!(!hull.is_empty());
        for i in 0..n {
            prop_assert!(points.contains(&hull[i]));
            if n >= 3 {
                let (a, b, c) = (hull[i], hull[(i + 1) % n], hull[(i + 2) % n]);
                prop_assert!((b - a).perp(&(c - b)) > 0.0, "a left turn at every corner");
            }
        }
        for p in &points {
            prop_assert!(distance_to_hull(p, &hull) <= TOLERANCE_M, "{} is outside {:?}", p, hull);
        }
    }

    #[test]
    fn a_hull_is_that_of_a_set(points in points(), seed in any::<prop::sample::Index>()) {
        let hull = convex_hull(&points);
        let mut turned = points.clone();
        turned.rotate_left(seed.index(points.len()));
        turned.reverse();
        turned.extend_from_slice(&points[..points.len() / 2]);
        prop_assert_eq!(&convex_hull(&turned), &hull);
        prop_assert_eq!(&convex_hull(&hull), &hull);
    }

    #[test]
    fn the_distance_from_a_hull_is_the_widest_gap_in_any_direction(
        points in points(),
        x in -20.0..20.0_f64,
        y in -20.0..20.0_f64,
    ) {
        // Of convex sets: the distance is the largest of d.p - max d.v over all directions d.
        let hull = convex_hull(&points);
        let p = Point::new(x, y);
        let directions = 3600;
        let gap = (0..directions)
            .map(|i| unit_normal(f64::from(i) * std::f64::consts::TAU / f64::from(directions)))
            .map(|d| d.dot(&p) - hull.iter().map(|v| d.dot(v)).fold(f64::NEG_INFINITY, f64::max))
            .fold(0.0, f64::max);
        let distance = distance_to_hull(&p, &hull);
        // The best of the directions is at most half a step off, where gap = distance * cos.
        let farthest = 60.0;
        prop_assert!(distance >= gap - TOLERANCE_M);
        prop_assert!(distance <= gap + farthest * (std::f64::consts::PI / f64::from(directions)));
    }
}

#[test]
fn minus_zero_is_zero_to_a_hull() {
    let points =
        [Point::new(-0.0, 5.0), Point::new(0.0, 1.0), Point::new(0.0, 5.0), Point::new(-0.0, 3.0)];
    assert_eq!(convex_hull(&points), [Point::new(0.0, 1.0), Point::new(0.0, 5.0)]);
}

#[test]
fn hulls_of_few_points() {
    let p = |x, y| Point::new(x, y);
    assert!(convex_hull(&[]).is_empty());
    assert_eq!(convex_hull(&[p(1.0, 2.0), p(1.0, 2.0)]), [p(1.0, 2.0)]);
    assert_eq!(
        convex_hull(&[p(2.0, 2.0), p(0.0, 0.0), p(1.0, 1.0)]),
        [p(0.0, 0.0), p(2.0, 2.0)],
        "what lies between the ends of a line is no corner"
    );
    assert!(distance_to_hull(&p(0.0, 0.0), &[]).is_infinite());
    assert!((distance_to_hull(&p(3.0, 4.0), &[p(0.0, 0.0)]) - 5.0).abs() < 1e-15);
    assert!((distance_to_hull(&p(1.0, 1.0), &[p(0.0, 0.0), p(2.0, 0.0)]) - 1.0).abs() < 1e-15);
}

/// Which of the millimetres 0..200 (each as the open piece up to the next) intervals cover.
fn covered(intervals: &[Interval]) -> Vec<bool> {
    (0..200).map(|mm| intervals.iter().any(|i| i.from <= mm && mm < i.to)).collect()
}

fn intervals() -> impl Strategy<Value = Vec<Interval>> {
    vec((0..200_i64, 0..200_i64).prop_map(|(from, to)| Interval { from, to }), 0..12)
}

fn assert_disjoint_ascending(intervals: &[Interval], apart: i64) {
    assert!(intervals.iter().all(|i| i.from < i.to));
    assert!(intervals.windows(2).all(|w| w[1].from - w[0].to > apart), "{intervals:?}");
}

proptest! {
    #[test]
    fn a_union_covers_what_its_parts_cover(parts in intervals()) {
        let union = union_intervals(&parts, 0);
        assert_disjoint_ascending(&union, 0);
        prop_assert_eq!(covered(&union), covered(&parts));
    }

    #[test]
    fn a_bridged_union_closes_the_gaps_up_to_the_bridge_and_no_other(
        parts in intervals(),
        bridge in 0..40_i64,
    ) {
        let union = union_intervals(&parts, bridge);
        assert_disjoint_ascending(&union, bridge);
        // Filling every gap of the plain union that is not wider gives the same.
        let plain = union_intervals(&parts, 0);
        let gaps = plain.windows(2).map(|w| Interval { from: w[0].to, to: w[1].from });
        let filled: Vec<Interval> =
            plain.iter().copied().chain(gaps.filter(|g| g.length() <= bridge)).collect();
        prop_assert_eq!(covered(&union), covered(&filled));
    }

    #[test]
    fn a_union_is_that_of_a_set(parts in intervals(), bridge in 0..40_i64) {
        let mut reversed = parts.clone();
        reversed.reverse();
        reversed.extend_from_slice(&parts);
        prop_assert_eq!(union_intervals(&reversed, bridge), union_intervals(&parts, bridge));
    }

    #[test]
    fn a_difference_is_what_is_left(a in intervals(), b in intervals()) {
        let (a, b) = (union_intervals(&a, 0), union_intervals(&b, 0));
        let left = subtract_intervals(&a, &b);
        prop_assert!(left.iter().all(|i| i.from < i.to));
        prop_assert!(left.windows(2).all(|w| w[0].to <= w[1].from));
        let expected: Vec<bool> =
            covered(&a).into_iter().zip(covered(&b)).map(|(a, b)| a && !b).collect();
        prop_assert_eq!(covered(&left), expected);
    }

    #[test]
    fn an_interval_between_two_coordinates_has_no_direction(a in -1e5..1e5_f64, b in -1e5..1e5_f64) {
        let there = Interval::from_metres(a, b);
        prop_assert_eq!(there, Interval::from_metres(b, a));
        prop_assert!((there.from_m() - a.min(b)).abs() <= 0.000_500_1);
        prop_assert!((there.to_m() - a.max(b)).abs() <= 0.000_500_1);
        prop_assert_eq!(Interval::from_metres(there.from_m(), there.to_m()), there);
    }

    #[test]
    fn a_gap_is_negative_exactly_where_two_intervals_share_something(
        a in (0..100_i64, 1..50_i64),
        b in (0..100_i64, 1..50_i64),
    ) {
        let [a, b] = [a, b].map(|(from, length)| Interval { from, to: from + length });
        let shared = covered(&[a]).into_iter().zip(covered(&[b])).any(|(a, b)| a && b);
        prop_assert_eq!(a.gap(&b) < 0, shared);
        prop_assert_eq!(a.gap(&b), b.gap(&a));
    }
}
