//! Covariances: what is accepted, and the floor below which no certainty counts.

use mapfold_map::geometry::{Covariance, mahalanobis_sq};
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, SymmetricEigen, Vector3};
use proptest::prelude::*;

fn factor<const N: usize>() -> impl Strategy<Value = SMatrix<f64, N, N>> {
    let entry = prop_oneof![-1.0..1.0_f64, (-8.0..0.0_f64).prop_map(|e| 10.0_f64.powf(e))];
    prop::collection::vec(entry, N * N).prop_map(|e| SMatrix::from_column_slice(&e))
}

/// Smallest eigenvalue of `c` in units of `sds`, by nalgebra's own method.
fn smallest_scaled(c: &Covariance<3>, sds: &[f64; 3]) -> f64 {
    let scaled = Matrix3::from_fn(|i, j| c.matrix()[(i, j)] / (sds[i] * sds[j]));
    SymmetricEigen::new(scaled).eigenvalues.min()
}

proptest! {
    #[test]
    fn products_with_their_transpose_are_covariances(l in factor::<3>(), scale in -150.0..150.0_f64) {
        let c = l * l.transpose() * 10.0_f64.powf(scale);
        prop_assert!(Covariance::new(c).is_ok(), "{}", c);
    }

    #[test]
    fn a_clearly_negative_direction_is_refused(
        l in factor::<3>(),
        toward in prop::array::uniform3(-1.0..1.0_f64),
        scale in -100.0..100.0_f64,
    ) {
        let toward = SVector::from(toward);
        prop_assume!(toward.norm() > 0.1);
        // Along `toward` the variance becomes -1 % of the largest.
        let c = l * l.transpose();
        let d = toward.normalize();
        let along = (d.transpose() * c * d)[(0, 0)];
        let negative = c - d * d.transpose() * (along + 0.01 * c.amax().max(1e-3));
        let symmetric = (negative + negative.transpose()) * 0.5 * 10.0_f64.powf(scale);
        prop_assert!(Covariance::new(symmetric).is_err());
    }

    #[test]
    fn any_bits_are_answered_and_what_is_accepted_is_finite_and_symmetric(
        bits in prop::array::uniform4(any::<u64>())
    ) {
        let [a, b, c, d] = bits.map(f64::from_bits);
        for m in [Matrix2::new(a, b, c, d), Matrix2::new(a, b, b, d)] {
            if let Ok(accepted) = Covariance::new(m) {
                let m = accepted.matrix();
                prop_assert!(m.iter().all(|entry| entry.is_finite()));
                prop_assert_eq!(m.clone_owned(), m.transpose());
                prop_assert!(m[(0, 0)] >= -1e-9 * m.amax() && m[(1, 1)] >= -1e-9 * m.amax());
            }
        }
    }

    #[test]
    fn nothing_is_more_certain_than_the_floor(
        l in factor::<3>(),
        magnitude in -6.0..3.0_f64,
        sds in prop::array::uniform3(1e-4..1.0_f64),
    ) {
        let c = Covariance::new(l * l.transpose() * 10.0_f64.powf(magnitude)).expect("L L^T");
        let floored = c.floored(&sds);
        let largest = floored.matrix().amax() / sds.iter().fold(1.0, |m: f64, s| m.min(s * s));
        prop_assert!(smallest_scaled(&floored, &sds) >= 1.0 - 1e-9 - 1e-11 * largest);
        // Variance is added, never taken away.
        let added = Matrix3::from_fn(|i, j| {
            (floored.matrix()[(i, j)] - c.matrix()[(i, j)]) / (sds[i] * sds[j])
        });
        prop_assert!(SymmetricEigen::new(added).eigenvalues.min() >= -1e-9 - 1e-11 * largest);
    }

    #[test]
    fn what_is_above_the_floor_keeps_its_bits(l in factor::<3>()) {
        let sds = [0.01, 0.02, 0.003];
        let unit = l * l.transpose() + Matrix3::identity() * 1.01;
        let c = Covariance::new(Matrix3::from_fn(|i, j| unit[(i, j)] * (sds[i] * sds[j])));
        let c = c.expect("above the floor");
        prop_assert_eq!(c.floored(&sds), c);
    }

    #[test]
    fn flooring_twice_is_flooring_once(l in factor::<3>(), magnitude in -6.0..3.0_f64) {
        let sds = [0.005, 0.005, 0.001];
        let c = Covariance::new(l * l.transpose() * 10.0_f64.powf(magnitude)).expect("L L^T");
        let once = c.floored(&sds);
        prop_assert_eq!(once.floored(&sds), once);
    }

    #[test]
    fn below_the_floor_everything_is_the_floor(l in factor::<2>(), shrink in 0.0..0.1_f64) {
        let c = Covariance::new(l * l.transpose() * shrink).expect("L L^T");
        let sds = [1.0, 2.0];
        prop_assert_eq!(c.floored(&sds), Covariance::from_variances([1.0, 4.0]));
    }

    #[test]
    fn the_mahalanobis_distance_does_not_depend_on_the_units(
        l in factor::<3>(),
        delta in prop::array::uniform3(-1.0..1.0_f64),
        units in prop::array::uniform3(0.1..10.0_f64),
    ) {
        let c = Covariance::new(l * l.transpose() + Matrix3::identity() * 0.1).expect("regular");
        let delta = SVector::from(delta);
        let d = Matrix3::from_diagonal(&Vector3::from(units));
        let before = mahalanobis_sq(&delta, &c);
        let after = mahalanobis_sq(&(d * delta), &c.transformed(&d));
        prop_assert!((before - after).abs() <= 1e-9 * before.max(1.0));
    }
}

#[test]
fn what_overflows_on_the_way_is_refused() {
    for huge in [f64::MAX, 1e308] {
        assert!(Covariance::new(Matrix2::new(huge, 0.0, 0.0, 1.0)).is_err());
        assert!(Covariance::new(Matrix2::new(1.0, huge, huge, 1.0)).is_err());
        assert!(Covariance::new(Matrix3::from_element(huge)).is_err());
    }
}
