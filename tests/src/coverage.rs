//! How well a merged map agrees with the readings that it was made of.

use crate::carmen::Log;
use crate::floor::Floor;
use crate::plane::Piece;

/// A return counts as explained if something of the map lies this near.
pub const NEAR_M: f64 = 0.10;

/// A beam counts as running through a wall if it goes on behind it for longer than this, along
/// itself: strict, as a beam that grazes a wall at 10 degrees does so for an error of 3.5 cm.
pub const THROUGH_M: f64 = 0.20;

/// Counts over the returns of a log. Beams without return say nothing here and are not counted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Coverage {
    /// Beams with a return.
    pub returns: u64,
    /// Of them, those whose end lies within [`NEAR_M`] of a segment, a cluster's hull or an
    /// occupied cell.
    pub explained: u64,
    /// Of them, those that cross a published segment and go on behind it for more than
    /// [`THROUGH_M`].
    pub through: u64,
}

impl Coverage {
    /// Share of the returns that the map explains.
    pub fn explained_share(&self) -> f64 {
        self.explained as f64 / self.returns.max(1) as f64
    }

    /// Share of the returns whose beams run through a segment.
    pub fn through_share(&self) -> f64 {
        self.through as f64 / self.returns.max(1) as f64
    }
}

/// Measures a map against all scans of a log, at the log's corrected poses.
pub fn measure(floor: &Floor, log: &Log) -> Coverage {
    let mut coverage = Coverage::default();
    for scan in &log.scans {
        for end in scan.end_points(log.cap) {
            let beam = Piece { a: scan.origin, b: end };
            coverage.returns += 1;
            coverage.explained += u64::from(floor.is_near(end, NEAR_M));
            coverage.through += u64::from(floor.behind_m(&beam) > THROUGH_M);
        }
    }
    coverage
}

#[cfg(test)]
mod tests {
    use mapfold_schema::v1::{EndKind, Facing, Segment, SolidInterval};

    use super::*;

    /// A wall on the line x = 2 from y = -5 to y = `top`.
    fn wall(top: f64) -> Segment {
        Segment {
            id: String::new(),
            rho_m: 2.0,
            alpha_rad: 0.0,
            covariance: [[1e-4, 0.0], [0.0, 1e-4]],
            covariance_independent: [[1e-4, 0.0], [0.0, 1e-4]],
            covariance_dependent: [[0.0, 0.0], [0.0, 0.0]],
            facing: Facing::Origin,
            solid: vec![SolidInterval {
                from_m: -5.0,
                to_m: top,
                ends: [EndKind::Jump; 2],
                existence_nat: 2.89,
            }],
            quality: 1,
            robots: Vec::new(),
            first_seen: String::new(),
            last_seen: String::new(),
        }
    }

    #[test]
    fn returns_are_explained_by_the_map_or_run_through_it() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("four-beams.log");
        // Beams at -90, -89, -88 and -87 degrees of a robot that looks up: to the right, all but.
        // 2 m end at the wall, 2.15 m behind it but not far, 6 m far behind; 20 m is no return.
        let line = "FLASER 4 2.0 2.15 6.0 20 0 0 1.5707963267948966 0 0 0 1 host 1\n";
        std::fs::write(&path, format!("PARAM robot_front_laser_max 20\n{line}")).expect("a log");
        let log = Log::read(&path).expect("a readable log");
        let whole = measure(&Floor::new(&[wall(5.0)], &[], &[], 0.05, NEAR_M), &log);
        assert_eq!(whole, Coverage { returns: 3, explained: 1, through: 1 });
        let short = measure(&Floor::new(&[wall(-1.0)], &[], &[], 0.05, NEAR_M), &log);
        assert_eq!(short, Coverage { returns: 3, explained: 0, through: 0 });
        assert!((whole.explained_share() - 1.0 / 3.0).abs() < 1e-12);
    }
}
