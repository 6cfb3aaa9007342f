//! Corrected ranges: what a scanner's table makes of a scan, beam by beam.
//!
//! The table asks for the incidence of each beam, which the scan itself tells, in two passes: a line
//! through a few neighbours of the raw points gives the incidence, with which the reading is
//! corrected; the corrected points give a better one, with which the raw reading is corrected again.
//! Where the neighbours on both sides lie on no line, as beside a corner, those of one side may. A
//! beam that no line explains is corrected as if it met its surface squarely, and the whole width
//! of the table at its reading counts as an error that its neighbours share.
//!
//! Sums over the neighbours are differences of running sums, so the cost of a beam does not grow
//! with their number; a scanner without a table costs nothing. Knows nothing of runs, splits and
//! fits: what comes out is a scan like any other, with a deviation for each beam.

use std::f64::consts::FRAC_PI_2;

use mapfold_map::geometry::Point;

use super::BeamState;
use super::points::Directions;
use crate::sensor::{CorrectedRange, RangeTable, Scan, ScannerProfile};

/// How incidences are found.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CorrectionConfig {
    /// Neighbours on each side that the line through a point takes in.
    pub neighbours: usize,
    /// Fewest points of such a line, itself included.
    pub points_min: usize,
    /// If the corrected points on both sides are farther than this many deviations (rms) from
    /// their line, one side is tried; one or two in a hundred lines of pure noise are beyond 1.5.
    pub sides_rms: f64,
    /// Points farther than this from every line lie on none. Raw points, which are bent, are first
    /// tried on one side beyond this.
    pub line_rms: f64,
    /// Neighbours are on one surface if it would be met at no more than this, radians: twice as far
    /// from grazing as the worst incidence of a table, for raw ranges are bent.
    pub surface_incidence_max: f64,
    /// So many beams without a point break a surface.
    pub missing_beams: usize,
}

impl CorrectionConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        neighbours: 5,
        points_min: 5,
        sides_rms: 1.5,
        line_rms: 3.0,
        surface_incidence_max: 80.0 * std::f64::consts::PI / 180.0,
        missing_beams: 3,
    };
}

/// The noise of one corrected range.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BeamNoise {
    /// Variance of the range, one reading from the next.
    pub variance: f64,
    /// Variance of what it shares with its neighbours, beyond the profile's systematic part.
    pub shared: f64,
}

/// A corrected scan.
#[derive(Debug, Clone, PartialEq)]
pub struct Corrected {
    /// The scan with corrected ranges; readings that gave no point stay as they were.
    pub scan: Scan,
    /// What became of the beams: lone ones, those met at too great an incidence and those outside
    /// the table are no hits any more.
    pub states: Vec<BeamState>,
    /// The noise of each hit.
    pub noise: Vec<BeamNoise>,
    /// The incidence of each hit, radians; NaN where none was found.
    pub incidences: Vec<f64>,
}

/// Corrects the scans of one scanner.
#[derive(Debug, Clone)]
pub struct Corrector {
    table: RangeTable,
    config: CorrectionConfig,
    /// Tangent of the greatest incidence of a surface.
    steepest: f64,
    /// One over every number of points that a line may have.
    shares: Vec<f64>,
    directions: Directions,
    sums: Vec<Sums>,
    spots: Vec<Spot>,
}

/// A hit on its way: its beam, its run and its range so far.
#[derive(Debug, Clone, Copy)]
struct Spot {
    beam: usize,
    direction: Point,
    range: f64,
    variance: f64,
    /// First and last spot of the surface that it may lie on.
    run: (u32, u32),
    incidence: Incidence,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Incidence {
    /// Radians; NaN if unknown.
    angle: f64,
    variance: f64,
}

const UNKNOWN: Incidence = Incidence { angle: f64::NAN, variance: 0.0 };

/// Running sums of the points before a spot.
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    variance: f64,
}

