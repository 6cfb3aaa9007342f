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
                let scale = (matrix[(row, row)].abs() * matrix[(column, column)].abs()).sqrt();
                if (a - b).abs() > SYMMETRY_TOLERANCE * scale.max(a.abs()).max(b.abs()) {
                    return Err(CovarianceError::NotSymmetric { row, column });
                }
            }
        }
        let symmetric = Self::symmetrised(matrix);
        if symmetric.is_positive() {
            Ok(symmetric)
        } else {
            Err(CovarianceError::NotPositive)
        }
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
            if d < -tolerance {
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

/// Squared Mahalanobis distance `delta^T C^-1 delta`; infinite where `C` is singular.
pub fn mahalanobis_sq<const N: usize>(
    delta: &SVector<f64, N>,
    covariance: &Covariance<N>,
) -> f64 {
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
