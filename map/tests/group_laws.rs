//! Laws that poses, lines and their covariances keep.

#![expect(clippy::expect_used, reason = "a test fails by panicking")]

use std::f64::consts::{PI, TAU};

use mapfold_map::geometry::{
    Covariance, Level, Line, Odom, Point, Pose, Robot, Sensor, UncertainLine, UncertainPose,
    difference, tangent, unit_normal, wrap,
};
use nalgebra::SMatrix;
use proptest::prelude::*;

/// Coordinates reach 100 m in each of up to three factors: a few hundred metres at 2^-52 each,
/// with a wide margin.
const TOLERANCE_M: f64 = 1e-11;
/// Sums of a few angles.
const TOLERANCE_RAD: f64 = 1e-13;
/// Of covariances, relative to the largest entry that took part.
const TOLERANCE_RELATIVE: f64 = 1e-12;

fn pose<A: Copy + std::fmt::Debug, B: Copy + std::fmt::Debug>() -> impl Strategy<Value = Pose<A, B>>
{
    let heading = prop_oneof![-4.0..4.0_f64, prop::sample::select(vec![0.0, PI, -PI, PI / 2.0])];
    (-100.0..100.0_f64, -100.0..100.0_f64, heading).prop_map(|(x, y, h)| Pose::new(x, y, h))
}

/// `L L^T` of a random L, in units of `sds`.
fn covariance<const N: usize>(sds: [f64; N]) -> impl Strategy<Value = Covariance<N>> {
    prop::collection::vec(-1.0..1.0_f64, N * N).prop_map(move |entries| {
        let l = SMatrix::<f64, N, N>::from_fn(|i, j| entries[N * i + j] * sds[i]);
        Covariance::new(l * l.transpose()).expect("L L^T is positive semi-definite")
    })
}

fn uncertain_pose<A: Copy + std::fmt::Debug, B: Copy + std::fmt::Debug>()
-> impl Strategy<Value = UncertainPose<A, B>> {
    (pose(), covariance([0.3, 0.3, 0.1]))
        .prop_map(|(pose, covariance)| UncertainPose { pose, covariance })
}

fn uncertain_line<F: Copy + std::fmt::Debug>() -> impl Strategy<Value = UncertainLine<F>> {
    (0.0..100.0_f64, -3.2..3.2_f64, covariance([0.05, 0.02]))
        .prop_map(|(rho, alpha, c)| UncertainLine::normal_form(rho, alpha, c).0)
}

fn assert_same_pose<A: Copy, B: Copy>(a: &Pose<A, B>, b: &Pose<A, B>) {
    assert!((a.position() - b.position()).norm() <= TOLERANCE_M);
    assert!(difference(a.heading(), b.heading()).abs() <= TOLERANCE_RAD);
}

fn assert_same_covariance<const N: usize>(a: &Covariance<N>, b: &Covariance<N>, scale: f64) {
    let error = (a.matrix() - b.matrix()).amax();
    assert!(error <= TOLERANCE_RELATIVE * scale, "{error:e}: {a:?} is not {b:?}");
}

/// The line seen in frame `A`, the pose being certain. The flag says whether it was turned round.
fn moved<A: Copy, B: Copy>(
    a_from_b: &Pose<A, B>,
    line: &UncertainLine<B>,
) -> (UncertainLine<A>, bool) {
    let moved = a_from_b.act_on_line(&line.line);
    let covariance = line.covariance.transformed(&moved.j_line_line);
    UncertainLine::normal_form(moved.rho, moved.alpha, covariance)
}

