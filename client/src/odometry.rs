//! Dead reckoning: the last pose carried on by what the wheels counted, ever less certain.
//!
//! Noise grows with the way driven and the angle turned, whatever the size of the steps in which
//! it is counted. Within a step the heading wanders too: over a way `d` it adds `d^2 / 3` times
//! the heading's variance across the way, correlated with the heading by `d / 2`. With that, one
//! step of a metre and a hundred of a centimetre give the same covariance.

use mapfold_map::geometry::{Covariance, Level, Odom, Point, Pose, Robot, UncertainPose};
use nalgebra::Matrix3;

/// How certainty is lost. The defaults are those of a differential drive on a smooth floor.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct OdometryNoise {
    /// Along the way, metres per root metre.
    pub along: f64,
    /// Across the way (slip), metres per root metre.
    pub across: f64,
    /// Heading, radians per root metre of way.
    pub turn_per_metre: f64,
    /// Heading, radians per root radian turned.
    pub turn_per_turn: f64,
}

impl OdometryNoise {
    /// 2 cm and 1 cm per root metre, 1 degree per root metre, 1.5 degrees per root radian.
    pub const STANDARD: Self = Self {
        along: 0.02,
        across: 0.01,
        turn_per_metre: std::f64::consts::PI / 180.0,
        turn_per_turn: 1.5 * std::f64::consts::PI / 180.0,
    };

    /// What a way and the turns on it add to the variance of the heading, square radians.
    pub(crate) fn heading_variance(&self, way: f64, turned: f64) -> f64 {
        self.turn_per_metre.powi(2) * way + self.turn_per_turn.powi(2) * turned.abs()
    }

    /// A step that the wheels counted, with what it adds to the covariance, in the frame in which it began.
    #[must_use]
    pub fn of_step(&self, step: &Pose<Robot, Robot>) -> UncertainPose<Robot, Robot> {
        UncertainPose { pose: *step, covariance: step_covariance(step, self) }
    }
}

/// A pose that is carried on.
#[derive(Debug, Clone, PartialEq)]
pub struct DeadReckoning {
    noise: OdometryNoise,
    last: Option<(Pose<Odom, Robot>, UncertainPose<Level, Robot>)>,
}

impl DeadReckoning {
    /// Not yet anywhere.
    pub fn new(noise: OdometryNoise) -> Self {
        Self { noise, last: None }
    }

    /// Where the robot is now that the wheels say so; the first time, where `start` says.
    pub fn carry_on(
        &mut self,
        odom_from_robot: Pose<Odom, Robot>,
        start: impl FnOnce() -> UncertainPose<Level, Robot>,
    ) -> UncertainPose<Level, Robot> {
        let now = match &self.last {
            None => start(),
            Some((odom_then, level_then)) => {
                let step: Pose<Robot, Robot> = odom_then.inverse().compose(&odom_from_robot);
                level_then.compose(&self.noise.of_step(&step))
            }
        };
        self.last = Some((odom_from_robot, now));
        now
    }
}

/// What a step adds to the covariance, in the frame in which it began.
fn step_covariance(step: &Pose<Robot, Robot>, noise: &OdometryNoise) -> Covariance<3> {
    let way = step.position();
    let d = way.norm();
    let turn = noise.heading_variance(d, step.heading());
    let along = noise.along.powi(2) * d;
    let slip = noise.across.powi(2) * d;
    // In axes along and across the way; a heading error turns the way about its beginning.
    let ahead = if d > 0.0 { way / d } else { Point::new(1.0, 0.0) };
    // Square root factors: along; slip; heading, which moves the end by d / 2 across, and the
    // d^2 / 12 of its wandering within the step that this leaves over.
    let wander = turn.sqrt();
    let j = Matrix3::new(
        ahead.x,
        -ahead.y,
        -ahead.y * 0.5 * d, //
        ahead.y,
        ahead.x,
        ahead.x * 0.5 * d, //
        0.0,
        0.0,
        1.0,
    );
    let own = Covariance::from_variances([along, slip + d * d * wander * wander / 12.0, turn]);
    own.transformed(&j)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn start() -> UncertainPose<Level, Robot> {
        UncertainPose { pose: Pose::new(5.0, -2.0, 0.8), covariance: Covariance::zero() }
    }

    fn drive(way: &[Pose<Odom, Robot>]) -> UncertainPose<Level, Robot> {
        let mut reckoning = DeadReckoning::new(OdometryNoise::STANDARD);
        way.iter().map(|odom| reckoning.carry_on(*odom, start)).last().unwrap()
    }

    #[test]
    fn the_pose_is_moved_as_the_wheels_moved() {
        let odom = [Pose::new(1.0, 1.0, 0.5), Pose::new(2.0, 1.0, 1.5)];
        let step = odom[0].inverse().compose::<Robot>(&odom[1]);
        let end = drive(&odom).pose;
        let expected = start().pose.compose(&step);
        assert!((end.position() - expected.position()).norm() < 1e-12);
        assert!((end.heading() - expected.heading()).abs() < 1e-12);
    }

    #[test]
    fn certainty_does_not_depend_on_the_size_of_the_steps() {
        for backwards in [1.0, -1.0] {
            let at = |s: f64| {
                Pose::new(1.0 + backwards * s * 0.6, 2.0 + backwards * s * 0.8, 0.6_f64.acos())
            };
            let once = drive(&[at(0.0), at(10.0)]).covariance;
            let often: Vec<_> = (0..=500).map(|i| at(0.02 * f64::from(i))).collect();
            let often = drive(&often).covariance;
            let off = (once.matrix() - often.matrix()).amax();
            assert!(off < 1e-12, "{off:e}");
            // 10 m: 6.3 cm along, 3 degrees of heading.
            assert!((once.sd(2) - 10_f64.sqrt().to_radians()).abs() < 1e-12);
        }
    }

    #[test]
    fn turning_on_the_spot_costs_heading_only() {
        let end = drive(&[Pose::new(0.0, 0.0, 0.0), Pose::new(0.0, 0.0, 1.0)]);
        assert!(end.covariance.sd(0) < 1e-12 && end.covariance.sd(1) < 1e-12);
        assert!((end.covariance.sd(2) - 1.5_f64.to_radians()).abs() < 1e-12);
    }

    #[test]
    fn certainty_is_only_ever_lost() {
        let odom: Vec<_> = (0..50)
            .map(|i| {
                let s = 0.2 * f64::from(i);
                Pose::new(s.cos() * 3.0, s.sin() * 3.0, s + 1.57)
            })
            .collect();
        let mut reckoning = DeadReckoning::new(OdometryNoise::STANDARD);
        let mut last = 0.0;
        for odom in odom {
            let pose = reckoning.carry_on(odom, start);
            assert!(pose.covariance.sd(2) >= last);
            last = pose.covariance.sd(2);
            assert!(Covariance::new(*pose.covariance.matrix()).is_ok());
        }
    }
}
