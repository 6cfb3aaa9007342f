//! Where two pieces of wall meet: whether they do, how well, and in which point.
//!
//! A joint leads from the head of one piece to the tail of another, so that whoever walks along
//! both has free space on the left all the way.

use nalgebra::Matrix2;

use super::chain::Vertex;
use super::piece::{End, Piece};
use super::{EndKind, VectorConfig};
use crate::geometry::{Covariance, Point};

/// How two pieces meet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Joint {
    /// The vertex that they share.
    pub(super) vertex: Vertex,
    /// Sum of the squared distances from both ends, each in units of what is allowed: 0 to 2.
    pub(super) cost: f64,
}

impl Joint {
    /// The joint from the head of `a` to the tail of `b`; `None` if they do not meet.
    pub(super) fn new(a: &Piece, b: &Piece, config: &VectorConfig) -> Option<Self> {
        let sine = a.direction.perp(&b.direction);
        if sine.abs() > config.corner_sine_min {
            corner(a, b, sine, config)
        } else if a.direction.dot(&b.direction) > 0.0 {
            straight(a, b, config)
        } else {
            None
        }
    }
}

/// How far along `piece` its `end` may lie from where another wall meets it, whose place along
/// the piece has the variance `crossing`.
fn reach(end: &End, crossing: f64, config: &VectorConfig) -> f64 {
    let sd = (end.along_variance + crossing).sqrt();
    (config.joint_margin + 3.0 * sd).min(config.joint_max)
}

/// Two lines that cross: the vertex is the intersection, `A dx = (offset errors at x)` with the
/// normals as rows of `A`.
fn corner(a: &Piece, b: &Piece, sine: f64, config: &VectorConfig) -> Option<Joint> {
    let may_be_corner = |end: &End| matches!(end.kind, EndKind::Corner | EndKind::Jump);
    if !may_be_corner(&a.head) || !may_be_corner(&b.tail) {
        return None;
    }
    // a.head + s a.direction = b.tail - t b.direction
    let gap = b.tail.at - a.head.at;
    let (s, t) = (gap.perp(&b.direction) / sine, a.direction.perp(&gap) / sine);
    let x = a.head.at + a.direction * s;
    let (va, vb) = (a.offset_variances(&x), b.offset_variances(&x));
    let crossing = |v: [f64; 2]| (v[0] + v[1]) / (sine * sine);
    let reach_a = reach(&a.head, crossing(vb), config);
    let reach_b = reach(&b.tail, crossing(va), config);
    // A corner may cut an end that looks saw too long, but not most of a wall.
    let near = |s: f64, reach: f64, length: f64| s.abs() <= reach && s > -0.5 * length;
    if !near(s, reach_a, a.length) || !near(t, reach_b, b.length) {
        return None;
    }
    // An error of a's line along its normal moves x along b, and the other way round.
    let (by_a, by_b) = (b.direction / sine, a.direction / sine);
    let covariance = of_two(by_a, va, by_b, vb);
    let cost = (s / reach_a).powi(2) + (t / reach_b).powi(2);
    Some(Joint { vertex: Vertex { at: x, covariance }, cost })
}

/// Covariance of a point that is moved by `a` and by `b` for each metre of two offset errors with
/// the given (independent, shared) variances.
///
/// How the shared errors of the two lines hang together is not known. Whatever it is,
/// `(P + Q) (P aa^T + Q bb^T)`, with their standard deviations P and Q, is not too small: it exceeds the
/// covariance with correlation c by `P Q (aa^T + bb^T - c (ab^T + ba^T))`, which is not negative.
fn of_two(a: Point, va: [f64; 2], b: Point, vb: [f64; 2]) -> Covariance<2> {
    let (p, q) = (va[1].sqrt(), vb[1].sqrt());
    let square = |v: Point| v * v.transpose();
    Covariance::symmetrised(square(a) * (va[0] + (p + q) * p) + square(b) * (vb[0] + (p + q) * q))
}

/// One line that goes on as another: the vertex lies halfway between the two ends.
fn straight(a: &Piece, b: &Piece, config: &VectorConfig) -> Option<Joint> {
    let gap = b.tail.at - a.head.at;
    let (along, across) = (gap.dot(&a.direction), gap.dot(&a.left()));
    let overlap_max = (0.5 * a.length.min(b.length)).min(config.gap_max);
    if along > config.gap_max || along <= -overlap_max || across.abs() > config.duplicate_offset {
        return None;
    }
    let (va, vb) = (a.offset_variances(&a.head.at), b.offset_variances(&b.tail.at));
    let (p, q) = (va[1].sqrt(), vb[1].sqrt());
    let shared = 0.25 * (p + q) * (p + q);
    // Where two estimates of a wall disagree, it is not known better than that.
    let disagreement = 0.25 * across * across;
    let normal = 0.25 * (va[0] + vb[0]) + shared + disagreement;
    let tangential = config.end_sd * config.end_sd + shared + along * along / 12.0;
    let (u, n) = (a.direction, a.left());
    let covariance = u * u.transpose() * tangential + n * n.transpose() * normal;
    let cost = (along / config.gap_max).powi(2) + (across / config.duplicate_offset).powi(2);
    Some(Joint {
        vertex: Vertex {
            at: (a.head.at + b.tail.at) * 0.5,
            covariance: Covariance::symmetrised(covariance),
        },
        cost,
    })
}

