//! Perception of one scanner where it sits on its robot.

use super::{BeamState, Extractor, Features};
use crate::sensor::{MountedAt, Scan, ScannerProfile};

/// What a scan shows, in the robot frame.
#[derive(Debug, Clone, Copy)]
pub struct Percept<'a> {
    /// The scan from where its sensor sits, its ranges corrected.
    pub scan: &'a Scan,
    /// What its beams are.
    pub states: &'a [BeamState],
    /// Walls and clusters.
    pub features: &'a Features,
}

/// Perceives scan after scan of one scanner, as its profile says that it sits and errs.
#[derive(Debug)]
pub struct Perception {
    mount: MountedAt,
    extractor: Extractor,
    /// The last scan, if the profile had to say where it was taken from.
    placed: Option<Scan>,
}

impl Perception {
    /// Of the scanner with this profile.
    pub fn for_scanner(profile: &ScannerProfile) -> Self {
        Self { mount: profile.mount, extractor: Extractor::for_scanner(profile), placed: None }
    }

    /// What a scan shows.
    pub fn of<'a>(&'a mut self, scan: &'a Scan) -> Percept<'a> {
        self.placed = self.mount.placed(scan);
        let scan = self.placed.as_ref().unwrap_or(scan);
        self.extractor.extract(scan);
        Percept {
            scan: self.extractor.corrected_scan().unwrap_or(scan),
            states: self.extractor.states(),
            features: self.extractor.features(),
        }
    }
}

#[cfg(test)]
mod tests {
    use mapfold_map::geometry::Pose;

    use super::*;
    use crate::sensor::{ScanGeometry, preset};

    /// Straight into a wall 3 m before the sensor, 90 degrees wide.
    fn scan() -> Scan {
        let beams = 181;
        let increment = std::f64::consts::FRAC_PI_2 / f64::from(beams - 1);
        let first_bearing = -std::f64::consts::FRAC_PI_4;
        let bearing = |beam: u32| first_bearing + increment * f64::from(beam);
        Scan {
            geometry: ScanGeometry { first_bearing, increment },
            ranges: (0..beams).map(|beam| 3.0 / bearing(beam).cos()).collect(),
            range_max: 20.0,
            robot_from_sensor: Pose::new(0.0, 0.0, 0.0),
            repeats: Vec::new(),
        }
    }

    #[test]
    fn a_wall_is_where_it_is_from_where_the_profile_says_that_the_scanner_sits() {
        let mut profile = preset("sick-lms").unwrap().scanner.unwrap();
        profile.mount = MountedAt { x_m: 0.5, y_m: 0.1, heading_rad: 0.0 };
        let mut perception = Perception::for_scanner(&profile);
        let scan = scan();
        let percept = perception.of(&scan);
        assert_eq!(percept.scan.robot_from_sensor, profile.mount.robot_from_sensor());
        let [wall] = percept.features.segments.as_slice() else { panic!("one wall") };
        assert!((wall.line.line.rho() - 3.5).abs() < 0.01, "{wall:?}");
        // What the log tells is believed before the profile.
        let told = Scan { robot_from_sensor: Pose::new(-0.2, 0.0, 0.0), ..scan };
        let percept = perception.of(&told);
        assert_eq!(percept.scan.robot_from_sensor, told.robot_from_sensor);
    }
}
