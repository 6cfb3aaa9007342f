//! Evidence from a scanner: free along the beam, a Gaussian bump where it ended, nothing behind.

use mapfold_map::geometry::{Level, Point, Robot, UncertainPose, unit_normal};
use mapfold_map::raster::{EvidencePatch, LogOdds, SensorClass};
use nalgebra::RowVector3;

use super::Canvas;
use super::walk::walk;
use crate::sensor::{Scan, ScannerProfile};

/// How beams become evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScannerEvidenceConfig {
    /// Evidence for "free" of a look for a cell that it saw through, nat (negative).
    pub free_nat: f64,
    /// Evidence for "occupied" of a beam that is known to have ended in a cell, nat.
    pub occupied_nat: f64,
    /// Beams are believed up to here, metres: further out neighbouring beams are half a metre apart.
    pub range_believed: f64,
    /// Where the heading's error moves a beam sideways by more than this many cells, it counts half;
    /// beyond twice as many, not at all.
    pub sideways_cells: f64,
}

impl ScannerEvidenceConfig {
    /// The defaults.
    pub const STANDARD: Self =
        Self { free_nat: -0.4, occupied_nat: 0.85, range_believed: 30.0, sideways_cells: 2.0 };
}

/// Evidence of one beam of range `z` for a cell at distance `d`, `sd` being the deviation of their
/// difference and `resolution` the cell's edge, all metres: the free part (zero or negative) and
/// the occupied part (zero or positive), nat.
///
/// Free up to 2 sd before the hit, falling to nothing at 1 sd; a Gaussian bump of support 2 sd
/// at the hit, whose integral is that of one cell of full evidence when it is wider than a cell;
/// nothing behind. The exact posterior of one beam has this shape (see the tests).
pub fn beam_evidence(
    d: f64,
    z: f64,
    sd: f64,
    resolution: f64,
    config: &ScannerEvidenceConfig,
) -> (f64, f64) {
    let before = (z - d) / sd;
    let free = config.free_nat * (before - 1.0).clamp(0.0, 1.0);
    if before.abs() > 2.0 {
        return (free, 0.0);
    }
    let spread = resolution / (sd * std::f64::consts::TAU.sqrt());
    let occupied = config.occupied_nat * spread.min(1.0) * (-0.5 * before * before).exp();
    (free, occupied)
}

/// The evidence of one scan. `usable` says beam by beam whether the reading passed the
/// plausibility checks; beams that are not usable, and those without return, say nothing.
pub fn scanner_evidence(
    scan: &Scan,
    usable: &[bool],
    profile: &ScannerProfile,
    level_from_robot: &UncertainPose<Level, Robot>,
    resolution: f64,
    config: &ScannerEvidenceConfig,
    canvas: &mut Canvas,
) -> EvidencePatch {
    let pose = &level_from_robot.pose;
    let level_from_sensor = pose.compose(&scan.robot_from_sensor);
    let start = level_from_sensor.position();
    let heading_sd = level_from_robot.covariance.sd(2);
    let cell_variance = resolution * resolution / 12.0;
    let full_to = config.sideways_cells * resolution / heading_sd.max(1e-9);
    let far = config.range_believed.min(2.0 * full_to);
    for (beam, z) in scan.ranges.iter().enumerate() {
        if !usable.get(beam).is_some_and(|usable| *usable) {
            continue;
        }
        let bearing = level_from_sensor.heading() + scan.geometry.bearing(beam);
        let direction = unit_normal(bearing);
        // The pose's error along the beam: its position projected, and its heading by the lever
        // of the scanner's place on the robot.
        let along = j_along_pose(&direction, &(start - pose.position()));
        let pose_variance = level_from_robot.covariance.transformed(&along).matrix()[(0, 0)];
        let range_sd = profile.range_sd(*z);
        let variance = range_sd * range_sd
            + profile.systematic_sd_m * profile.systematic_sd_m
            + pose_variance.max(0.0)
            + cell_variance;
        let sd = variance.sqrt();
        walk(&start, &direction, (z + 2.0 * sd).min(far), resolution, |cell, from, to| {
            let d = 0.5 * (from + to);
            let weight = if d > full_to { 0.5 } else { 1.0 };
            let (free, occupied) = beam_evidence(d, *z, sd, resolution, config);
            if free < 0.0 {
                canvas.free_once(cell, (weight * free) as f32);
            }
            if occupied > 0.0 {
                // A cell that the ray only grazes gets its share.
                let share = ((to - from) / resolution).min(1.0);
                canvas.hit(cell, (weight * share * occupied) as f32);
            }
        });
    }
    canvas.take(SensorClass::Scanner, LogOdds(1))
}