impl Corrector {
    /// For a scanner that has a table.
    pub fn for_scanner(profile: &ScannerProfile, config: CorrectionConfig) -> Option<Self> {
        profile.correction.as_ref().map(|correction| Self {
            table: RangeTable::new(correction),
            steepest: config.surface_incidence_max.tan(),
            shares: (0..=2 * config.neighbours + 1).map(|n| 1.0 / (n.max(1) as f64)).collect(),
            config,
            directions: Directions::default(),
            sums: Vec::new(),
            spots: Vec::new(),
        })
    }

    /// Corrects a scan whose beams have been judged.
    pub fn correct(&mut self, scan: &Scan, states: &[BeamState]) -> Corrected {
        let mut corrected = Corrected {
            scan: scan.clone(),
            states: Vec::new(),
            noise: Vec::new(),
            incidences: Vec::new(),
        };
        self.correct_into(scan, states, &mut corrected);
        corrected
    }

    /// Corrects a scan whose beams have been judged into what an earlier scan has left.
    pub fn correct_into(&mut self, scan: &Scan, states: &[BeamState], into: &mut Corrected) {
        into.scan.geometry = scan.geometry;
        into.scan.range_max = scan.range_max;
        into.scan.robot_from_sensor = scan.robot_from_sensor;
        into.scan.ranges.clone_from(&scan.ranges);
        into.scan.repeats.clone_from(&scan.repeats);
        into.states.clear();
        into.states.extend_from_slice(states);
        into.noise.clear();
        into.noise.resize(states.len(), BeamNoise::default());
        into.incidences.clear();
        into.incidences.resize(states.len(), f64::NAN);
        let overlap = self.gather(scan, states);
        self.find_incidences(self.config.line_rms);
        for spot in &mut self.spots {
            let reading = scan.ranges[spot.beam];
            // What the table does not cover is dropped at the end; its place is still telling.
            let found = corrected(&self.table, reading, 1.0, spot.incidence);
            (spot.range, spot.variance) =
                found.map_or((reading, spot.variance), |(c, _)| (c.range, c.variance));
        }
        self.find_incidences(self.config.sides_rms);
        let count = self.spots.len() - 2 * overlap;
        for spot in &self.spots[overlap..overlap + count] {
            let (reading, share) = (scan.ranges[spot.beam], scan.variance_share(spot.beam));
            into.incidences[spot.beam] = spot.incidence.angle;
            if spot.run.0 == spot.run.1 {
                into.states[spot.beam] = BeamState::Isolated;
            } else if spot.incidence.angle > self.table.incidence_max() {
                into.states[spot.beam] = BeamState::Oblique;
            } else if let Some((found, noise)) =
                corrected(&self.table, reading, share, spot.incidence)
            {
                into.scan.ranges[spot.beam] = found.range;
                into.noise[spot.beam] = noise;
            } else {
                into.states[spot.beam] = BeamState::Uncalibrated;
            }
        }
    }

    /// Lists the hits with their runs; on a full circle, its last hits come once more before the
    /// first, and its first after the last. Answers how many are repeated at each end.
    fn gather(&mut self, scan: &Scan, states: &[BeamState]) -> usize {
        self.spots.clear();
        let directions = self.directions.of(scan);
        for (beam, _) in states.iter().enumerate().filter(|(_, s)| **s == BeamState::Hit) {
            let range = scan.ranges[beam];
            // Noise as if met squarely; a reading far outside the table is none of its own. Means of
            // several readings have less, but are off their line by the bends of the table as well.
            let variance = self.table.variance_met_squarely(range).unwrap_or(0.0);
            self.spots.push(Spot {
                beam,
                direction: directions[beam],
                range,
                variance,
                run: (0, 0),
                incidence: UNKNOWN,
            });
        }
        let count = self.spots.len();
        let overlap =
            if scan.is_full_circle() { (2 * self.config.neighbours).min(count) } else { 0 };
        self.spots.extend_from_within(..overlap);
        self.spots.extend_from_within(count - overlap..count);
        self.spots.rotate_right(overlap);
        let mut from = 0;
        for at in 1..=self.spots.len() {
            if at == self.spots.len() || !self.neighbours(scan, at - 1, at) {
                for spot in &mut self.spots[from..at] {
                    spot.run = (from as u32, at as u32 - 1);
                }
                from = at;
            }
        }
        overlap
    }

