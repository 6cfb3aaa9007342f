//! Which readings are a surface at all.

use std::f64::consts::FRAC_PI_2;

use mapfold_map::geometry::Point;

use crate::sensor::{Scan, ScannerProfile};

/// What a beam's reading is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum BeamState {
    /// A surface was hit.
    Hit,
    /// Nothing came back from within the range of the sensor.
    NoReturn,
    /// Nearer than the sensor can measure, 0, or no number: it says nothing.
    Invalid,
    /// The mean of two surfaces that shared the beam (a "veil"): no surface is there.
    Mixed,
    /// Far from what the beams on both sides saw, by a scanner whose ranges need correction: such
    /// heads err now and then for no reason that one reading tells. (Of other scanners a lone
    /// reading makes no feature either, but may be a table's leg.)
    Isolated,
    /// A surface met at a greater incidence than the scanner's correction is good for.
    Oblique,
    /// Nearer or farther than the scanner's correction was measured.
    Uncalibrated,
}

/// When a reading is no surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PlausibilityConfig {
    /// Nearer readings are invalid, metres.
    pub range_min: f64,
    /// Readings from here on are no return, metres; a smaller limit of the scan itself rules.
    pub range_max: f64,
    /// A veil's two neighbours are at least this much nearer and farther, metres (its beam covers
    /// two surfaces; steps below this are edges of one thing).
    pub veil_step: f64,
    /// Largest angle between the beam and the way to either neighbour, radians: the point lies on
    /// the line of sight between foreground and background. 10 degrees, as the worst incidence
    /// at which points still count as one surface.
    pub veil_angle: f64,
    /// A point that continues the line through its two neighbours on one side to within this many
    /// degrees of the angle at them is a wall seen at a grazing angle and no veil, radians.
    pub continuation_angle: f64,
}

impl PlausibilityConfig {
    /// The settings that follow from a scanner's profile.
    pub fn for_scanner(profile: &ScannerProfile) -> Self {
        Self {
            range_min: profile.range_min_m,
            range_max: profile.range_max_m,
            veil_step: 3.0 * profile.range_sd(2.0) + 0.05,
            veil_angle: 10f64.to_radians(),
            continuation_angle: 3f64.to_radians(),
        }
    }
}

/// Judges every beam of a scan.
pub fn judge(scan: &Scan, config: &PlausibilityConfig) -> Vec<BeamState> {
    let range_max = config.range_max.min(scan.range_max);
    let by_range: Vec<BeamState> = scan
        .ranges
        .iter()
        .map(|&range| {
            if !range.is_finite() {
                if range == f64::INFINITY { BeamState::NoReturn } else { BeamState::Invalid }
            } else if range < config.range_min {
                BeamState::Invalid
            } else if range >= range_max {
                BeamState::NoReturn
            } else {
                BeamState::Hit
            }
        })
        .collect();
    (0..by_range.len())
        .map(|beam| {
            if by_range[beam] == BeamState::Hit && is_veil(scan, &by_range, beam, config) {
                BeamState::Mixed
            } else {
                by_range[beam]
            }
        })
        .collect()
}

/// Whether the reading lies in the air between a foreground and a background.
fn is_veil(scan: &Scan, states: &[BeamState], beam: usize, config: &PlausibilityConfig) -> bool {
    let neighbour = |offset: isize| -> Option<usize> {
        let count = states.len() as isize;
        let at = beam as isize + offset;
        let at = if scan.is_full_circle() { at.rem_euclid(count) } else { at };
        ((0..count).contains(&at) && states[at as usize] == BeamState::Hit).then_some(at as usize)
    };
    let (Some(before), Some(after)) = (neighbour(-1), neighbour(1)) else { return false };
    let (r, r0, r1) = (scan.ranges[beam], scan.ranges[before], scan.ranges[after]);
    let between = (r0 - r > config.veil_step && r - r1 > config.veil_step)
        || (r - r0 > config.veil_step && r1 - r > config.veil_step);
    if !between {
        return false;
    }
    let at = |b: usize| scan.direction(b) * scan.ranges[b];
    let p = at(beam);
    let along_beam = |q: &Point| {
        let way = q - p;
        angle_between_lines(&way, &scan.direction(beam)) < config.veil_angle
    };
    let (p0, p1) = (at(before), at(after));
    if !along_beam(&p0) || !along_beam(&p1) {
        return false;
    }
    // A wall at a grazing angle looks the same to three beams; five tell.
    let continues = |near: usize, far: Option<usize>| {
        far.is_some_and(|far| {
            let (near, far) = (at(near), at(far));
            angle_between_lines(&(near - far), &(p - near)) < config.continuation_angle
        })
    };
    !(continues(before, neighbour(-2)) || continues(after, neighbour(2)))
}

/// The angle between two lines of these directions, 0 to pi/2.
fn angle_between_lines(a: &Point, b: &Point) -> f64 {
    let angle = a.perp(b).atan2(a.dot(b)).abs();
    if angle > FRAC_PI_2 { std::f64::consts::PI - angle } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sensor::{ScanGeometry, preset};
    use mapfold_map::geometry::Pose;

    fn scan_of(ranges: Vec<f64>) -> Scan {
        Scan {
            geometry: ScanGeometry { first_bearing: 0.0, increment: 0.5f64.to_radians() },
            ranges,
            range_max: 50.0,
            robot_from_sensor: Pose::identity(),
        }
    }

    fn judged(ranges: Vec<f64>) -> Vec<BeamState> {
        let profile = preset("sick-lms").unwrap().scanner.unwrap();
        judge(&scan_of(ranges), &PlausibilityConfig::for_scanner(&profile))
    }

    #[test]
    fn limits_tell_hits_from_no_return_and_from_nonsense() {
        use BeamState::{Hit, Invalid, NoReturn};
        assert_eq!(
            judged(vec![0.0, 0.01, f64::NAN, -1.0, 3.0, 50.0, 81.83, f64::INFINITY]),
            [Invalid, Invalid, Invalid, Invalid, Hit, NoReturn, NoReturn, NoReturn]
        );
    }

    #[test]
    fn a_reading_between_two_surfaces_is_a_veil() {
        let states = judged(vec![2.0, 2.0, 2.0, 3.1, 5.0, 5.0, 5.0]);
        assert_eq!(states[3], BeamState::Mixed);
        assert_eq!(states.iter().filter(|s| **s == BeamState::Hit).count(), 6);
    }

    #[test]
    fn a_wall_seen_at_a_grazing_angle_is_no_veil() {
        // A wall 1 m to the side, seen down to 3 degrees off its own direction.
        let ranges = (0..20).map(|i| 1.0 / (3.0 + 0.5 * f64::from(i)).to_radians().sin()).collect();
        let mut scan = scan_of(ranges);
        scan.geometry.first_bearing = 3f64.to_radians();
        let profile = preset("sick-lms").unwrap().scanner.unwrap();
        let states = judge(&scan, &PlausibilityConfig::for_scanner(&profile));
        assert!(states.iter().all(|s| *s == BeamState::Hit), "{states:?}");
    }

    #[test]
    fn a_foreground_edge_without_a_veil_stays() {
        let states = judged(vec![2.0, 2.0, 2.0, 5.0, 5.0, 5.0]);
        assert!(states.iter().all(|s| *s == BeamState::Hit));
    }
}
