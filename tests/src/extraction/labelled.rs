//! Lines of a real building that people drew, and the laser points that they drew them from: scans
//! are made of the points, and the lines that are found in them held against those that were drawn.
//!
//! The points are gathered from a whole drive, so that a wall is as thick as the robot's poses were
//! uncertain; the lines leave out what was not worth drawing. What is measured is agreement.

use std::path::Path;

use mapfold_client::perception::Extractor;

use super::score::{Found, is_visible};
use super::set::{Set, bare_found, found};
use crate::plane::{Piece, Point};
use crate::simulation::{Errors, Fan, Noise, Plan, REACH_M, Sweep};
use crate::statistics::quantile;
use crate::yardstick::BareLoop;
use crate::{Error, report};

/// A point stops the beams that pass it as near as this, metres: the points lie on a raster of 2 cm.
const POINT_RADIUS_M: f64 = 0.02;
/// What the raster alone makes points scatter, metres.
const RASTER_SD_M: f64 = 0.006;
/// From one place to the next, metres.
const PITCH_M: f64 = 1.0;
/// Nearer to a point no scan is taken, metres.
const CLEARANCE_M: f64 = 0.4;
/// Fewer beams than this share come back where there is no building around.
const RETURNS_MIN: f64 = 0.8;
/// What lies this close to a line that was drawn is that line's, metres and radians.
const NEAR_M: f64 = 0.10;
const TURN_MAX: f64 = 15.0 * std::f64::consts::PI / 180.0;
/// Steps in which a found line is looked at, metres.
const STEP_M: f64 = 0.05;

/// The map of a building, in the format of `MobileRobots`: millimetres.
struct Drawing {
    lines: Vec<Piece>,
    points: Vec<Point>,
}

impl Drawing {
    fn read(path: &Path) -> Result<Self, Error> {
        let text = std::fs::read_to_string(path).map_err(|e| Error::file(path, e))?;
        let mut drawing = Self { lines: Vec::new(), points: Vec::new() };
        let mut section = "";
        for (number, line) in text.lines().enumerate() {
            if matches!(line, "LINES" | "DATA") {
                section = line;
                continue;
            }
            if section.is_empty() || line.is_empty() {
                continue;
            }
            let metres: Vec<f64> =
                line.split_whitespace().filter_map(|n| n.parse::<f64>().ok()).collect();
            let at = |i: usize| Point::new(metres[i] / 1e3, metres[i + 1] / 1e3);
            match (section, metres.len()) {
                ("LINES", 4) => drawing.lines.push(Piece { a: at(0), b: at(2) }),
                ("DATA", 2) => drawing.points.push(at(0)),
                _ => {
                    let fault = format!("no entry of {section}: {line}");
                    return Err(Error::Log { path: path.to_owned(), line: number + 1, fault });
                }
            }
        }
        Ok(drawing)
    }

    /// The standard deviation of the points about the lines, by the median, metres.
    fn scatter_m(&self) -> f64 {
        let nearest = |p: &Point| {
            self.lines.iter().map(|line| line.distance(*p)).fold(f64::INFINITY, f64::min)
        };
        let off: Vec<f64> = self.points.iter().step_by(11).map(nearest).collect();
        let near: Vec<f64> = off.into_iter().filter(|off| *off < NEAR_M).collect();
        quantile(&near, 0.5) / 0.6745
    }

