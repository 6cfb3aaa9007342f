//! Real readings of sonar, and a ring emulated from a real scanner.
//!
//! No plan of the corridor of `corridor-ring8` is known. What its grid is held against are readings that it
//! does not contain: the log is cut into stretches, every other one makes the grid, and in those between, the two
//! sonars that look square to the side, where the walls are, are the reference: square walls are where
//! sonars are right.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use mapfold_client::emulation::{Chance, EmulationConfig, emulate};
use mapfold_client::evidence::{
    Canvas, ScannerEvidenceConfig, SonarEvidenceConfig, SonarRule, SonarVerdicts, scanner_evidence,
    sonar_evidence,
};
use mapfold_client::log::{Observation, Reading, carmen};
use mapfold_client::replay::SensorChoice;
use mapfold_client::robot::at_rest::{AtRestConfig, settle};
use mapfold_client::sensor::{MountedAt, Ring, SonarProfile, preset};
use mapfold_map::geometry::{Level, Pose, Robot};

use super::rooms::claimed;
use super::{Grid, Truth, cone};
use crate::Error;
use crate::plane::{Piece, Point};

/// Cells of the scored grids, metres.
const RESOLUTION_M: f64 = 0.1;
/// Cells of the picture, metres.
const PICTURED_M: f64 = 0.05;
/// How far off the poses of these logs are taken to be.
const POSE_SD: (f64, f64) = (0.03, 0.005);
/// Sonars that look at least this far aside, radians, are the reference.
const ASIDE_RAD: f64 = 1.2;
/// Rounds in a stretch: some 60 cm of the way.
const STRETCH: usize = 10;

/// A committed log.
pub fn log(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data").join(name)
}

fn place(pose: &Pose<Level, Robot>) -> (Point, f64) {
    (Point::new(pose.x, pose.y), pose.heading())
}

/// A rectangle about these places, `reach_m` wider on all sides.
fn about(places: &[(Point, f64)], reach_m: f64, resolution_m: f64) -> Grid {
    let corners: Vec<Piece> = places
        .iter()
        .map(|(p, _)| Piece {
            a: Point::new(p.x - reach_m, p.y - reach_m),
            b: Point::new(p.x + reach_m, p.y + reach_m),
        })
        .collect();
    Grid::about(&corners, resolution_m)
}

/// A ring's log: where the robot was for each round, and what it heard.
pub struct Rounds {
    profile: SonarProfile,
    rounds: Vec<((Point, f64), Ring)>,
}

