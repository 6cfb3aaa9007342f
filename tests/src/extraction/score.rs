//! Lines that were found in a scan, held against the walls that are there.

use std::collections::BTreeMap;
use std::f64::consts::PI;

use crate::plane::{Piece, Point};
use crate::simulation::{Plan, Sweep};

/// A line that was found, in the scanner's frame.
#[derive(Debug, Clone, Copy)]
pub struct Found {
    /// Distance, metres.
    pub rho: f64,
    /// Angle of the normal, radians.
    pub alpha: f64,
    /// From where to where along the line, metres from the foot point.
    pub span: (f64, f64),
    /// Covariance of (rho, alpha): its entries rr, ra, aa.
    pub covariance: Option<[f64; 3]>,
    /// The standard deviations of its ends along the line, of those that claim to be physical.
    pub ends: [Option<End>; 2],
}

/// A physical end.
#[derive(Debug, Clone, Copy)]
pub struct End {
    /// Whether it claims to be a corner; else it is where a wall ends and the view goes on.
    pub corner: bool,
    /// Standard deviation along the line, metres.
    pub sd: f64,
}

/// A wall counts as visible if so many beams hit it,
const BEAMS_MIN: usize = 10;
/// over such a length, metres.
const SEEN_MIN_M: f64 = 0.5;
/// A line is a wall's if it lies along it to within these: generous, so that what is bent counts as
/// bent and not as missing.
const ANGLE_MAX: f64 = 15.0 * PI / 180.0;
const OFFSET_MAX_M: f64 = 0.10;
/// How far the line's middle may lie beyond the wall's ends, metres.
const BEYOND_MAX_M: f64 = 0.10;
/// An end farther from a wall's true end is not that end at all, metres.
const ASTRAY_M: f64 = 0.30;

/// What came of a set of scans.
#[derive(Debug, Clone, Default)]
pub struct Score {
    /// Scans.
    pub scans: usize,
    /// Lines.
    pub lines: usize,
    /// Lines on no wall.
    pub false_lines: usize,
    /// Visible walls.
    pub visible: usize,
    /// Those of them half of whose beams lie within lines on them.
    pub recalled: usize,
    /// Of each line on a visible wall: its angle off, radians.
    pub angles: Vec<f64>,
    /// Of each visible wall on which a line lies, by scan and wall: the angle off of the longest.
    pub walls: BTreeMap<(usize, usize), f64>,
    /// Of each line on a visible wall: how far its middle is off, metres.
    pub offsets: Vec<f64>,
    /// Of each line on a wall with a covariance: its squared Mahalanobis distance from the truth.
    pub nees: Vec<f64>,
    /// Of each corner at a wall's end: its error along the line over its deviation.
    pub corners: Vec<f64>,
    /// Of each end where the view goes on: the same.
    pub jumps: Vec<f64>,
    /// Physical ends that are no wall's.
    pub astray: usize,
}

/// A wall in the scanner's frame.
struct Truth {
    rho: f64,
    normal: Point,
    tangent: Point,
    /// Ends along the tangent.
    span: (f64, f64),
}

impl Truth {
    fn of(piece: &Piece, sweep: &Sweep) -> Self {
        let (a, b) = (sweep.local(piece.a), sweep.local(piece.b));
        let length = a.distance(b);
        let (tx, ty) = ((b.x - a.x) / length, (b.y - a.y) / length);
        let rho = ty * a.x - tx * a.y;
        let turn = if rho < 0.0 { -1.0 } else { 1.0 };
        let (normal, tangent) =
            (Point::new(ty * turn, -tx * turn), Point::new(tx * turn, ty * turn));
        let along = |p: Point| tangent.x * p.x + tangent.y * p.y;
        let (s, t) = (along(a), along(b));
        Self { rho: rho.abs(), normal, tangent, span: (s.min(t), s.max(t)) }
    }

    fn along(&self, p: Point) -> f64 {
        self.tangent.x * p.x + self.tangent.y * p.y
    }

    fn across(&self, p: Point) -> f64 {
        self.normal.x * p.x + self.normal.y * p.y - self.rho
    }

    /// How far off a line is in angle, and its middle across the wall, if it is this wall's.
    fn errors(&self, found: &Found) -> Option<(f64, f64)> {
        let angle = wrapped(found.alpha - self.normal.y.atan2(self.normal.x));
        let angle = if angle.abs() > PI / 2.0 { wrapped(angle - PI) } else { angle };
        let middle = found.at(f64::midpoint(found.span.0, found.span.1));
        let (t, offset) = (self.along(middle), self.across(middle));
        (angle.abs() < ANGLE_MAX
            && offset.abs() < OFFSET_MAX_M
            && t > self.span.0 - BEYOND_MAX_M
            && t < self.span.1 + BEYOND_MAX_M)
            .then_some((angle, offset))
    }
}

impl Found {
    fn length(&self) -> f64 {
        self.span.1 - self.span.0
    }

    /// Where it is in the plan that the scan was taken in.
    pub(super) fn placed(&self, sweep: &Sweep) -> Piece {
        let (sin, cos) = sweep.heading.sin_cos();
        let [a, b] = [self.span.0, self.span.1].map(|t| {
            let p = self.at(t);
            Point::new(sweep.at.x + cos * p.x - sin * p.y, sweep.at.y + sin * p.x + cos * p.y)
        });
        Piece { a, b }
    }

    /// Whether a point that the scanner saw lies within the line's span, give or take a centimetre.
    fn covers(&self, p: Point) -> bool {
        let (sin, cos) = self.alpha.sin_cos();
        let t = cos * p.y - sin * p.x;
        t > self.span.0 - 0.01 && t < self.span.1 + 0.01
    }

