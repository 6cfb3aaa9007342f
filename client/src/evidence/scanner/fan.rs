//! The beams of the scan under way, in cells about the scanner.

use mapfold_map::geometry::{Point, unit_normal};
use mapfold_map::raster::Cell;

use super::{BUMP_SDS, FAN_INCREMENT_MAX, OUTLINE_SDS};
use crate::sensor::{Scan, ScanGeometry};

/// Classes of deviations to a cell, and their number: wider bumps are rare and have the last class's
/// width at least.
const CLASSES_A_CELL: f64 = 32.0;
const CLASSES: usize = 8 * 32;

/// Density of the bell curve in its middle, by standard deviations: 1 / sqrt(2 pi).
const BELL_DENSITY: f64 = 0.398_942_280_401_432_7;

/// Neighbouring beams that ended within this of the first of them, in cells, are entered as one.
const TOGETHER: f64 = 0.5;
/// Most beams that are.
const TOGETHER_MOST: u32 = 32;

/// Beams that ended at one place, in cells about the scanner.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sheaf {
    /// Beams.
    pub(super) count: u32,
    /// The mean of where they ended, and of how far away that is.
    pub(super) end: Point,
    pub(super) z: f64,
    /// Deviation of that distance for each of them.
    pub(super) sd: f64,
    /// A unit vector towards it in the level frame.
    pub(super) direction: Point,
    /// How far it is free.
    pub(super) free: f64,
    /// Whether its first beam is a neighbour of the last sheaf's last beam.
    pub(super) follows: bool,
}

/// Steepest slope, by the tangent of the incidence, at which neighbouring ends are taken for one surface.
const SLOPE_MAX: f64 = 6.0;
/// Ends that are apart in depth by this many cells more than such a slope are not.
const JUMP_CELLS: f64 = 2.0;

impl Sheaf {
    /// Whether it follows the one before, and ended on the same surface as far as can be told.
    pub(super) fn joins(&self, before: &Self) -> bool {
        let across = before.direction.perp(&self.direction).abs() * self.z.min(before.z);
        self.follows && (self.z - before.z).abs() <= SLOPE_MAX * across + JUMP_CELLS
    }
}

/// The evidence of bumps for cells at so many steps from their middle, millinats.
#[derive(Debug, Default)]
pub(super) struct Bumps {
    occupied_nat: f64,
    /// By classes of deviations, where a bump begins in `values`, and how many steps wide a side is.
    classes: Vec<(u32, u32)>,
    values: Vec<i16>,
}

impl Bumps {
    pub(super) fn make(&mut self, occupied_nat: f64) {
        if self.occupied_nat.total_cmp(&occupied_nat).is_eq() && !self.classes.is_empty() {
            return;
        }
        self.occupied_nat = occupied_nat;
        self.classes.clear();
        self.values.clear();
        for class in 0..CLASSES {
            let sd = (class.max(1) as f64) / CLASSES_A_CELL;
            let side = (BUMP_SDS * sd) as u32;
            self.classes.push((self.values.len() as u32, side));
            let most = 1000.0 * occupied_nat * (BELL_DENSITY / sd).min(1.0);
            self.values.extend((0..=2 * side).map(|step| {
                let off = (f64::from(step) - f64::from(side)) / sd;
                (most * (-0.5 * off * off).exp()).round() as i16
            }));
        }
    }

    /// What falls to the points of a bump of deviation `sd`, a cell apart and in order.
    pub(super) fn bump(&self, sd: f64) -> &[i16] {
        let class = ((sd * CLASSES_A_CELL + 0.5) as usize).min(CLASSES - 1);
        let of = |(start, side): &(u32, u32)| {
            self.values.get(*start as usize..(*start + 2 * side + 1) as usize)
        };
        self.classes.get(class).and_then(of).unwrap_or_default()
    }
}

/// A fan of beams. Reused from scan to scan, it allocates nothing once warm.
#[derive(Debug, Default)]
pub(in crate::evidence) struct Fan {
    geometry: Option<ScanGeometry>,
    /// Directions in the sensor frame, of the last geometry.
    units: Vec<Point>,
    pub(super) sheaves: Vec<Sheaf>,
    pub(super) bumps: Bumps,
    /// Left, low, right, high of what the beams reach.
    reach: [f64; 4],
}

