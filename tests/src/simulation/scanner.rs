//! A laser scanner: narrow beams, noise, lost returns.

use super::drive::Pose;
use super::{Noise, World};

/// A scanner that looks a half turn ahead, a beam every degree.
#[derive(Debug, Clone, Copy)]
pub struct Scanner {
    /// Reading for "no return", metres.
    pub cap_m: f64,
    /// Standard deviation of a range, metres.
    pub range_sd_m: f64,
    /// Share of returns that get lost.
    pub lost_share: f64,
}

impl Default for Scanner {
    fn default() -> Self {
        Self { cap_m: 30.0, range_sd_m: 0.01, lost_share: 0.005 }
    }
}

impl Scanner {
    /// One sweep from a pose.
    pub fn scan(&self, world: &World, pose: Pose, noise: &mut Noise) -> Vec<f64> {
        let beam = |degrees: i32| {
            let angle = pose.1 + f64::from(degrees).to_radians();
            let hit = world.cast(pose.0, angle, self.cap_m);
            let lost = noise.share() < self.lost_share;
            match hit {
                Some((range, _)) if !lost => {
                    (range + noise.normal(self.range_sd_m)).clamp(0.1, self.cap_m)
                }
                _ => self.cap_m,
            }
        };
        (-90..=90).map(beam).collect()
    }
}
