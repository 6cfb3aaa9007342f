//! Evidence from a scanner: free up to where the beams ended, a Gaussian bump there, nothing behind.
//!
//! What one beam by itself says of a cell is [`beam_evidence`]. A scan's beams together free what lies
//! inside of the outline of their ends, each cell once: ray by ray, the cells before the scanner
//! would be visited a hundred times and those between far beams never.

mod bumps;
mod fan;
mod rings;
mod spread;

use mapfold_map::geometry::{Level, Point, Robot, UncertainPose};
use mapfold_map::raster::{EvidencePatch, LogOdds, SensorClass};

use super::Canvas;
use super::canvas::GRADES;
use super::outline::{corner, fixed};
use super::stroke::stroke;
use super::window::Window;
use crate::sensor::{Scan, ScannerProfile};

pub(super) use bumps::Bumps;
pub(super) use fan::Fan;
use fan::Sheaves;
use rings::Rings;
use spread::Spread;

/// How beams become evidence.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScannerEvidenceConfig {
    /// Evidence for "free" of a look for a cell that it saw through, nat (negative).
    pub free_nat: f64,
    /// Evidence for "occupied" of a beam that is known to have ended in a cell, nat.
    pub occupied_nat: f64,
    /// Beams are believed up to here, metres: further out neighbouring beams are half a metre apart.
    pub range_believed: f64,
    /// Width of the least thing that two neighbouring beams cannot both miss by chance, metres. Where
    /// they are farther apart, what lies between them is free by so much less.
    pub missed_width: f64,
    /// Where the heading's error moves a beam sideways by more than this many cells, it counts half;
    /// beyond twice as many, not at all.
    pub sideways_cells: f64,
    /// Evidence is rounded to this, in log-odds steps: coarser, it travels in longer runs.
    pub step: LogOdds,
}

impl ScannerEvidenceConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        free_nat: -0.4,
        occupied_nat: 0.85,
        range_believed: 30.0,
        missed_width: 0.1,
        sideways_cells: 2.0,
        step: LogOdds(10),
    };
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
    if before.abs() > BUMP_SDS {
        return (free, 0.0);
    }
    let spread = resolution / (sd * std::f64::consts::TAU.sqrt());
    let occupied = config.occupied_nat * spread.min(1.0) * (-0.5 * before * before).exp();
    (free, occupied)
}

/// Half the support of the bump, standard deviations.
const BUMP_SDS: f64 = 2.0;
/// Where the outline of what is free runs before the hit, standard deviations: halfway down the
/// ramp of [`beam_evidence`].
const OUTLINE_SDS: f64 = 1.5;
/// Beams farther apart than this, radians, are no fan: what lies between them was not looked at.
const FAN_INCREMENT_MAX: f64 = 0.1;
/// Variance of a place that may be anywhere in a cell, in squares of cells.
const CELL_VARIANCE: f64 = 1.0 / 12.0;
/// Places farther from the level's origin than this, in cells, are in no level.
const CELLS_MAX: f64 = 1e8;

/// The evidence of one scan. `usable` says beam by beam whether the reading passed the
/// plausibility checks; beams that are not usable, and those without return, say nothing.
///
/// It says what [`beam_evidence`] says of the cells that every beam crosses, hits before free and free
/// once a look: of 97 % of these cells to within 0.45 nat, of 85 % to within 0.2, of all free and all
/// occupied cells together to within 12 % (`tests/tests/raster.rs`). The rest lies at borders: a cell is free
/// if the outline holds its centre, not if a ray grazes it. Cells between beams are freed too.
pub fn scanner_evidence(
    scan: &Scan,
    usable: impl Fn(usize) -> bool,
    profile: &ScannerProfile,
    level_from_robot: &UncertainPose<Level, Robot>,
    resolution: f64,
    config: &ScannerEvidenceConfig,
    canvas: &mut Canvas,
) -> EvidencePatch {
    let grades = Rings::grades(config);
    let pose = &level_from_robot.pose;
    let level_from_sensor = pose.compose(&scan.robot_from_sensor);
    // From here on in cells.
    let start = level_from_sensor.position() / resolution;
    if start.norm().is_nan() || start.norm() > CELLS_MAX {
        return canvas.take(SensorClass::Scanner, config.step, grades);
    }
    let rings = Rings::new(scan, level_from_robot.covariance.sd(2), resolution, config);
    let per_metre = resolution.recip();
    let mut fan = std::mem::take(&mut canvas.fan);
    let mut bumps = std::mem::take(&mut canvas.bumps);
    bumps.make(config.occupied_nat);
    fan.gather(scan, usable, per_metre);
    let arm = level_from_sensor.position() - pose.position();
    let spread = Spread::new(profile, level_from_robot, &arm, resolution);
    let sheaves = fan.aim(level_from_sensor.heading(), rings.far, &spread);
    let (low, high) = sheaves.bounds(&start, rings.far);
    if let Some((low, window)) = canvas.begin(low, high) {
        let start = start - Point::new(f64::from(low.column), f64::from(low.row));
        free(&sheaves, &rings, start, window, canvas);
        hit(&sheaves, &bumps, &rings, start, canvas);
    }
    (canvas.fan, canvas.bumps) = (fan, bumps);
    canvas.take(SensorClass::Scanner, config.step, grades)
}

