//! Iterative End Point Fit (Duda and Hart) as a proposer, least squares as the judge.
//!
//! The chord between a run's end points leans on two noisy points: of a hundred points on one
//! straight wall it would split two thirds of the runs at three standard deviations. So the chord
//! only proposes where to split; the run is split only if its least-squares line fails as well.
//! All tests are normalised by each point's own deviation across the line, never a fixed width.
//! A merge pass then joins neighbours that one line explains, points at the seams go to the
//! closer line, and what its neighbours explain, or what is too short or too curved to be a wall, is let
//! go.
//!
//! Until the last of these, lines are guesses from running sums, which cost the same for three
//! points as for three hundred.

use std::ops::Range;

use mapfold_map::geometry::Point;

use super::Config;
use super::cloud::Cloud;
use super::explain::explaining;
use super::fit::{LineFit, Local};
use super::guess::Guess;
use super::settle::clear_of_seams;
use super::tally::Held;

/// When a run of points is a line.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SplitConfig {
    /// Deviations off a line up to which a point next to its end is taken for its own.
    pub near_sds: f64,
    /// Deviations off the least-squares line up to which a point belongs to it.
    pub residual_sds: f64,
    /// So many deviations off the chord, the least-squares line need not be asked.
    pub hopeless_sds: f64,
    /// Standard normal quantile at which the sum of squared residuals convicts (3.09: 99.9 %).
    pub chi_sq_z: f64,
    /// Fewest points of a line.
    pub points_min: usize,
    /// The same for scanners with less than half a degree from beam to beam.
    pub points_min_fine: usize,
    /// Shortest line, metres.
    pub length_min: f64,
    /// Largest standard deviation of a line's direction, radians: beyond, it is not known.
    pub direction_sd_max: f64,
    /// Deviations of its slope across the beams over which that has to hold. A stretch that noise turned
    /// towards the beams seems to know its direction well: of the many that are proposed, the worst is it.
    pub direction_sds: f64,
    /// A line whose points bow by more than this share of its length, and more than so many standard
    /// deviations, is the side of something round.
    pub bow_max: f64,
    /// See `bow_max`.
    pub bow_sds: f64,
    /// Longest line of which this is asked, metres: longer ones are walls.
    pub bow_length_max: f64,
    /// A shorter line than this, metres, must show that it is straight: it could not bow by
    /// `bow_doubt` of its length unseen. Legs of people and of tables are as long.
    pub plain_length: f64,
    /// See `plain_length`.
    pub bow_doubt: f64,
    /// Largest root mean square of the normalised residuals: more is a curve.
    pub rms_max: f64,
    /// Gate for joining two lines, chi-square with two degrees of freedom. 23.0 (one in a hundred
    /// thousand) and not the usual 9.21: pieces were cut where the noise was worst, which bends
    /// each of them, and a gate that does not know that leaves one wall in 300 in pieces.
    pub merge_gate: f64,
    /// Deviations off the joint line up to which two lines are joined. Wider than
    /// `residual_sds`: among the hundred points of a long wall one lies beyond four deviations
    /// every other hundred scans, and such a split must be healed.
    pub merge_sds: f64,
    /// The same for the sum of squares (4.75: one in a million).
    pub merge_chi_sq_z: f64,
    /// What walls deviate from straight: added to the gate's covariance, metres and radians.
    pub model_sd: (f64, f64),
    /// Stray points between two lines that still may be one.
    pub stray_points: usize,
    /// Where two lines meet, points within so many deviations of their intersection may be either's
    /// and bend neither.
    pub seam_sds: f64,
    /// Deviations from which on the outermost points of a line together are not its own.
    pub astray_sds: f64,
    /// Most points that are looked at for this at either end.
    pub astray_points_max: usize,
}

