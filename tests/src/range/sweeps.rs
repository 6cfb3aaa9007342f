//! Simulated heads at work: before a target, and sweeping walls.

use std::fmt::Write as _;

use mapfold_client::perception::correction::{Corrected, CorrectionConfig, Corrector};
use mapfold_client::perception::plausibility::{PlausibilityConfig, judge};
use mapfold_client::perception::{BeamState, Config, extract_corrected};
use mapfold_client::robot::at_rest::{self, AtRestConfig};
use mapfold_client::sensor::calibration::{
    Calibration, CalibrationConfig, TargetReadings, calibrate,
};
use mapfold_client::sensor::{RangeTable, Scan, ScanGeometry, preset};
use mapfold_map::geometry::Pose as SensorPose;

use super::{FARTHEST_M, STEEPEST_DEG};
use crate::plane::{Piece, Point};
use crate::simulation::{IrBeam, IrHead, IrScanner, Noise, World};

/// One counted reading of a wall.
#[derive(Debug, Clone, Copy)]
pub struct Sample {
    /// True distance along the beam, metres.
    pub distance: f64,
    /// True incidence, degrees.
    pub incidence_deg: f64,
    /// Error of the reading as it came.
    pub raw: f64,
    /// Error after correction with the true incidence.
    pub known: Option<f64>,
    /// Error after correction as in a robot: with the incidence that the scan itself tells.
    pub in_situ: Option<f64>,
    /// Deviation claimed for that: noise, shared and systematic parts.
    pub claimed: f64,
    /// The same for the mean of [`AT_REST`] sweeps of a robot that stands.
    pub at_rest: Option<f64>,
    /// Deviation claimed for that.
    pub claimed_at_rest: f64,
    /// What noise alone, without any systematic error, would have deviated by.
    pub noise_sd: f64,
}

/// Sweeps that a robot takes while it stands.
pub const AT_REST: usize = 8;

/// A straight wall 0.8 to 2.2 m away, turned by up to 30 degrees.
fn wall(noise: &mut Noise) -> World {
    let away = 0.8 + 1.4 * noise.share();
    let turn = (noise.share() - 0.5) * 60f64.to_radians();
    let (left, right) = (4.0, -4.0);
    let place = |along: f64| {
        let (sin, cos) = turn.sin_cos();
        Point::new(away * cos - along * sin, away * sin + along * cos)
    };
    let walls = vec![Piece { a: place(left), b: place(right) }];
    World { name: "a wall", walls, way: Vec::new() }
}

/// A corner of two walls, and a cupboard of half a metre before one of them.
fn corner(noise: &mut Noise) -> World {
    let (x, y) = (0.8 + 1.8 * noise.share(), 0.8 + 1.8 * noise.share());
    let from = -2.0 + 1.5 * noise.share();
    let piece =
        |a: (f64, f64), b: (f64, f64)| Piece { a: Point::new(a.0, a.1), b: Point::new(b.0, b.1) };
    let walls = vec![
        piece((x, -4.0), (x, y)),
        piece((x, y), (-4.0, y)),
        piece((x - 0.4, from), (x - 0.4, from + 0.6)),
        piece((x - 0.4, from), (x, from)),
        piece((x - 0.4, from + 0.6), (x, from + 0.6)),
    ];
    World { name: "a corner", walls, way: Vec::new() }
}

/// Measures a target with a head and makes a table of it.
///
/// # Errors
/// Words for what the calibration refuses.
pub fn calibrated(head: &IrHead, per_node: u32, noise: &mut Noise) -> Result<Calibration, String> {
    let mut text = "distance_m,incidence_deg,reading_m\n".to_owned();
    for incidence in [0.0, 10.0, 20.0, 30.0, 40.0, 50.0, 55.0, 60.0, 65.0, 70.0_f64] {
        for step in 3..=41 {
            let distance = 0.1 * f64::from(step);
            for _ in 0..per_node {
                let read = head.target(distance, incidence.to_radians(), noise).unwrap_or(0.0);
                // Writing to a String cannot fail.
                let _ = writeln!(text, "{distance:.1},{incidence},{read:.4}");
            }
        }
    }
    let base = preset("ir-led").and_then(|s| s.scanner).ok_or("no preset ir-led")?;
    let readings = TargetReadings::parse(&text).map_err(|e| e.to_string())?;
    calibrate(&readings, &base, &CalibrationConfig::STANDARD).map_err(|e| e.to_string())
}

/// What is swept.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scene {
    /// One wall, in a sector of 60 degrees: the set-up of the design.
    Sector,
    /// One wall, in half a turn: from square to grazing every time.
    Wall,
    /// Two walls and a cupboard, in half a turn.
    Corner,
}

/// A robot's side of a calibrated scanner.
struct Seeing {
    scanner: IrScanner,
    plausibility: PlausibilityConfig,
    corrector: Corrector,
}

impl Seeing {
    fn new(head: &IrHead, done: &Calibration, scene: Scene) -> Result<Self, String> {
        let half_turn = IrScanner::new(*head);
        let scanner = match scene {
            Scene::Sector => IrScanner { first_rad: -30f64.to_radians(), beams: 61, ..half_turn },
            Scene::Wall | Scene::Corner => half_turn,
        };
        let corrector = Corrector::for_scanner(&done.profile, CorrectionConfig::STANDARD);
        Ok(Self {
            scanner,
            plausibility: PlausibilityConfig::for_scanner(&done.profile),
            corrector: corrector.ok_or("the profile has no table")?,
        })
    }

