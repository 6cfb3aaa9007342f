//! Fleets that localize on the very map that they write: is what the map claims of itself true?
//!
//! The first look is fixed on surveyed landmarks, every later one on the map as it is by then, so
//! that the first fix's error is in every later pose and comes back with every look. The classical
//! rule (lines fused as if their poses were exact) goes the same way beside it, to show what such
//! feedback does to a map that does not account for it.

mod classical;
mod fix;
mod room;

use std::path::Path;
use std::sync::Arc;

use mapfold_client::perception::{Config, extract};
use mapfold_client::sensor::{Scan, ScanGeometry, ScannerProfile, preset};
use mapfold_map::geometry::{self, Covariance, Pose, Robot, UncertainPose, mahalanobis_sq};
use mapfold_map::level::{Contribution, ContributionId, Level, LevelConfig, Provenance};
use mapfold_map::vector::ObservedSegment;

use crate::simulation::{Noise, Scanner};
use crate::{Error, report};
use classical::Classical;
use fix::{MapLine, fix};
use room::{Room, Truth};

/// Standard deviations of the survey, which all fixes on its landmarks share: metres, radians.
/// They are what the fold takes for granted of a `datum` fix.
const SURVEY_SD: (f64, f64) = (0.01, 0.001);

/// Standard deviations of one fix on surveyed landmarks.
const DATUM_FIX_SD: (f64, f64) = (0.03, 0.005);

/// Standard deviations of a robot's guess before it looks for itself on the map.
const GUESS_SD: (f64, f64) = (0.06, 0.02);

/// Robots of the fleet; each has a range bias of its own.
const ROBOTS: u64 = 3;

/// The numbers of looks after which the map is measured.
pub const LOOKS: [u64; 3] = [2, 10, 50];

/// What maps claim beside how wrong they are, after so many looks.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Honesty {
    /// Lines that were compared with the walls.
    pub lines: u64,
    /// Mean normalised estimation error squared of (offset, angle); 2 for a true claim.
    pub nees: f64,
    /// Claimed over actual standard deviation of an offset.
    pub offset_ratio: f64,
    /// Claimed over actual standard deviation of an angle.
    pub angle_ratio: f64,
    /// Actual standard deviation of an offset, metres.
    pub offset_sd_m: f64,
    /// The mean normalised error squared of the poses that were found on the map since the last
    /// measure; 3 for a true claim.
    pub pose_nees: f64,
    /// The mean error squared of the classical rule's lines.
    pub classical_nees: f64,
}

/// Sums that become a [`Honesty`].
#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    lines: u64,
    nees: f64,
    claimed: [f64; 2],
    actual: [f64; 2],
    poses: u64,
    pose_nees: f64,
    classical_lines: u64,
    classical_nees: f64,
}

impl Sums {
    fn honesty(&self) -> Honesty {
        let ratio = |i: usize| (self.claimed[i] / self.actual[i]).sqrt();
        Honesty {
            lines: self.lines,
            nees: self.nees / self.lines as f64,
            offset_ratio: ratio(0),
            angle_ratio: ratio(1),
            offset_sd_m: (self.actual[0] / self.lines as f64).sqrt(),
            pose_nees: self.pose_nees / self.poses as f64,
            classical_nees: self.classical_nees / self.classical_lines as f64,
        }
    }
}

/// Sends `runs` fleets into the room, each with chances of its own, and measures their maps after
/// each number of [`LOOKS`].
pub fn measure(runs: u64, seed: u64) -> [Honesty; LOOKS.len()] {
    let mut sums = [Sums::default(); LOOKS.len()];
    for run in 0..runs {
        let mut fleet = Fleet::new(Noise::of_seed(seed + run));
        for (target, sums) in LOOKS.into_iter().zip(&mut sums) {
            while fleet.looks < target {
                fleet.look();
            }
            fleet.compare(sums);
        }
    }
    sums.map(|sums| sums.honesty())
}

/// The upper end of the 95 % band of the mean of `runs` squared errors of two components (Wilson
/// and Hilferty 1931).
pub fn upper_bound(runs: u64) -> f64 {
    let dof = 2.0 * runs as f64;
    let h = 2.0 / (9.0 * dof);
    dof * (1.0 - h + 1.96 * h.sqrt()).powi(3) / runs as f64
}