impl Default for SplitConfig {
    fn default() -> Self {
        Self {
            near_sds: 3.0,
            residual_sds: 4.0,
            hopeless_sds: 15.0,
            chi_sq_z: 3.09,
            points_min: 5,
            points_min_fine: 8,
            length_min: 0.20,
            direction_sd_max: 8f64.to_radians(),
            direction_sds: 4.0,
            bow_max: 0.03,
            bow_sds: 3.5,
            bow_length_max: 1.0,
            plain_length: 0.35,
            bow_doubt: 0.10,
            rms_max: 2.0,
            merge_gate: 23.0,
            merge_sds: 5.0,
            merge_chi_sq_z: 4.75,
            model_sd: (0.005, 0.2 * std::f64::consts::PI / 180.0),
            stray_points: 2,
            seam_sds: 1.0,
            astray_sds: 4.0,
            astray_points_max: 16,
        }
    }
}

impl SplitConfig {
    /// Fewest points of a line for beams `increment` apart.
    pub fn fewest(&self, increment: f64) -> usize {
        // Half a degree itself is coarse; the margin is for its rounding.
        if increment < 0.49_f64.to_radians() { self.points_min_fine } else { self.points_min }
    }
}

/// A line and the points that support it.
#[derive(Debug, Clone, PartialEq)]
pub struct FoundLine {
    /// Its points, but for those that are marked as strays.
    pub points: Range<usize>,
    /// The line.
    pub fit: LineFit,
    /// Whether strays are marked among its points.
    pub(super) has_strays: bool,
}

impl FoundLine {
    /// Index of its first point.
    pub fn first(&self) -> usize {
        self.points.start
    }

    /// Index of its last point.
    pub fn last(&self) -> usize {
        self.points.end - 1
    }
}

/// A stretch of points that may be a line.
#[derive(Debug, Clone)]
pub(super) struct Piece {
    pub(super) points: Range<usize>,
    /// Points among them that do not lie on it.
    pub(super) strays: usize,
    pub(super) guess: Guess,
    /// What was summed when it was proposed.
    pub(super) held: Option<Held>,
}

/// Buffers that are used from run to run.
#[derive(Debug, Default)]
pub(super) struct Splitter {
    waiting: Vec<Range<usize>>,
    pieces: Vec<Piece>,
    /// The points at the ends of a line.
    pub(super) ends: [Vec<Local>; 2],
    /// For every point of the scan, whether it lies among a line's points and not on it.
    pub(super) stray: Vec<bool>,
}

impl Splitter {
    /// Forgets the last scan.
    pub(super) fn begin(&mut self, points: usize) {
        self.stray.clear();
        self.stray.resize(points, false);
    }

    /// Finds the lines of a run and appends them to `lines`; stretches of points in no line go to
    /// `loose`.
    pub(super) fn lines(
        &mut self,
        cloud: &Cloud,
        run: &Range<usize>,
        increment: f64,
        config: &Config,
        lines: &mut Vec<FoundLine>,
        loose: &mut Vec<Range<usize>>,
    ) {
        let fewest = config.split.fewest(increment);
        self.pieces.clear();
        if run.len() >= fewest {
            self.propose(cloud, run, fewest, config);
            self.share_out(cloud);
            self.extend(cloud, run, config);
            self.merge(cloud, config);
            self.contest(cloud);
            if self.dissolve(cloud, fewest, config) {
                self.extend(cloud, run, config);
                self.contest(cloud);
            }
        }
        let mut free_from = run.start;
        let mut ends = std::mem::take(&mut self.ends);
        for (i, piece) in self.pieces.iter().enumerate() {
            let before = i.checked_sub(1).map(|i| &self.pieces[i]);
            let clear = clear_of_seams(cloud, piece, [before, self.pieces.get(i + 1)], config);
            let line = self.settled(cloud, piece, clear, fewest, config, &mut ends);
            let Some(line) = line else { continue };
            if !line.has_strays {
                if line.points.start > free_from {
                    loose.push(free_from..line.points.start);
                }
                free_from = line.points.end;
                lines.push(line);
                continue;
            }
            for at in line.points.clone() {
                if self.stray[at] {
                    continue;
                }
                if at > free_from {
                    loose.push(free_from..at);
                }
                free_from = at + 1;
            }
            lines.push(line);
        }
        self.ends = ends;
        if free_from < run.end {
            loose.push(free_from..run.end);
        }
    }

