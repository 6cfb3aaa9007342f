//! The incidence of every beam, from lines through the neighbours of its point.
//!
//! Sums over the neighbours are differences of running sums, so the cost of a beam does not grow with
//! their number. Runs of points are set apart by places that hold no point and add nothing, as many as a
//! line reaches: all lines are found in one straight loop that asks nothing. The few that it is not
//! content with are looked at again one by one: where the neighbours on both sides lie on no line, as
//! beside a corner, those of one side may.

use std::f64::consts::{FRAC_PI_2, PI};

use mapfold_map::geometry::Point;

use super::correction::CorrectionConfig;
use crate::sensor::Place;

/// What a spot is called whose incidence nobody wants: none, or one that is listed twice.
pub(super) const NO_BEAM: u32 = u32::MAX;

/// A hit, or nothing.
#[derive(Debug, Clone, Copy)]
pub(super) struct Spot {
    /// Unit vector along the beam, or zero.
    pub(super) direction: Point,
    /// What was read, metres.
    pub(super) reading: f64,
    /// Where it lies on its beam as far as is known, metres.
    pub(super) range: f64,
    /// Variance of that.
    pub(super) variance: f64,
    /// Where it lies in the table.
    pub(super) place: Place,
    /// 1, or 0 for nothing.
    count: f64,
    /// Its beam, or [`NO_BEAM`].
    pub(super) beam: u32,
}

impl Spot {
    /// The spot of a hit.
    #[inline]
    pub(super) fn new(
        beam: u32,
        direction: Point,
        (reading, place): (f64, Place),
        variance: f64,
    ) -> Self {
        Self { direction, reading, range: reading, variance, place, count: 1.0, beam }
    }
}

/// No point.
const NOTHING: Spot = Spot {
    direction: Point::new(0.0, 0.0),
    reading: 0.0,
    range: 0.0,
    variance: 0.0,
    place: Place::FIRST,
    count: 0.0,
    beam: NO_BEAM,
};

/// Spots in their places, and their incidences.
#[derive(Debug, Clone)]
pub(super) struct Incidences {
    /// Neighbours on each side.
    reach: usize,
    points_min: usize,
    /// Square of how far off its line a spot may be, in deviations.
    line_rms_sq: f64,
    spots: Vec<Spot>,
    /// First spot of the run that is being listed.
    run: usize,
    /// Over the spots before each.
    sums: Sums,
    /// Cosine and sine of twice the bearing.
    doubles: [Vec<f64>; 2],
    /// How many spots there are from so far before each to so far after it as a line reaches.
    counts: Vec<f64>,
    /// Incidence of each spot, radians; NaN if unknown.
    angles: Vec<f64>,
    /// Its variance.
    variances: Vec<f64>,
    /// How far its neighbours are off their line, squared; NaN if they are too few.
    off: Vec<f64>,
    /// How far one deviation would be, in the same measure, which is each place's own.
    noise: Vec<f64>,
}

impl Incidences {
    /// For lines of this kind.
    pub(super) fn new(config: &CorrectionConfig) -> Self {
        Self {
            reach: config.neighbours,
            points_min: config.points_min,
            line_rms_sq: config.line_rms * config.line_rms,
            spots: Vec::new(),
            run: 0,
            sums: Sums::default(),
            doubles: Default::default(),
            counts: Vec::new(),
            angles: Vec::new(),
            variances: Vec::new(),
            off: Vec::new(),
            noise: Vec::new(),
        }
    }

    /// Forgets all spots.
    pub(super) fn begin(&mut self) {
        self.spots.clear();
        self.part();
    }

    /// Adds a spot to the run.
    #[inline]
    pub(super) fn push(&mut self, spot: Spot) {
        self.spots.push(spot);
    }

    /// Ends the run. If it is too short for a line it is handed to `short` and forgotten.
    #[inline]
    pub(super) fn end_run(&mut self, short: impl FnOnce(&[Spot])) {
        let run = &self.spots[self.run..];
        if run.len() >= self.points_min {
            self.part();
        } else if !run.is_empty() {
            short(run);
            self.spots.truncate(self.run);
        }
    }

    /// Leaves room between runs.
    fn part(&mut self) {
        self.spots.extend(std::iter::repeat_n(NOTHING, self.reach));
        self.run = self.spots.len();
    }

