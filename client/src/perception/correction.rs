//! Corrected ranges: what a scanner's table makes of a scan, beam by beam.
//!
//! The table asks for the incidence of each beam, which the scan itself tells, in two passes: a line
//! through a few neighbours of the raw points gives the incidence, with which the reading is
//! corrected; the corrected points give a better one, with which the raw reading is corrected again.
//! Where the neighbours on both sides lie on no line, as beside a corner, those of one side may. A
//! beam that no line explains is corrected as if it met its surface squarely, and the whole width
//! of the table at its reading counts as an error that its neighbours share.
//!
//! The first pass may be rough: what it is wrong by bends the lines of the second as little as the
//! table bends within the cells that it is looked up in.
//!
//! A scanner without a table costs nothing. Knows nothing of splits and fits: what comes out is a scan
//! like any other, with a deviation for each beam.

use mapfold_map::geometry::Point;

use super::BeamState;
use super::breakpoints::Missing;
use super::incidence::{Incidences, NO_BEAM, Spot};
use super::points::Directions;
use crate::sensor::{RangeTable, Scan, ScannerProfile, TableSpot};

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
    pub missing: Missing,
}

impl CorrectionConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        neighbours: 5,
        points_min: 5,
        sides_rms: 1.5,
        line_rms: 3.0,
        surface_incidence_max: 80.0 * std::f64::consts::PI / 180.0,
        missing: Missing::STANDARD,
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
    directions: Directions,
    incidences: Incidences,
    spots: Vec<TableSpot>,
}

impl Corrector {
    /// For a scanner that has a table.
    pub fn for_scanner(profile: &ScannerProfile, config: CorrectionConfig) -> Option<Self> {
        profile.correction.as_ref().map(|correction| Self {
            table: RangeTable::new(correction),
            steepest: config.surface_incidence_max.tan(),
            config,
            directions: Directions::default(),
            incidences: Incidences::new(&config),
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
        self.gather(scan, states, into);
        let Self { table, config, incidences, spots, .. } = self;
        let table = &*table;
        incidences.find::<false>(config.line_rms);
        // Each step in a loop of its own: none has to wait for the one before.
        spots.clear();
        spots.extend(incidences.spots().map(|(spot, angle)| table.spot(spot.place, angle)));
        for ((spot, _), in_table) in incidences.spots().zip(&*spots) {
            (spot.range, spot.variance) = table.correct_roughly(in_table, spot.reading);
        }
        incidences.find::<true>(config.sides_rms);
        spots.clear();
        spots.extend(incidences.spots().map(|(spot, angle)| table.spot(spot.place, angle)));
        for ((spot, angle, variance), in_table) in incidences.found().zip(&*spots) {
            if spot.beam == NO_BEAM {
                continue;
            }
            let beam = spot.beam as usize;
            into.incidences[beam] = angle;
            if angle > table.incidence_max() {
                into.states[beam] = BeamState::Oblique;
            } else if angle.is_nan() {
                lineless(table, scan, beam, into);
            } else if let Some(found) = table.correct_at(in_table, spot.reading) {
                into.scan.ranges[beam] = found.range;
                // Neighbours share most of the points that their incidences come from.
                let shared = found.slope * found.slope * variance;
                let variance = scan.variance_share(beam) * found.variance;
                into.noise[beam] = BeamNoise { variance, shared };
            } else {
                into.states[beam] = BeamState::Uncalibrated;
            }
        }
    }

    /// Lists the hits in runs that may each lie on one surface; those of runs too short for a line are
    /// done with. On a full circle, its last hits come once more before the first, and its first
    /// after the last.
    fn gather(&mut self, scan: &Scan, states: &[BeamState], into: &mut Corrected) {
        let directions = self.directions.of(scan);
        let beams = states.len();
        let (mut lead, mut tail) = (beams, 0);
        if scan.is_full_circle() {
            let hits = || (0..beams).filter(|beam| states[*beam] == BeamState::Hit);
            lead = hits().rev().take(2 * self.config.neighbours).last().unwrap_or(lead);
            tail = hits().take(2 * self.config.neighbours).last().map_or(tail, |last| last + 1);
        }
        self.incidences.begin();
        let mut listing = Listing {
            table: &self.table,
            missing_beams: self.config.missing.steps_max(scan.geometry.increment) as i32,
            reach: scan.geometry.increment * self.steepest,
            before: None,
            incidences: &mut self.incidences,
            scan,
            into,
        };
        for (part, turn) in [(lead..beams, -1), (0..beams, 0), (0..tail, 1)] {
            let hits = states[part.clone()].iter().zip(&scan.ranges[part.clone()]);
            let hits = part.clone().zip(hits.zip(&directions[part]));
            for (beam, ((_, reading), direction)) in
                hits.filter(|(_, ((state, _), _))| **state == BeamState::Hit)
            {
                let name = if turn == 0 { beam as u32 } else { NO_BEAM };
                listing.list(name, beam as i32 + turn * beams as i32, *reading, direction);
            }
        }
        listing.end_run();
        self.incidences.end();
    }
}

/// A list of hits being made.
struct Listing<'a> {
    table: &'a RangeTable,
    missing_beams: i32,
    /// How much of its range a surface may step from a beam to the next.
    reach: f64,
    /// Number, reading and variance of the last hit.
    before: Option<(i32, f64, f64)>,
    incidences: &'a mut Incidences,
    scan: &'a Scan,
    into: &'a mut Corrected,
}

impl Listing<'_> {
    /// Appends a hit; beams are numbered on round the circle.
    #[inline]
    fn list(&mut self, name: u32, number: i32, reading: f64, direction: &Point) {
        let place = self.table.place(reading);
        // Noise as if met squarely. Means of several readings have less, but are off their line by
        // the bends of the table as well.
        let variance = self.table.variance_roughly(place);
        // Whether one surface may hold this and the last.
        let near = self.before.is_some_and(|(last, range, last_variance)| {
            let steps = number - last;
            let apart =
                (reading - range).abs() - reading.min(range) * self.reach * f64::from(steps);
            steps <= self.missing_beams
                && (apart <= 0.0 || apart * apart <= 9.0 * (variance + last_variance))
        });
        if !near {
            self.end_run();
        }
        self.before = Some((number, reading, variance));
        self.incidences.push(Spot::new(name, *direction, (reading, place), variance));
    }

