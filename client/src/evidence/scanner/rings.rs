//! How much free evidence falls with the distance: rings of equal evidence about the scanner.

use mapfold_map::geometry::Point;
use mapfold_map::raster::TILE_SIDE;

use super::ScannerEvidenceConfig;
use crate::evidence::Canvas;
use crate::evidence::canvas::GRADES;
use crate::evidence::outline::{fixed, whole};
use crate::evidence::window::{Rows, bits};
use crate::sensor::Scan;

/// Rings of equal free evidence, in cells.
///
/// Beams that are `g` apart miss a thing of width `w < g` with the probability `1 - w / g`, so that a
/// gap says `w / g` of what a beam says, to first order. The share that is left, after what the
/// heading's error leaves, is told in quarters.
#[derive(Debug, Clone, Copy)]
pub(super) struct Rings {
    /// Outer radii of the quarters, the weakest first: never ascending.
    radii: [f64; GRADES],
    /// The end of all evidence.
    pub(super) far: f64,
    /// Up to here the heading's error does not matter; to twice as far beams count half.
    pub(super) heading_to: f64,
}

impl Rings {
    /// The rings of one scan.
    pub(super) fn new(
        scan: &Scan,
        heading_sd: f64,
        resolution: f64,
        config: &ScannerEvidenceConfig,
    ) -> Self {
        let heading_to = config.sideways_cells / heading_sd.max(1e-9);
        let far = (config.range_believed / resolution).min(2.0 * heading_to);
        // Where beams are as far apart as the least thing is wide.
        let increment = scan.geometry.increment.abs();
        let gap_to = config.missed_width / resolution / increment.max(1e-9);
        // How far at least this share is left.
        let reach = |share: f64| {
            let near = (gap_to / share).min(heading_to);
            let halved = if share > 0.5 { 0.0 } else { (0.5 * gap_to / share).min(far) };
            if halved > heading_to { halved } else { near }
        };
        let mut radii = [0.0; GRADES];
        for (grade, radius) in radii.iter_mut().enumerate() {
            // What is rounded to this quarter.
            *radius = reach((grade as f64 + 0.5) / GRADES as f64).min(far);
        }
        Self { radii, far, heading_to }
    }

    /// The quarters, in millinats.
    pub(super) fn grades(config: &ScannerEvidenceConfig) -> [i16; GRADES] {
        let mut grades = [0; GRADES];
        for (grade, value) in grades.iter_mut().enumerate() {
            *value = (1000.0 * config.free_nat * (grade + 1) as f64 / GRADES as f64) as i16;
        }
        grades
    }

    /// Lays free evidence on the cells `inside` of the tile in this column and row of the window; `eye` is
    /// where the scanner is among the centres of cells.
    pub(super) fn lay(
        &self,
        eye: &Point,
        (x, y): (usize, usize),
        inside: &Rows,
        canvas: &mut Canvas,
    ) {
        let side = TILE_SIDE as f64;
        // Where the scanner is among the centres of the tile's cells.
        let eye = eye - Point::new(x as f64 * side, y as f64 * side);
        let farthest = |eye: f64| eye.abs().max((side - 1.0 - eye).abs());
        let nearest = |eye: f64| (eye - eye.clamp(0.0, side - 1.0)).abs();
        let farthest_sq = farthest(eye.x).powi(2) + farthest(eye.y).powi(2);
        let nearest_sq = nearest(eye.x).powi(2) + nearest(eye.y).powi(2);
        for (grade, radius) in self.radii.iter().enumerate().rev() {
            let radius_sq = radius * radius;
            if nearest_sq > radius_sq {
                continue;
            }
            let Some(free) = canvas.free(x, y, grade) else { return };
            if farthest_sq <= radius_sq {
                for (free, inside) in free.iter_mut().zip(inside) {
                    *free |= inside;
                }
                return;
            }
            for (row, (free, inside)) in free.iter_mut().zip(inside).enumerate() {
                let off = row as f64 - eye.y;
                let half = (radius_sq - off * off).max(-1.0).sqrt();
                // Of what is not a number comes no cell.
                let first = whole(fixed((eye.x - half).max(-1.0))) + 1;
                let behind = whole(fixed((eye.x + half).min(side - 1.0))) + 1;
                if *inside != 0 && half >= 0.0 && first < behind {
                    *free |= inside & bits(first as u32, behind as u32);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    #![expect(clippy::float_cmp, reason = "these numbers have no rounding to speak of")]

    use mapfold_map::geometry::Pose;

    use super::*;
    use crate::sensor::ScanGeometry;

    fn rings(increment: f64, heading_sd: f64) -> Rings {
        let scan = Scan {
            geometry: ScanGeometry { first_bearing: 0.0, increment },
            ranges: Vec::new(),
            range_max: 50.0,
            robot_from_sensor: Pose::identity(),
            repeats: Vec::new(),
        };
        Rings::new(&scan, heading_sd, 0.05, &ScannerEvidenceConfig::STANDARD)
    }

    #[test]
    fn gaps_between_beams_weaken_what_they_leave_free() {
        // Beams a hundredth of a radian apart leave 10 cm, two cells, between them at 200 cells.
        let [weakest, weak, strong, strongest] = rings(0.01, 0.0).radii;
        assert!((strongest - 200.0 / 0.875).abs() < 1e-9, "{strongest}");
        assert!((strong - 200.0 / 0.625).abs() < 1e-9, "{strong}");
        assert!((weak - 200.0 / 0.375).abs() < 1e-9, "{weak}");
        // The weakest ends where nothing is believed any more, 30 m away.
        assert_eq!(weakest, 600.0);
    }

    #[test]
    fn an_uncertain_heading_halves_and_then_ends_what_is_free() {
        // Two cells sideways at 100.
        let rings = rings(0.001, 0.02);
        assert_eq!(rings.radii, [200.0, 200.0, 100.0, 100.0]);
        assert_eq!(rings.heading_to, 100.0);
        assert_eq!(rings.far, 200.0);
    }
}