impl Rounds {
    /// Reads them from a log.
    ///
    /// # Errors
    /// A log without sonar, or that cannot be read.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let fault = |error: &dyn std::fmt::Display| {
            Error::file(path, std::io::Error::other(error.to_string()))
        };
        let log = carmen::read(path).map_err(|error| fault(&error))?;
        let sensors = SensorChoice::default().choose(&log).map_err(|error| fault(&error))?;
        let profile = sensors.sonar.ok_or_else(|| fault(&"no sonar"))?;
        let of = |reading: Reading| match (reading.observation, reading.level_from_robot) {
            (Observation::Ring(ring), Some(pose)) => Some((place(&pose), ring)),
            _ => None,
        };
        let readings = settle(log.readings, &AtRestConfig::STANDARD);
        Ok(Self { profile, rounds: readings.into_iter().filter_map(of).collect() })
    }

    fn blank(&self, resolution_m: f64) -> Grid {
        let places: Vec<_> = self.rounds.iter().map(|(place, _)| *place).collect();
        about(&places, 3.5, resolution_m)
    }

    /// The stretches that make the grid; or of those between, the sonars that look aside.
    fn part(&self, is_reference: bool) -> Vec<((Point, f64), Ring)> {
        let stretches = self.rounds.chunks(STRETCH).skip(usize::from(is_reference)).step_by(2);
        let of = |(place, ring): &((Point, f64), Ring)| {
            let mut ring = ring.clone();
            let aside = |heading: f64| heading.abs() > ASIDE_RAD;
            ring.sonars.retain(|s| !is_reference || aside(s.robot_from_sensor.heading()));
            (*place, ring)
        };
        stretches.flatten().map(of).collect()
    }

    fn ours(
        &self,
        rounds: &[((Point, f64), Ring)],
        blank: &Grid,
        config: &SonarEvidenceConfig,
    ) -> (Grid, SonarVerdicts) {
        let (mut grid, mut canvas) = (blank.clone(), Canvas::default());
        let mut verdicts = SonarVerdicts::default();
        for (place, ring) in rounds {
            let (patch, told) = sonar_evidence(
                ring,
                &self.profile,
                &claimed(*place, POSE_SD.0, POSE_SD.1),
                None,
                blank.resolution_m,
                config,
                &mut canvas,
            );
            grid.add(&patch, 1.0);
            verdicts.add(&told);
        }
        (grid, verdicts)
    }

    /// What the sonars that look aside say along their axes: free up to 20 cm before the echo, occupied where
    /// it came from, and what most say of a cell counts.
    fn told_aside(&self, blank: &Grid) -> Truth {
        let mut votes = vec![[0_u32; 2]; blank.nats.len()];
        for ((at, heading), ring) in self.part(true) {
            for sonar in &ring.sonars {
                let Some(range) = sonar.range.filter(|r| *r < self.profile.range_max_m) else {
                    continue;
                };
                let angle = heading + sonar.robot_from_sensor.heading();
                let mut vote = |distance: f64, kind: usize| {
                    if let Some(cell) = blank.holding(at.towards(angle, distance)) {
                        votes[cell][kind] += 1;
                    }
                };
                let steps = ((range - 0.2) / blank.resolution_m).max(0.0) as u32;
                (0..steps).for_each(|step| vote(f64::from(step) * blank.resolution_m, 0));
                vote(range, 1);
            }
        }
        let known = votes.iter().map(|[free, hit]| free + hit > 0).collect();
        Truth::given(votes.iter().map(|[free, hit]| hit > free).collect(), known)
    }

    /// Rows of a table: base rate, plain cone and ours; and what was refused of the whole log.
    pub fn rows(&self) -> (Vec<Vec<String>>, String) {
        let blank = self.blank(RESOLUTION_M);
        let reference = self.told_aside(&blank);
        let made_of = self.part(false);
        let mut plain = blank.clone();
        for (place, ring) in &made_of {
            cone::enter(&mut plain, ring, *place, self.profile.range_max_m);
        }
        let standard = SonarEvidenceConfig::STANDARD;
        let lax = SonarEvidenceConfig { off: [Some(SonarRule::Specular), None], ..standard };
        let (ours, _) = self.ours(&made_of, &blank, &standard);
        let (unruled, _) = self.ours(&made_of, &blank, &lax);
        let (_, verdicts) = self.ours(&self.rounds, &blank, &standard);
        let scores = [reference.base_scores(), reference.scores(&plain), reference.scores(&ours)];
        let name = "corridor-ring8, against held-out readings square to the walls";
        let mut rows = rows(name, scores.map(|s| s.cells()));
        let first = [name.to_owned(), "Mapfold without the specular rule".to_owned()];
        rows.push([first.to_vec(), reference.scores(&unruled).cells()].concat());
        (rows, verdicts.in_words().unwrap_or_default())
    }

    /// The grid of all sonars as a picture.
    pub fn picture(&self) -> String {
        let blank = self.blank(PICTURED_M);
        picture(&self.ours(&self.rounds, &blank, &SonarEvidenceConfig::STANDARD).0)
    }
}

/// The rows of base rate, plain cone and ours.
fn rows(name: &str, scores: [Vec<String>; 3]) -> Vec<Vec<String>> {
    ["base rate", "plain cone", "Mapfold"]
        .into_iter()
        .zip(scores)
        .map(|(model, cells)| [vec![name.to_owned(), model.to_owned()], cells].concat())
        .collect()
}