impl Fan {
    /// Gathers the beams of a scan that say something, in the sensor frame.
    pub(super) fn gather(&mut self, scan: &Scan, usable: impl Fn(usize) -> bool, per_metre: f64) {
        let count = scan.ranges.len();
        if self.geometry != Some(scan.geometry) || self.units.len() != count {
            self.units.clear();
            self.units.extend((0..count).map(|beam| unit_normal(scan.geometry.bearing(beam))));
            self.geometry = Some(scan.geometry);
        }
        self.sheaves.clear();
        let is_dense = scan.geometry.increment.abs() <= FAN_INCREMENT_MAX;
        let (mut first, mut follows) = (Point::zeros(), false);
        for (beam, (z, unit)) in scan.ranges.iter().zip(&self.units).enumerate() {
            if !(usable(beam) && z.is_finite()) {
                follows = false;
                continue;
            }
            let z = z * per_metre;
            let end = unit * z;
            if let Some(last) = self.sheaves.last_mut().filter(|_| follows)
                && (end - first).norm_squared() <= TOGETHER * TOGETHER
                && last.count < TOGETHER_MOST
            {
                last.count += 1;
                last.end += end;
                last.z += z;
            } else {
                let blank = Point::zeros();
                self.sheaves.push(Sheaf {
                    count: 1,
                    end,
                    z,
                    sd: 0.0,
                    direction: blank,
                    free: 0.0,
                    follows,
                });
                first = end;
            }
            follows = is_dense;
        }
        // All the way round, the first beam is the last one's neighbour.
        let ends = [0, count.saturating_sub(1)];
        let is_closed = is_dense && scan.is_full_circle();
        if let Some(first) = self.sheaves.first_mut() {
            let says =
                |beam: usize| usable(beam) && scan.ranges.get(beam).is_some_and(|z| z.is_finite());
            first.follows = is_closed && ends.into_iter().all(says);
        }
    }

    /// Turns the beams to where the sensor looks and finds out how sure their ends are: `variance` answers
    /// for a distance and a direction, in squares of cells. Nothing is believed beyond `far`.
    pub(super) fn aim(&mut self, heading: f64, far: f64, variance: impl Fn(f64, &Point) -> f64) {
        self.reach = [0.0; 4];
        let (sin, cos) = heading.sin_cos();
        for sheaf in &mut self.sheaves {
            let mean = f64::from(sheaf.count).recip();
            let z = sheaf.z * mean;
            let p = sheaf.end * mean;
            let end = Point::new(cos * p.x - sin * p.y, sin * p.x + cos * p.y);
            let direction = end / z.max(1e-9);
            let sd = variance(z, &direction).sqrt();
            let free = (z - OUTLINE_SDS * sd).clamp(0.0, far);
            let tip = direction * (z + BUMP_SDS * sd).clamp(0.0, far);
            let [left, low, right, high] = &mut self.reach;
            (*left, *low) = (left.min(tip.x), low.min(tip.y));
            (*right, *high) = (right.max(tip.x), high.max(tip.y));
            *sheaf = Sheaf { end, z, sd, direction, free, ..*sheaf };
        }
    }

    /// Draws the ends of what is free back from surfaces that are seen aslant, so that between two beams
    /// no cell of such a surface is freed: by as much as keeps half a cell square to the surface.
    pub(super) fn draw_back(&mut self) {
        let count = self.sheaves.len();
        let Some(mut before) =
            count.checked_sub(1).and_then(|last| self.sheaves.get(last).copied())
        else {
            return;
        };
        for index in 0..count {
            let sheaf = self.sheaves[index];
            let next = self.sheaves[if index + 1 == count { 0 } else { index + 1 }];
            let from = if sheaf.joins(&before) { before.end } else { sheaf.end };
            let to = if next.joins(&sheaf) { next.end } else { sheaf.end };
            let chord = to - from;
            let (along, across) = (chord.dot(&sheaf.direction), chord.perp(&sheaf.direction));
            // The tangent of the incidence; of a lone end nothing is known.
            let slope = (along / across.abs().max(1e-9)).abs().min(SLOPE_MAX);
            let back = 0.5 * ((1.0 + slope * slope).sqrt() - 1.0);
            self.sheaves[index].free = (sheaf.free - back).max(0.0);
            before = sheaf;
        }
    }

    /// The cells that hold all that the beams reach; `start` is where the scanner is, in cells.
    pub(super) fn bounds(&self, start: &Point) -> (Cell, Cell) {
        let [left, low, right, high] = self.reach;
        let corner = |x: f64, y: f64| Cell::holding(&Point::new(start.x + x, start.y + y), 1.0);
        (corner(left, low), corner(right, high))
    }
}