    /// Gets ready to find the incidences of what has been listed.
    pub(super) fn end(&mut self) {
        let Self { reach, spots, doubles: [cosines, sines], counts, .. } = self;
        let places = spots.len();
        for column in [&mut *cosines, &mut *sines, &mut *counts] {
            column.resize(places, 0.0);
        }
        let (cosines, sines) = (&mut cosines[..places], &mut sines[..places]);
        for (at, Spot { direction: e, .. }) in spots.iter().enumerate() {
            (cosines[at], sines[at]) = (e.x * e.x - e.y * e.y, 2.0 * e.x * e.y);
        }
        let (mut count, span) = (0.0, 2 * *reach + 1);
        for (at, spot) in spots.iter().enumerate() {
            count += spot.count;
            if at + 1 >= span {
                // Where there is no spot, nothing is of use.
                counts[at - *reach] = count * spots[at - *reach].count;
                count -= spots[at + 1 - span].count;
            }
        }
        for column in [&mut self.angles, &mut self.variances, &mut self.off, &mut self.noise] {
            column.resize(places, f64::NAN);
        }
        // No line reaches round the outermost.
        self.off[..self.reach].fill(f64::NAN);
        self.off[places - self.reach..].fill(f64::NAN);
    }

    /// The spots, places without one among them, with their incidences.
    pub(super) fn spots(&mut self) -> impl Iterator<Item = (&mut Spot, f64)> {
        self.spots.iter_mut().zip(self.angles.iter().copied())
    }

    /// The spots, places without one among them, with their incidences and the variances of these.
    pub(super) fn found(&self) -> impl Iterator<Item = (&Spot, f64, f64)> {
        let found = self.angles.iter().zip(&self.variances);
        self.spots.iter().zip(found).map(|(spot, (a, v))| (spot, *a, *v))
    }

    /// Finds the incidences of all spots where they lie by now; one side is tried where both are farther
    /// off their line than so many deviations. Variances are found if they are asked for.
    pub(super) fn find<const VARIANCES: bool>(&mut self, sides_rms: f64) {
        let Self { reach, sums, doubles, counts, angles, variances, off, noise, .. } = self;
        if self.spots.len() <= 2 * *reach {
            return;
        }
        sums.run_over(&self.spots);
        let places = *reach..self.spots.len() - *reach;
        let lines = Columns {
            sums,
            span: 2 * *reach + 1,
            points_min: self.points_min as f64,
            doubles: doubles.each_ref().map(|column| &column[places.clone()]),
            counts: &counts[places.clone()],
        };
        lines.fit::<VARIANCES>(
            &mut angles[places.clone()],
            &mut variances[places.clone()],
            &mut off[places.clone()],
            &mut noise[places.clone()],
        );
        let limit = sides_rms * sides_rms;
        for at in places {
            let content = self.off[at] <= limit * self.noise[at];
            if !content && self.spots[at].count > 0.0 {
                self.try_sides(at);
            }
        }
    }

    /// The best line of those through the neighbours on both sides and on either: that on one side is
    /// the line of both sides of a place farther on.
    fn try_sides(&mut self, at: usize) {
        let Self { reach, off, noise, .. } = self;
        let mut best = at;
        for other in [at - *reach, at + *reach] {
            // Where there is no line is NaN, which is neither less nor more.
            let better = off[other] * noise[best] < off[best] * noise[other];
            if better || off[best].is_nan() {
                best = other;
            }
        }
        let on_line = off[best] <= self.line_rms_sq * noise[best];
        if !on_line {
            (self.angles[at], self.variances[at]) = (f64::NAN, 0.0);
        } else if best != at {
            let window = self.sums.between(best - *reach, best + *reach + 1);
            let line = window.line(self.counts[best], self.doubles.each_ref().map(|c| c[at]));
            (self.angles[at], self.variances[at]) = (line.incidence(), line.variance());
        }
    }
}

/// What lines are found from, column by column.
struct Columns<'a> {
    sums: &'a Sums,
    /// Places that a line takes in.
    span: usize,
    points_min: f64,
    doubles: [&'a [f64]; 2],
    counts: &'a [f64],
}

impl Columns<'_> {
    /// The line through the neighbours of each place. (A function of its own, so that the columns
    /// that it fills are known not to overlap.)
    #[inline(never)]
    fn fit<const VARIANCES: bool>(
        &self,
        angles: &mut [f64],
        variances: &mut [f64],
        off: &mut [f64],
        noise: &mut [f64],
    ) {
        let count = angles.len();
        let columns = &self.sums.0;
        let from: [&[f64]; 6] = std::array::from_fn(|i| &columns[i][..count]);
        let to: [&[f64]; 6] = std::array::from_fn(|i| &columns[i][self.span..][..count]);
        let [cosines, sines] = self.doubles.map(|column| &column[..count]);
        let counts = &self.counts[..count];
        let (variances, off, noise) =
            (&mut variances[..count], &mut off[..count], &mut noise[..count]);
        for i in 0..count {
            let window = Window(std::array::from_fn(|k| to[k][i] - from[k][i]));
            let line = window.line(counts[i], [cosines[i], sines[i]]);
            angles[i] = line.incidence();
            if VARIANCES {
                variances[i] = line.variance();
            }
            off[i] = if counts[i] < self.points_min { f64::NAN } else { line.area * line.length };
            noise[i] = line.spread * line.freedom * line.variance;
        }
    }
}