proptest! {
    #[test]
    fn wrapping_keeps_the_angle_and_the_bits_of_what_is_in_range(angle in -1e6..1e6_f64) {
        let wrapped = wrap(angle);
        prop_assert!(wrapped > -PI && wrapped <= PI);
        prop_assert_eq!(wrap(wrapped).to_bits(), wrapped.to_bits());
        let turns = (angle - wrapped) / TAU;
        prop_assert!((turns - turns.round()).abs() < 1e-9);
    }

    #[test]
    fn an_angle_in_range_keeps_its_bits(angle in -PI.next_down()..=PI, exponent in -300..=0) {
        for angle in [angle, angle * 10.0_f64.powi(exponent)] {
            prop_assert_eq!(wrap(angle).to_bits(), angle.to_bits());
        }
    }

    #[test]
    fn any_finite_angle_wraps_into_range(bits in any::<u64>()) {
        let angle = f64::from_bits(bits);
        prop_assume!(angle.is_finite());
        let wrapped = wrap(angle);
        prop_assert!(wrapped > -PI && wrapped <= PI);
    }

    #[test]
    fn poses_compose_associatively(
        a in pose::<Level, Odom>(),
        b in pose::<Odom, Robot>(),
        c in pose::<Robot, Sensor>(),
    ) {
        assert_same_pose(&a.compose(&b).compose(&c), &a.compose(&b.compose(&c)));
    }

    #[test]
    fn the_identity_changes_no_bit(a in pose::<Level, Robot>()) {
        prop_assert_eq!(a.compose(&Pose::<Robot, Robot>::identity()), a);
        prop_assert_eq!(Pose::<Level, Level>::identity().compose(&a), a);
    }

    #[test]
    fn a_pose_and_its_inverse_cancel(a in pose::<Level, Robot>()) {
        assert_same_pose(&a.compose(&a.inverse()), &Pose::identity());
        assert_same_pose(&a.inverse().compose(&a), &Pose::identity());
        assert_same_pose(&a.inverse().inverse(), &a);
    }

    #[test]
    fn acting_twice_is_acting_with_the_product(
        a in pose::<Level, Robot>(),
        b in pose::<Robot, Sensor>(),
        x in -100.0..100.0_f64,
        y in -100.0..100.0_f64,
    ) {
        let p = Point::new(x, y);
        prop_assert!((a.act(&b.act(&p)) - a.compose(&b).act(&p)).norm() <= TOLERANCE_M);
        prop_assert!((a.inverse().act(&a.act(&p)) - p).norm() <= TOLERANCE_M);
    }

    #[test]
    fn uncertain_poses_compose_associatively(
        a in uncertain_pose::<Level, Odom>(),
        b in uncertain_pose::<Odom, Robot>(),
        c in uncertain_pose::<Robot, Sensor>(),
    ) {
        let left = a.compose(&b).compose(&c);
        let right = a.compose(&b.compose(&c));
        assert_same_pose(&left.pose, &right.pose);
        assert_same_covariance(&left.covariance, &right.covariance, left.covariance.matrix().amax());
    }

    #[test]
    fn the_inverse_of_a_product_is_the_product_of_the_inverses(
        a in uncertain_pose::<Level, Robot>(),
        b in uncertain_pose::<Robot, Sensor>(),
    ) {
        let left = a.compose(&b).inverse();
        let right = b.inverse().compose(&a.inverse());
        assert_same_pose(&left.pose, &right.pose);
        let scale = a.compose(&b).covariance.matrix().amax().max(right.covariance.matrix().amax());
        assert_same_covariance(&left.covariance, &right.covariance, scale);
    }

    #[test]
    fn inverting_twice_gives_the_covariance_back(a in uncertain_pose::<Level, Robot>()) {
        let scale = a.inverse().covariance.matrix().amax().max(a.covariance.matrix().amax());
        assert_same_covariance(&a.inverse().inverse().covariance, &a.covariance, scale);
    }

    #[test]
    fn results_of_the_algebra_are_symmetric_to_the_bit(
        a in uncertain_pose::<Level, Robot>(),
        b in uncertain_pose::<Robot, Sensor>(),
        line in uncertain_line::<Robot>(),
    ) {
        for c in [a.compose(&b).covariance, a.inverse().covariance] {
            prop_assert_eq!(*c.matrix(), c.matrix().transpose());
            prop_assert_eq!(Covariance::from_rows(c.rows()), Ok(c));
        }
        let c = moved(&a.pose, &line).0.covariance;
        prop_assert_eq!(*c.matrix(), c.matrix().transpose());
        prop_assert_eq!(Covariance::from_rows(c.rows()), Ok(c));
    }

    #[test]
    fn a_line_moved_there_and_back_is_the_line(
        a in pose::<Level, Robot>(),
        line in uncertain_line::<Robot>(),
    ) {
        // So near the origin, rounding may turn the normal round: another name of the same line.
        prop_assume!(line.line.rho() > 1e-6);
        let (there, turned) = moved(&a, &line);
        let (back, turned_back) = moved(&a.inverse(), &there);
        prop_assert_eq!(turned, turned_back, "turned round as often as back");
        prop_assert!((back.line.rho() - line.line.rho()).abs() <= TOLERANCE_M);
        prop_assert!(difference(back.line.alpha(), line.line.alpha()).abs() <= TOLERANCE_RAD);
        let scale = there.covariance.matrix().amax().max(line.covariance.matrix().amax());
        assert_same_covariance(&back.covariance, &line.covariance, scale);
    }

    #[test]
    fn moving_a_line_twice_is_moving_it_by_the_product(
        a in pose::<Level, Robot>(),
        b in pose::<Robot, Sensor>(),
        line in uncertain_line::<Sensor>(),
    ) {
        let middle = moved(&b, &line).0;
        let twice = moved(&a, &middle).0;
        let once = moved(&a.compose(&b), &line).0;
        prop_assume!(once.line.rho() > 1e-6);
        prop_assert!((twice.line.rho() - once.line.rho()).abs() <= TOLERANCE_M);
        prop_assert!(difference(twice.line.alpha(), once.line.alpha()).abs() <= TOLERANCE_RAD);
        let scale = middle.covariance.matrix().amax().max(once.covariance.matrix().amax());
        assert_same_covariance(&twice.covariance, &once.covariance, scale);
    }

    #[test]
    fn a_moved_line_goes_through_the_moved_points(
        a in pose::<Level, Robot>(),
        line in uncertain_line::<Robot>(),
        t in -100.0..100.0_f64,
        length in 0.1..100.0_f64,
        off in -10.0..10.0_f64,
    ) {
        let (there, turned) = moved(&a, &line);
        let sign = if turned { -1.0 } else { 1.0 };
        let [p, q] = [t, t + length].map(|t| a.act(&line.line.at(t)));
        prop_assert!(there.line.across(&p).abs() <= TOLERANCE_M);
        prop_assert!(there.line.across(&q).abs() <= TOLERANCE_M);
        // Coordinates along the line keep their differences, up to the sign.
        let along = there.line.along(&q) - there.line.along(&p);
        prop_assert!((along - sign * length).abs() <= TOLERANCE_M);
        // So do distances from it.
        let beside = line.line.at(t) + unit_normal(line.line.alpha()) * off;
        prop_assert!((there.line.across(&a.act(&beside)) - sign * off).abs() <= TOLERANCE_M);
    }

    #[test]
    fn a_line_in_normal_form_is_the_same_line_with_its_covariance_turned(
        rho in -100.0..100.0_f64,
        alpha in -7.0..7.0_f64,
        c in covariance([0.05, 0.02]),
        t in -50.0..50.0_f64,
    ) {
        let (normal, turned) = UncertainLine::<Level>::normal_form(rho, alpha, c);
        prop_assert_eq!(turned, rho < 0.0);
        prop_assert!(normal.line.rho() >= 0.0);
        let p = unit_normal(alpha) * rho + tangent(alpha) * t;
        prop_assert!(normal.line.across(&p).abs() <= TOLERANCE_M);
        // The variance of the line's distance from a fixed point does not depend on the form.
        let variance = |c: &Covariance<2>, along: f64| {
            let m = c.matrix();
            m[(0, 0)] - 2.0 * along * m[(0, 1)] + along * along * m[(1, 1)]
        };
        let before = variance(&c, t);
        let after = variance(&normal.covariance, normal.line.along(&p));
        let scale = c.matrix().amax() * (1.0 + t * t);
        prop_assert!((before - after).abs() <= TOLERANCE_RELATIVE * scale);
    }

    #[test]
    fn a_point_of_a_line_is_where_its_coordinates_say(
        rho in 0.0..100.0_f64,
        alpha in -3.2..3.2_f64,
        t in -100.0..100.0_f64,
    ) {
        let line = Line::<Level>::normal_form(rho, alpha).0;
        let p = line.at(t);
        prop_assert!((line.along(&p) - t).abs() <= TOLERANCE_M);
        prop_assert!(line.across(&p).abs() <= TOLERANCE_M);
        prop_assert!((p.norm() - rho.hypot(t)).abs() <= TOLERANCE_M);
    }
}

#[test]
fn a_quarter_turn_moves_a_wall_as_on_paper() {
    // The robot stands at (10, 0) and looks up; the wall one metre ahead of it is y = 1.
    let level_from_robot = Pose::<Level, Robot>::new(10.0, 0.0, PI / 2.0);
    let ahead = Line::<Robot>::normal_form(1.0, 0.0).0;
    let seen = level_from_robot.act_on_line(&ahead);
    assert!((seen.rho - 1.0).abs() < 1e-12 && (seen.alpha - PI / 2.0).abs() < 1e-12);
    // The wall two metres to its right is x = 12.
    let right = Line::<Robot>::normal_form(2.0, -PI / 2.0).0;
    let seen = level_from_robot.act_on_line(&right);
    assert!((seen.rho - 12.0).abs() < 1e-12 && seen.alpha.abs() < 1e-12);
}
