//! The beams of the scan under way, in cells about the scanner.
//!
//! Column by column rather than beam by beam: so the processor works at four of them at once. Single
//! precision is a ten-thousandth of a cell here.

use mapfold_map::geometry::{Point, unit_normal};
use mapfold_map::raster::Cell;

use super::spread::Spread;
use super::{BUMP_SDS, FAN_INCREMENT_MAX, OUTLINE_SDS};
use crate::sensor::{Scan, ScanGeometry};

/// Neighbouring beams that ended within this of the first of them, in cells, are entered as one.
const TOGETHER: f32 = 0.5;
/// Most beams that are.
const TOGETHER_MOST: f32 = 32.0;

/// Steepest slope, by the tangent of the incidence, at which neighbouring ends are taken for one surface.
const SLOPE_MAX: f32 = 6.0;
/// Ends that are apart in depth by this many cells more than such a slope are not.
const JUMP_CELLS: f32 = 2.0;

/// Ends farther away than this, in cells, are taken to be this far: nothing is believed out there.
const Z_MOST: f64 = 1e8;

/// What is known of sheaves, beams that ended at one place, column by column. They are counted from 1; the
/// last one's entries stand also at 0 and the first one's also behind the last, for that is how they are
/// neighbours in a circle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sheaves<'a> {
    /// Beams in each.
    pub(super) counts: &'a [f32],
    /// The mean of where they ended, and of how far away that is.
    pub(super) x: &'a [f32],
    pub(super) y: &'a [f32],
    pub(super) z: &'a [f32],
    /// Deviation of that distance for each of them.
    pub(super) sd: &'a [f32],
    /// A unit vector towards it in the level frame.
    pub(super) along_x: &'a [f32],
    pub(super) along_y: &'a [f32],
    /// How far it is free.
    pub(super) free: &'a [f32],
    /// By how much more than a steep slope's the depth may differ from the one before's: by less than
    /// anything if its first beam is no neighbour of the last sheaf's last beam.
    slack: &'a [f32],
    /// 1 if it ended on the same surface as the one before, as far as can be told; else 0.
    joined: &'a [f32],
}

impl Sheaves<'_> {
    /// Their numbers.
    pub(super) fn numbers(&self) -> std::ops::Range<usize> {
        1..self.z.len() - 1
    }

    /// Whether a sheaf's first beam is a neighbour of the last beam of the one before.
    pub(super) fn follows(&self, at: usize) -> bool {
        self.slack[at] >= 0.0
    }

    /// Whether a sheaf follows the one before, and ended on the same surface as far as can be told.
    pub(super) fn joins(&self, at: usize) -> bool {
        self.joined[at] > 0.0
    }

    /// A unit vector towards where a sheaf ended.
    pub(super) fn direction(&self, at: usize) -> Point {
        Point::new(f64::from(self.along_x[at]), f64::from(self.along_y[at]))
    }

    /// The cells that hold all that the beams reach, as far as it is believed; `start` is where the
    /// scanner is, in cells.
    pub(super) fn bounds(&self, start: &Point, far: f64) -> (Cell, Cell) {
        let far = far as f32;
        let [mut left, mut low, mut right, mut high] = [0.0_f32; 4];
        for at in self.numbers() {
            let reach = (self.z[at] + BUMP_SDS as f32 * self.sd[at]).max(0.0).min(far);
            let (x, y) = (self.along_x[at] * reach, self.along_y[at] * reach);
            (left, low) = (left.min(x), low.min(y));
            (right, high) = (right.max(x), high.max(y));
        }
        let corner = |x: f32, y: f32| {
            Cell::holding(&Point::new(start.x + f64::from(x), start.y + f64::from(y)), 1.0)
        };
        (corner(left, low), corner(right, high))
    }
}

/// Columns that are worked out from the sums.
const COLUMNS: usize = 9;

/// A fan of beams. Reused from scan to scan, it allocates nothing once warm.
#[derive(Debug, Default)]
pub(in crate::evidence) struct Fan {
    geometry: Option<ScanGeometry>,
    /// Directions in the sensor frame, of the last geometry.
    units: Vec<[f32; 2]>,
    sheaves: usize,
    /// Sheaf by sheaf, how many beams, and the sums of where they ended in the sensor frame and of how
    /// far away.
    sums: Vec<[f32; 4]>,
    slack: Vec<f32>,
    /// The other columns, one behind the other.
    columns: Vec<f32>,
}

impl Fan {
    /// Gathers the beams of a scan that say something, in the sensor frame: sums sheaf by sheaf.
    pub(super) fn gather(&mut self, scan: &Scan, usable: impl Fn(usize) -> bool, per_metre: f64) {
        let count = scan.ranges.len();
        if self.geometry != Some(scan.geometry) || self.units.len() != count {
            let unit = |beam| unit_normal(scan.geometry.bearing(beam));
            self.units.clear();
            self.units.extend((0..count).map(unit).map(|unit| [unit.x as f32, unit.y as f32]));
            self.geometry = Some(scan.geometry);
            self.sums.resize(count + 2, [0.0; 4]);
            self.slack.resize(count + 2, 0.0);
            self.columns.resize(COLUMNS * (count + 2), 0.0);
        }
        let is_dense = scan.geometry.increment.abs() <= FAN_INCREMENT_MAX;
        let (sums, slack) = (&mut self.sums[..count + 2], &mut self.slack[..count + 2]);
        slack.fill(JUMP_CELLS);
        let (mut at, mut follows) = (0, false);
        let (mut first, mut sum) = ([0.0; 2], [0.0_f32; 4]);
        for (beam, (z, [unit_x, unit_y])) in scan.ranges.iter().zip(&self.units).enumerate() {
            if !(usable(beam) && z.is_finite()) {
                follows = false;
                continue;
            }
            let z = (z * per_metre).clamp(0.0, Z_MOST) as f32;
            let (x, y) = (unit_x * z, unit_y * z);
            let (off_x, off_y) = (x - first[0], y - first[1]);
            let is_near = off_x * off_x + off_y * off_y <= TOGETHER * TOGETHER;
            if is_near & follows && sum[0] < TOGETHER_MOST {
                sum = [sum[0] + 1.0, sum[1] + x, sum[2] + y, sum[3] + z];
            } else {
                at += 1;
                first = [x, y];
                sum = [1.0, x, y, z];
                if !follows {
                    slack[at] = f32::NEG_INFINITY;
                }
            }
            sums[at] = sum;
            follows = is_dense;
        }
        self.sheaves = at;
        // All the way round, the first beam is the last one's neighbour.
        let ends = [0, count.saturating_sub(1)];
        let says =
            |beam: usize| usable(beam) && scan.ranges.get(beam).is_some_and(|z| z.is_finite());
        if at > 0 && is_dense && scan.is_full_circle() && ends.into_iter().all(says) {
            self.slack[1] = JUMP_CELLS;
        }
    }