/// d(place of the scanner along `direction`) / d(x, y, heading) of the robot, `arm` leading from
/// the robot to the scanner in the level frame.
fn j_along_pose(direction: &Point, arm: &Point) -> RowVector3<f64> {
    RowVector3::new(direction.x, direction.y, direction.y * arm.x - direction.x * arm.y)
}

#[cfg(test)]
mod tests {
    use mapfold_map::geometry::{Covariance, Pose};
    use mapfold_map::raster::{Cell, TILE_CELLS, Tile, TileKey};

    use super::*;
    use crate::sensor::{ScanGeometry, preset};

    fn scan(ranges: Vec<f64>, first_bearing: f64) -> Scan {
        Scan {
            geometry: ScanGeometry { first_bearing, increment: 1f64.to_radians() },
            ranges,
            range_max: 50.0,
            robot_from_sensor: Pose::identity(),
            repeats: Vec::new(),
        }
    }

    fn evidence(scan: &Scan, pose: Pose<Level, Robot>, sd: [f64; 3]) -> EvidencePatch {
        let profile = preset("sick-lms").and_then(|s| s.scanner).unwrap();
        scanner_evidence(
            scan,
            &vec![true; scan.ranges.len()],
            &profile,
            &UncertainPose { pose, covariance: Covariance::from_variances(sd.map(|s| s * s)) },
            0.05,
            &ScannerEvidenceConfig::STANDARD,
            &mut Canvas::default(),
        )
    }

    fn value(patch: &EvidencePatch, x: f64, y: f64) -> i32 {
        let (index, offset) = Cell::holding(&Point::new(x, y), 0.05).tile();
        let mut tile = Tile::default();
        if let Some(cells) = patch.tiles.get(&index) {
            tile.add(cells);
        }
        assert!(offset < TILE_CELLS);
        tile.cells()[offset]
    }

    #[test]
    fn one_beam_is_free_then_occupied_then_silent() {
        let patch = evidence(&scan(vec![3.02], 0.0), Pose::new(0.02, 0.02, 0.0), [0.0; 3]);
        assert_eq!(value(&patch, 1.0, 0.02), -40);
        assert!(value(&patch, 3.03, 0.02) > 30);
        for behind in 1..10 {
            assert_eq!(value(&patch, 3.15 + 0.05 * f64::from(behind), 0.02), 0);
        }
        assert_eq!(value(&patch, 1.0, 0.07), 0, "a narrow beam says nothing beside itself");
    }

    /// The exact posterior of one beam over a row of cells with prior 1/2 and first-hit Gaussian
    /// model, by enumeration of which cell is hit first (algorithm of the 1-D oracle).
    fn posterior(z: f64, sd: f64, cells: usize, resolution: f64) -> Vec<f64> {
        let prior: f64 = 0.5;
        let hit: Vec<f64> = (0..cells)
            .map(|k| {
                let d = (k as f64 + 0.5) * resolution;
                prior * (1.0 - prior).powi(k as i32) * (-0.5 * ((z - d) / sd).powi(2)).exp()
            })
            .collect();
        let total: f64 = hit.iter().sum();
        (0..cells)
            .map(|k| (prior * hit[..k].iter().sum::<f64>() + hit[k]) / total)
            .map(|p| (p / (1.0 - p)).ln())
            .collect()
    }