    /// One sweep from the origin: what it met, and as the robot reads it.
    fn read(&self, world: &World, heading: f64, noise: &mut Noise) -> (Vec<IrBeam>, Scan) {
        let beams = self.scanner.sweep(world, (Point::new(0.0, 0.0), heading), noise);
        let scan = Scan {
            geometry: ScanGeometry {
                first_bearing: self.scanner.first_rad,
                increment: self.scanner.increment_rad,
            },
            ranges: beams.iter().map(|b| b.reading_m.unwrap_or(f64::INFINITY)).collect(),
            range_max: f64::INFINITY,
            robot_from_sensor: SensorPose::identity(),
            repeats: Vec::new(),
        };
        (beams, scan)
    }

    /// [`AT_REST`] sweeps, as the robot makes one of them.
    fn stop(&self, world: &World, heading: f64, noise: &mut Noise) -> Result<Scan, String> {
        let scans: Vec<Scan> = (0..AT_REST).map(|_| self.read(world, heading, noise).1).collect();
        let scans: Vec<&Scan> = scans.iter().collect();
        at_rest::mean(&scans, &AtRestConfig::STANDARD).ok_or("too few scans".to_owned())
    }

    /// A scan's judged readings, and these corrected.
    fn correct(&mut self, scan: &Scan) -> (Vec<BeamState>, Corrected) {
        let states = judge(scan, &self.plausibility);
        let corrected = self.corrector.correct(scan, &states);
        (states, corrected)
    }
}

/// Normalised squared errors of the lines that are extracted from corrected sweeps of one wall, 2
/// on average if their covariances are right; and how many sweeps showed no line or several. `at_rest`:
/// of robots that stand, instead of single sweeps.
///
/// # Errors
/// The profile has no table.
pub fn line_errors(
    head: &IrHead,
    done: &Calibration,
    sweeps: u32,
    at_rest: bool,
    noise: &mut Noise,
) -> Result<(Vec<f64>, u32), String> {
    let mut seeing = Seeing::new(head, done, Scene::Sector)?;
    let config = Config::for_scanner(&done.profile);
    let (mut errors, mut others) = (Vec::new(), 0);
    for _ in 0..sweeps {
        let world = wall(noise);
        let scan = if at_rest {
            seeing.stop(&world, 0.0, noise)?
        } else {
            seeing.read(&world, 0.0, noise).1
        };
        let (_, corrected) = seeing.correct(&scan);
        let features = extract_corrected(&corrected, &config);
        let [segment] = features.segments.as_slice() else {
            others += 1;
            continue;
        };
        // The wall in Hesse's form, by this crate's own means.
        let [Piece { a, b }] = world.walls.as_slice() else { continue };
        let length = a.distance(*b);
        let (nx, ny) = ((b.y - a.y) / length, (a.x - b.x) / length);
        let signed = nx * a.x + ny * a.y;
        let (rho, alpha) = (signed.abs(), (signed.signum() * ny).atan2(signed.signum() * nx));
        let c = segment.line.covariance.matrix();
        let (c00, c01, c11) = (c[(0, 0)], c[(0, 1)], c[(1, 1)]);
        let (e, f) = (segment.line.line.rho() - rho, segment.line.line.alpha() - alpha);
        let determinant = c00 * c11 - c01 * c01;
        errors.push((c11 * e * e - 2.0 * c01 * e * f + c00 * f * f) / determinant);
    }
    Ok((errors, others))
}

/// Sweeps a scene again and again and corrects what comes.
///
/// # Errors
/// The profile has no table.
pub fn samples(
    head: &IrHead,
    done: &Calibration,
    scene: Scene,
    sweeps: u32,
    noise: &mut Noise,
) -> Result<Vec<Sample>, String> {
    let correction = done.profile.correction.as_ref().ok_or("the profile has no table")?;
    let table = RangeTable::new(correction);
    let mut seeing = Seeing::new(head, done, scene)?;
    let mut samples = Vec::new();
    for _ in 0..sweeps {
        let world = match scene {
            Scene::Sector | Scene::Wall => wall(noise),
            Scene::Corner => corner(noise),
        };
        let heading = 0.3 * (noise.share() - 0.5);
        let (beams, scan) = seeing.read(&world, heading, noise);
        let (states, corrected) = seeing.correct(&scan);
        let settled = seeing.stop(&world, heading, noise)?;
        let (_, settled) = seeing.correct(&settled);
        for (beam, read) in beams.iter().enumerate() {
            let IrBeam { reading_m: Some(reading), truth: Some((distance, incidence)) } = *read
            else {
                continue;
            };
            let counted = states[beam] == BeamState::Hit
                && distance <= FARTHEST_M
                && incidence.to_degrees() <= STEEPEST_DEG;
            if !counted {
                continue;
            }
            let systematic = done.profile.systematic_sd_m.powi(2);
            let [one, mean] = [&corrected, &settled].map(|of| {
                let (hit, part) = (of.states[beam] == BeamState::Hit, &of.noise[beam]);
                let error = hit.then(|| of.scan.ranges[beam] - distance);
                (error, (part.variance + part.shared + systematic).sqrt())
            });
            samples.push(Sample {
                distance,
                incidence_deg: incidence.to_degrees(),
                raw: reading - distance,
                known: table.correct(reading, incidence).map(|c| c.range - distance),
                in_situ: one.0,
                claimed: one.1,
                at_rest: mean.0,
                claimed_at_rest: mean.1,
                noise_sd: head.deviation(distance, incidence),
            });
        }
    }
    Ok(samples)
}