    /// Turns the beams to where the sensor looks, finds out how sure their ends are and which are on one
    /// surface. Nothing is believed beyond `far`.
    pub(super) fn aim(&mut self, heading: f64, far: f64, spread: &Spread) -> Sheaves<'_> {
        let sheaves = self.sheaves;
        let (sin, cos) = heading.sin_cos();
        let (sin, cos, far) = (sin as f32, cos as f32, far as f32);
        let mut columns = self.columns.chunks_exact_mut(self.units.len() + 2);
        let mut columns: [&mut [f32]; COLUMNS] =
            std::array::from_fn(|_| columns.next().map_or(&mut [][..], |c| &mut c[..sheaves + 2]));
        {
            let [counts, x, y, z, sd, along_x, along_y, free, _] =
                columns.each_mut().map(|column| &mut column[1..=sheaves]);
            let sums = &self.sums[1..=sheaves];
            for at in 0..sheaves {
                let [count, sum_x, sum_y, sum_z] = sums[at];
                let mean = count.recip();
                let (mean_x, mean_y, mean_z) = (sum_x * mean, sum_y * mean, sum_z * mean);
                let (end_x, end_y) = (cos * mean_x - sin * mean_y, sin * mean_x + cos * mean_y);
                let unit = mean_z.max(1e-6).recip();
                let (unit_x, unit_y) = (end_x * unit, end_y * unit);
                let deviation = spread.variance(mean_z, unit_x, unit_y).sqrt();
                (counts[at], x[at], y[at], z[at]) = (count, end_x, end_y, mean_z);
                (along_x[at], along_y[at], sd[at]) = (unit_x, unit_y, deviation);
                free[at] = (mean_z - OUTLINE_SDS as f32 * deviation).max(0.0).min(far);
            }
        }
        for column in &mut columns {
            column[0] = column[sheaves];
            column[sheaves + 1] = column[1];
        }
        let slack = &mut self.slack[..sheaves + 2];
        slack[sheaves + 1] = slack[1];
        let [counts, x, y, z, sd, along_x, along_y, free, joined] = columns;
        join([z, along_x, along_y, slack], joined);
        draw_back([x, y, along_x, along_y, joined], free);
        free[0] = free[sheaves];
        Sheaves { counts, x, y, z, sd, along_x, along_y, free, slack, joined }
    }
}

/// Finds out which ends are on one surface with those before.
#[inline(never)]
fn join([z, along_x, along_y, slack]: [&[f32]; 4], joined: &mut [f32]) {
    let count = joined.len() - 1;
    let (z_before, x_before, y_before) = (&z[..count], &along_x[..count], &along_y[..count]);
    let (z, x, y, slack) =
        (&z[1..=count], &along_x[1..=count], &along_y[1..=count], &slack[1..=count]);
    let joined = &mut joined[1..=count];
    for at in 0..count {
        let across = x_before[at] * y[at] - y_before[at] * x[at];
        let near = if z[at] < z_before[at] { z[at] } else { z_before[at] };
        let most = SLOPE_MAX * across.abs() * near + slack[at];
        joined[at] = if (z[at] - z_before[at]).abs() <= most { 1.0 } else { 0.0 };
    }
}

/// Draws the ends of what is free back from surfaces that are seen aslant, so that between two beams no
/// cell of such a surface is freed: by as much as keeps half a cell square to the surface.
#[inline(never)]
fn draw_back([x, y, along_x, along_y, joined]: [&[f32]; 5], free: &mut [f32]) {
    let count = free.len() - 2;
    let [x_before, y_before] = [&x[..count], &y[..count]];
    let [x_next, y_next, joined_next] = [&x[2..][..count], &y[2..][..count], &joined[2..][..count]];
    let [x, y, along_x, along_y, joined] =
        [x, y, along_x, along_y, joined].map(|column| &column[1..][..count]);
    let free = &mut free[1..][..count];
    for at in 0..count {
        // From the end before to the next one, as far as they are on one surface with this.
        let chord_x = (x[at] - x_before[at]) * joined[at] + (x_next[at] - x[at]) * joined_next[at];
        let chord_y = (y[at] - y_before[at]) * joined[at] + (y_next[at] - y[at]) * joined_next[at];
        let along = chord_x * along_x[at] + chord_y * along_y[at];
        let across = chord_x * along_y[at] - chord_y * along_x[at];
        // The tangent of the incidence; of a lone end nothing is known.
        let slope = (along.abs() / across.abs().max(1e-9)).min(SLOPE_MAX);
        free[at] = (free[at] - 0.5 * ((1.0 + slope * slope).sqrt() - 1.0)).max(0.0);
    }
}
