//! How much free evidence falls with the distance: rings of equal evidence about the scanner.

use mapfold_map::geometry::Point;

use super::ScannerEvidenceConfig;
use crate::evidence::Canvas;
use crate::evidence::canvas::GRADES;
use crate::evidence::outline::{fixed, whole};
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

    /// The grade of a cell that a beam without neighbours crosses at this distance.
    pub(super) fn of_beam(&self, distance: f64) -> usize {
        if distance > self.heading_to { GRADES / 2 - 1 } else { GRADES - 1 }
    }

    /// Lays free evidence on a piece of a row; `eye` is where the scanner is among the centres of
    /// cells.
    pub(super) fn lay(&self, eye: &Point, row: i32, from: i32, to: i32, canvas: &mut Canvas) {
        let off = f64::from(row) - eye.y;
        let (left, right) = (f64::from(from) - eye.x, f64::from(to - 1) - eye.x);
        let farthest_sq = off * off + (left * left).max(right * right);
        for (grade, radius) in self.radii.iter().enumerate().rev() {
            if farthest_sq <= radius * radius {
                canvas.lay(row, from, to, grade);
                return;
            }
            let half_sq = radius * radius - off * off;
            if half_sq > 0.0 {
                let half = half_sq.sqrt();
                if left <= half && right >= -half {
                    let first = from.max(1 + whole(fixed(eye.x - half)));
                    let behind = to.min(1 + whole(fixed(eye.x + half)));
                    canvas.lay(row, first, behind, grade);
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
        assert_eq!([99.0, 101.0].map(|d| rings.of_beam(d)), [3, 1]);
        assert_eq!(rings.far, 200.0);
    }
}