    /// Places within the building, and the scans there.
    fn sweeps(&self, fan: &Fan) -> Vec<Sweep> {
        let mut noise = Noise::of_seed(1);
        let range = |of: fn(&Point) -> f64| {
            let all = self.points.iter().map(of);
            all.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), x| (a.min(x), b.max(x)))
        };
        let ((left, right), (below, above)) = (range(|p| p.x), range(|p| p.y));
        let count = |from: f64, to: f64| ((to - from) / PITCH_M) as u32;
        let mut sweeps = Vec::new();
        for column in 1..count(left, right) {
            for row in 1..count(below, above) {
                let at = Point::new(
                    left + PITCH_M * f64::from(column),
                    below + PITCH_M * f64::from(row),
                );
                let heading = noise.share() * std::f64::consts::TAU;
                sweeps.extend(self.sweep(at, heading, fan));
            }
        }
        sweeps
    }

    fn sweep(&self, at: Point, heading: f64, fan: &Fan) -> Option<Sweep> {
        let mut sweep = Sweep {
            at,
            heading,
            ranges: vec![f64::INFINITY; fan.beams],
            hits: vec![None; fan.beams],
        };
        let beams = fan.beams as i64;
        for p in &self.points {
            let (range, bearing) = {
                let local = sweep.local(*p);
                (local.x.hypot(local.y), local.y.atan2(local.x))
            };
            if range < CLEARANCE_M {
                return None;
            }
            if range > REACH_M {
                continue;
            }
            let half = (POINT_RADIUS_M / range).asin();
            let beam = |bearing: f64| (bearing - fan.bearing(0)) / fan.increment();
            for i in beam(bearing - half).ceil() as i64..=beam(bearing + half).floor() as i64 {
                // All the way round: the last beam is the first one's neighbour.
                let i = i.rem_euclid(beams) as usize;
                if range < sweep.ranges[i] {
                    sweep.ranges[i] = range;
                    sweep.hits[i] = Some((0, *p));
                }
            }
        }
        let returns = sweep.hits.iter().flatten().count();
        if (returns as f64) < RETURNS_MIN * fan.beams as f64 {
            return None;
        }
        for hit in &mut sweep.hits {
            *hit = hit.and_then(|(_, p)| {
                let lines = self.lines.iter().enumerate().map(|(i, line)| (i, line.distance(p)));
                let (i, off) = lines.min_by(|a, b| a.1.total_cmp(&b.1))?;
                (off < 0.5 * NEAR_M).then_some((i, p))
            });
        }
        Some(sweep)
    }
}

/// How well found lines and drawn ones agree.
#[derive(Debug, Default)]
struct Agreement {
    visible: usize,
    recalled: usize,
    found: usize,
    right: usize,
}

impl Agreement {
    fn add(&mut self, lines: &[Piece], sweep: &Sweep, found: &[Found]) {
        for (index, line) in lines.iter().enumerate() {
            let own = sweep.hits.iter().flatten().filter(|(i, _)| *i == index);
            let own: Vec<Point> = own.map(|(_, p)| *p).collect();
            if !is_visible(&own) {
                continue;
            }
            self.visible += 1;
            let covered = |p: &&Point| {
                found.iter().any(|f| {
                    let piece = f.placed(sweep);
                    turn(&piece, line) < TURN_MAX && piece.distance(**p) < NEAR_M
                })
            };
            self.recalled += usize::from(2 * own.iter().filter(covered).count() >= own.len());
        }
        for piece in found.iter().map(|f| f.placed(sweep)) {
            let steps = (piece.length() / STEP_M).ceil() as u32;
            let along = |i: u32| piece.at(f64::from(i) / f64::from(steps.max(1)));
            let on = (0..=steps).filter(|i| {
                let near = |line: &&Piece| line.distance(along(*i)) < NEAR_M;
                lines.iter().filter(near).any(|line| turn(&piece, line) < TURN_MAX)
            });
            self.found += 1;
            self.right += usize::from(2 * on.count() as u32 > steps);
        }
    }

    fn row(&self, name: &str, scans: usize) -> Vec<String> {
        vec![
            name.to_owned(),
            format!("{:.1}", self.found as f64 / scans as f64),
            format!("{:.3}", self.recall()),
            format!("{:.3}", self.precision()),
        ]
    }

    fn recall(&self) -> f64 {
        self.recalled as f64 / self.visible.max(1) as f64
    }

    fn precision(&self) -> f64 {
        self.right as f64 / self.found.max(1) as f64
    }
}

/// The angle between two pieces, whichever way round they run.
fn turn(a: &Piece, b: &Piece) -> f64 {
    let angle = |piece: &Piece| (piece.b.y - piece.a.y).atan2(piece.b.x - piece.a.x);
    let turn = (angle(a) - angle(b)).rem_euclid(std::f64::consts::PI);
    turn.min(std::f64::consts::PI - turn)
}