    /// Whether one surface may hold two spots that follow each other.
    fn neighbours(&self, scan: &Scan, a: usize, b: usize) -> bool {
        let (a, b) = (&self.spots[a], &self.spots[b]);
        let beams = scan.ranges.len();
        let steps = if b.beam > a.beam { b.beam - a.beam } else { b.beam + beams - a.beam };
        let turn = scan.geometry.increment * steps as f64;
        let noise = 3.0 * (a.variance + b.variance).sqrt();
        steps <= self.config.missing_beams
            && (a.range - b.range).abs() <= a.range.min(b.range) * turn * self.steepest + noise
    }

    /// The incidence of every spot, from the spots' places so far; one side is tried where both
    /// are farther off their line than `sides_rms`.
    fn find_incidences(&mut self, sides_rms: f64) {
        self.sums.clear();
        let mut sum = Sums::default();
        self.sums.push(sum);
        for spot in &self.spots {
            let (x, y) = (spot.range * spot.direction.x, spot.range * spot.direction.y);
            sum.x += x;
            sum.y += y;
            sum.xx += x * x;
            sum.xy += x * y;
            sum.yy += y * y;
            sum.variance += spot.variance;
            self.sums.push(sum);
        }
        let reach = self.config.neighbours;
        for at in 0..self.spots.len() {
            let spot = &self.spots[at];
            let (first, last) = (spot.run.0 as usize, spot.run.1 as usize);
            let window = |before: usize, after: usize| {
                let from = at.saturating_sub(before).max(first);
                let to = (at + after).min(last);
                self.local_line(spot.direction, from, to)
            };
            let both = window(reach, reach);
            let found = match both {
                Some(line) if line.rms_sq <= sides_rms * sides_rms => both,
                _ => [both, window(2 * reach, 0), window(0, 2 * reach)]
                    .into_iter()
                    .flatten()
                    .min_by(|a, b| a.rms_sq.total_cmp(&b.rms_sq)),
            };
            let on_line = found.filter(|line| line.rms_sq <= self.config.line_rms.powi(2));
            self.spots[at].incidence = on_line.map_or(UNKNOWN, |line| line.incidence());
        }
    }

    /// The line through the spots `from..=to`, as a beam of this direction meets it.
    fn local_line(&self, direction: Point, from: usize, to: usize) -> Option<LocalLine> {
        let count = to + 1 - from;
        if count < self.config.points_min {
            return None;
        }
        let (a, b) = (&self.sums[from], &self.sums[to + 1]);
        let n = count as f64;
        let share = self.shares[count];
        let (x, y) = (share * (b.x - a.x), share * (b.y - a.y));
        let xx = share * (b.xx - a.xx) - x * x;
        let xy = share * (b.xy - a.xy) - x * y;
        let yy = share * (b.yy - a.yy) - y * y;
        // Twice the direction of the line: (d, 2 xy) over its length.
        let (d, sum) = (xx - yy, xx + yy);
        let length = (d * d + 4.0 * xy * xy).sqrt();
        if length <= 0.0 {
            return None;
        }
        // Range noise across the line, in the ratio of the squares of the cosine of the incidence.
        // cos of twice the angle between beam and line is that of twice the incidence, negative.
        let (ex, ey) = (direction.x, direction.y);
        let twice = (d * (ex * ex - ey * ey) + 4.0 * xy * ex * ey) / length;
        let cosine_sq = (0.5 * (1.0 - twice)).clamp(0.0, 1.0);
        // A beam along the line still has some noise across.
        let across = (share * (b.variance - a.variance) * cosine_sq.max(0.01)).max(1e-12);
        let off = (0.5 * (sum - length)).max(0.0) * n / (n - 2.0);
        Some(LocalLine { twice, across, along: 0.5 * (sum + length) * n, rms_sq: off / across })
    }
}