/// The same for a ring that is emulated from a scanner's log, held against the grid of the very scans; and,
/// at the end, of both models with their evidence put on the base rate: most cells are told a little only, and
/// read by themselves they stay near one half, where the base rate knows that few are occupied.
///
/// # Errors
/// A log that cannot be read.
pub fn emulated(path: &Path, part: std::ops::Range<usize>) -> Result<Vec<Vec<String>>, Error> {
    let fault =
        |error: &dyn std::fmt::Display| Error::file(path, std::io::Error::other(error.to_string()));
    let log = carmen::read(path).map_err(|error| fault(&error))?;
    let sonar = preset("sonar-ring").and_then(|s| s.sonar).ok_or_else(|| fault(&"no preset"))?;
    // The outermost look as far aside as the scanner sees.
    let heading = |at: usize| (-77.4 + 154.8 / 7.0 * at as f64).to_radians();
    let transducers =
        (0..8).map(|at| MountedAt { heading_rad: heading(at), ..MountedAt::default() }).collect();
    let sonar = SonarProfile { transducers, ..sonar };
    let laser = preset("sick-pls").and_then(|s| s.scanner).ok_or_else(|| fault(&"no preset"))?;
    let readings = log.readings.get(part).unwrap_or_default();
    let scans: Vec<_> = readings
        .iter()
        .filter_map(|reading| match (&reading.observation, &reading.level_from_robot) {
            (Observation::Scan(scan), Some(pose)) => Some((place(pose), scan)),
            _ => None,
        })
        .collect();
    let places: Vec<_> = scans.iter().map(|(place, _)| *place).collect();
    let blank = about(&places, 5.0, RESOLUTION_M);
    let [mut seen, mut ours, mut lax, mut plain] = std::array::from_fn(|_| blank.clone());
    let (mut canvas, mut chance) = (Canvas::default(), Chance::new(1));
    for (place, scan) in &scans {
        let pose = claimed(*place, POSE_SD.0, POSE_SD.1);
        let is_return = |beam: usize| scan.is_return(scan.ranges[beam]);
        let config = ScannerEvidenceConfig::STANDARD;
        let patch =
            scanner_evidence(scan, is_return, &laser, &pose, RESOLUTION_M, &config, &mut canvas);
        seen.add(&patch, 1.0);
        let ring = emulate(scan, &sonar, &EmulationConfig::STANDARD, &mut chance);
        let standard = SonarEvidenceConfig::STANDARD;
        let unruled = SonarEvidenceConfig { off: [Some(SonarRule::Specular), None], ..standard };
        for (grid, config) in [(&mut ours, standard), (&mut lax, unruled)] {
            let (patch, _) =
                sonar_evidence(&ring, &sonar, &pose, None, RESOLUTION_M, &config, &mut canvas);
            grid.add(&patch, 1.0);
        }
        cone::enter(&mut plain, &ring, *place, sonar.range_max_m);
    }
    // Of the scanner's cells those are believed that it is sure of, as far as sonars reach.
    let sure = |nat: f64| nat.abs() > 1.0;
    let near = |index: usize| {
        let centre = blank.centre(index);
        places.iter().any(|(place, _)| place.distance(centre) < sonar.range_max_m)
    };
    let known = (0..seen.nats.len()).map(|i| sure(seen.nats[i]) && near(i)).collect();
    let reference = Truth::given(seen.nats.iter().map(|nat| *nat > 0.0).collect(), known);
    let scores = [reference.base_scores(), reference.scores(&plain), reference.scores(&ours)];
    let name = "killian, **emulated**, against the scanner";
    let mut rows = rows(name, scores.map(|s| s.cells()));
    let base_nat = (reference.base_rate() / (1.0 - reference.base_rate())).ln();
    for (model, grid, nat) in [
        ("Mapfold without the specular rule", &lax, 0.0),
        ("plain cone on the base rate", &plain, base_nat),
        ("Mapfold on the base rate", &ours, base_nat),
        ("Mapfold without the specular rule, on the base rate", &lax, base_nat),
    ] {
        let mut grid = grid.clone();
        grid.nats.iter_mut().for_each(|cell| *cell += nat);
        let first = vec![name.to_owned(), model.to_owned()];
        rows.push([first, reference.scores(&grid).cells()].concat());
    }
    Ok(rows)
}

/// Shades of a picture, from surely free to surely occupied, by log-odds.
const SHADES: [(f64, &str); 6] = [
    (-1.5, "#ffffff"),
    (-0.3, "#ebebeb"),
    (0.3, "#c8c8c8"),
    (1.0, "#8c8c8c"),
    (2.0, "#505050"),
    (f64::INFINITY, "#000000"),
];

/// A grid as an SVG: white is free, black occupied, grey unknown.
fn picture(grid: &Grid) -> String {
    let (columns, rows) = grid.size();
    let mut paths: BTreeMap<usize, String> = BTreeMap::new();
    for row in 0..rows {
        let shade = |column: usize| {
            let nat = grid.nats[row * columns + column];
            SHADES.iter().position(|(most, _)| nat < *most).unwrap_or(SHADES.len() - 1)
        };
        let mut from = 0;
        while from < columns {
            let is = shade(from);
            let to = (from..columns).find(|column| shade(*column) != is).unwrap_or(columns);
            let path = paths.entry(is).or_default();
            // Up is up in the level, down in a picture. Writing to a string cannot fail.
            let _ = write!(path, "M{from} {}h{}v1h-{}z", rows - 1 - row, to - from, to - from);
            from = to;
        }
    }
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {columns} {rows}\" width=\"{}\" \
         shape-rendering=\"crispEdges\">\n<rect width=\"100%\" height=\"100%\" fill=\"{}\"/>\n",
        2 * columns,
        SHADES[2].1
    );
    for (shade, path) in paths.into_iter().filter(|(shade, _)| *shade != 2) {
        let _ = writeln!(svg, "<path fill=\"{}\" d=\"{path}\"/>", SHADES[shade].1);
    }
    svg + "</svg>\n"
}