/// Rewrites the table `labelled` of the report; answers what is not as it must be.
///
/// # Errors
/// A page or a map that cannot be read or written.
pub(super) fn labelled(page: &Path, map: &Path) -> Result<Vec<String>, Error> {
    let drawing = Drawing::read(map)?;
    let fan = Fan { beams: 720, field_deg: 359.5 };
    let range_sd_m = drawing.scatter_m().max(RASTER_SD_M);
    let set = Set {
        name: "columbia".to_owned(),
        fan,
        profile: Set::profile(&Errors { range_sd_m, ..Errors::default() }),
        sweeps: drawing.sweeps(&fan).into_iter().map(|sweep| (0, sweep)).collect(),
        plans: vec![Plan { walls: drawing.lines.len(), pieces: drawing.lines }],
        is_cluttered: true,
    };
    let bare = BareLoop::for_noise(range_sd_m);
    let mut extractor = Extractor::new(set.config());
    let (mut ours, mut theirs) = (Agreement::default(), Agreement::default());
    let mut lines = Vec::new();
    for (scan, (_, sweep)) in set.scans().iter().zip(&set.sweeps) {
        ours.add(&set.plans[0].pieces, sweep, &found(extractor.extract(scan)));
        bare.lines(&fan, &scan.ranges, &mut lines);
        theirs.add(&set.plans[0].pieces, sweep, &bare_found(&lines));
    }
    let count = set.sweeps.len();
    let table = report::table(
        &["extractor", "seg/scan", "recall", "precision"],
        &[theirs.row("bare loop", count), ours.row("Mapfold", count)],
    );
    let words = format!(
        "{count} scans; {} times a line that was drawn is visible; points scatter by {:.0} mm.",
        ours.visible,
        1e3 * range_sd_m
    );
    report::rewrite(page, "labelled", &format!("{words}\n\n{table}"))?;
    let holds = ours.recall() >= theirs.recall() && ours.precision() >= theirs.precision();
    let fault = format!("lines that people drew: {ours:?}, the bare loop {theirs:?}");
    Ok((!holds).then_some(fault).into_iter().collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A room of 4 by 3 m of points 1 cm apart, in millimetres, with lines for three of its walls.
    fn room() -> String {
        let head = "2D-Map\nNumLines: 3\nLINES\n0 0 4000 0\n4000 3000 4000 0\n0 0 0 3000\nDATA\n";
        let long = (0..400).map(|i| format!("{0} 0\n{0} 3000\n", 10 * i));
        let short = (0..300).map(|i| format!("0 {0}\n4000 {0}\n", 10 * i));
        head.to_owned() + &long.chain(short).collect::<String>()
    }

    #[test]
    fn lines_are_held_against_those_that_were_drawn() {
        let folder = tempfile::tempdir().expect("a folder");
        let (map, page) = (folder.path().join("room.map"), folder.path().join("page.md"));
        std::fs::write(&map, room()).expect("a map");
        std::fs::write(&page, "<!-- begin: labelled --><!-- end: labelled -->").expect("a page");
        let drawing = Drawing::read(&map).expect("a drawing");
        assert_eq!((drawing.lines.len(), drawing.points.len()), (3, 1400));
        let fan = Fan { beams: 720, field_deg: 359.5 };
        let sweeps = drawing.sweeps(&fan);
        assert!(sweeps.len() >= 6, "{}", sweeps.len());
        // Three of four walls were drawn: of what is found, three in four lines are right.
        let mut agreement = Agreement::default();
        for sweep in &sweeps {
            assert!(sweep.ranges.iter().all(|r| r.is_finite()));
            let walls = [
                (0.0, 0.0, 4.0, 0.0),
                (4.0, 0.0, 4.0, 3.0),
                (0.0, 3.0, 0.0, 0.0),
                (4.0, 3.0, 0.0, 3.0),
            ];
            let found = walls.map(|(ax, ay, bx, by)| {
                let (a, b) = (sweep.local(Point::new(ax, ay)), sweep.local(Point::new(bx, by)));
                let alpha = (b.y - a.y).atan2(b.x - a.x) - std::f64::consts::FRAC_PI_2;
                let along = |p: Point| alpha.cos() * p.y - alpha.sin() * p.x;
                let rho = alpha.cos() * a.x + alpha.sin() * a.y;
                let span = (along(a), along(b));
                Found { rho, alpha, span, covariance: None, ends: [None; 2] }
            });
            agreement.add(&drawing.lines, sweep, &found);
        }
        assert_eq!(agreement.visible, 3 * sweeps.len());
        assert_eq!(agreement.recalled, agreement.visible);
        assert_eq!((agreement.found, agreement.right), (4 * sweeps.len(), 3 * sweeps.len()));
        let faults = labelled(&page, &map).expect("a table");
        assert!(faults.is_empty(), "{faults:?}");
        let text = std::fs::read_to_string(&page).expect("the page");
        assert!(text.contains("| Mapfold | 4.") && text.contains(" | 1.000 | 0.7"), "{text}");
        std::fs::write(&map, "LINES\n1 2 3\n").expect("a map");
        assert!(matches!(Drawing::read(&map), Err(Error::Log { line: 2, .. })));
    }
}
