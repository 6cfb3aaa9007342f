//! Worlds of straight walls and round pillars, and a scanner in them: shares no code with what is
//! tested. Randomness is a small seeded generator, so every run is the same.

use std::f64::consts::TAU;

use mapfold_client::sensor::{Scan, ScanGeometry};
use mapfold_map::geometry::{Point, Pose};

/// A seeded generator (`SplitMix64`) with Gaussian numbers.
pub(crate) struct Chance(pub(crate) u64);

impl Chance {
    pub(crate) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub(crate) fn gauss(&mut self) -> f64 {
        (-2.0 * (1.0 - self.unit()).ln()).sqrt() * (TAU * self.unit()).cos()
    }
}

/// What stands around.
#[derive(Debug, Clone, Default)]
pub(crate) struct Room {
    pub(crate) walls: Vec<[(f64, f64); 2]>,
    pub(crate) pillars: Vec<(f64, f64, f64)>,
}

impl Room {
    /// A closed polygon.
    pub(crate) fn polygon(corners: &[(f64, f64)]) -> Self {
        let walls =
            (0..corners.len()).map(|i| [corners[i], corners[(i + 1) % corners.len()]]).collect();
        Self { walls, pillars: Vec::new() }
    }

    /// Distance to the first thing in this direction; infinite if there is none.
    pub(crate) fn cast(&self, from: Point, bearing: f64) -> f64 {
        let (dy, dx) = bearing.sin_cos();
        let mut nearest = f64::INFINITY;
        for [a, b] in &self.walls {
            let (ex, ey) = (b.0 - a.0, b.1 - a.1);
            let (px, py) = (a.0 - from.x, a.1 - from.y);
            let determinant = ex * dy - ey * dx;
            if determinant != 0.0 {
                let t = (ex * py - ey * px) / determinant;
                let s = (dx * py - dy * px) / determinant;
                if t > 1e-9 && (0.0..=1.0).contains(&s) {
                    nearest = nearest.min(t);
                }
            }
        }
        for &(x, y, radius) in &self.pillars {
            let (px, py) = (x - from.x, y - from.y);
            let along = px * dx + py * dy;
            let reach_sq = radius * radius - (px * px + py * py - along * along);
            if along > 0.0 && reach_sq > 0.0 {
                nearest = nearest.min(along - reach_sq.sqrt());
            }
        }
        nearest
    }

    /// A scan from a place, with the range and bearing noise of one beam.
    pub(crate) fn scan(
        &self,
        (x, y, heading): (f64, f64, f64),
        (count, increment): (usize, f64),
        (range_sd, bearing_sd): (f64, f64),
        chance: &mut Chance,
    ) -> Scan {
        let first_bearing = -0.5 * increment * (count - 1) as f64;
        let geometry = ScanGeometry { first_bearing, increment };
        let ranges = (0..count)
            .map(|beam| {
                let bearing = heading + geometry.bearing(beam) + bearing_sd * chance.gauss();
                self.cast(Point::new(x, y), bearing) + range_sd * chance.gauss()
            })
            .collect();
        Scan {
            geometry,
            ranges,
            range_max: 30.0,
            robot_from_sensor: Pose::identity(),
            repeats: Vec::new(),
        }
    }
}
