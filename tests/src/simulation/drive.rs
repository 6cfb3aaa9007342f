//! A robot on its way: true poses, what its odometry says, and what a good SLAM makes of it.

use super::Noise;
use crate::plane::Point;

/// How a robot's own reckoning of its motion errs.
#[derive(Debug, Clone, Copy)]
pub struct Odometry {
    /// Standard deviation of the length of a step, as a share of it.
    pub length_sd_share: f64,
    /// Standard deviation of the heading after a metre, radians.
    pub heading_sd_rad_per_sqrt_m: f64,
    /// Standard deviation of a corrected position, metres: a good SLAM's.
    pub corrected_sd_m: f64,
    /// Standard deviation of a corrected heading, radians.
    pub corrected_sd_rad: f64,
}

impl Default for Odometry {
    /// A tidy differential drive, and corrected poses like those of published indoor logs.
    fn default() -> Self {
        Self {
            length_sd_share: 0.02,
            heading_sd_rad_per_sqrt_m: 0.01,
            corrected_sd_m: 0.01,
            corrected_sd_rad: 0.002,
        }
    }
}

/// Position and heading, radians from x.
pub type Pose = (Point, f64);

/// Where the robot stood for a scan.
#[derive(Debug, Clone, Copy)]
pub struct Stop {
    /// Seconds since the start.
    pub time: f64,
    /// Where it was.
    pub truth: Pose,
    /// Where its odometry says that it was.
    pub odometry: Pose,
    /// Where a good SLAM says that it was.
    pub corrected: Pose,
}

/// Speed on the way, m/s.
const SPEED_M_PER_S: f64 = 0.5;

/// Drives along the corners of a way and stops every `step` metres.
pub fn drive(way: &[Point], step: f64, errors: &Odometry, noise: &mut Noise) -> Vec<Stop> {
    let mut stops = Vec::new();
    let mut driven = 0.0;
    let mut reckoned: Option<(Pose, Pose)> = None;
    for leg in way.windows(2) {
        let length = leg[0].distance(leg[1]);
        let heading = (leg[1].y - leg[0].y).atan2(leg[1].x - leg[0].x);
        for index in 0..(length / step).floor() as usize {
            let truth = (leg[0].towards(heading, index as f64 * step), heading);
            let odometry = match reckoned {
                None => truth,
                Some((from, said)) => reckon(from, said, truth, errors, noise),
            };
            reckoned = Some((truth, odometry));
            let corrected = (
                Point::new(
                    truth.0.x + noise.normal(errors.corrected_sd_m),
                    truth.0.y + noise.normal(errors.corrected_sd_m),
                ),
                truth.1 + noise.normal(errors.corrected_sd_rad),
            );
            stops.push(Stop { time: driven / SPEED_M_PER_S, truth, odometry, corrected });
            driven += step;
        }
    }
    stops
}

/// The next word of the odometry: the true motion from `from` to `to`, as seen from where the
/// odometry last was, with its errors.
fn reckon(from: Pose, said: Pose, to: Pose, errors: &Odometry, noise: &mut Noise) -> Pose {
    let length = from.0.distance(to.0);
    let course = (to.0.y - from.0.y).atan2(to.0.x - from.0.x) - from.1;
    let driven = length * (1.0 + noise.normal(errors.length_sd_share));
    let drift = noise.normal(errors.heading_sd_rad_per_sqrt_m * length.sqrt());
    (said.0.towards(said.1 + course, driven), said.1 + (to.1 - from.1) + drift)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn odometry_without_errors_is_the_truth_and_with_errors_it_drifts() {
        let way =
            [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (3.0, 2.0)].map(|(x, y)| Point::new(x, y));
        let exact = Odometry {
            length_sd_share: 0.0,
            heading_sd_rad_per_sqrt_m: 0.0,
            corrected_sd_m: 0.0,
            corrected_sd_rad: 0.0,
        };
        let off = |errors: &Odometry| {
            let stops = drive(&way, 0.5, errors, &mut Noise::of_seed(1));
            assert_eq!(stops.len(), 61);
            stops.last().map_or(0.0, |stop| stop.odometry.0.distance(stop.truth.0))
        };
        assert!(off(&exact) < 1e-9);
        assert!(off(&Odometry::default()) > 0.05);
    }
}
