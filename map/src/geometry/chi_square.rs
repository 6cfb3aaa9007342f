//! Quantiles of the chi-square distribution.

/// The quantile whose standard normal equivalent is `z` (Wilson and Hilferty 1931): within 2 % from three degrees of
/// freedom on.
pub fn chi_square_quantile(dof: usize, z: f64) -> f64 {
    let k = dof.max(1) as f64;
    let h = 2.0 / (9.0 * k);
    k * (1.0 - h + z * h.sqrt()).powi(3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_close_to_the_published_ones() {
        for (dof, published) in [(3, 16.266), (4, 18.467), (10, 29.588), (30, 59.703)] {
            let q = chi_square_quantile(dof, 3.0902);
            assert!((q / published - 1.0).abs() < 0.02, "{dof}: {q}");
        }
    }
}
