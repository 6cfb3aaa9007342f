//! Every Jacobian of the geometry against central differences.

use mapfold_map::geometry::{Level, Line, Point, Pose, Robot, wrap};
use nalgebra::{SMatrix, SVector, Vector2, Vector3};
use proptest::prelude::*;

/// Step of the differences: near the cube root of the machine's precision, where rounding and
/// curvature cost alike.
const STEP: f64 = 1e-5;
/// Largest difference from the Jacobian, relative to its largest entry or 1. Coordinates reach
/// 100 m, so rounding alone costs 100 * 2^-52 / STEP, about 2e-9.
const TOLERANCE: f64 = 1e-7;

/// d(out)/d(in) of `f` at `at` by central differences; `angles` says which outputs are angles.
fn central_differences<const M: usize, const N: usize>(
    f: impl Fn(&SVector<f64, N>) -> SVector<f64, M>,
    at: &SVector<f64, N>,
    angles: [bool; M],
) -> SMatrix<f64, M, N> {
    let mut j = SMatrix::zeros();
    for column in 0..N {
        let mut step = SVector::<f64, N>::zeros();
        step[column] = STEP;
        let difference = f(&(at + step)) - f(&(at - step));
        for row in 0..M {
            let d = if angles[row] { wrap(difference[row]) } else { difference[row] };
            j[(row, column)] = d / (2.0 * STEP);
        }
    }
    j
}

fn assert_jacobian<const M: usize, const N: usize>(
    j: &SMatrix<f64, M, N>,
    f: impl Fn(&SVector<f64, N>) -> SVector<f64, M>,
    at: &SVector<f64, N>,
    angles: [bool; M],
) {
    let numeric = central_differences(f, at, angles);
    let error = (j - numeric).abs().max() / j.abs().max().max(1.0);
    assert!(error <= TOLERANCE, "{error:e} at {at}: {j} is not {numeric}");
}

fn pose_of<A: Copy, B: Copy>(v: &Vector3<f64>) -> Pose<A, B> {
    Pose::new(v[0], v[1], v[2])
}

fn state() -> impl Strategy<Value = Vector3<f64>> {
    (-100.0..100.0_f64, -100.0..100.0_f64, -3.2..3.2_f64)
        .prop_map(|(x, y, h)| Vector3::new(x, y, h))
}

const POSE: [bool; 3] = [false, false, true];
const LINE: [bool; 2] = [false, true];

proptest! {
    #[test]
    fn of_a_point_with_respect_to_the_pose(
        at in state(),
        x in -100.0..100.0_f64,
        y in -100.0..100.0_f64,
    ) {
        let p = Point::new(x, y);
        let pose: Pose<Level, Robot> = pose_of(&at);
        let f = |v: &Vector3<f64>| pose_of::<Level, Robot>(v).act(&p);
        assert_jacobian(&pose.j_point_pose(&p), f, &at, [false, false]);
    }

    #[test]
    fn of_a_product_with_respect_to_both_factors(a in state(), b in state()) {
        let first: Pose<Level, Robot> = pose_of(&a);
        let second: Pose<Robot, Robot> = pose_of(&b);
        let (j_ac_ab, j_ac_bc) = first.j_compose(&second);
        let by_first = |v: &Vector3<f64>| pose_of::<Level, Robot>(v).compose(&second).vector();
        let by_second = |v: &Vector3<f64>| first.compose(&pose_of::<Robot, Robot>(v)).vector();
        assert_jacobian(&j_ac_ab, by_first, &a, POSE);
        assert_jacobian(&j_ac_bc, by_second, &b, POSE);
    }

    #[test]
    fn of_the_inverse(at in state()) {
        let pose: Pose<Level, Robot> = pose_of(&at);
        let f = |v: &Vector3<f64>| pose_of::<Level, Robot>(v).inverse().vector();
        assert_jacobian(&pose.j_inverse(), f, &at, POSE);
    }

    #[test]
    fn of_a_moved_line_with_respect_to_line_and_pose(
        at in state(),
        rho in 0.001..100.0_f64,
        alpha in -3.2..3.2_f64,
    ) {
        let pose: Pose<Level, Robot> = pose_of(&at);
        // rho stays positive within the step, so that normal form turns nothing.
        let line_at = |v: &Vector2<f64>| Line::<Robot>::normal_form(v[0], v[1]).0;
        let of = |pose: &Pose<Level, Robot>, line: &Line<Robot>| {
            let moved = pose.act_on_line(line);
            Vector2::new(moved.rho, moved.alpha)
        };
        let at_line = Vector2::new(rho, alpha);
        let moved = pose.act_on_line(&line_at(&at_line));
        assert_jacobian(&moved.j_line_line, |v| of(&pose, &line_at(v)), &at_line, LINE);
        assert_jacobian(&moved.j_line_pose, |v| of(&pose_of(v), &line_at(&at_line)), &at, LINE);
    }
}

#[test]
fn differences_notice_a_wrong_jacobian() {
    let wrong = nalgebra::Matrix1::new(2.001);
    let caught = std::panic::catch_unwind(|| {
        assert_jacobian(&wrong, |v| v.component_mul(v), &nalgebra::Vector1::new(1.0), [false]);
    });
    assert!(caught.is_err());
}