    fn at(&self, t: f64) -> Point {
        let (sin, cos) = self.alpha.sin_cos();
        Point::new(self.rho * cos - t * sin, self.rho * sin + t * cos)
    }
}

fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(2.0 * PI) - PI
}

impl Score {
    /// Adds a scan and the lines that were found in it.
    pub fn add(&mut self, plan: &Plan, sweep: &Sweep, found: &[Found]) {
        self.scans += 1;
        self.lines += found.len();
        let mut hits: BTreeMap<usize, Vec<Point>> = BTreeMap::new();
        for (wall, at) in sweep.hits.iter().flatten() {
            if *wall < plan.walls {
                hits.entry(*wall).or_default().push(sweep.local(*at));
            }
        }
        let indices: Vec<usize> = hits.keys().copied().collect();
        let walls: Vec<(Truth, Vec<Point>)> = hits
            .into_iter()
            .map(|(wall, points)| (Truth::of(&plan.pieces[wall], sweep), points))
            .collect();
        // Which lines lie on which wall.
        let mut on: Vec<Vec<&Found>> = vec![Vec::new(); walls.len()];
        for line in found {
            let nearest = walls
                .iter()
                .enumerate()
                .filter_map(|(i, (truth, _))| Some((i, truth.errors(line)?)))
                .min_by(|a, b| cost(a.1).total_cmp(&cost(b.1)));
            let Some((i, (angle, offset))) = nearest else {
                self.false_lines += 1;
                continue;
            };
            on[i].push(line);
            if is_visible(&walls[i].1) {
                self.angles.push(angle.abs());
                self.offsets.push(offset.abs());
            }
            self.add_honesty(&walls[i].0, line);
        }
        for (i, ((truth, points), lines)) in walls.iter().zip(on).enumerate() {
            if !is_visible(points) {
                continue;
            }
            self.visible += 1;
            let longest = lines.iter().max_by(|a, b| a.length().total_cmp(&b.length()));
            if let Some((angle, _)) = longest.and_then(|line| truth.errors(line)) {
                self.walls.insert((self.scans, indices[i]), angle.abs());
            }
            let covered = |p: &&Point| lines.iter().any(|line| line.covers(**p));
            if 2 * points.iter().filter(covered).count() >= points.len() {
                self.recalled += 1;
            }
        }
    }

    fn add_honesty(&mut self, truth: &Truth, line: &Found) {
        if let Some([rr, ra, aa]) = line.covariance {
            // About the line's own middle, as it is fused: far from it, rho bends with alpha.
            let t = f64::midpoint(line.span.0, line.span.1);
            let middle = line.at(t);
            let mut turn = wrapped(line.alpha - truth.normal.y.atan2(truth.normal.x));
            let mut off = -truth.across(middle);
            if turn.abs() > PI / 2.0 {
                (turn, off) = (wrapped(turn - PI), -off);
            }
            // The found line passes through its middle; the truth by `-off` from there.
            let off = -off;
            let (dd, da) = (rr - 2.0 * t * ra + t * t * aa, ra - t * aa);
            let determinant = dd * aa - da * da;
            let squared = aa * off * off - 2.0 * da * off * turn + dd * turn * turn;
            self.nees.push(squared / determinant);
        }
        for (end, t) in line.ends.iter().zip([line.span.0, line.span.1]) {
            let Some(end) = end else { continue };
            let t = truth.along(line.at(t));
            let off = [truth.span.0, truth.span.1].map(|true_end| (t - true_end).abs());
            let off = off[0].min(off[1]);
            if off > ASTRAY_M {
                self.astray += 1;
            } else if end.corner {
                self.corners.push(off / end.sd);
            } else {
                self.jumps.push(off / end.sd);
            }
        }
    }

    /// Adds what came of other scans.
    pub fn append(&mut self, mut other: Self) {
        let scans = self.scans;
        self.walls
            .extend(other.walls.into_iter().map(|((scan, wall), x)| ((scans + scan, wall), x)));
        self.scans += other.scans;
        self.lines += other.lines;
        self.false_lines += other.false_lines;
        self.visible += other.visible;
        self.recalled += other.recalled;
        self.astray += other.astray;
        for (own, more) in [
            (&mut self.angles, &mut other.angles),
            (&mut self.offsets, &mut other.offsets),
            (&mut self.nees, &mut other.nees),
            (&mut self.corners, &mut other.corners),
            (&mut self.jumps, &mut other.jumps),
        ] {
            own.append(more);
        }
    }

    /// The angles off of the longest lines on the walls on which both have lines.
    pub fn angles_on_same_walls(&self, other: &Self) -> (Vec<f64>, Vec<f64>) {
        let both =
            self.walls.iter().filter_map(|(wall, own)| Some((*own, *other.walls.get(wall)?)));
        both.unzip()
    }

    /// Share of the visible walls that were found.
    pub fn recall(&self) -> f64 {
        self.recalled as f64 / self.visible.max(1) as f64
    }
}

/// Whether these points of a wall make it one that has to be found.
pub(super) fn is_visible(points: &[Point]) -> bool {
    let extent = points.iter().map(|p| p.distance(points[0])).fold(0.0, f64::max);
    points.len() >= BEAMS_MIN && extent >= SEEN_MIN_M
}

/// To compare how well lines fit walls: half a degree is as far off as a centimetre.
fn cost((angle, offset): (f64, f64)) -> f64 {
    (angle.to_degrees() / 0.5).hypot(offset / 0.01)
}
