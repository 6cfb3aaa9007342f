//! Which readings are a surface at all.

use mapfold_map::geometry::Point;

use super::points::Directions;
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
    /// A point that continues the line through its two neighbours on one side to within this angle at
    /// them, and three standard deviations of it, is a wall seen at a grazing angle and no veil,
    /// radians.
    pub continuation_angle: f64,
    /// Standard deviation of a range, metres.
    pub range_sd: f64,
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
            range_sd: profile.range_sd(2.0),
        }
    }
}

/// Judges every beam of a scan.
pub fn judge(scan: &Scan, config: &PlausibilityConfig) -> Vec<BeamState> {
    let mut states = Vec::new();
    judge_into(scan, Directions::default().of(scan), config, &mut states);
    states
}

/// Judges every beam of a scan, into a buffer that is used again.
pub fn judge_into(
    scan: &Scan,
    directions: &[Point],
    config: &PlausibilityConfig,
    states: &mut Vec<BeamState>,
) {
    let range_max = config.range_max.min(scan.range_max);
    states.clear();
    states.extend(scan.ranges.iter().map(|&range| {
        // NaN fails both.
        if range >= config.range_min && range < range_max {
            BeamState::Hit
        } else if range >= range_max {
            BeamState::NoReturn
        } else {
            BeamState::Invalid
        }
    }));
    let count = states.len();
    let step = config.veil_step;
    let jumps = |before: f64, after: f64| (after - before).abs() > step;
    // Given that it jumps on both sides.
    let between = |r0: f64, r: f64, r1: f64| (r0 > r && r > r1) || (r0 < r && r < r1);
    let closed = scan.is_full_circle();
    let veils = Veils {
        ranges: &scan.ranges,
        directions,
        closed,
        narrow: config.veil_angle.tan(),
        slight: config.continuation_angle.tan(),
        range_sd: config.range_sd,
    };
    let mut jumped = false;
    for (i, two) in scan.ranges.windows(2).enumerate() {
        let jump = jumps(two[0], two[1]);
        if jumped & jump && between(scan.ranges[i - 1], two[0], two[1]) && veils.holds(states, i) {
            states[i] = BeamState::Mixed;
        }
        jumped = jump;
    }
    if closed {
        for (before, beam, after) in [(count - 2, count - 1, 0), (count - 1, 0, 1)] {
            let ranges = [before, beam, after].map(|beam| scan.ranges[beam]);
            let is_step = jumps(ranges[0], ranges[1]) && jumps(ranges[1], ranges[2]);
            if is_step && between(ranges[0], ranges[1], ranges[2]) && veils.holds(states, beam) {
                states[beam] = BeamState::Mixed;
            }
        }
    }
}

/// What it takes to tell a veil.
struct Veils<'a> {
    ranges: &'a [f64],
    directions: &'a [Point],
    closed: bool,
    /// Tangent of the veil angle, and of the continuation angle.
    narrow: f64,
    slight: f64,
    range_sd: f64,
}

impl Veils<'_> {
    /// Whether a reading between its neighbours' lies in the air between a foreground and a
    /// background.
    fn holds(&self, states: &[BeamState], beam: usize) -> bool {
        let point = |offset: isize| -> Option<Point> {
            let count = states.len() as isize;
            let at = beam as isize + offset;
            let at = if self.closed { at.rem_euclid(count) } else { at };
            let at = (0..count).contains(&at).then_some(at as usize)?;
            // A veil itself still has a range, and beams before this one have been judged.
            let has_range = matches!(states[at], BeamState::Hit | BeamState::Mixed);
            has_range.then(|| self.directions[at] * self.ranges[at])
        };
        let (Some(p), Some(before), Some(after)) = (point(0), point(-1), point(1)) else {
            return false;
        };
        let direction = self.directions[beam];
        let along_beam = |q: &Point| turns_less(&(q - p), &direction, self.narrow);
        if !along_beam(&before) || !along_beam(&after) {
            return false;
        }
        // A wall at a grazing angle looks the same to three beams; five tell.
        let continues = |near: Point, far: Option<Point>| {
            far.is_some_and(|far| {
                let (before, after) = (near - far, p - near);
                // Ranges err along the beam, and across the wall by the sine of the angle between.
                let length = after.norm();
                let sine = (after.perp(&direction) / length).abs();
                let sd = self.range_sd * sine * (6f64.sqrt() / before.norm().min(length));
                turns_less(&before, &after, self.slight + 3.0 * sd)
            })
        };
        !(continues(before, point(-2)) || continues(after, point(2)))
    }
}

/// Whether the angle between two lines of these directions has less than this tangent.
fn turns_less(a: &Point, b: &Point, tangent: f64) -> bool {
    a.perp(b).abs() < tangent * a.dot(b).abs()
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
            repeats: Vec::new(),
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
