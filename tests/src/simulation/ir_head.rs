//! A range finder with an infrared LED, like the head of the paper's scanner: cheap, and wrong in
//! ways that depend on how far a wall is and how it stands.
//!
//! The phase of the light is measured against leaked light (a ripple in the distance), the receiver
//! saturates close by (readings too short), the spot smears out on slanted walls (readings too
//! long, ever more so), and its echo weakens with distance and slant (noise, lost echoes). A beam
//! is as wide as an LED's: its reading is the mean over what it covers, so that edges give mixed
//! pixels. Each head has figures of its own, drawn from a seed, that nothing else knows.

use super::drive::Pose;
use super::{Noise, World};

/// One head.
#[derive(Debug, Clone, Copy)]
pub struct IrHead {
    ripple_m: f64,
    ripple_period_m: f64,
    ripple_phase: f64,
    ripple_fades_m: f64,
    gain: f64,
    near_m: f64,
    near_reach_m: f64,
    smear: f64,
    slant_m: f64,
    noise_m: f64,
    noise_per_m: f64,
    /// Full width of a beam.
    beam_rad: f64,
    /// Readings come in steps of this.
    step_m: f64,
    lost_share: f64,
}

/// Rays that stand for one beam.
const RAYS: i32 = 9;

/// Farther than this no echo is strong enough.
const REACH_M: f64 = 6.0;

/// What a wall does to a ray: how far it is, and the incidence (radians from its normal).
#[derive(Debug, Clone, Copy)]
struct Echo {
    distance: f64,
    incidence: f64,
}

impl IrHead {
    /// The head that belongs to a seed: its errors are those of the design (ripple of 6 cm and
    /// 1.7 m, 5 cm short close by, noise of 8 mm and 4 mm per metre), give or take.
    pub fn of_seed(seed: u64) -> Self {
        let mut noise = Noise::of_seed(seed ^ 0x4952_6865_6164);
        let mut about =
            |middle: f64, share: f64| middle * (1.0 + share * (2.0 * noise.share() - 1.0));
        Self {
            ripple_m: about(0.06, 0.15),
            ripple_period_m: about(1.7, 0.1),
            ripple_phase: about(0.0, 0.0) + about(0.5, 1.0),
            ripple_fades_m: about(6.0, 0.2),
            gain: about(0.002, 1.0),
            near_m: about(0.05, 0.2),
            near_reach_m: about(0.5, 0.15),
            smear: about(0.007, 0.3),
            slant_m: about(0.015, 0.3),
            noise_m: about(0.008, 0.1),
            noise_per_m: about(0.004, 0.1),
            beam_rad: about(0.015, 0.3),
            step_m: 0.005,
            lost_share: 0.01,
        }
    }

    /// How much too long a reading is on average.
    fn error(&self, echo: Echo) -> f64 {
        let Echo { distance: d, incidence } = echo;
        let turn = std::f64::consts::TAU * d / self.ripple_period_m + self.ripple_phase;
        let ripple = self.ripple_m * turn.sin() * (-d / self.ripple_fades_m).exp();
        let near = self.near_m * (-d / self.near_reach_m).exp();
        let smear = self.smear * d * (1.0 / incidence.cos() - 1.0);
        let slant = self.slant_m * (d / 4.0).powi(2) * (incidence / 1.2).powi(2);
        ripple + self.gain * d - near + smear + slant
    }

    /// Deviation of a reading.
    pub fn deviation(&self, distance: f64, incidence: f64) -> f64 {
        self.noise_m + self.noise_per_m * distance / incidence.cos().sqrt()
    }

    /// The reading of one beam that covers these echoes, most of its light on the middle one;
    /// nothing if the echo gets lost.
    fn reading(&self, echoes: &[Option<Echo>], noise: &mut Noise) -> Option<f64> {
        let middle = (*echoes.get(echoes.len() / 2)?)?;
        let half = (echoes.len() / 2).max(1) as f64;
        let (mut sum, mut weight) = (0.0, 0.0);
        for (index, echo) in echoes.iter().enumerate() {
            let Some(echo) = echo else { continue };
            let off = (index as f64 - half) / half;
            let light = (-2.0 * off * off).exp();
            sum += light * echo.distance;
            weight += light;
        }
        let mean = Echo { distance: sum / weight, incidence: middle.incidence };
        // Echoes fade with distance and slant.
        let faint = ((mean.distance / 5.0).powi(4) + (mean.incidence / 1.35).powi(12)).min(1.0);
        if noise.share() < self.lost_share + 0.5 * faint {
            return None;
        }
        let sd = self.deviation(mean.distance, mean.incidence);
        let reading = mean.distance + self.error(mean) + noise.normal(sd);
        Some(((reading / self.step_m).round() * self.step_m).max(0.05))
    }

