//! Symmetric positive semi-definite matrices.

use nalgebra::{SMatrix, SVector};

/// Why a matrix is not a covariance.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
pub enum CovarianceError {
    /// An entry is NaN or infinite.
    #[error("entry ({row}, {column}) is not a finite number")]
    NotFinite {
        /// Row of the entry, from 0.
        row: usize,
        /// Column of the entry, from 0.
        column: usize,
    },
    /// Two mirrored entries differ by more than rounding.
    #[error("entries ({row}, {column}) and ({column}, {row}) differ: a covariance is symmetric")]
    NotSymmetric {
        /// Row of the entry, from 0.
        row: usize,
        /// Column of the entry, from 0.
        column: usize,
    },
    /// Some direction would have a negative variance.
    #[error("the matrix is not positive semi-definite")]
    NotPositive,
}

/// Relative difference up to which two mirrored entries count as rounding.
const SYMMETRY_TOLERANCE: f64 = 1e-9;
/// Negative pivot, relative to the largest variance, up to which it counts as rounding.
const PIVOT_TOLERANCE: f64 = 1e-10;

/// How far an eigenvalue may lie below the floor and count as on it, so that flooring twice is
/// flooring once.
const FLOOR_TOLERANCE: f64 = 1e-9;
/// Error of a computed eigenvalue relative to the largest one, with a wide margin.
const ROUNDING_TOLERANCE: f64 = 1e-12;
/// Sweeps of Jacobi's method; it converges quadratically, a 3 by 3 matrix in about five.
const JACOBI_SWEEPS_MAX: usize = 16;

/// A covariance: symmetric by construction, positive semi-definite by check.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Covariance<const N: usize>(SMatrix<f64, N, N>);

impl<const N: usize> Covariance<N> {
    /// Checks a matrix from outside: finite, symmetric, positive semi-definite.
    ///
    /// # Errors
    /// The first property that fails.
    pub fn new(matrix: SMatrix<f64, N, N>) -> Result<Self, CovarianceError> {
        for row in 0..N {
            for column in 0..N {
                if !matrix[(row, column)].is_finite() {
                    return Err(CovarianceError::NotFinite { row, column });
                }
            }
        }
        for row in 0..N {
            for column in 0..row {
                let (a, b) = (matrix[(row, column)], matrix[(column, row)]);
                let scale = matrix[(row, row)].abs().sqrt() * matrix[(column, column)].abs().sqrt();
                if (a - b).abs() > SYMMETRY_TOLERANCE * scale.max(a.abs()).max(b.abs()) {
                    return Err(CovarianceError::NotSymmetric { row, column });
                }
            }
        }
        let symmetric = Self::symmetrised(matrix);
        if symmetric.is_positive() { Ok(symmetric) } else { Err(CovarianceError::NotPositive) }
    }

    /// Checks rows from outside, like [`Self::new`].
    ///
    /// # Errors
    /// The first property that fails.
    pub fn from_rows(rows: [[f64; N]; N]) -> Result<Self, CovarianceError> {
        Self::new(SMatrix::from_fn(|row, column| rows[row][column]))
    }

    /// The matrix row by row. [`Self::from_rows`] gives the same bits back.
    pub fn rows(&self) -> [[f64; N]; N] {
        std::array::from_fn(|row| std::array::from_fn(|column| self.0[(row, column)]))
    }

    /// A result of the algebra that is a covariance up to rounding: made exactly symmetric.
    pub(crate) fn symmetrised(matrix: SMatrix<f64, N, N>) -> Self {
        Self((matrix + matrix.transpose()) * 0.5)
    }

    /// No uncertainty at all.
    pub fn zero() -> Self {
        Self(SMatrix::zeros())
    }

    /// Independent components with the given variances (not standard deviations).
    ///
    /// Negative or non-finite variances are a fault of the caller and are caught in debug builds.
    pub fn from_variances(variances: [f64; N]) -> Self {
        debug_assert!(variances.iter().all(|v| v.is_finite() && *v >= 0.0));
        Self(SMatrix::from_diagonal(&SVector::from(variances)))
    }

    /// The matrix.
    pub fn matrix(&self) -> &SMatrix<f64, N, N> {
        &self.0
    }

    /// `J C J^T`: the covariance after a linear(ised) map with Jacobian `J`.
    #[must_use]
    pub fn transformed<const M: usize>(&self, jacobian: &SMatrix<f64, M, N>) -> Covariance<M> {
        Covariance::symmetrised(jacobian * self.0 * jacobian.transpose())
    }

