//! Chance, from a seed.

use rand::rngs::StdRng;
use rand::{RngExt, SeedableRng};

/// A source of random numbers: the same seed gives the same run.
#[derive(Debug)]
pub struct Noise(StdRng);

impl Noise {
    /// The source that belongs to a seed.
    pub fn of_seed(seed: u64) -> Self {
        Self(StdRng::seed_from_u64(seed))
    }

    /// A number from 0 to 1, evenly.
    pub fn share(&mut self) -> f64 {
        self.0.random::<f64>()
    }

    /// A normal deviate with mean 0 (Box and Muller 1958).
    pub fn normal(&mut self, sd: f64) -> f64 {
        let (u, v) = (1.0 - self.share(), self.share());
        sd * (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_deviates_have_the_spread_that_is_asked_for() {
        let mut noise = Noise::of_seed(7);
        let count = 20_000;
        let draws: Vec<f64> = (0..count).map(|_| noise.normal(2.0)).collect();
        let mean = draws.iter().sum::<f64>() / f64::from(count);
        let variance = draws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / f64::from(count);
        // Five standard errors of each.
        assert!(mean.abs() < 5.0 * 2.0 / f64::from(count).sqrt(), "mean {mean}");
        assert!((variance - 4.0).abs() < 5.0 * 4.0 * (2.0 / f64::from(count)).sqrt(), "{variance}");
    }
}
