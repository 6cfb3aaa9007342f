//! Derivatives against finite differences, and the filter against filters that are written out.

use mapfold_map::landmarks::{Landmark, LandmarkKind, LandmarkTable};
use nalgebra::{Cholesky, Matrix3, SMatrix, SVector, Vector3};

use super::super::filter::{Filter, MapError, Measurement};
use super::super::lines::{self, Reach};
use super::super::{landmarks, sonar};
use super::*;
use crate::emulation::Chance;
use crate::sensor::{Ring, Sonar, preset};

const STEP: f64 = 1e-6;
const REACH: Reach = Reach { overlap_min: 0.2, turn_max: 0.5, offset_max: 1.0 };

fn nudged(pose: &Pose<Level, Robot>, component: usize, by: f64) -> Pose<Level, Robot> {
    let mut v = [pose.x, pose.y, pose.heading()];
    v[component] += by;
    Pose::new(v[0], v[1], v[2])
}

/// Derivative of what is expected, the negative of that of the innovation.
fn difference_of<const N: usize>(innovation: impl Fn(f64) -> SVector<f64, N>) -> SVector<f64, N> {
    -(innovation(STEP) - innovation(-STEP)) / (2.0 * STEP)
}

#[test]
fn of_walls() {
    for (wall, pose) in [
        (Wall::new((3.0, -2.0), (3.0, 2.0)), Pose::new(0.5, 0.2, 0.3)),
        (placed(&Wall::new((-3.0, 2.0), (-3.0, -2.0))), Pose::new(39.0, -24.0, -2.9)),
    ] {
        let seen = wall.seen(&pose, (0.0, 0.0), [1e-4, 1e-5]);
        let segment = wall.mapped((0.0, 0.0), [4e-4, 9e-6], [1e-4, 4e-6]);
        let of = |segment: &Segment, pose: &Pose<Level, Robot>| {
            let walls = ReferenceWalls::of_segments([(id(1), segment)]);
            let near = walls.near(&wall.a, &wall.b, 1.0);
            lines::measure(near[0], &seen, pose, &REACH).unwrap()
        };
        let measured = of(&segment, &pose);
        assert!(measured.innovation.amax() < 1e-9);
        for k in 0..3 {
            let by_steps = difference_of(|by| of(&segment, &nudged(&pose, k, by)).innovation);
            let off = (measured.j_pose.column(k) - by_steps).amax();
            assert!(off < 1e-6, "{k}: {off:e}");
        }
        // An offset and an angle of the wall, each moved by one deviation: 2 cm and half a degree's worth.
        let sizes = measured.j_errors.iter().find(|(e, _)| matches!(e, MapError::Wall(_))).unwrap();
        let offset = difference_of(|by| {
            let moved = wall.mapped((by, 0.0), [4e-4, 9e-6], [1e-4, 4e-6]);
            of(&moved, &pose).innovation
        });
        assert!((sizes.1.column(0) - offset * (4e-4_f64 + 25e-6).sqrt()).amax() < 1e-6);
        let angle = difference_of(|by| {
            let turned = wall.mapped((0.0, by), [4e-4, 9e-6], [1e-4, 4e-6]);
            of(&turned, &pose).innovation
        });
        let sd = (9e-6 + (0.2_f64.to_radians()).powi(2)).sqrt();
        // The map's spans are whole millimetres, so that its middle is up to half of one off.
        assert!((sizes.1.column(1) - angle * sd).amax() < 1e-5);
    }
}

fn corner(at: (f64, f64)) -> Landmark {
    Landmark {
        kind: LandmarkKind::ConcaveCorner,
        at: Point::new(at.0, at.1),
        direction: 2.0,
        covariance: Covariance::from_rows([[4e-4, 1e-4], [1e-4, 9e-4]]).unwrap(),
        direction_sd: 0.02,
    }
}

#[test]
fn of_landmarks() {
    let known = corner((5.0, -3.0));
    let pose = Pose::new(1.0, 2.0, -2.2);
    let at = pose.inverse().act(&known.at);
    let seen = Landmark { at, direction: known.direction - pose.heading(), ..known };
    let measured = landmarks::measure(&known, &seen, &pose, (0.01, 0.002), 0.05);
    assert!(measured.innovation.amax() < 1e-12);
    for k in 0..3 {
        let by_steps = difference_of(|by| {
            landmarks::measure(&known, &seen, &nudged(&pose, k, by), (0.0, 0.0), 0.05).innovation
        });
        assert!((measured.j_pose.column(k) - by_steps).amax() < 1e-7, "{k}");
    }
    // The errors of the place have the covariance that is claimed, turned into the robot frame.
    let j = measured.j_errors[0].1.fixed_view::<2, 3>(0, 0).into_owned();
    let (sin, cos) = pose.heading().sin_cos();
    let turn = Matrix2::new(cos, sin, -sin, cos);
    let expected = turn * known.covariance.matrix() * turn.transpose();
    assert!((j * j.transpose() - expected).amax() < 1e-12);
}