/// Lays down what is free. `start` is where the scanner is, in cells from the window's corner.
fn free(fan: &Sheaves, rings: &Rings, start: Point, window: Window, canvas: &mut Canvas) {
    let mut outline = std::mem::take(&mut canvas.outline);
    outline.begin(window);
    // An outline goes through the centres of cells.
    let centre = start - Point::new(0.5, 0.5);
    let eye = corner(&centre);
    let at = |sheaf: usize, free: f32| corner(&(centre + fan.direction(sheaf) * f64::from(free)));
    let mut last = at(0, fan.free[0]);
    for sheaf in fan.numbers() {
        let before = sheaf - 1;
        let (free, free_before) = (fan.free[sheaf], fan.free[before]);
        let end = at(sheaf, free);
        if fan.joins(sheaf) {
            outline.edge(last, end);
        } else if fan.follows(sheaf) {
            // What lies between a near end and a far one was seen as far as the near one; the far one's
            // beam went on by itself.
            let near = free.min(free_before);
            let far = if free_before < free { sheaf } else { before };
            let beside = at(far, near);
            outline.edge(last, beside);
            outline.edge(beside, end);
            cross(fan, far, near, &start, rings, canvas);
        } else {
            outline.edge(eye, end);
        }
        if !fan.follows(sheaf + 1) {
            outline.edge(end, eye);
            if !fan.follows(sheaf) {
                // What has no neighbours frees the cells that it crosses.
                cross(fan, sheaf, 0.0, &start, rings, canvas);
            }
        }
        last = end;
    }
    outline.tiles(|x, y, inside| rings.lay(&centre, (x, y), inside, canvas));
    canvas.outline = outline;
}

/// Frees the cells that a beam crosses by itself, from a distance on.
fn cross(
    fan: &Sheaves,
    sheaf: usize,
    from: f32,
    start: &Point,
    rings: &Rings,
    canvas: &mut Canvas,
) {
    let (from, free) = (f64::from(from), f64::from(fan.free[sheaf]));
    let at = |distance: f64| start + fan.direction(sheaf) * distance;
    let whole_to = rings.heading_to.min(free).max(from);
    for (from, to, grade) in [(from, whole_to, GRADES - 1), (whole_to, free, GRADES / 2 - 1)] {
        if from < to {
            stroke(&at(from), &at(to), |row, first, behind| canvas.lay(row, first, behind, grade));
        }
    }
}

/// Adds the bumps where beams ended: as many points a cell apart as fit in, each to the cell in which it
/// lies.
fn hit(fan: &Sheaves, bumps: &Bumps, rings: &Rings, start: Point, canvas: &mut Canvas) {
    let (far, heading_to) = (rings.far as f32, rings.heading_to as f32);
    let mut marks = canvas.marks();
    let numbers = fan.numbers();
    let [x, y, z, sd, along_x, along_y, counts] =
        [fan.x, fan.y, fan.z, fan.sd, fan.along_x, fan.along_y, fan.counts]
            .map(|column| &column[numbers.clone()]);
    let classes = bumps.classes();
    for at in 0..numbers.len() {
        let Some(bump) = classes.get(Bumps::class(sd[at])) else { continue };
        let (side, z) = (bump.side as f32, z[at]);
        if z < side || z + side > far {
            continue;
        }
        let beams = small(counts[at]) as i32;
        let halves = if z > heading_to { beams } else { 2 * beams };
        let values = bump.values().iter().map(|value| (halves * i32::from(*value)) >> 1);
        let middle = [start.x + f64::from(x[at]), start.y + f64::from(y[at])].map(fixed);
        let step = [along_x[at], along_y[at]].map(f64::from).map(fixed);
        marks.add_along(middle, step, bump.side, values);
    }
}

/// The whole number nearest to a small one that is not negative.
fn small(v: f32) -> u32 {
    // Adding this much leaves the lowest bit of a float just there.
    const SHIFT: f32 = (1 << 23) as f32;
    (v + SHIFT).to_bits() & 0xffff
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
            |_| true,
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
            |_| false,
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
