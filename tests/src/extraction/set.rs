//! Sets of simulated scans, and what two ways of finding lines find in them.

use mapfold_client::perception::{Config, Extractor, Features};
use mapfold_client::sensor::{MountedAt, Scan, ScanGeometry, ScannerProfile};
use mapfold_map::geometry::Pose;
use mapfold_map::vector::EndKind;

use super::score::{End, Found, Score};
use crate::simulation::{Errors, Fan, Noise, Plan, REACH_M, Sweep};
use crate::statistics::mean;
use crate::yardstick::{BareLine, BareLoop};

/// Scans in one office before the next is built.
const SCANS_IN_OFFICE: usize = 20;

/// The scanners: those of the published comparison.
pub const FANS: [Fan; 3] = [
    Fan { beams: 361, field_deg: 180.0 },
    Fan { beams: 682, field_deg: 240.0 },
    Fan { beams: 1081, field_deg: 270.0 },
];

/// A set of scans by one scanner.
pub struct Set {
    /// Its name in the table.
    pub name: String,
    /// The scanner.
    pub fan: Fan,
    /// What its profile says.
    pub profile: ScannerProfile,
    /// The scans, and which office each was taken in.
    pub sweeps: Vec<(usize, Sweep)>,
    /// The offices.
    pub plans: Vec<Plan>,
    /// Whether round things stand in them.
    pub is_cluttered: bool,
}

impl Set {
    /// Scans with range noise only, in offices without clutter.
    pub fn plain(fan: Fan, range_sd_m: f64, scans: usize) -> Self {
        let errors = Errors { range_sd_m, ..Errors::default() };
        Self::of(format!("syn_{}_{range_sd_m}", fan.beams), fan, &errors, 0, scans)
    }

    /// Scans of wide beams with all that is wrong with real ones, in offices full of round things.
    pub fn cluttered(fan: Fan, range_sd_m: f64, scans: usize) -> Self {
        let errors = Errors {
            range_sd_m,
            bearing_sd_rad: 0.1 * fan.increment(),
            shared_sd_m: 0.005,
            width_rad: 0.004,
            step_m: 0.005,
            lost_share: 0.01,
        };
        Self::of(format!("clutter_{}_{range_sd_m}", fan.beams), fan, &errors, 3, scans)
    }

    fn of(name: String, fan: Fan, errors: &Errors, round_things: u32, scans: usize) -> Self {
        let seed = fan.beams as u64 + (errors.range_sd_m * 1e5) as u64;
        Self::drawn(name, fan, errors, round_things, (scans, seed))
    }

    /// Scans by a scanner with any errors, among so many round things, drawn from a seed.
    pub fn drawn(
        name: String,
        fan: Fan,
        errors: &Errors,
        round_things: u32,
        (scans, seed): (usize, u64),
    ) -> Self {
        let mut noise = Noise::of_seed(seed);
        let mut plans = Vec::new();
        let mut sweeps = Vec::new();
        for number in 0..scans {
            if number % SCANS_IN_OFFICE == 0 {
                plans.push(Plan::office(round_things, &mut noise));
            }
            let plan = &plans[plans.len() - 1];
            let place = plan.place(number, &mut noise);
            sweeps.push((plans.len() - 1, Sweep::take(plan, place, &fan, errors, &mut noise)));
        }
        let profile = Self::profile(errors);
        Self { name, fan, profile, sweeps, plans, is_cluttered: round_things > 0 }
    }

    /// A profile that tells the truth about such errors.
    pub fn profile(errors: &Errors) -> ScannerProfile {
        ScannerProfile {
            model: String::new(),
            range_min_m: 0.05,
            range_max_m: REACH_M,
            range_sd_m: errors.range_sd_m,
            range_sd_per_m: 0.0,
            bearing_sd_rad: errors.bearing_sd_rad.max(1e-6),
            systematic_sd_m: errors.shared_sd_m,
            mount: MountedAt::default(),
            correction: None,
        }
    }

    /// The settings that follow from the profile, and from nothing else.
    pub fn config(&self) -> Config {
        Config::for_scanner(&self.profile)
    }

    /// The scans as extraction takes them.
    pub fn scans(&self) -> Vec<Scan> {
        let geometry =
            ScanGeometry { first_bearing: self.fan.bearing(0), increment: self.fan.increment() };
        self.sweeps
            .iter()
            .map(|(_, sweep)| Scan {
                geometry,
                ranges: sweep.ranges.clone(),
                range_max: REACH_M,
                robot_from_sensor: Pose::identity(),
                repeats: Vec::new(),
            })
            .collect()
    }

    /// Mean range of the returns, metres.
    pub fn mean_range_m(&self) -> f64 {
        let ranges = self.sweeps.iter().flat_map(|(_, s)| &s.ranges).copied();
        let returns: Vec<f64> = ranges.filter(|r| r.is_finite()).collect();
        mean(&returns)
    }

    /// The bare loop for this scanner.
    pub fn bare_loop(&self) -> BareLoop {
        BareLoop::for_noise(self.profile.range_sd_m)
    }

    /// What extraction and what the bare loop find.
    pub fn scores(&self) -> [Score; 2] {
        let scans = self.scans();
        let mut extractor = Extractor::new(self.config());
        let (bare, mut lines) = (self.bare_loop(), Vec::new());
        let ours = self.score(|i| found(extractor.extract(&scans[i])));
        let theirs = self.score(|i| {
            bare.lines(&self.fan, &scans[i].ranges, &mut lines);
            bare_found(&lines)
        });
        [ours, theirs]
    }

    /// Holds what was found in each scan against its office.
    fn score(&self, mut found_in: impl FnMut(usize) -> Vec<Found>) -> Score {
        let mut score = Score::default();
        for (i, (plan, sweep)) in self.sweeps.iter().enumerate() {
            score.add(&self.plans[*plan], sweep, &found_in(i));
        }
        score
    }
}

/// A scan's segments.
pub(super) fn found(features: &Features) -> Vec<Found> {
    let of = |segment: &mapfold_map::vector::ObservedSegment| {
        let covariance = segment.line.covariance.rows();
        Found {
            rho: segment.line.line.rho(),
            alpha: segment.line.line.alpha(),
            span: (segment.from, segment.to),
            covariance: Some([covariance[0][0], covariance[0][1], covariance[1][1]]),
            ends: segment.ends.map(|end| match end.kind {
                EndKind::Corner => Some(End { corner: true, sd: end.sd }),
                EndKind::Jump => Some(End { corner: false, sd: end.sd }),
                EndKind::Occluded => None,
            }),
        }
    };
    features.segments.iter().map(of).collect()
}

/// A scan's bare lines.
pub(super) fn bare_found(lines: &[BareLine]) -> Vec<Found> {
    let of = |line: &BareLine| Found {
        rho: line.rho,
        alpha: line.alpha,
        span: (line.span.0.min(line.span.1), line.span.0.max(line.span.1)),
        covariance: None,
        ends: [None; 2],
    };
    lines.iter().map(of).collect()
}