    /// The same uncertainty with all variances multiplied by `factor` (not negative).
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        debug_assert!(factor >= 0.0);
        Self(self.0 * factor)
    }

    /// The same uncertainty, but in no direction less than that of independent components with the
    /// standard deviations `sds` (all positive): in units of these, every eigenvalue is raised to
    /// 1 at least. A covariance that reaches that already comes back bit for bit.
    #[must_use]
    pub fn floored(&self, sds: &[f64; N]) -> Self {
        debug_assert!(sds.iter().all(|sd| sd.is_finite() && *sd > 0.0));
        let scaled = SMatrix::<f64, N, N>::from_fn(|i, j| self.0[(i, j)] / (sds[i] * sds[j]));
        let (values, vectors) = symmetric_eigen(scaled);
        let tolerance = FLOOR_TOLERANCE + ROUNDING_TOLERANCE * values.amax();
        if values.iter().all(|v| *v >= 1.0 - tolerance) {
            return *self;
        }
        if values.iter().all(|v| *v <= 1.0) {
            return Self::from_variances(sds.map(|sd| sd * sd));
        }
        let raised = vectors * SMatrix::<f64, N, N>::from_diagonal(&values.map(|v| v.max(1.0)));
        let floored = raised * vectors.transpose();
        Self::symmetrised(SMatrix::from_fn(|i, j| floored[(i, j)] * (sds[i] * sds[j])))
    }

    /// The standard deviation of component `index`.
    pub fn sd(&self, index: usize) -> f64 {
        self.0[(index, index)].max(0.0).sqrt()
    }

    /// The inverse (information) matrix; `None` if some direction has no uncertainty.
    pub fn information(&self) -> Option<SMatrix<f64, N, N>> {
        nalgebra::Cholesky::new(self.0).map(|c| {
            let inverse = c.inverse();
            (inverse + inverse.transpose()) * 0.5
        })
    }

    /// LDL^T with diagonal pivots: every pivot not (more than rounding) negative, and a zero
    /// pivot has a zero column.
    fn is_positive(&self) -> bool {
        let mut a = self.0;
        let scale = a.diagonal().amax();
        let tolerance = PIVOT_TOLERANCE * scale;
        let mut done = [false; N];
        for _ in 0..N {
            let mut pivot = None;
            for i in 0..N {
                if !done[i] && pivot.is_none_or(|p: usize| a[(i, i)] > a[(p, p)]) {
                    pivot = Some(i);
                }
            }
            let Some(p) = pivot else { break };
            let d = a[(p, p)];
            // Said so that NaN, which overflow can lead to, is refused too.
            let in_range = d >= -tolerance && d.is_finite();
            if !in_range {
                return false;
            }
            done[p] = true;
            if d <= tolerance {
                for i in 0..N {
                    if !done[i] && a[(i, p)].abs() > (tolerance * scale).sqrt() {
                        return false;
                    }
                }
                continue;
            }
            for i in 0..N {
                for j in 0..N {
                    if !done[i] && !done[j] {
                        a[(i, j)] -= a[(i, p)] * a[(p, j)] / d;
                    }
                }
            }
        }
        true
    }
}

impl<const N: usize> std::ops::Add for Covariance<N> {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0)
    }
}

/// Eigenvalues and eigenvectors (as columns) of a symmetric matrix by Jacobi's cyclic rotations
/// (Golub & Van Loan 2013, algorithm 8.5.2). It uses only operations that every processor rounds
/// alike, so the result is the same everywhere.
fn symmetric_eigen<const N: usize>(
    mut a: SMatrix<f64, N, N>,
) -> (SVector<f64, N>, SMatrix<f64, N, N>) {
    let mut vectors = SMatrix::<f64, N, N>::identity();
    for _ in 0..JACOBI_SWEEPS_MAX {
        let mut turned = false;
        for p in 0..N {
            for q in p + 1..N {
                let scale = a[(p, p)].abs().max(a[(q, q)].abs());
                if a[(p, q)].abs() <= f64::EPSILON * f64::EPSILON * scale {
                    continue;
                }
                turned = true;
                let tau = (a[(q, q)] - a[(p, p)]) / (2.0 * a[(p, q)]);
                let t = tau.signum() / (tau.abs() + (1.0 + tau * tau).sqrt());
                let c = 1.0 / (1.0 + t * t).sqrt();
                let s = t * c;
                for k in 0..N {
                    let (kp, kq) = (a[(k, p)], a[(k, q)]);
                    a[(k, p)] = c * kp - s * kq;
                    a[(k, q)] = s * kp + c * kq;
                }
                for k in 0..N {
                    let (pk, qk) = (a[(p, k)], a[(q, k)]);
                    a[(p, k)] = c * pk - s * qk;
                    a[(q, k)] = s * pk + c * qk;
                }
                for k in 0..N {
                    let (kp, kq) = (vectors[(k, p)], vectors[(k, q)]);
                    vectors[(k, p)] = c * kp - s * kq;
                    vectors[(k, q)] = s * kp + c * kq;
                }
            }
        }
        if !turned {
            break;
        }
    }
    (a.diagonal(), vectors)
}

/// Squared Mahalanobis distance `delta^T C^-1 delta`; infinite where `C` is singular.
pub fn mahalanobis_sq<const N: usize>(delta: &SVector<f64, N>, covariance: &Covariance<N>) -> f64 {
    nalgebra::Cholesky::new(covariance.0)
        .map_or(f64::INFINITY, |c| (delta.transpose() * c.solve(delta))[(0, 0)])
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix2, Vector2};

    #[test]
    fn refusals_name_the_property_that_fails() {
        assert_eq!(
            Covariance::new(Matrix2::new(1.0, f64::NAN, 0.0, 1.0)),
            Err(CovarianceError::NotFinite { row: 0, column: 1 })
        );
        assert_eq!(
            Covariance::new(Matrix2::new(1.0, 0.5, 0.4, 1.0)),
            Err(CovarianceError::NotSymmetric { row: 1, column: 0 })
        );
        assert_eq!(
            Covariance::new(Matrix2::new(1.0, 2.0, 2.0, 1.0)),
            Err(CovarianceError::NotPositive)
        );
        assert_eq!(
            Covariance::new(Matrix2::new(0.0, 1.0, 1.0, 0.0)),
            Err(CovarianceError::NotPositive)
        );
    }

    #[test]
    fn singular_but_positive_is_accepted() {
        assert!(Covariance::new(Matrix2::new(1.0, 1.0, 1.0, 1.0)).is_ok());
        assert!(Covariance::new(Matrix2::zeros()).is_ok());
    }

    #[test]
    fn mahalanobis_of_one_sigma_is_one() {
        let c = Covariance::from_variances([4.0, 9.0]);
        assert!((mahalanobis_sq(&Vector2::new(2.0, 0.0), &c) - 1.0).abs() < 1e-12);
        assert!((mahalanobis_sq(&Vector2::new(0.0, 3.0), &c) - 1.0).abs() < 1e-12);
    }
}
