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
    /// Its growth with distance.
    pub range_sd_per_m: f64,
    /// A wall echoes only if it is met within this angle of its normal, radians.
    pub mirror_rad: f64,
    /// Share of echoes that get lost.
    pub lost_share: f64,
    /// Share of corners and edges well inside of the cone that echo.
    pub corners_share: f64,
    /// Share of pulses that walls threw aside and that come back by a detour, 0.3 to 3 m
    /// later.
    pub detour_share: f64,
    /// Share of readings that are another sonar's pulse: anything.
    pub crosstalk_share: f64,
}

/// How much longer detours are, metres.
const DETOUR_M: std::ops::Range<f64> = 0.3..3.0;
/// Corners echo in this share of the cone about its axis.
const CORNERS_WITHIN: f64 = 0.8;

impl Default for SonarRing {
    /// Sixteen around, as on many research robots.
    fn default() -> Self {
        let step = std::f64::consts::TAU / 16.0;
        Self {
            bearings_rad: (0..16).map(|index| f64::from(index) * step).collect(),
            cone_rad: 25.0_f64.to_radians(),
            range_max_m: 5.0,
            range_sd_m: 0.03,
            range_sd_per_m: 0.0,
            mirror_rad: 20.0_f64.to_radians(),
            lost_share: 0.1,
            corners_share: 0.0,
            detour_share: 0.0,
            crosstalk_share: 0.0,
        }
    }
}

/// Rays that stand for one cone.
const RAYS: i32 = 25;

impl SonarRing {
    /// Twenty-four around in rooms of smooth walls, with all that is wrong with sonars: those walls echo
    /// within 18 degrees only, corners now and then, detours, crosstalk.
    pub fn in_smooth_rooms() -> Self {
        let step = std::f64::consts::TAU / 24.0;
        Self {
            bearings_rad: (0..24).map(|index| f64::from(index) * step).collect(),
            range_sd_m: 0.01,
            range_sd_per_m: 0.005,
            mirror_rad: 18.0_f64.to_radians(),
            lost_share: 0.0,
            corners_share: 0.6,
            detour_share: 0.5,
            crosstalk_share: 0.02,
            ..Self::default()
        }
    }

    /// One round of readings from a pose; 0 where no echo came back.
    pub fn ping(&self, world: &World, pose: Pose, noise: &mut Noise) -> Vec<f64> {
        self.ping_rounds(world, pose, 1, noise).pop().unwrap_or_default()
    }

    /// Rounds of readings from one pose. Walls, corners and detours are the same in all of them.
    pub fn ping_rounds(
        &self,
        world: &World,
        pose: Pose,
        rounds: usize,
        noise: &mut Noise,
    ) -> Vec<Vec<f64>> {
        let mut told = vec![Vec::new(); rounds];
        for bearing in &self.bearings_rad {
            let nearest = self.nearest(world, pose, *bearing, noise);
            for round in &mut told {
                round.push(self.reading(nearest, noise));
            }
        }
        told
    }

    fn reading(&self, nearest: Option<f64>, noise: &mut Noise) -> f64 {
        if self.crosstalk_share > 0.0 && noise.share() < self.crosstalk_share {
            return 0.3 + noise.share() * (self.range_max_m - 0.3);
        }
        match nearest {
            Some(range) if noise.share() >= self.lost_share => {
                let sd = self.range_sd_m + self.range_sd_per_m * range;
                (range + noise.normal(sd)).max(0.15)
            }
            _ => 0.0,
        }
    }

    /// Where the first echo comes from, metres.
    fn nearest(&self, world: &World, pose: Pose, bearing: f64, noise: &mut Noise) -> Option<f64> {
        let axis = pose.1 + bearing;
        let ray = |index: i32| {
            let off = self.cone_rad * (f64::from(index) / f64::from(RAYS - 1) - 0.5);
            world.cast(pose.0, axis + off, self.range_max_m)
        };
        let mut nearest = (0..RAYS)
            .filter_map(ray)
            .filter(|(_, cosine)| *cosine >= self.mirror_rad.cos())
            .map(|(range, _)| range)
            .fold(f64::INFINITY, f64::min);
        if self.corners_share > 0.0 {
            for corner in world.walls.iter().flat_map(|wall| [wall.a, wall.b]) {
                let (range, angle) =
                    (pose.0.distance(corner), (corner.y - pose.0.y).atan2(corner.x - pose.0.x));
                let off = (angle - axis).sin().atan2((angle - axis).cos()).abs();
                let within = off < 0.5 * self.cone_rad * CORNERS_WITHIN && range < nearest;
                let seen = || {
                    let first = world.cast(pose.0, angle, range + 0.01);
                    first.is_none_or(|(first, _)| first > range - 0.02)
                };
                if within && seen() && noise.share() < self.corners_share {
                    nearest = range;
                }
            }
        }
        if nearest.is_infinite() && self.detour_share > 0.0 {
            let first = world.cast(pose.0, axis, self.range_max_m);
            if let Some((first, _)) = first.filter(|_| noise.share() < self.detour_share) {
                let later = DETOUR_M.start + noise.share() * (DETOUR_M.end - DETOUR_M.start);
                nearest = first + later;
            }
        }
        (nearest < self.range_max_m).then_some(nearest)
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

    #[test]
    fn smooth_rooms_have_detours_corners_and_crosstalk_as_often_as_told() {
        let wall = Piece { a: Point::new(-1.0, -3.0), b: Point::new(5.0, 3.0) };
        let world = World { name: "an oblique wall", walls: vec![wall], way: Vec::new() };
        let ring = SonarRing { bearings_rad: vec![0.0], ..SonarRing::in_smooth_rooms() };
        let mut noise = Noise::of_seed(5);
        let here = (Point::new(0.0, 0.0), 0.0);
        let rounds: Vec<Vec<Vec<f64>>> =
            (0..2000).map(|_| ring.ping_rounds(&world, here, 2, &mut noise)).collect();
        // The wall is 2 m ahead at 45 degrees: silent, or a detour of at least 2.3 m.
        let late = rounds.iter().filter(|r| r[0][0] > 2.2).count();
        let changed = rounds.iter().filter(|r| (r[0][0] - r[1][0]).abs() > 0.3).count();
        assert!((900..1100).contains(&late), "{late}");
        // One of two is crosstalk: 4 %.
        assert!((40..110).contains(&changed), "{changed}");
    }
}
