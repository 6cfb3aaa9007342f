//! A ring of ultrasonic range finders: wide cones, and walls that mirror.

use super::drive::Pose;
use super::{Noise, World};

/// Sonars around the robot's centre.
#[derive(Debug, Clone)]
pub struct SonarRing {
    /// Where each looks, radians from the heading.
    pub bearings_rad: Vec<f64>,
    /// Full width of a cone, radians.
    pub cone_rad: f64,
    /// Farthest echo, metres.
    pub range_max_m: f64,
    /// Standard deviation of a range, metres.
    pub range_sd_m: f64,
    /// A wall echoes only if it is met within this angle of its normal, radians.
    pub mirror_rad: f64,
    /// Share of echoes that get lost.
    pub lost_share: f64,
}

impl Default for SonarRing {
    /// Sixteen around, as on many research robots.
    fn default() -> Self {
        let step = std::f64::consts::TAU / 16.0;
        Self {
            bearings_rad: (0..16).map(|index| f64::from(index) * step).collect(),
            cone_rad: 25.0_f64.to_radians(),
            range_max_m: 5.0,
            range_sd_m: 0.03,
            mirror_rad: 20.0_f64.to_radians(),
            lost_share: 0.1,
        }
    }
}

/// Rays that stand for one cone.
const RAYS: i32 = 25;

impl SonarRing {
    /// One round of readings from a pose; 0 where no echo came back.
    pub fn ping(&self, world: &World, pose: Pose, noise: &mut Noise) -> Vec<f64> {
        self.bearings_rad.iter().map(|bearing| self.echo(world, pose, *bearing, noise)).collect()
    }

    fn echo(&self, world: &World, pose: Pose, bearing: f64, noise: &mut Noise) -> f64 {
        let ray = |index: i32| {
            let off = self.cone_rad * (f64::from(index) / f64::from(RAYS - 1) - 0.5);
            world.cast(pose.0, pose.1 + bearing + off, self.range_max_m)
        };
        let nearest = (0..RAYS)
            .filter_map(ray)
            .filter(|(_, cosine)| *cosine >= self.mirror_rad.cos())
            .map(|(range, _)| range)
            .fold(f64::INFINITY, f64::min);
        if nearest.is_infinite() || noise.share() < self.lost_share {
            return 0.0;
        }
        (nearest + noise.normal(self.range_sd_m)).max(0.15)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::{Piece, Point};

    #[test]
    fn a_wall_ahead_echoes_and_an_oblique_one_mirrors_the_sound_away() {
        let wall = |a: (f64, f64), b: (f64, f64)| World {
            name: "a wall",
            walls: vec![Piece { a: Point::new(a.0, a.1), b: Point::new(b.0, b.1) }],
            way: Vec::new(),
        };
        let ring = SonarRing { bearings_rad: vec![0.0], lost_share: 0.0, ..SonarRing::default() };
        let here = (Point::new(0.0, 0.0), 0.0);
        let mut noise = Noise::of_seed(3);
        let ahead = ring.ping(&wall((2.0, -3.0), (2.0, 3.0)), here, &mut noise);
        assert!((ahead[0] - 2.0).abs() < 6.0 * ring.range_sd_m, "{ahead:?}");
        let oblique = ring.ping(&wall((-1.0, -3.0), (5.0, 3.0)), here, &mut noise);
        assert!(oblique[0] < f64::EPSILON, "{oblique:?}");
    }
}