#[derive(Debug, Clone, Copy)]
struct LocalLine {
    /// Cosine of twice the incidence, negative.
    twice: f64,
    /// Variance of a point across the line.
    across: f64,
    /// Sum of the squares of the points' distances along it from their middle.
    along: f64,
    /// Mean square of the residuals over that of the noise.
    rms_sq: f64,
}

impl LocalLine {
    fn incidence(&self) -> Incidence {
        let (sine_sq, cosine_sq) = (1.0 + self.twice, 1.0 - self.twice);
        Incidence {
            angle: arc_tangent_sqrt(sine_sq.max(0.0), cosine_sq.max(0.0)),
            variance: self.across / self.along,
        }
    }
}

/// The range that a reading means, and its noise, of which it has this share of a single reading's.
fn corrected(
    table: &RangeTable,
    reading: f64,
    share: f64,
    incidence: Incidence,
) -> Option<(CorrectedRange, BeamNoise)> {
    if incidence.angle.is_nan() {
        let (found, spread) = table.correct_unknown(reading)?;
        // Nobody knows whether the next beam is off by the same: it counts both ways.
        let shared = spread * spread;
        return Some((found, BeamNoise { variance: share * found.variance + shared, shared }));
    }
    let found = table.correct(reading, incidence.angle)?;
    // Neighbours share most of the points that their incidences come from.
    let shared = found.slope * found.slope * incidence.variance;
    Some((found, BeamNoise { variance: share * found.variance, shared }))
}