/// The vertex at an end that nothing meets: across as uncertain as the line is there, along as the
/// end is.
pub(super) fn free_end(piece: &Piece, end: &End) -> Vertex {
    let [independent, dependent] = piece.offset_variances(&end.at);
    let (u, n) = (piece.direction, piece.left());
    let covariance: Matrix2<f64> =
        u * u.transpose() * end.along_variance + n * n.transpose() * (independent + dependent);
    Vertex { at: end.at, covariance: Covariance::symmetrised(covariance) }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use nalgebra::{Matrix2x4, Matrix4};

    use super::*;
    use crate::chance::Chance;
    use crate::geometry::{Interval, Level, Line, tangent};
    use crate::raster::LogOdds;
    use crate::vector::{Facing, Segment, SolidInterval};

    const CONFIG: VectorConfig = VectorConfig::STANDARD;

    fn covariance(a: f64, b: f64, c: f64) -> Covariance<2> {
        Covariance::new(Matrix2::new(a, b, b, c)).unwrap()
    }

    /// The wall from `a` to `b` with free space on its left, its line moved by (rho, alpha).
    fn piece(
        a: Point,
        b: Point,
        moved: [f64; 2],
        [independent, dependent]: [Covariance<2>; 2],
    ) -> Piece {
        let way = (b - a).normalize();
        let left = Point::new(-way.y, way.x);
        let (rho, alpha) = (left.dot(&a), left.y.atan2(left.x));
        let (line, turned) = Line::<Level>::normal_form(rho, alpha);
        let sign = if turned { -1.0 } else { 1.0 };
        let line_moved = Line::normal_form(line.rho() + moved[0], line.alpha() + moved[1]).0;
        let u = tangent(alpha) * sign;
        let ends = [u.dot(&a), u.dot(&b)];
        let segment = Arc::new(Segment {
            line: line_moved,
            independent,
            dependent,
            facing: if turned { Facing::Origin } else { Facing::Away },
            solid: vec![SolidInterval {
                span: Interval::from_metres(ends[0], ends[1]),
                ends: [EndKind::Corner; 2],
                existence: LogOdds(289),
            }],
            looks: 1,
            robots: Vec::new(),
            first_seen_us: 0,
            last_seen_us: 0,
        });
        Piece::of(&segment, &CONFIG).next().unwrap()
    }

    /// A room's corner at an angle, some way from the origin.
    const CORNER: [Point; 3] =
        [Point::new(52.0, 31.0), Point::new(57.0, 33.0), Point::new(55.5, 37.0)];

    /// Line covariances about the origin as they are 60 m away from it.
    fn uncertain(along: f64, offset_sd: f64, angle_sd: f64) -> Covariance<2> {
        let (r, q) = (offset_sd * offset_sd, angle_sd * angle_sd);
        covariance(r + along * along * q, along * q, q)
    }

    fn joint(moved: [f64; 4], parts: [[Covariance<2>; 2]; 2]) -> Joint {
        let [a, x, b] = CORNER;
        let first = piece(a, x, [moved[0], moved[1]], parts[0]);
        let second = piece(x, b, [moved[2], moved[3]], parts[1]);
        Joint::new(&first, &second, &CONFIG).unwrap()
    }

    /// Coordinates of the corner along the two lines.
    fn along() -> [f64; 2] {
        let [a, x, b] = CORNER;
        [(a, x), (x, b)].map(|(from, to)| {
            let made = piece(from, to, [0.0; 2], [Covariance::zero(); 2]);
            made.segment.line.along(&x)
        })
    }

    fn jacobian() -> Matrix2x4<f64> {
        let exact = [[Covariance::zero(); 2]; 2];
        let step = 1e-6;
        let columns: Vec<Point> = (0..4)
            .map(|i| {
                let at = |by: f64| {
                    let mut moved = [0.0; 4];
                    moved[i] = by;
                    joint(moved, exact).vertex.at
                };
                (at(step) - at(-step)) / (2.0 * step)
            })
            .collect();
        Matrix2x4::from_columns(&columns)
    }

    #[test]
    fn exact_lines_give_the_exact_corner_at_any_angle() {
        let [_, x, _] = CORNER;
        for step in 0..24 {
            let angle = f64::from(step) * std::f64::consts::TAU / 24.0;
            let (s, c) = angle.sin_cos();
            let turn = |p: Point| Point::new(c * p.x - s * p.y, s * p.x + c * p.y);
            let [a, b] = [CORNER[0], CORNER[2]].map(turn);
            let parts = [Covariance::zero(); 2];
            let (first, second) =
                (piece(a, turn(x), [0.0; 2], parts), piece(turn(x), b, [0.0; 2], parts));
            let joint = Joint::new(&first, &second, &CONFIG).unwrap();
            assert!((joint.vertex.at - turn(x)).norm() < 1e-9);
            assert!(joint.cost < 1e-3, "ends are whole millimetres: {}", joint.cost);
        }
    }

    #[test]
    fn independent_errors_reach_the_corner_through_its_jacobian() {
        let [ta, tb] = along();
        let own = [uncertain(ta, 0.01, 0.004), uncertain(tb, 0.02, 0.003)];
        let parts = own.map(|c| [c, Covariance::zero()]);
        let mut both = Matrix4::zeros();
        both.fixed_view_mut::<2, 2>(0, 0).copy_from(own[0].matrix());
        both.fixed_view_mut::<2, 2>(2, 2).copy_from(own[1].matrix());
        let j = jacobian();
        let expected = j * both * j.transpose();
        let claimed = joint([0.0; 4], parts).vertex.covariance;
        let difference = (claimed.matrix() - expected).norm() / expected.norm();
        assert!(difference < 1e-5, "{difference}: {claimed:?} {expected}");
    }

    #[test]
    fn shared_errors_of_any_correlation_are_covered_and_not_by_more_than_twice() {
        let [ta, tb] = along();
        let shared = [uncertain(ta, 0.03, 0.002), uncertain(tb, 0.01, 0.004)];
        let claimed = joint([0.0; 4], shared.map(|c| [Covariance::zero(), c])).vertex.covariance;
        let j = jacobian();
        let roots = shared.map(|c| nalgebra::Cholesky::new(*c.matrix()).unwrap().l());
        let mut closest = f64::INFINITY;
        for turn in 0..16 {
            for length in [0.0, 0.5, 1.0] {
                // The second line's error follows the first's by any rotation, more or less so.
                let (s, c) = (f64::from(turn) * std::f64::consts::TAU / 16.0).sin_cos();
                let cross = roots[0] * Matrix2::new(c, -s, s, c) * length * roots[1].transpose();
                let mut both = Matrix4::zeros();
                both.fixed_view_mut::<2, 2>(0, 0).copy_from(shared[0].matrix());
                both.fixed_view_mut::<2, 2>(2, 2).copy_from(shared[1].matrix());
                both.fixed_view_mut::<2, 2>(0, 2).copy_from(&cross);
                both.fixed_view_mut::<2, 2>(2, 0).copy_from(&cross.transpose());
                let actual = j * both * j.transpose();
                let left = claimed.matrix() - actual;
                let least = left.symmetric_eigenvalues().min();
                assert!(least >= -1e-6 * actual.norm(), "{least}: {claimed:?} {actual}");
                if length == 0.0 {
                    let ratio = claimed.matrix().trace() / actual.trace();
                    assert!(ratio <= 2.0 + 1e-6, "{ratio}");
                }
                closest = closest.min(least / actual.norm());
            }
        }
        assert!(closest < 0.05, "the bound is touched where they hang together most: {closest}");
    }

    #[test]
    fn a_monte_carlo_of_lines_scatters_corners_as_claimed() {
        let [ta, tb] = along();
        let own = [uncertain(ta, 0.01, 0.0008), uncertain(tb, 0.02, 0.0006)];
        let claimed = joint([0.0; 4], own.map(|c| [c, Covariance::zero()])).vertex.covariance;
        let roots = own.map(|c| nalgebra::Cholesky::new(*c.matrix()).unwrap().l());
        let exact = [[Covariance::zero(); 2]; 2];
        let mut chance = Chance(11);
        let (runs, mut nees) = (4000, 0.0);
        for _ in 0..runs {
            let errors = roots.map(|root| root * Point::new(chance.normal(), chance.normal()));
            let moved = [errors[0].x, errors[0].y, errors[1].x, errors[1].y];
            let error = joint(moved, exact).vertex.at - CORNER[1];
            nees += crate::geometry::mahalanobis_sq(&error, &claimed);
        }
        let mean = nees / f64::from(runs);
        // The mean of 4000 chi-squares with 2 degrees of freedom has a standard deviation of 0.032.
        assert!((1.9..2.1).contains(&mean), "{mean}");
    }

    #[test]
    fn walls_that_end_too_far_from_their_crossing_or_occluded_do_not_meet() {
        let [a, x, b] = CORNER;
        let parts = [Covariance::zero(); 2];
        let second = piece(x, b, [0.0; 2], parts);
        let drawn_in = |by: f64| {
            let way = (x - a).normalize();
            piece(a, x - way * by, [0.0; 2], parts)
        };
        // Margin 0.10 m and three times the 3 cm of an end.
        assert!(Joint::new(&drawn_in(0.18), &second, &CONFIG).is_some());
        assert!(Joint::new(&drawn_in(0.20), &second, &CONFIG).is_none());
        let mut occluded = drawn_in(0.0);
        occluded.head.kind = EndKind::Occluded;
        assert!(Joint::new(&occluded, &second, &CONFIG).is_none());
        // The other way round nothing leads from the second to the first.
        assert!(Joint::new(&second, &drawn_in(0.0), &CONFIG).is_none());
    }
}