#[test]
fn of_echoes() {
    let walls = known(&[Wall::new((3.0, -2.0), (3.0, 2.0))]);
    let table = LandmarkTable::new(vec![corner((0.2, 3.5))]);
    let profile = preset("sonar-ring").unwrap().sonar.unwrap();
    for (bearing, range) in [(0.05, 2.4), (1.6, 3.1)] {
        let mount = Pose::new(0.2, 0.1, bearing);
        let heard = Sonar { robot_from_sensor: mount, range: Some(range), is_steady: true };
        let ring = Ring { cone: 0.5, sonars: vec![heard] };
        let echo = sonar::echo(&ring, 0, &profile, 0.01).unwrap();
        let pose = Pose::new(0.3, 0.2, -0.02);
        let of = |pose: Pose<Level, Robot>| {
            let all = sonar::sources(&echo, &fix(pose, [0.1; 3]), &walls, Some(&table));
            assert_eq!(all.len(), 1);
            all.into_iter().next().unwrap().measurement
        };
        let measured = of(pose);
        for k in 0..3 {
            let by_steps = difference_of(|by| of(nudged(&pose, k, by)).innovation);
            assert!((measured.j_pose.column(k) - by_steps).amax() < 1e-7, "{k}");
        }
    }
}

fn random<const R: usize, const C: usize>(chance: &mut Chance) -> SMatrix<f64, R, C> {
    SMatrix::from_fn(|_, _| chance.normal(1.0))
}

#[test]
fn a_linear_toy_is_batch_least_squares() {
    let mut chance = Chance::new(5);
    let start = fix(Pose::identity(), [0.3, 0.2, 0.1]);
    let mut filter = Filter::new(start);
    let mut information = start.covariance.information().unwrap();
    let mut weighted = Vector3::zeros();
    for _ in 0..30 {
        let h: SMatrix<f64, 2, 3> = random(&mut chance);
        let z: SVector<f64, 2> = random(&mut chance) * 0.01;
        let noise = Matrix2::new(0.02, 0.005, 0.005, 0.03);
        let weight = Cholesky::new(noise).unwrap().inverse();
        let innovation = z - h * filter.pose().pose.vector();
        filter.update(&Measurement { innovation, j_pose: h, j_errors: Vec::new(), noise });
        information += h.transpose() * weight * h;
        weighted += h.transpose() * weight * z;
    }
    let solved = Cholesky::new(information).unwrap();
    let found = filter.pose();
    assert!((found.pose.vector() - solved.solve(&weighted)).amax() < 1e-12);
    assert!((found.covariance.matrix() - solved.inverse()).amax() < 1e-12);
}

#[test]
fn considered_errors_count_as_in_a_filter_of_everything_that_does_not_learn_them() {
    // State: pose, one error that all measurements share, and two of single things.
    const ALL: usize = 12;
    let errors = [
        MapError::Shared,
        MapError::Wall(WallName::Mapped(id(1))),
        MapError::Wall(WallName::Mapped(id(2))),
    ];
    let mut chance = Chance::new(6);
    let start = fix(Pose::identity(), [0.3, 0.2, 0.1]);
    let mut filter = Filter::new(start);
    let mut whole = SMatrix::<f64, ALL, ALL>::identity();
    whole.fixed_view_mut::<3, 3>(0, 0).copy_from(start.covariance.matrix());
    for round in 0..20 {
        let step = UncertainPose {
            pose: Pose::new(0.1, 0.0, 0.05),
            covariance: Covariance::from_variances([1e-4, 2e-4, 3e-5]),
        };
        let (j, with) = filter.pose().pose.j_compose::<Robot>(&step.pose);
        let mut f = SMatrix::<f64, ALL, ALL>::identity();
        f.fixed_view_mut::<3, 3>(0, 0).copy_from(&j);
        whole = f * whole * f.transpose();
        let mut top = whole.fixed_view_mut::<3, 3>(0, 0);
        top += with * step.covariance.matrix() * with.transpose();
        filter.moved(&step);

        let own = 1 + round % 2;
        let j_errors = vec![
            (errors[0], random::<2, 3>(&mut chance) * 0.05),
            (errors[own], random::<2, 3>(&mut chance) * 0.05),
        ];
        let j_pose: SMatrix<f64, 2, 3> = random(&mut chance);
        let noise = Matrix2::new(0.002, 0.0, 0.0, 0.003);
        let mut h = SMatrix::<f64, 2, ALL>::zeros();
        h.fixed_view_mut::<2, 3>(0, 0).copy_from(&j_pose);
        h.fixed_view_mut::<2, 3>(0, 3).copy_from(&j_errors[0].1);
        h.fixed_view_mut::<2, 3>(0, 3 + 3 * own).copy_from(&j_errors[1].1);
        let spread = h * whole * h.transpose() + noise;
        let mut gain = whole * h.transpose() * Cholesky::new(spread).unwrap().inverse();
        gain.fixed_view_mut::<9, 2>(3, 0).fill(0.0);
        let a = SMatrix::<f64, ALL, ALL>::identity() - gain * h;
        whole = a * whole * a.transpose() + gain * noise * gain.transpose();
        let innovation = SVector::<f64, 2>::zeros();
        filter.update(&Measurement { innovation, j_pose, j_errors, noise });
        let expected: Matrix3<f64> = whole.fixed_view::<3, 3>(0, 0).into_owned();
        assert!((filter.pose().covariance.matrix() - expected).amax() < 1e-12, "{round}");
    }
}