    /// Ends the run; of hits too few for a line, what there is to say is said.
    fn end_run(&mut self) {
        let Self { table, scan, into, .. } = self;
        self.incidences.end_run(|run| {
            for spot in run.iter().filter(|spot| spot.beam != NO_BEAM) {
                let beam = spot.beam as usize;
                if run.len() == 1 {
                    into.states[beam] = BeamState::Isolated;
                } else {
                    lineless(table, scan, beam, into);
                }
            }
        });
    }
}

/// Corrects a beam of which no line tells the incidence.
fn lineless(table: &RangeTable, scan: &Scan, beam: usize, into: &mut Corrected) {
    let Some((found, spread)) = table.correct_unknown(scan.ranges[beam]) else {
        into.states[beam] = BeamState::Uncalibrated;
        return;
    };
    into.scan.ranges[beam] = found.range;
    // Nobody knows whether the next beam is off by the same: it counts both ways.
    let shared = spread * spread;
    let variance = scan.variance_share(beam) * found.variance + shared;
    into.noise[beam] = BeamNoise { variance, shared };
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI, TAU};

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
    fn scans_with_few_hits_or_none_are_corrected_too_and_leave_no_trace() {
        let geometry = ScanGeometry { first_bearing: 0.0, increment: TAU / 360.0 };
        let wall = wall_scan((1.2, 0.3), geometry, 360, walk).0;
        let mut corrector = corrector(&scanner(walk));
        let first = corrector.correct(&wall, &judged(&wall));
        for hits in [0, 1, 4, 5, 6, 11, 30] {
            let mut few = wall.clone();
            few.ranges[hits..].fill(f64::INFINITY);
            let done = corrector.correct(&few, &judged(&few));
            let left = done.states.iter().filter(|s| **s == BeamState::Hit).count();
            assert_eq!(left, if hits > 1 { hits } else { 0 });
            let known = done.incidences.iter().filter(|i| !i.is_nan()).count();
            assert_eq!(known, if hits < 5 { 0 } else { hits }, "{hits} hits");
            assert_eq!(
                format!("{:?}", corrector.correct(&wall, &judged(&wall))),
                format!("{first:?}")
            );
        }
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
}