    /// A reading of a large flat target at a distance along the beam under an incidence.
    pub fn target(&self, distance: f64, incidence: f64, noise: &mut Noise) -> Option<f64> {
        // The target stands `distance` away along the middle ray, its normal `incidence` off it.
        let square = distance * incidence.cos();
        let echoes: Vec<Option<Echo>> = (0..RAYS)
            .map(|ray| {
                let slant = incidence + self.ray(ray);
                Some(Echo { distance: square / slant.cos(), incidence: slant.abs() })
            })
            .collect();
        self.reading(&echoes, noise)
    }

    /// Angle of a ray off the middle of its beam.
    fn ray(&self, ray: i32) -> f64 {
        self.beam_rad * (f64::from(ray) / f64::from(RAYS - 1) - 0.5)
    }
}

/// One reading of a sweep.
#[derive(Debug, Clone, Copy)]
pub struct IrBeam {
    /// What the head said, metres; nothing if no echo came back.
    pub reading_m: Option<f64>,
    /// How far the wall is that the middle of the beam met, and the incidence, radians.
    pub truth: Option<(f64, f64)>,
}

/// A head that is turned from beam to beam.
#[derive(Debug, Clone, Copy)]
pub struct IrScanner {
    /// The head.
    pub head: IrHead,
    /// Beam 0, radians from the heading.
    pub first_rad: f64,
    /// From one beam to the next, radians.
    pub increment_rad: f64,
    /// Number of beams.
    pub beams: u32,
    /// Deviation of a beam's direction, radians.
    pub jitter_rad: f64,
}

impl IrScanner {
    /// A half turn in steps of one degree, each a tenth of a degree off.
    pub fn new(head: IrHead) -> Self {
        let increment_rad = 1f64.to_radians();
        Self {
            head,
            first_rad: -std::f64::consts::FRAC_PI_2,
            increment_rad,
            beams: 181,
            jitter_rad: 0.1 * increment_rad,
        }
    }

    /// One sweep from a pose. The truth is that of the direction in which the beam really went.
    pub fn sweep(&self, world: &World, pose: Pose, noise: &mut Noise) -> Vec<IrBeam> {
        let beam = |index: u32| {
            let angle = pose.1
                + self.first_rad
                + f64::from(index) * self.increment_rad
                + noise.normal(self.jitter_rad);
            let cast = |off: f64| {
                world.cast(pose.0, angle + off, REACH_M).map(|(distance, cosine)| Echo {
                    distance,
                    incidence: cosine.clamp(0.0, 1.0).acos(),
                })
            };
            let echoes: Vec<Option<Echo>> = (0..RAYS).map(|ray| cast(self.head.ray(ray))).collect();
            IrBeam {
                reading_m: self.head.reading(&echoes, noise),
                truth: cast(0.0).map(|echo| (echo.distance, echo.incidence)),
            }
        };
        (0..self.beams).map(beam).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plane::{Piece, Point};

    #[test]
    fn readings_have_the_error_and_the_deviation_of_the_head() {
        let head = IrHead::of_seed(1);
        let mut noise = Noise::of_seed(2);
        for (distance, incidence) in [(0.4, 0.0), (1.0, 0.5), (2.5, 1.0), (4.0, 0.2)] {
            let readings: Vec<f64> =
                (0..20_000).filter_map(|_| head.target(distance, incidence, &mut noise)).collect();
            let count = readings.len() as f64;
            assert!(count > 10_000.0);
            let mean = readings.iter().sum::<f64>() / count;
            let sd = (readings.iter().map(|r| (r - mean).powi(2)).sum::<f64>() / count).sqrt();
            let expected = distance + head.error(Echo { distance, incidence });
            // A wide beam on a slanted wall reads a trifle long.
            assert!((mean - expected).abs() < 2e-3, "{distance} {incidence}: {mean} {expected}");
            assert!((sd / head.deviation(distance, incidence) - 1.0).abs() < 0.05, "{sd}");
        }
    }

    #[test]
    fn a_beam_on_an_edge_reads_something_between() {
        let wall =
            |x: f64, from: f64, to: f64| Piece { a: Point::new(x, from), b: Point::new(x, to) };
        let world = World {
            name: "an edge",
            walls: vec![wall(1.0, 0.0, 2.0), wall(2.0, -2.0, 2.0)],
            way: Vec::new(),
        };
        let scanner = IrScanner {
            first_rad: 0.0,
            beams: 1,
            jitter_rad: 0.0,
            ..IrScanner::new(IrHead::of_seed(3))
        };
        let mut noise = Noise::of_seed(4);
        let here = (Point::new(0.0, -1e-3), 0.0);
        let read = (0..50).find_map(|_| scanner.sweep(&world, here, &mut noise)[0].reading_m);
        assert!(read.is_some_and(|r| (1.2..1.8).contains(&r)), "{read:?}");
    }

    #[test]
    fn each_seed_is_a_head_of_its_own() {
        let error = |seed: u64| IrHead::of_seed(seed).error(Echo { distance: 2.0, incidence: 0.3 });
        assert!((error(1) - error(1)).abs() < 1e-15);
        assert!((error(1) - error(2)).abs() > 1e-4);
    }
}
