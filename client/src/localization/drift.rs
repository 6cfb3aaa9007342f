//! What wheels get wrong the same way every time, learned on the way.
//!
//! Unequal wheels turn a robot a little with every metre, and a wheelbase that is not known exactly makes every turn a
//! little too wide. Between two places that are known both show: a linear regression with a prior, one step at a time.

use mapfold_map::geometry::{Pose, Robot, difference};
use nalgebra::{Matrix2, Vector2};

use crate::odometry::OdometryNoise;

/// How far wheels may be off, and when that can be told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriftConfig {
    /// Deviation of what a robot turns with each metre, radians.
    pub turn_per_metre_sd: f64,
    /// Deviation of what a turn is too wide by, a share of it.
    pub turn_share_sd: f64,
    /// Deviation of the heading between two known places, radians.
    pub heading_sd: f64,
    /// Longer ways tell nothing, metres: the heading may have turned round more than once.
    pub way_max: f64,
    /// What is off by more than so many deviations tells nothing.
    pub outlier_sds: f64,
}

impl DriftConfig {
    /// The defaults: cheap wheels.
    pub const STANDARD: Self = Self {
        turn_per_metre_sd: 2.0 * std::f64::consts::PI / 180.0,
        turn_share_sd: 0.05,
        heading_sd: 0.7 * std::f64::consts::PI / 180.0,
        way_max: 6.0,
        outlier_sds: 4.0,
    };
}

/// What is known of it: radians too much for each metre, and for each radian.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Drift {
    config: DriftConfig,
    mean: Vector2<f64>,
    covariance: Matrix2<f64>,
    /// What the wheels counted since the last known place: metres driven, and radians turned.
    way: f64,
    turned: f64,
}

impl Drift {
    pub(super) fn new(config: DriftConfig) -> Self {
        let sds = Vector2::new(config.turn_per_metre_sd, config.turn_share_sd);
        Self {
            config,
            mean: Vector2::zeros(),
            covariance: Matrix2::from_diagonal(&sds.component_mul(&sds)),
            way: 0.0,
            turned: 0.0,
        }
    }

    /// A step that the wheels counted, without what is known to be wrong with it.
    pub(super) fn corrected(&mut self, step: &Pose<Robot, Robot>) -> Pose<Robot, Robot> {
        let way = step.position().norm();
        self.way += way;
        self.turned += step.heading();
        let excess = self.mean.dot(&Vector2::new(way, step.heading()));
        // The way bends by half of what it turns.
        let half: Pose<Robot, Robot> = Pose::new(0.0, 0.0, -0.5 * excess);
        let at = half.act(&step.position());
        Pose::new(at.x, at.y, step.heading() - excess)
    }

    /// The robot is at a known place and was at another one when it was told so last: what truly lay between them.
    pub(super) fn learn(&mut self, moved: &Pose<Robot, Robot>, noise: &OdometryNoise) {
        let row = Vector2::new(self.way, self.turned);
        let excess = difference(self.turned, moved.heading());
        let counted = noise.heading_variance(self.way, self.turned);
        let variance = self.config.heading_sd.powi(2) + counted;
        let expected = variance + row.dot(&(self.covariance * row));
        let off = excess - self.mean.dot(&row);
        let is_told = self.way <= self.config.way_max
            && off * off <= self.config.outlier_sds.powi(2) * expected;
        if is_told {
            let gain = self.covariance * row / expected;
            self.mean += gain * off;
            let covariance = self.covariance - gain * row.transpose() * self.covariance;
            self.covariance = (covariance + covariance.transpose()) * 0.5;
        }
        self.forget_way();
    }

    /// The robot is at a known place, and it is not known where it was before.
    pub(super) fn forget_way(&mut self) {
        (self.way, self.turned) = (0.0, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bias_of_the_wheels_is_learned_and_taken_off() {
        let mut drift = Drift::new(DriftConfig::STANDARD);
        let (per_metre, share) = (-0.06, 0.03);
        for n in 0..200 {
            let turn = [0.0, 0.4, -0.3, 1.0][n % 4];
            let truly: Pose<Robot, Robot> = Pose::new(0.5, 0.01, turn);
            let counted = Pose::new(0.5, 0.01, turn * (1.0 + share) + 0.5 * per_metre);
            let corrected = drift.corrected(&counted);
            drift.learn(&truly, &OdometryNoise::STANDARD);
            if n > 150 {
                assert!((corrected.heading() - turn).abs() < 0.005, "{corrected:?}");
            }
        }
        assert!((drift.mean - Vector2::new(per_metre, share)).amax() < 0.01, "{}", drift.mean);
    }

    #[test]
    fn what_cannot_be_drift_teaches_nothing() {
        let mut drift = Drift::new(DriftConfig::STANDARD);
        drift.corrected(&Pose::new(0.5, 0.0, 0.0));
        drift.learn(&Pose::new(0.5, 0.0, 1.0), &OdometryNoise::STANDARD);
        assert_eq!(drift.mean, Vector2::zeros());
    }
}