    /// Iterative End Point Fit: ascending candidates; neighbours share the point they were split at.
    fn propose(&mut self, cloud: &Cloud, run: &Range<usize>, fewest: usize, config: &Config) {
        self.waiting.clear();
        self.waiting.push(run.clone());
        while let Some(range) = self.waiting.pop() {
            if range.len() < fewest {
                continue;
            }
            let (farthest, sds_sq) = farthest_from_chord(cloud, &range);
            let hopeless = sds_sq > config.split.hopeless_sds * config.split.hopeless_sds;
            if !hopeless {
                let guess = cloud.guess(&range);
                let (sds, z) = (config.split.residual_sds, config.split.chi_sq_z);
                let strays = (&self.stray[..], 0);
                if let Some((guess, held)) = explaining(cloud, &range, strays, &guess, sds, z) {
                    self.pieces.push(Piece { points: range, strays: 0, guess, held });
                    continue;
                }
            }
            self.waiting.push(farthest..range.end);
            self.waiting.push(range.start..farthest + 1);
        }
    }

    /// Gives the point that two neighbours share to the closer one.
    fn share_out(&mut self, cloud: &Cloud) {
        for i in 1..self.pieces.len() {
            let [a, b] = neighbours(&mut self.pieces, i);
            if a.points.end == b.points.start + 1 {
                let shared = &cloud.points[b.points.start];
                if a.guess.normalised_sq(shared) <= b.guess.normalised_sq(shared) {
                    b.points.start += 1;
                    b.guess = cloud.guess(&b.points);
                } else {
                    a.points.end -= 1;
                    a.guess = cloud.guess(&a.points);
                }
            }
        }
    }

    /// Lets every line take the free points next to its ends that lie on it.
    fn extend(&mut self, cloud: &Cloud, run: &Range<usize>, config: &Config) {
        let near_sq = config.split.near_sds * config.split.near_sds;
        let mut from = run.start;
        for i in 0..self.pieces.len() {
            let to = self.pieces.get(i + 1).map_or(run.end, |next| next.points.start);
            let piece = &mut self.pieces[i];
            let near = |at: usize| piece.guess.normalised_sq(&cloud.points[at]) <= near_sq;
            let Range { mut start, mut end } = piece.points;
            while start > from && near(start - 1) {
                start -= 1;
            }
            while end < to && near(end) {
                end += 1;
            }
            if piece.points != (start..end) {
                piece.points = start..end;
                piece.guess = cloud.guess(&piece.points);
            }
            from = end;
        }
    }

    /// Joins neighbours that one line explains, stray points between them included if they lie on it.
    fn merge(&mut self, cloud: &Cloud, config: &Config) {
        let mut i = 0;
        while i + 1 < self.pieces.len() {
            if let Some(union) = self.union(cloud, i, config) {
                self.pieces[i] = union;
                self.pieces.remove(i + 1);
                // The longer line may now also explain its predecessor.
                i = i.saturating_sub(1);
            } else {
                i += 1;
            }
        }
    }

    /// The one line of piece `i` and the next, if it explains them; an end point that alone stands
    /// against it (the last of a run may well be another surface's first) is left out.
    fn union(&mut self, cloud: &Cloud, i: usize, config: &Config) -> Option<Piece> {
        let split = &config.split;
        let (a, b) = (&self.pieces[i], &self.pieces[i + 1]);
        let between = a.points.end..b.points.start;
        if between.len() > split.stray_points || !may_be_one(a, b, cloud, config) {
            return None;
        }
        self.stray[between.clone()].fill(true);
        let strays = a.strays + b.strays + between.len();
        let mut points = a.points.start..b.points.end;
        let mut guess = guess_without(cloud, &points, &self.stray, strays);
        let holding = |points: &Range<usize>, guess: &Guess| {
            let (sds, z) = (split.merge_sds, split.merge_chi_sq_z);
            explaining(cloud, points, (&self.stray, strays), guess, sds, z)
        };
        let held;
        if let Some(better) = holding(&points, &guess) {
            (guess, held) = better;
        } else {
            let off = |at: usize| guess.normalised_sq(&cloud.points[at]);
            if off(points.start) >= off(points.end - 1) {
                points.start += 1;
            } else {
                points.end -= 1;
            }
            guess = guess_without(cloud, &points, &self.stray, strays);
            let Some(better) = holding(&points, &guess) else {
                self.stray[between].fill(false);
                return None;
            };
            (guess, held) = better;
        }
        let mut strays = strays;
        for at in between {
            let on = guess.normalised_sq(&cloud.points[at]) <= split.residual_sds.powi(2);
            self.stray[at] = !on;
            strays -= usize::from(on);
        }
        let guess = guess_without(cloud, &points, &self.stray, strays);
        Some(Piece { points, strays, guess, held })
    }