/// `atan2(sqrt(y), sqrt(x))` to within 1e-5 rad, in a third of the time (Hastings 1955, sheet 11).
fn arc_tangent_sqrt(y: f64, x: f64) -> f64 {
    let (small, large) = if y < x { (y, x) } else { (x, y) };
    let s = if large > 0.0 { small / large } else { 0.0 };
    let angle = s.sqrt()
        * (0.999_977_26
            + s * (-0.332_623_47
                + s * (0.193_543_46
                    + s * (-0.116_432_87 + s * (0.052_653_32 - s * 0.011_721_20)))));
    if y < x { angle } else { FRAC_PI_2 - angle }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{PI, TAU};

    use mapfold_map::geometry::Pose;
    use mapfold_schema::v1::RangeCorrection;
    use proptest::prelude::*;

    use super::*;
    use crate::sensor::{ScanGeometry, preset};

    fn scanner(bias: impl Fn(f64, f64) -> f64) -> ScannerProfile {
        let distances: Vec<f64> = (3..=40).map(|i| 0.1 * f64::from(i)).collect();
        let incidences: Vec<f64> = (0..=14).map(|i| f64::from(5 * i).to_radians()).collect();
        let bias_m: Vec<Vec<f64>> = incidences
            .iter()
            .map(|beta| distances.iter().map(|d| bias(*d, *beta)).collect())
            .collect();
        ScannerProfile {
            correction: Some(RangeCorrection {
                sd_m: vec![vec![0.01; distances.len()]; incidences.len()],
                distances_m: distances,
                incidences_rad: incidences,
                bias_m,
                incidence_max_rad: 65f64.to_radians(),
            }),
            ..preset("ir-led").and_then(|s| s.scanner).unwrap()
        }
    }

    fn walk(d: f64, beta: f64) -> f64 {
        0.03 * (3.0 * d).sin() + 0.02 * d * (1.0 / beta.cos() - 1.0)
    }

    /// What a scan of the wall at `rho` under `alpha` reads like, beam by beam, and the truth.
    fn wall_scan(
        (rho, alpha): (f64, f64),
        geometry: ScanGeometry,
        beams: usize,
        bias: impl Fn(f64, f64) -> f64,
    ) -> (Scan, Vec<f64>, Vec<f64>) {
        let incidence = |beam: usize| {
            let turn = (geometry.bearing(beam) - alpha).rem_euclid(TAU);
            if turn > PI { TAU - turn } else { turn }
        };
        let seen = |beam: usize| incidence(beam) < 80f64.to_radians();
        let truth: Vec<f64> = (0..beams)
            .map(|b| if seen(b) { rho / incidence(b).cos() } else { f64::INFINITY })
            .collect();
        let ranges = (0..beams)
            .map(|b| if seen(b) { truth[b] + bias(truth[b], incidence(b)) } else { f64::INFINITY })
            .collect();
        let scan = Scan {
            geometry,
            ranges,
            range_max: 9.0,
            robot_from_sensor: Pose::identity(),
            repeats: Vec::new(),
        };
        (scan, truth, (0..beams).map(incidence).collect())
    }

    fn judged(scan: &Scan) -> Vec<BeamState> {
        let state = |r: &f64| if r.is_finite() { BeamState::Hit } else { BeamState::NoReturn };
        scan.ranges.iter().map(state).collect()
    }

    fn corrector(profile: &ScannerProfile) -> Corrector {
        Corrector::for_scanner(profile, CorrectionConfig::STANDARD).unwrap()
    }

    /// Equal within `by`, or both without return.
    fn alike(a: f64, b: f64, by: f64) -> bool {
        (a - b).abs() < by || !(a.is_finite() || b.is_finite())
    }

    const HALF_TURN: ScanGeometry =
        ScanGeometry { first_bearing: -FRAC_PI_2, increment: PI / 180.0 };

    #[test]
    fn a_scanner_without_a_table_has_no_corrector() {
        let profile = preset("sick-lms").and_then(|s| s.scanner).unwrap();
        assert!(Corrector::for_scanner(&profile, CorrectionConfig::STANDARD).is_none());
    }

    #[test]
    fn a_table_without_bias_leaves_ranges_alone() {
        let (scan, _, incidences) = wall_scan((1.5, 0.4), HALF_TURN, 181, |_, _| 0.0);
        let states = judged(&scan);
        let done = corrector(&scanner(|_, _| 0.0)).correct(&scan, &states);
        for (beam, incidence) in incidences.iter().enumerate() {
            if done.states[beam] == BeamState::Hit {
                assert!((done.scan.ranges[beam] - scan.ranges[beam]).abs() < 1e-9);
                assert!((done.incidences[beam] - incidence).abs() < 1e-4, "{beam}");
                assert!(done.noise[beam].shared < 1e-12);
            } else {
                assert!(*incidence > 64.9f64.to_radians(), "{beam}");
            }
        }
        assert!(done.states.iter().filter(|s| **s == BeamState::Hit).count() > 120);
    }

    proptest! {
        #[test]
        fn a_bent_wall_is_bent_back_wherever_it_stands_and_the_sensor_looks(
            rho in 0.7..1.6, alpha in -0.7..0.7, turn in -PI..PI,
        ) {
            let mut corrector = corrector(&scanner(walk));
            let (scan, truth, incidences) = wall_scan((rho, alpha), HALF_TURN, 181, walk);
            let done = corrector.correct(&scan, &judged(&scan));
            for beam in 0..181 {
                if done.states[beam] == BeamState::Hit && incidences[beam] < 64f64.to_radians() {
                    let off = done.scan.ranges[beam] - truth[beam];
                    prop_assert!(off.abs() < 4e-3, "beam {}: {} off", beam, off);
                }
            }
            // Target and sensor turned together: nothing changes.
            let geometry =
                ScanGeometry { first_bearing: HALF_TURN.first_bearing + turn, ..HALF_TURN };
            let (turned, ..) = wall_scan((rho, alpha + turn), geometry, 181, walk);
            let again = corrector.correct(&turned, &judged(&turned));
            prop_assert_eq!(&done.states, &again.states);
            for (a, b) in done.scan.ranges.iter().zip(&again.scan.ranges) {
                prop_assert!(alike(*a, *b, 1e-6), "{} {}", a, b);
            }
        }
    }

    #[test]
    fn a_wall_across_the_seam_of_a_full_circle_is_corrected_as_any_other() {
        let mut corrector = corrector(&scanner(walk));
        let circle = |first_bearing: f64| ScanGeometry { first_bearing, increment: TAU / 360.0 };
        let (ahead, ..) = wall_scan((1.2, 0.0), circle(-PI), 360, walk);
        let (seam, ..) = wall_scan((1.2, 0.0), circle(0.0), 360, walk);
        let ahead = corrector.correct(&ahead, &judged(&ahead));
        let seam = corrector.correct(&seam, &judged(&seam));
        for beam in 0..360 {
            let (a, b) = (ahead.scan.ranges[(beam + 180) % 360], seam.scan.ranges[beam]);
            assert!(alike(a, b, 1e-9), "{beam}: {a} {b}");
        }
        assert_eq!(seam.states[0], BeamState::Hit);
        assert!(seam.incidences[0] < 0.01);
    }

    #[test]
    fn beside_a_corner_one_side_tells_the_incidence() {
        // Two walls at a right angle, x = 1.5 and y = 1.5: the corner at 45 degrees.
        let geometry = ScanGeometry { first_bearing: 0.0, increment: PI / 180.0 };
        let incidence =
            |b: usize| geometry.bearing(b).min(FRAC_PI_2 - geometry.bearing(b)).to_degrees();
        let truth = |b: usize| 1.5 / incidence(b).to_radians().cos();
        let ranges: Vec<f64> =
            (0..=90).map(|b| truth(b) + walk(truth(b), incidence(b).to_radians())).collect();
        let scan = Scan {
            geometry,
            ranges,
            range_max: 9.0,
            robot_from_sensor: Pose::identity(),
            repeats: Vec::new(),
        };
        let done = corrector(&scanner(walk)).correct(&scan, &judged(&scan));
        for beam in 0..=90 {
            let off = (done.incidences[beam].to_degrees() - incidence(beam)).abs();
            assert!(off < 8.0, "beam {beam}: {off} degrees off");
            assert!((done.scan.ranges[beam] - truth(beam)).abs() < 6e-3, "beam {beam}");
        }
    }

    #[test]
    fn what_lies_on_no_line_is_claimed_to_share_the_width_of_the_table() {
        let ranges: Vec<f64> = (0..40).map(|i| 2.0 + 0.04 * f64::from(i * 7 % 5)).collect();
        let scan = Scan {
            geometry: ScanGeometry { first_bearing: 0.0, increment: PI / 180.0 },
            ranges: [&ranges[..], &[9.9; 4], &[2.0; 3], &[f64::NAN; 4], &[2.3]].concat(),
            range_max: 99.0,
            robot_from_sensor: Pose::identity(),
            repeats: Vec::new(),
        };
        let profile = scanner(walk);
        let done = corrector(&profile).correct(&scan, &judged(&scan));
        let table = RangeTable::new(profile.correction.as_ref().unwrap());
        for beam in (0..40).chain(44..47) {
            let (square, width) = table.correct_unknown(scan.ranges[beam]).unwrap();
            assert!(done.incidences[beam].is_nan(), "{beam}");
            assert!((done.scan.ranges[beam] - square.range).abs() < 1e-12);
            assert!(width > 0.05 && (done.noise[beam].shared - width * width).abs() < 1e-12);
            assert!(done.noise[beam].variance > width * width);
        }
        assert_eq!(done.states[40], BeamState::Uncalibrated);
        assert_eq!(done.states[47], BeamState::NoReturn);
        assert_eq!(done.states[51], BeamState::Isolated);
    }

    #[test]
    fn the_arc_tangent_is_good_enough_for_any_table() {
        for i in 0..=2000 {
            let angle = FRAC_PI_2 * f64::from(i) / 2000.0;
            assert!(
                (arc_tangent_sqrt(angle.sin().powi(2), angle.cos().powi(2)) - angle).abs() < 1e-5,
                "{angle}"
            );
        }
    }
}
