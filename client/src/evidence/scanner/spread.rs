//! How sure the ends of a scan's beams are.

use mapfold_map::geometry::{Level, Point, Robot, UncertainPose};

use super::CELL_VARIANCE;
use crate::sensor::ScannerProfile;

/// The variance of the difference between a beam's end and a cell, along the beam, in squares of cells: what is
/// the same for all beams of a scan, worked out once.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spread {
    constant: f32,
    /// Times the square of the distance.
    growth: f32,
    /// The pose's part by the direction (x, y): times x x, x y and y y.
    pose: [f32; 3],
}

impl Spread {
    /// Of a scanner that sits at `arm` from the robot's place, in the level frame.
    ///
    /// The robot's position counts as projected on the beam, and its heading by the lever of the scanner's place
    /// on it, `y arm.x - x arm.y`: the place along the direction, derived by the heading.
    pub(super) fn new(
        profile: &ScannerProfile,
        level_from_robot: &UncertainPose<Level, Robot>,
        arm: &Point,
        resolution: f64,
    ) -> Self {
        let covariance = level_from_robot.covariance.matrix();
        let c = |row, column| covariance[(row, column)];
        let xx = c(0, 0) + arm.y * arm.y * c(2, 2) - 2.0 * arm.y * c(0, 2);
        let yy = c(1, 1) + arm.x * arm.x * c(2, 2) + 2.0 * arm.x * c(1, 2);
        let xy = c(0, 1) - arm.x * arm.y * c(2, 2) + arm.x * c(0, 2) - arm.y * c(1, 2);
        let ranges = profile.range_sd_m.powi(2) + profile.systematic_sd_m.powi(2);
        let cells = (resolution * resolution).recip();
        Self {
            constant: (ranges * cells + CELL_VARIANCE) as f32,
            growth: profile.range_sd_per_m.powi(2) as f32,
            pose: [xx, 2.0 * xy, yy].map(|part| (part * cells) as f32),
        }
    }

    /// At a distance in cells, in the direction of a unit vector.
    #[inline]
    pub(super) fn variance(&self, z: f32, x: f32, y: f32) -> f32 {
        let [xx, xy, yy] = self.pose;
        let pose = xx * x * x + xy * x * y + yy * y * y;
        self.constant + self.growth * z * z + pose.max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use mapfold_map::geometry::{Covariance, Pose, unit_normal};

    use super::*;

    #[test]
    fn the_variance_is_that_of_the_scanners_place_projected() {
        let rows = [[4e-3, 1e-3, 5e-4], [1e-3, 2e-3, -3e-4], [5e-4, -3e-4, 1e-3]];
        let covariance = Covariance::from_rows(rows).unwrap();
        let profile = ScannerProfile {
            range_sd_m: 0.02,
            range_sd_per_m: 0.01,
            systematic_sd_m: 0.03,
            ..crate::sensor::preset("sick-lms").and_then(|s| s.scanner).unwrap()
        };
        let (arm, resolution, z) = (Point::new(0.4, -0.2), 0.05, 60.0_f32);
        let pose = UncertainPose { pose: Pose::identity(), covariance };
        let spread = Spread::new(&profile, &pose, &arm, resolution);
        for angle in [0.0, 0.7, 2.0, 4.0, 5.5] {
            let direction = unit_normal(angle);
            // The derivative of the place along the direction by position and heading.
            let by = [direction.x, direction.y, direction.y * arm.x - direction.x * arm.y];
            let along: f64 = (0..9).map(|at| by[at / 3] * rows[at / 3][at % 3] * by[at % 3]).sum();
            let ranges = 4e-4 + 9e-4 + (0.01 * f64::from(z) * resolution).powi(2);
            let expected = (ranges + along) / (resolution * resolution) + 1.0 / 12.0;
            let variance = spread.variance(z, direction.x as f32, direction.y as f32);
            assert!((f64::from(variance) / expected - 1.0).abs() < 1e-5, "{variance} {expected}");
        }
    }
}