/// Running sums over the spots before each, column by column: x, y, xx, xy, yy,
/// variances.
#[derive(Debug, Clone, Default)]
struct Sums([Vec<f64>; 6]);

impl Sums {
    fn run_over(&mut self, spots: &[Spot]) {
        for column in &mut self.0 {
            column.resize(spots.len() + 1, 0.0);
        }
        let [x, y, xx, xy, yy, v] = self.0.each_mut().map(|c| &mut c[1..=spots.len()]);
        let mut sum = [0.0; 6];
        for (i, spot) in spots.iter().enumerate() {
            let (px, py) = (spot.range * spot.direction.x, spot.range * spot.direction.y);
            let own = [px, py, px * px, px * py, py * py, spot.count * spot.variance];
            sum = std::array::from_fn(|k| sum[k] + own[k]);
            [x[i], y[i], xx[i], xy[i], yy[i], v[i]] = sum;
        }
    }

    /// Over the spots `from..to`.
    fn between(&self, from: usize, to: usize) -> Window {
        Window(self.0.each_ref().map(|column| column[to] - column[from]))
    }
}

/// Sums over neighbours.
#[derive(Debug, Clone, Copy)]
struct Window([f64; 6]);

impl Window {
    /// The line through these `n`, as a beam meets it, of whose bearing cosine and sine of the double are
    /// given.
    #[inline]
    fn line(&self, n: f64, [cosine, sine]: [f64; 2]) -> Line {
        let [x, y, xx, xy, yy, variance] = self.0;
        // Central moments times the square of their number: nothing is divided by it.
        let (xx, xy, yy) = (n * xx - x * x, n * xy - x * y, n * yy - y * y);
        // Twice the direction of the line: (d, 2 xy) over its length.
        let (d, c) = (xx - yy, 2.0 * xy);
        let length = (d * d + c * c).sqrt();
        // The angle between beam and line is a right angle less the incidence.
        let (along, across) = (-(d * cosine + c * sine), (d * sine - c * cosine).abs());
        // Range noise across the line, in the ratio of the squares of the cosine of the incidence; a
        // beam along the line still has some.
        let share = at_least(0.5 * (length + along), 0.01 * length);
        Line {
            twice: [along, across],
            length,
            variance: at_least(variance, 1e-12) * share,
            spread: 0.5 * (xx + yy + length),
            area: xx * yy - xy * xy,
            freedom: n - 2.0,
        }
    }
}

/// The larger one of two numbers.
#[inline]
fn at_least(value: f64, least: f64) -> f64 {
    if value > least { value } else { least }
}

/// A line through neighbours. Their number is `n`; moments are `n` times the sums of squares.
#[derive(Debug, Clone, Copy)]
struct Line {
    /// Cosine and sine of twice the incidence, times `length`.
    twice: [f64; 2],
    length: f64,
    /// Sum of the points' variances across the line, times `length`.
    variance: f64,
    /// Moment along it.
    spread: f64,
    /// Product of the moments along and across it.
    area: f64,
    /// `n - 2`.
    freedom: f64,
}

impl Line {
    /// The incidence, radians.
    #[inline]
    fn incidence(&self) -> f64 {
        0.5 * arc_tangent(self.twice)
    }

    /// Its variance.
    #[inline]
    fn variance(&self) -> f64 {
        self.variance / (self.length * self.spread)
    }
}

/// The angle of (x, y), y not negative, to within 1e-5 rad and without a branch (Hastings 1955, sheet
/// 11); NaN if both are 0.
#[inline]
fn arc_tangent([x, y]: [f64; 2]) -> f64 {
    let steep = y > x.abs();
    let (small, large) = if steep { (x.abs(), y) } else { (y, x.abs()) };
    let t = small / large;
    let s = t * t;
    let angle = t
        * (0.999_977_26
            + s * (-0.332_623_47
                + s * (0.193_543_46
                    + s * (-0.116_432_87 + s * (0.052_653_32 - s * 0.011_721_20)))));
    let angle = if steep { FRAC_PI_2 - angle } else { angle };
    if x < 0.0 { PI - angle } else { angle }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arc_tangent_is_good_enough_for_any_table() {
        for i in 0..=2000 {
            let angle = PI * f64::from(i) / 2000.0;
            let found = arc_tangent([3.0 * angle.cos(), 3.0 * angle.sin().abs()]);
            assert!((found - angle).abs() < 1.2e-5, "{angle}");
        }
        assert!(arc_tangent([0.0, 0.0]).is_nan());
    }
}