    /// Points at the seam of two lines go to the closer one.
    fn contest(&mut self, cloud: &Cloud) {
        for i in 1..self.pieces.len() {
            let [a, b] = neighbours(&mut self.pieces, i);
            if a.points.end != b.points.start {
                continue;
            }
            let seam = a.points.end;
            let closer = |at: usize, this: &Guess, than: &Guess| {
                let point = &cloud.points[at];
                this.normalised_sq(point) < than.normalised_sq(point)
            };
            let down = a.points.clone().skip(3).rev();
            let to_b = down.take_while(|at| closer(*at, &b.guess, &a.guess)).count();
            let up = b.points.start..b.points.end.saturating_sub(3);
            let to_a = up.take_while(|at| closer(*at, &a.guess, &b.guess)).count();
            let seam = if to_b > 0 { seam - to_b } else { seam + to_a };
            if seam != a.points.end {
                a.points.end = seam;
                b.points.start = seam;
                a.guess = guess_without(cloud, &a.points, &self.stray, a.strays);
                b.guess = guess_without(cloud, &b.points, &self.stray, b.strays);
            }
        }
    }

    /// Lets go of every piece that its longer neighbours explain but for fewer points than make a
    /// line: what seems to run from one surface to another along the beams is their noise, where that
    /// is as wide as the step. Answers whether there was one.
    fn dissolve(&mut self, cloud: &Cloud, fewest: usize, config: &Config) -> bool {
        let near_sq = config.split.near_sds * config.split.near_sds;
        let strays = config.split.stray_points;
        let count = self.pieces.len();
        let mut i = 0;
        while i < self.pieces.len() {
            let piece = &self.pieces[i];
            let points = &piece.points;
            let near = |other: &Piece, at: &usize| {
                other.points.len() >= points.len()
                    && other.guess.normalised_sq(&cloud.points[*at]) <= near_sq
            };
            let before = i.checked_sub(1).map(|i| &self.pieces[i]);
            let before = before.filter(|b| b.points.end + strays >= points.start);
            let after = self.pieces.get(i + 1).filter(|a| a.points.start <= points.end + strays);
            let from = before.map_or(0, |b| points.clone().take_while(|at| near(b, at)).count());
            let to = after.map_or(0, |a| points.clone().rev().take_while(|at| near(a, at)).count());
            if points.len() < from + to + fewest {
                // Nothing is a stray of no line.
                self.stray[points.clone()].fill(false);
                self.pieces.remove(i);
            } else {
                i += 1;
            }
        }
        self.pieces.len() < count
    }
}

fn neighbours(pieces: &mut [Piece], i: usize) -> [&mut Piece; 2] {
    let (left, right) = pieces.split_at_mut(i);
    [&mut left[i - 1], &mut right[0]]
}