    #[test]
    fn the_model_has_the_sign_of_the_exact_posterior_before_at_and_behind_the_hit() {
        let (z, sd, resolution) = (2.0, 0.04, 0.05);
        let exact = posterior(z, sd, 80, resolution);
        for (k, exact) in exact.iter().enumerate() {
            let d = (k as f64 + 0.5) * resolution;
            let config = ScannerEvidenceConfig::STANDARD;
            let (free, occupied) = beam_evidence(d, z, sd, resolution, &config);
            if d < z - 3.0 * sd {
                assert!(*exact < -1.0 && free <= config.free_nat && occupied.abs() < 1e-12);
            } else if d > z + 3.0 * sd {
                assert!(exact.abs() < 0.1, "{d}: {exact}");
                assert!(free.abs() < 1e-12 && occupied.abs() < 1e-12);
            }
        }
        // The bump sits where the exact posterior has its largest value, to within a cell or two:
        // with a prior of 1/2 the first of several equally likely cells is the likelier hit.
        let peak = (0..exact.len()).max_by(|a, b| exact[*a].total_cmp(&exact[*b])).unwrap();
        assert!((peak as f64 + 0.5 - z / resolution).abs() <= 2.0);
    }

    #[test]
    fn the_bump_holds_the_evidence_of_one_cell_however_wide_it_is() {
        let config = ScannerEvidenceConfig::STANDARD;
        for sd in [0.03, 0.06, 0.15] {
            let sum: f64 = (0..4000)
                .map(|i| beam_evidence(f64::from(i) * 1e-3, 2.0, sd, 0.05, &config).1 * 1e-3)
                .sum();
            let one_cell = config.occupied_nat * 0.05;
            // A support of 2 sd holds 95 % of a Gaussian.
            assert!((sum / one_cell - 0.9545).abs() < 0.01, "{sd}: {}", sum / one_cell);
        }
    }

    #[test]
    fn a_look_from_whole_cells_away_gives_the_same_patch_moved() {
        let ranges: Vec<f64> = (0..180).map(|i| 2.0 + f64::from(i % 17) * 0.11).collect();
        let scan = scan(ranges, -1.57);
        let sd = [0.02, 0.02, 0.003];
        let here = evidence(&scan, Pose::new(0.512, 0.273, 0.4), sd);
        let there = evidence(&scan, Pose::new(0.512 + 6.4, 0.273 - 3.2, 0.4), sd);
        let cells = |patch: &EvidencePatch| -> Vec<_> {
            let key = |tile| TileKey { class: patch.class, tile };
            let keyed = patch.tiles.iter().map(|(tile, cells)| (key(*tile), cells.clone()));
            keyed.collect()
        };
        let (here, there) = (cells(&here), cells(&there));
        assert_eq!(here.len(), there.len());
        let mut differing = 0;
        for ((a, from), (b, to)) in here.iter().zip(&there) {
            assert_eq!((a.tile.x + 2, a.tile.y - 1), (b.tile.x, b.tile.y));
            let (mut left, mut right) = (Tile::default(), Tile::default());
            left.add(from);
            right.add(to);
            differing += left.cells().iter().zip(right.cells()).filter(|(l, r)| l != r).count();
        }
        // Rays through cell corners may round to the other side.
        assert!(differing < 40, "{differing} cells differ");
    }

    #[test]
    fn beams_that_are_not_usable_say_nothing() {
        let profile = preset("sick-lms").and_then(|s| s.scanner).unwrap();
        let pose = UncertainPose { pose: Pose::identity(), covariance: Covariance::zero() };
        let patch = scanner_evidence(
            &scan(vec![3.0, 50.0], 0.0),
            &[false, false],
            &profile,
            &pose,
            0.05,
            &ScannerEvidenceConfig::STANDARD,
            &mut Canvas::default(),
        );
        assert!(patch.tiles.is_empty());
    }

    #[test]
    fn an_uncertain_heading_silences_far_cells() {
        let scan = scan(vec![20.0], 0.0);
        let pose = Pose::new(0.02, 0.02, 0.0);
        let sure = evidence(&scan, pose, [0.0, 0.0, 0.001]);
        let unsure = evidence(&scan, pose, [0.0, 0.0, 0.02]);
        assert_eq!(value(&sure, 15.0, 0.02), -40);
        assert_eq!(value(&unsure, 3.0, 0.02), -40);
        assert_eq!(value(&unsure, 7.0, 0.02), -20);
        assert_eq!(value(&unsure, 15.0, 0.02), 0);
    }
}
