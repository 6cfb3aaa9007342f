//! Single scans of which the truth is known, beam by beam.

use super::{Noise, Plan};
use crate::plane::Point;

/// Farthest that these scanners see, metres.
pub const REACH_M: f64 = 30.0;

/// How many beams a scanner has, and how wide it looks.
#[derive(Debug, Clone, Copy)]
pub struct Fan {
    /// Beams.
    pub beams: usize,
    /// From the first to the last, degrees.
    pub field_deg: f64,
}

impl Fan {
    /// Angle from one beam to the next, radians.
    pub fn increment(&self) -> f64 {
        self.field_deg.to_radians() / (self.beams - 1) as f64
    }

    /// Bearing of a beam, radians.
    pub fn bearing(&self, beam: usize) -> f64 {
        -0.5 * self.field_deg.to_radians() + beam as f64 * self.increment()
    }
}

/// What is wrong with a scanner's readings.
#[derive(Debug, Clone, Copy, Default)]
pub struct Errors {
    /// Standard deviation of a range, metres.
    pub range_sd_m: f64,
    /// Standard deviation of a bearing, radians.
    pub bearing_sd_rad: f64,
    /// Standard deviation of what all ranges of one scan have in common, metres.
    pub shared_sd_m: f64,
    /// Full width of a beam, radians: what it covers is averaged, so that readings at edges lie
    /// between the surfaces.
    pub width_rad: f64,
    /// Steps in which ranges are told, metres; 0 for none.
    pub step_m: f64,
    /// Share of returns that get lost.
    pub lost_share: f64,
}

/// Rays that a beam of some width is averaged from.
const RAYS: u32 = 9;

/// One scan and its truth.
#[derive(Debug, Clone)]
pub struct Sweep {
    /// Where the scanner was.
    pub at: Point,
    /// Where it looked, radians.
    pub heading: f64,
    /// One range a beam, metres; infinite without return.
    pub ranges: Vec<f64>,
    /// Which piece of the plan the middle of the beam hit, and where.
    pub hits: Vec<Option<(usize, Point)>>,
}

impl Sweep {
    /// Takes a scan.
    pub fn take(
        plan: &Plan,
        place: (Point, f64),
        fan: &Fan,
        errors: &Errors,
        noise: &mut Noise,
    ) -> Self {
        let (at, heading) = place;
        let shared = noise.normal(errors.shared_sd_m);
        let mut sweep = Self { at, heading, ranges: Vec::new(), hits: Vec::new() };
        for beam in 0..fan.beams {
            let angle = heading + fan.bearing(beam) + noise.normal(errors.bearing_sd_rad);
            let middle = plan.cast(at, angle, REACH_M);
            sweep.hits.push(middle.map(|(range, piece)| (piece, at.towards(angle, range))));
            let range = match middle {
                Some((range, _)) if errors.width_rad == 0.0 => Some(range),
                _ => mean_over_width(plan, at, angle, errors.width_rad),
            };
            let lost = noise.share() < errors.lost_share;
            let error = shared + noise.normal(errors.range_sd_m);
            let told = range.filter(|_| !lost).map_or(f64::INFINITY, |range| {
                let range = (range + error).max(0.05);
                if errors.step_m > 0.0 {
                    (range / errors.step_m).round() * errors.step_m
                } else {
                    range
                }
            });
            sweep.ranges.push(told);
        }
        sweep
    }
}

impl Sweep {
    /// A point of the plan in the scanner's frame.
    pub fn local(&self, p: Point) -> Point {
        let (sin, cos) = self.heading.sin_cos();
        let (x, y) = (p.x - self.at.x, p.y - self.at.y);
        Point::new(cos * x + sin * y, cos * y - sin * x)
    }
}

/// The mean of the rays that hit, if most do; the middle of the beam counts most.
fn mean_over_width(plan: &Plan, at: Point, angle: f64, width: f64) -> Option<f64> {
    let (mut sum, mut weights, mut all) = (0.0, 0.0, 0.0);
    for ray in 0..RAYS {
        let off = f64::from(ray) / f64::from(RAYS - 1) - 0.5;
        let weight = (-0.5 * (4.0 * off).powi(2)).exp();
        all += weight;
        if let Some((range, _)) = plan.cast(at, angle + off * width, REACH_M) {
            sum += weight * range;
            weights += weight;
        }
    }
    (weights > 0.5 * all).then(|| sum / weights)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readings_err_as_told_and_wide_beams_see_veils() {
        let mut noise = Noise::of_seed(3);
        let plan = Plan::office(0, &mut noise);
        let fan = Fan { beams: 361, field_deg: 180.0 };
        let place = plan.place(0, &mut noise);
        let range_of = |sweep: &Sweep, beam: usize| {
            sweep.hits[beam].map_or(f64::INFINITY, |(_, p)| p.distance(sweep.at))
        };
        let errors = Errors { range_sd_m: 0.02, ..Errors::default() };
        let (mut sum, mut count) = (0.0, 0.0);
        for _ in 0..20 {
            let sweep = Sweep::take(&plan, place, &fan, &errors, &mut noise);
            for beam in (0..fan.beams).filter(|beam| sweep.hits[*beam].is_some()) {
                sum += (sweep.ranges[beam] - range_of(&sweep, beam)).powi(2);
                count += 1.0;
            }
        }
        // Five standard errors of a variance.
        assert!((sum / count / 4e-4 - 1.0_f64).abs() < 5.0 * (2.0_f64 / count).sqrt());
        let wide = Errors { width_rad: 0.01, ..Errors::default() };
        let sweep = Sweep::take(&plan, place, &fan, &wide, &mut noise);
        let off = (0..fan.beams).filter(|b| (sweep.ranges[*b] - range_of(&sweep, *b)).abs() > 0.1);
        assert!((1..40).contains(&off.count()));
    }
}
