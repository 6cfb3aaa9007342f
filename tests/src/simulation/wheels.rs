//! A poor platform: two wheels that count a little wrong, always in the same way, that slip, now and then
//! badly, and whose encoders count whole steps.

use super::Noise;
use super::drive::Pose;
use crate::plane::Point;

/// One platform; what it does wrong all the time is drawn from a seed.
#[derive(Debug, Clone, Copy)]
pub struct Platform {
    /// Distance between the wheels that it believes in, metres.
    base_m: f64,
    /// The true one.
    true_base_m: f64,
    /// How much too much each wheel counts, as a share.
    scales: [f64; 2],
    /// Slip of each wheel, metres per root metre.
    slip_m: f64,
    /// Slip of both together, metres per root metre.
    common_slip_m: f64,
    /// Drift aside, metres per root metre.
    aside_m: f64,
    /// Bad slips on a metre.
    bad_per_m: f64,
    /// Encoders count steps of this, metres.
    step_m: f64,
    /// What each wheel has turned and not counted yet.
    rest_m: [f64; 2],
}

/// How far both wheels spin when they slip badly, metres.
const BAD_SLIP_M: std::ops::Range<f64> = 0.05..0.2;

impl Platform {
    /// A platform of its kind: half a metre wide; scales of 1 % and width of 0.5 % wrong (standard deviations). After
    /// 1.67 m some 2 degrees and 3 cm off, and a bad slip every 200 m.
    pub fn poor(noise: &mut Noise) -> Self {
        Self {
            base_m: 0.5,
            true_base_m: 0.5 * (1.0 + noise.normal(0.005)),
            // What both have in common is the scale; a robot that does not drive straight is adjusted.
            scales: {
                let common = noise.normal(0.01);
                [common + noise.normal(0.002), common + noise.normal(0.002)]
            },
            slip_m: 0.009,
            common_slip_m: 0.02,
            aside_m: 0.01,
            bad_per_m: 1.0 / 200.0,
            step_m: 0.001,
            rest_m: [0.0; 2],
        }
    }

    /// The same platform on a floor on which it never slips badly.
    #[must_use]
    pub fn without_bad_slips(self) -> Self {
        Self { bad_per_m: 0.0, ..self }
    }

    /// The step that it counts, in its own frame (ahead, left, turned), while it really goes from one pose to
    /// another: straight ahead or on the spot.
    pub fn count(&mut self, from: Pose, to: Pose, noise: &mut Noise) -> [f64; 3] {
        let turn = (to.1 - from.1).sin().atan2((to.1 - from.1).cos());
        let way = from.0.distance(to.0);
        let spun = if noise.share() < self.bad_per_m * way {
            BAD_SLIP_M.start + noise.share() * (BAD_SLIP_M.end - BAD_SLIP_M.start)
        } else {
            noise.normal(self.common_slip_m * way.sqrt())
        };
        let mut counted = [0.0; 2];
        for (wheel, side) in [-1.0, 1.0].into_iter().enumerate() {
            let rolled = way + 0.5 * side * self.true_base_m * turn;
            let slip = noise.normal(self.slip_m * rolled.abs().sqrt());
            let all = rolled * (1.0 + self.scales[wheel]) + slip + spun + self.rest_m[wheel];
            counted[wheel] = (all / self.step_m).trunc() * self.step_m;
            self.rest_m[wheel] = all - counted[wheel];
        }
        let ahead = 0.5 * (counted[0] + counted[1]);
        let turned = (counted[1] - counted[0]) / self.base_m;
        let (sin, cos) = (0.5 * turned).sin_cos();
        // That the robot drifts aside is not counted; it is the same, the other way round, in what is.
        let aside = noise.normal(self.aside_m * way.sqrt());
        [ahead * cos - aside * sin, ahead * sin + aside * cos, turned]
    }
}

/// Poses on the way along some corners, straight ahead and turning on the spot, with the way driven until each: steps of
/// at most so many metres and radians.
pub fn way_points(corners: &[Point], step_m: f64, step_rad: f64) -> Vec<(Pose, f64)> {
    let mut poses: Vec<(Pose, f64)> = Vec::new();
    let mut driven = 0.0;
    for leg in corners.windows(2) {
        let heading = (leg[1].y - leg[0].y).atan2(leg[1].x - leg[0].x);
        if let Some(((_, last), _)) = poses.last().copied() {
            let turn = (heading - last).sin().atan2((heading - last).cos());
            let count = (turn.abs() / step_rad).ceil() as u32;
            for i in 1..=count {
                poses.push(((leg[0], last + turn * f64::from(i) / f64::from(count)), driven));
            }
        } else {
            poses.push(((leg[0], heading), driven));
        }
        let length = leg[0].distance(leg[1]);
        let count = (length / step_m).ceil() as u32;
        for i in 1..=count {
            let along = length * f64::from(i) / f64::from(count);
            poses.push(((leg[0].towards(heading, along), heading), driven + along));
        }
        driven += length;
    }
    poses
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_leg_of_the_paper_ends_some_centimetres_and_degrees_off() {
        let mut noise = Noise::of_seed(5);
        let way = way_points(&[Point::new(0.0, 0.0), Point::new(1.67, 0.0)], 0.1, 0.1);
        let (mut along, mut turned, runs) = (0.0, 0.0, 2000);
        for _ in 0..runs {
            let mut platform = Platform::poor(&mut noise).without_bad_slips();
            let (mut x, mut heading) = (0.0, 0.0_f64);
            for pair in way.windows(2) {
                let [ahead, left, turn] = platform.count(pair[0].0, pair[1].0, &mut noise);
                x += ahead * heading.cos() - left * heading.sin();
                heading += turn;
            }
            along += (x - 1.67).powi(2) / f64::from(runs);
            turned += heading.powi(2) / f64::from(runs);
        }
        let (along, turned) = (along.sqrt(), turned.sqrt().to_degrees());
        assert!((0.025..0.04).contains(&along), "{along} m");
        assert!((1.5..2.5).contains(&turned), "{turned} degrees");
    }
}