/// One run: a fleet, its map, and the classical rule's map beside it.
struct Fleet {
    noise: Noise,
    room: Room,
    level: Level,
    classical: Classical,
    scanner: Scanner,
    perception: Config,
    biases_m: Vec<f64>,
    survey_error: [f64; 3],
    looks: u64,
    /// Errors of the poses found on the map since the last measure: their sum and number.
    poses: (f64, u64),
}

impl Fleet {
    fn new(mut noise: Noise) -> Self {
        let survey_error = noise_of(SURVEY_SD, &mut noise);
        let profile = profile();
        let biases_m = (0..ROBOTS).map(|_| noise.normal(profile.systematic_sd_m)).collect();
        Self {
            room: Room::new(),
            level: Level::new(LevelConfig::standard(0.05)),
            classical: Classical::default(),
            scanner: Scanner { range_sd_m: profile.range_sd_m, ..Scanner::default() },
            perception: Config::for_scanner(&profile),
            biases_m,
            survey_error,
            looks: 0,
            poses: (0.0, 0),
            noise,
        }
    }

    /// One robot looks round from somewhere, finds itself, and hands in what it saw.
    fn look(&mut self) {
        let truth = self.room.somewhere(&mut self.noise);
        let robot = self.looks % ROBOTS;
        let segments = self.observe(truth, self.biases_m[robot as usize]);
        let exact = Pose::<geometry::Level, Robot>::new(truth.0.x, truth.0.y, truth.1);
        let moved = |error: [f64; 3]| {
            Pose::new(exact.x + error[0], exact.y + error[1], exact.heading() + error[2])
        };
        let own = noise_of(DATUM_FIX_SD, &mut self.noise);
        let guess = moved(noise_of(GUESS_SD, &mut self.noise));
        let (located, provenance, classically) = if self.looks == 0 {
            let error = [0, 1, 2].map(|i| self.survey_error[i] + own[i]);
            let located = UncertainPose { pose: moved(error), covariance: datum_covariance() };
            (Some(located), Provenance::Datum, Some(located.pose))
        } else {
            let lines: Vec<MapLine> = MapLine::of(self.level.map()).collect();
            let by_classical: Vec<MapLine> = self.classical.lines(&self.room).collect();
            let classically = fix(&by_classical, &segments, &guess).map(|found| found.pose);
            (fix(&lines, &segments, &guess), Provenance::SharedMap, classically)
        };
        // A robot that sees too little to find itself drives on.
        let (Some(located), Some(classically)) = (located, classically) else { return };
        if provenance == Provenance::SharedMap {
            let mut error = located.pose.vector() - exact.vector();
            error.z = geometry::wrap(error.z);
            self.poses.0 += mahalanobis_sq(&error, &located.covariance);
            self.poses.1 += 1;
        }
        self.classical.fuse(&self.room, truth, &classically, &segments);
        let mut id = [0; 16];
        id[8..].copy_from_slice(&self.looks.to_be_bytes());
        self.level.fold([&Contribution {
            id: ContributionId(id),
            robot: Arc::from(format!("robot-{robot}")),
            observed_at_us: 0,
            level_from_robot: located,
            provenance,
            segments,
            clusters: Vec::new(),
            evidence: Vec::new(),
        }]);
        self.looks += 1;
    }

    fn observe(&mut self, truth: Truth, bias_m: f64) -> Vec<ObservedSegment> {
        let mut ranges = self.scanner.scan(&self.room.world, truth, &mut self.noise);
        for range in &mut ranges {
            if *range < self.scanner.cap_m {
                *range += bias_m;
            }
        }
        let scan = Scan {
            geometry: ScanGeometry {
                first_bearing: -std::f64::consts::FRAC_PI_2,
                increment: 1f64.to_radians(),
            },
            ranges,
            range_max: self.scanner.cap_m,
            repeats: Vec::new(),
            robot_from_sensor: Pose::identity(),
        };
        extract(&scan, &self.perception).segments
    }