/// The inner point farthest from the chord, and how far in its own deviations, squared; of a run
/// that ends where it began, the one farthest from there.
fn farthest_from_chord(cloud: &Cloud, run: &Range<usize>) -> (usize, f64) {
    const TOGETHER: usize = 8;
    let (a, b) = (cloud.columns.at(run.start), cloud.columns.at(run.end - 1));
    let chord = b - a;
    let length_sq = chord.norm_squared();
    let inner = run.start + 1..run.end - 1;
    let [x, y] = [&cloud.columns.x, &cloud.columns.y].map(|column| &column[inner.clone()]);
    let (mut best, mut farthest) = (run.len() / 2 - 1, 0.0);
    // A chord shorter than a hand has no direction worth the name.
    if length_sq > 0.01 {
        let n = Point::new(-chord.y, chord.x) / length_sq.sqrt();
        let from = n.dot(&a);
        let off = |x: f64, y: f64| (n.x * x + n.y * y - from).abs();
        // So many at a time: that a new farthest is among them is rare, and which it is, is asked once.
        let ((xs, x_rest), (ys, y_rest)) = (x.as_chunks::<TOGETHER>(), y.as_chunks::<TOGETHER>());
        let mut among = None;
        for (i, (x, y)) in xs.iter().zip(ys).enumerate() {
            let offs: [f64; TOGETHER] = std::array::from_fn(|k| off(x[k], y[k]));
            let four: [f64; 4] = std::array::from_fn(|k| larger(offs[k], offs[k + 4]));
            let largest = larger(larger(four[0], four[2]), larger(four[1], four[3]));
            if largest > farthest {
                (among, farthest) = (Some(i), largest);
            }
        }
        if let Some(i) = among {
            let is_it = |k: &usize| off(xs[i][*k], ys[i][*k]) >= farthest;
            best = TOGETHER * i + (0..TOGETHER).find(is_it).unwrap_or(0);
        }
        for (i, (x, y)) in x_rest.iter().zip(y_rest).enumerate() {
            if off(*x, *y) > farthest {
                (best, farthest) = (TOGETHER * xs.len() + i, off(*x, *y));
            }
        }
        let at = run.start + 1 + best;
        (at, farthest * farthest / cloud.points[at].variance(&n))
    } else {
        for (i, (x, y)) in x.iter().zip(y).enumerate() {
            let off_sq = (Point::new(*x, *y) - a).norm_squared();
            if off_sq > farthest {
                (best, farthest) = (i, off_sq);
            }
        }
        let at = run.start + 1 + best;
        let point = &cloud.points[at];
        (at, farthest / (point.variance_along + point.variance_across))
    }
}

#[inline]
fn larger(a: f64, b: f64) -> f64 {
    if b > a { b } else { a }
}

/// The guess of a stretch but for its strays.
pub(super) fn guess_without(
    cloud: &Cloud,
    points: &Range<usize>,
    stray: &[bool],
    strays: usize,
) -> Guess {
    let mut sums = cloud.sums(points);
    if strays > 0 {
        for at in points.clone().filter(|at| stray[*at]) {
            sums = sums.without(&cloud.sums(&(at..at + 1)));
        }
    }
    sums.guess()
}

/// The gate of two lines, compared about a point between them.
fn may_be_one(a: &Piece, b: &Piece, cloud: &Cloud, config: &Config) -> bool {
    let split = &config.split;
    let anchor = (cloud.columns.at(a.points.end - 1) + cloud.columns.at(b.points.start)) * 0.5;
    let (offset_sd, turn_sd) = split.model_sd;
    // Covariance of (offset at the anchor, turn), both lines and what walls are.
    let (mut rr, mut ra, mut aa) = (offset_sd * offset_sd, 0.0, turn_sd * turn_sd);
    for piece in [a, b] {
        let guess = &piece.guess;
        // The weights knew of the range alone; what they make of it across the line is seen at
        // three points.
        let ends = [
            piece.points.start,
            piece.points.start.midpoint(piece.points.end - 1),
            piece.points.end - 1,
        ];
        let across: f64 = ends
            .iter()
            .map(|at| cloud.points[*at].variance(&guess.normal) / cloud.points[*at].variance_along)
            .sum::<f64>()
            / 3.0;
        let floor = config.fit.systematic_sd * config.fit.systematic_sd;
        let half = 0.5 * (cloud.columns.at(ends[2]) - cloud.columns.at(ends[0])).norm();
        let tilt = across / guess.along() + floor / (3.0 * half * half);
        let arm = guess.tangent.dot(&(guess.centre - anchor));
        rr += across / guess.weight + floor + arm * arm * tilt;
        ra += arm * tilt;
        aa += tilt;
    }
    let turn = b.guess.normal.perp(&a.guess.normal);
    let apart = b.guess.residual(&anchor) - a.guess.residual(&anchor);
    let determinant = rr * aa - ra * ra;
    // Lines that face apart are never one.
    a.guess.normal.dot(&b.guess.normal) > 0.0
        && aa * apart * apart - 2.0 * ra * apart * turn + rr * turn * turn
            < split.merge_gate * determinant
}