    /// Compares both maps with the walls.
    fn compare(&mut self, sums: &mut Sums) {
        let (error, count) = std::mem::take(&mut self.poses);
        sums.pose_nees += error;
        sums.poses += count;
        // Lines that a look or two founded beside the walls' own are not "the merged lines".
        let least = self.looks.div_ceil(10) as u32;
        for segment in self.level.map().segments.values().filter(|s| s.looks >= least.max(2)) {
            let Some(error) = self.room.error(segment) else { continue };
            sums.lines += 1;
            sums.nees += error.nees;
            for i in 0..2 {
                sums.claimed[i] += error.claimed[i];
                sums.actual[i] += error.actual[i];
            }
        }
        for nees in self.classical.errors() {
            sums.classical_lines += 1;
            sums.classical_nees += nees;
        }
    }
}

fn profile() -> ScannerProfile {
    let common = preset("sick-lms").and_then(|sensors| sensors.scanner);
    ScannerProfile {
        systematic_sd_m: 0.005,
        range_sd_m: 0.01,
        range_sd_per_m: 0.0,
        ..common.unwrap_or_else(|| unreachable!("`sick-lms` is a preset with a scanner"))
    }
}

fn noise_of((position, heading): (f64, f64), noise: &mut Noise) -> [f64; 3] {
    [noise.normal(position), noise.normal(position), noise.normal(heading)]
}

fn datum_covariance() -> Covariance<3> {
    let sum = |i: (f64, f64), j: (f64, f64)| (i.0.hypot(j.0).powi(2), i.1.hypot(j.1).powi(2));
    let (position, heading) = sum(SURVEY_SD, DATUM_FIX_SD);
    Covariance::from_variances([position, position, heading])
}

/// Fleets in the table.
const RUNS: u64 = 1000;

/// Rewrites the table `honesty` of the report and answers what is not as it must be.
///
/// # Errors
/// The report cannot be read or written.
pub fn table(page: &Path) -> Result<Vec<String>, Error> {
    let upper = upper_bound(RUNS);
    let mut rows = Vec::new();
    let mut faults = Vec::new();
    for (looks, honesty) in LOOKS.into_iter().zip(measure(RUNS, 1)) {
        rows.push(vec![
            looks.to_string(),
            honesty.lines.to_string(),
            format!("{:.2}", honesty.nees),
            format!("{upper:.2}"),
            format!("{:.2}", honesty.offset_ratio),
            format!("{:.2}", honesty.angle_ratio),
            format!("{:.1}", 1e3 * honesty.offset_sd_m),
            format!("{:.0}", honesty.classical_nees),
        ]);
        faults.extend(faults_of(looks, &honesty, upper));
    }
    let header = [
        "looks",
        "lines",
        "NEES",
        "95 % band up to",
        "claimed/actual sd of offset",
        "of angle",
        "actual sd mm",
        "NEES, classical rule",
    ];
    report::rewrite(page, "honesty", &report::table(&header, &rows))?;
    Ok(faults)
}

/// What is not as it must be after `looks` looks.
pub fn faults_of(looks: u64, honesty: &Honesty, upper: f64) -> Vec<String> {
    let mut faults = Vec::new();
    if honesty.nees > upper {
        faults.push(format!("after {looks} looks: NEES {:.2} above {upper:.2}", honesty.nees));
    }
    // Two decimals: the mean of a thousand fleets is not known better.
    for (what, ratio) in [("offset", honesty.offset_ratio), ("angle", honesty.angle_ratio)] {
        if !(0.995..1.605).contains(&ratio) {
            faults.push(format!("after {looks} looks: claimed/actual sd of {what} {ratio:.2}"));
        }
    }
    if looks > 2 && honesty.classical_nees < 100.0 {
        faults.push(format!("after {looks} looks: classical rule {:.0}", honesty.classical_nees));
    }
    faults
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_band_is_that_of_the_chi_square_distribution() {
        for (runs, published) in [(50, 2.591), (200, 2.287), (1000, 2.126)] {
            assert!((upper_bound(runs) - published).abs() < 0.002, "{runs}");
        }
    }
}
