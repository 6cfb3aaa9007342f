//! A range correction as it is used: from a reading and the incidence of its beam to the distance.
//!
//! The table of a profile says what a target at distance `d` under incidence `beta` reads like,
//! `z = d + b(d, beta)`. Here it is turned round, once: a curve `z -> d` for each incidence (`curve`),
//! piecewise linear, and linear in the incidence between two curves.
//!
//! Up to [`EXTRAPOLATED_M`] outside the table the bias of its edge goes on; a reading farther out is
//! not one that was calibrated, and has no answer.
//!
//! Half a million times a second somebody asks: readings fall into cells that all curves share and
//! incidences into cells of their own (`axis`), so that nothing is searched for and nothing branches on
//! what was read. Whoever can do with a rough answer has one at a third of the cost.

mod axis;
mod curve;

use mapfold_schema::v1::RangeCorrection;

use axis::{Axis, Cells};
use curve::Node;

/// How far the bias at the edge of the table goes on, metres of reading.
pub const EXTRAPOLATED_M: f64 = 0.10;

/// Cells of readings for each distance of the table: enough that a cell rarely holds two knots of one
/// curve.
const CELLS_PER_NODE: usize = 3;

/// More than readings are ever rounded by, metres.
const ROUNDED_M: f64 = 1e-9;

/// A corrected reading.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CorrectedRange {
    /// Distance along the beam, metres.
    pub range: f64,
    /// Variance of it, one reading from the next.
    pub variance: f64,
    /// Its change with the incidence that was assumed, metres for a radian.
    pub slope: f64,
}

/// Where a reading lies in a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    /// Its cell.
    cell: u32,
    /// The share of the cell that is past.
    past: f32,
}

/// A correction table, ready to use.
#[derive(Debug, Clone, PartialEq)]
pub struct RangeTable {
    incidences: Axis,
    incidence_max: f64,
    flattened: usize,
    /// The curves, one after the other.
    knots: Vec<Knot>,
    cells: Cells,
    /// For each cell of readings, and in it for each step, of either curve: its last knot at or before
    /// the cell.
    knots_of_cells: Vec<[u32; 2]>,
    /// Where each cell begins, and in it for each step, of either curve: bias and variance.
    rough: Vec<[f32; 4]>,
    /// Where each cell begins: how far apart the curves are.
    spreads: Vec<f64>,
}

/// One point of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Knot {
    reading: f64,
    /// One over the way to the next.
    per_metre: f64,
    /// Range and variance.
    means: [f64; 2],
}

/// Where a reading and an incidence lie in a table.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Spot {
    /// The cell of the reading and the step of the incidence, as a place in the tables of both.
    at: u32,
    /// The shares of the cell and of the step that are past.
    past: f32,
    share: f64,
    /// By how much the latter grows with the incidence.
    per_radian: f64,
}

impl Place {
    /// The least of a table.
    pub(crate) const FIRST: Self = Self { cell: 0, past: 0.0 };
}

impl RangeTable {
    /// Turns a checked table round.
    pub fn new(correction: &RangeCorrection) -> Self {
        let distances = &correction.distances_m;
        let rows = correction.bias_m.iter().zip(&correction.sd_m);
        let mut curves: Vec<Vec<Node>> =
            rows.map(|(bias, sd)| curve::turned_round(distances, bias, sd)).collect();
        let kept: usize = curves.iter().map(|curve| curve.len() - 2).sum();
        let flattened = distances.len() * curves.len() - kept;
        let mut incidences = correction.incidences_rad.clone();
        if let ([only], [curve]) = (&incidences[..], &curves[..]) {
            // Two alike, so that there is always a next one.
            (incidences, curves) = (vec![*only, only + 1.0], vec![curve.clone(); 2]);
        }
        let either = |a: (f64, f64), b: (f64, f64)| (a.0.min(b.0), a.1.max(b.1));
        let all = curves.iter().map(|curve| ends(curve)).fold(ends(&curves[0]), either);
        let cells = Cells::new(all, CELLS_PER_NODE * distances.len());
        let mut table = Self {
            incidences: Axis::new(&incidences),
            incidence_max: correction.incidence_max_rad,
            flattened,
            knots: Vec::new(),
            knots_of_cells: Vec::new(),
            rough: Vec::new(),
            spreads: Vec::new(),
            cells,
        };
        let firsts: Vec<usize> = curves.iter().map(|curve| table.take(curve)).collect();
        for begin in table.cells.begins() {
            table.begin_cell(begin, &curves, &firsts);
        }
        table
    }

    /// Appends a curve, and beyond it a knot that no reading reaches; answers where it begins.
    fn take(&mut self, curve: &[Node]) -> usize {
        let first = self.knots.len();
        for (i, node) in curve.iter().enumerate() {
            let per_metre =
                curve.get(i + 1).map_or(0.0, |next| 1.0 / (next.reading - node.reading));
            let means = [node.range, node.variance];
            self.knots.push(Knot { reading: node.reading, per_metre, means });
        }
        let last = self.knots[self.knots.len() - 1];
        self.knots.push(Knot { reading: f64::INFINITY, ..last });
        first
    }

    /// Appends what is known of the cell that begins at this reading.
    fn begin_cell(&mut self, begin: f64, curves: &[Vec<Node>], firsts: &[usize]) {
        let knot = |i: usize| {
            // Rounding may put a reading just before a knot into the cell that begins there.
            let before = curves[i].partition_point(|node| node.reading < begin - ROUNDED_M);
            (firsts[i] + before.saturating_sub(1)) as u32
        };
        let rough = |curve: &[Node]| {
            let (first, last) = ends(curve);
            let held = begin.clamp(first, last);
            let (range, variance) = curve::at(curve, held);
            [(range - held) as f32, variance as f32]
        };
        for (low, two) in curves.windows(2).enumerate() {
            self.knots_of_cells.push([knot(low), knot(low + 1)]);
            let ([a, b], [c, d]) = (rough(&two[0]), rough(&two[1]));
            self.rough.push([a, b, c, d]);
        }
        let (mut least, mut most) = (f64::INFINITY, f64::NEG_INFINITY);
        for curve in curves {
            let (first, last) = ends(curve);
            if (first..=last).contains(&begin) {
                let (range, _) = curve::at(curve, begin);
                (least, most) = (least.min(range), most.max(range));
            }
        }
        self.spreads.push((most - least).max(0.0));
    }

    /// Surfaces met at more than this are not to be used, radians from their normal.
    pub fn incidence_max(&self) -> f64 {
        self.incidence_max
    }

    /// Nodes that were pooled with a neighbour because the response is not monotone there.
    pub fn flattened(&self) -> usize {
        self.flattened
    }

    /// The distance that a reading means if its beam met a surface under `incidence` radians from
    /// the surface's normal; `None` outside the table. Beyond the last incidence, the last curve.
    pub fn correct(&self, reading: f64, incidence: f64) -> Option<CorrectedRange> {
        self.correct_at(&self.spot(self.place(reading), incidence), reading)
    }

    /// The place of a reading.
    #[inline]
    pub(crate) fn place(&self, reading: f64) -> Place {
        let (cell, past) = self.cells.of(reading);
        Place { cell, past: past as f32 }
    }

    /// The spot of a reading and an incidence.
    #[inline]
    pub(crate) fn spot(&self, place: Place, incidence: f64) -> Spot {
        let (below, share, per_radian) = self.incidences.of(incidence);
        let at = place.cell * self.incidences.steps() as u32 + below;
        Spot { at, past: place.past, share, per_radian }
    }

    /// As [`Self::correct`], for a reading of which the spot is known.
    #[inline]
    pub(crate) fn correct_at(&self, spot: &Spot, reading: f64) -> Option<CorrectedRange> {
        let [low, high] = self.knots_of_cells[spot.at as usize];
        let low = self.at(low, reading)?;
        let high = self.at(high, reading)?;
        let rise = [high[0] - low[0], high[1] - low[1]];
        Some(CorrectedRange {
            range: low[0] + spot.share * rise[0],
            variance: low[1] + spot.share * rise[1],
            slope: rise[0] * spot.per_radian,
        })
    }

    /// What [`Self::correct`] says, to a part of what neighbouring distances of the table differ by:
    /// range and variance. Without an incidence (NaN) as if met squarely; outside the table as at its
    /// edge.
    #[inline]
    pub(crate) fn correct_roughly(&self, spot: &Spot, reading: f64) -> (f64, f64) {
        let at = spot.at as usize;
        let (here, next) = (&self.rough[at], &self.rough[at + self.incidences.steps()]);
        let both: [f32; 4] = std::array::from_fn(|i| here[i] + spot.past * (next[i] - here[i]));
        let share = spot.share as f32;
        let [bias, variance] = std::array::from_fn(|i| both[i] + share * (both[i + 2] - both[i]));
        (reading + f64::from(bias), f64::from(variance))
    }

    /// The variance that [`Self::correct_roughly`] finds for what is met squarely.
    #[inline]
    pub(crate) fn variance_roughly(&self, place: Place) -> f64 {
        let (at, steps) = (place.cell as usize, self.incidences.steps());
        let (here, next) = (self.rough[at * steps][1], self.rough[(at + 1) * steps][1]);
        f64::from(here + place.past * (next - here))
    }

    /// The distance if nothing is known of the incidence: that of the curve of least incidence,
    /// and how far apart all curves are about this reading.
    pub fn correct_unknown(&self, reading: f64) -> Option<(CorrectedRange, f64)> {
        let (cell, past) = self.cells.of(reading);
        let [knot, _] = self.knots_of_cells[cell as usize * self.incidences.steps()];
        let [range, variance] = self.at(knot, reading)?;
        let (here, next) = (self.spreads[cell as usize], self.spreads[cell as usize + 1]);
        let found = CorrectedRange { range, variance, slope: 0.0 };
        Some((found, here + past * (next - here)))
    }

    /// Range and variance at a reading, on a curve of which a knot at or shortly before it is given;
    /// `None` if the curve does not cover the reading, as none covers NaN.
    #[inline]
    fn at(&self, knot: u32, reading: f64) -> Option<[f64; 2]> {
        if !reading.is_finite() {
            return None;
        }
        let mut at = knot as usize;
        // One step at most, nearly always; whether it is taken is chance, so it is no branch.
        at += usize::from(self.knots[at + 1].reading <= reading);
        let (mut low, mut high) = (&self.knots[at], &self.knots[at + 1]);
        while high.reading <= reading {
            at += 1;
            (low, high) = (high, &self.knots[at + 1]);
        }
        let past = reading - low.reading;
        // The last knot is the end.
        if !(past >= 0.0 && (past <= 0.0 || high.reading < f64::INFINITY)) {
            return None;
        }
        let share = past * low.per_metre;
        Some(std::array::from_fn(|i| low.means[i] + share * (high.means[i] - low.means[i])))
    }
}

/// The first and the last reading of a curve.
fn ends(curve: &[Node]) -> (f64, f64) {
    (curve[0].reading, curve[curve.len() - 1].reading)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    /// A table of a response `z = d + bias(d, incidence)` on a grid of 10 cm and 10 degrees.
    fn table_of(bias: impl Fn(f64, f64) -> f64, sd: f64) -> RangeCorrection {
        let distances: Vec<f64> = (3..=40).map(|i| 0.1 * f64::from(i)).collect();
        let incidences: Vec<f64> = (0..=7).map(|i| f64::from(10 * i).to_radians()).collect();
        RangeCorrection {
            bias_m: incidences
                .iter()
                .map(|beta| distances.iter().map(|d| bias(*d, *beta)).collect())
                .collect(),
            sd_m: vec![vec![sd; distances.len()]; incidences.len()],
            incidence_max_rad: 65f64.to_radians(),
            distances_m: distances,
            incidences_rad: incidences,
        }
    }

    /// A ripple, a walk with the incidence, an offset close by.
    fn head(amplitude: f64, period: f64, walk: f64) -> impl Fn(f64, f64) -> f64 {
        move |d: f64, beta: f64| {
            amplitude * (std::f64::consts::TAU * d / period).sin()
                + walk * d * (1.0 / beta.cos() - 1.0)
                - 0.05 * (-d / 0.5).exp()
        }
    }

    proptest! {
        #[test]
        fn a_rough_answer_is_right_to_a_part_of_a_step(
            amplitude in 0.0..0.05, walk in -0.02..0.02, reading in 0.25..4.1, incidence in 0.0..1.4,
        ) {
            let table = RangeTable::new(&table_of(head(amplitude, 0.7, walk), 0.02));
            if let Some(exact) = table.correct(reading, incidence) {
                let place = table.place(reading);
                let (range, variance) = table.correct_roughly(&table.spot(place, incidence), reading);
                // A grid over all of these heads finds 4.2 mm, of the steepest on its steepest slope.
                prop_assert!((range - exact.range).abs() < 5e-3, "{} {:?}", range, exact);
                prop_assert!((variance / exact.variance).ln().abs() < 0.5, "{} {:?}", variance, exact);
                let squarely = table.correct_roughly(&table.spot(place, f64::NAN), reading).1;
                prop_assert_eq!(squarely.to_bits(), table.variance_roughly(place).to_bits());
            }
        }

        #[test]
        fn a_table_without_bias_changes_nothing(reading in 0.21..4.09, incidence in 0.0..1.5) {
            let table = RangeTable::new(&table_of(|_, _| 0.0, 0.02));
            let corrected = table.correct(reading, incidence).unwrap();
            prop_assert!((corrected.range - reading).abs() < 1e-12);
            prop_assert!((corrected.variance.sqrt() - 0.02).abs() < 1e-12);
            prop_assert!(corrected.slope.abs() < 1e-9);
            let (unknown, spread) = table.correct_unknown(reading).unwrap();
            prop_assert!((unknown.range - reading).abs() < 1e-12 && spread < 1e-12);
        }

        #[test]
        fn a_greater_reading_is_a_greater_distance(
            amplitude in -0.3..0.3, period in 0.5..3.0, walk in -0.02..0.02,
            incidence in 0.0..1.3, reading in 0.3..3.9, more in 1e-6..1.0,
        ) {
            let table = RangeTable::new(&table_of(head(amplitude, period, walk), 0.02));
            let pair = (table.correct(reading, incidence), table.correct(reading + more, incidence));
            if let (Some(a), Some(b)) = pair {
                prop_assert!(b.range > a.range - 1e-12, "{a:?} {b:?}");
                prop_assert!(a.variance.is_finite() && a.variance > 0.0);
            }
        }

        #[test]
        fn a_reading_of_a_node_is_the_distance_of_the_node(
            amplitude in -0.1..0.1, period in 1.0..3.0, walk in -0.02..0.02,
            row in 0_usize..8, column in 0_usize..38,
        ) {
            // The steepest of these ripples falls by less than the distance grows.
            let response = head(amplitude, period, walk);
            let correction = table_of(&response, 0.02);
            let table = RangeTable::new(&correction);
            prop_assert_eq!(table.flattened(), 0);
            let (d, beta) = (correction.distances_m[column], correction.incidences_rad[row]);
            let corrected = table.correct(d + response(d, beta), beta).unwrap();
            prop_assert!((corrected.range - d).abs() < 1e-9, "{d} {beta}: {corrected:?}");
        }
    }

    #[test]
    fn between_nodes_a_smooth_head_is_corrected_to_a_millimetre_or_two() {
        let response = head(0.06, 1.7, 0.005);
        let table = RangeTable::new(&table_of(&response, 0.02));
        for i in 0..1000 {
            let (d, beta) = (0.3 + 0.0037 * f64::from(i), 0.00113 * f64::from(i));
            let corrected = table.correct(d + response(d, beta), beta).unwrap();
            assert!((corrected.range - d).abs() < 2.5e-3, "{d} {beta}: {}", corrected.range - d);
        }
    }

    #[test]
    fn outside_the_table_the_bias_goes_on_for_a_hand_and_no_farther() {
        let table = RangeTable::new(&table_of(|_, _| 0.05, 0.02));
        let range = |reading| table.correct(reading, 0.3).map(|c| c.range);
        assert!((range(0.26).unwrap() - 0.21).abs() < 1e-12);
        assert!((range(4.14).unwrap() - 4.09).abs() < 1e-12);
        for outside in [0.24, 4.16, f64::NAN, f64::INFINITY, -1.0] {
            assert_eq!(range(outside), None, "{outside}");
            assert_eq!(table.correct_unknown(outside), None);
        }
    }

    #[test]
    fn a_response_that_is_not_monotone_is_flattened_and_its_width_claimed() {
        // From 1.5 to 2.1 m the readings fall again.
        let response = head(0.25, 1.2, 0.0);
        let table = RangeTable::new(&table_of(&response, 0.005));
        assert!(table.flattened() > 0);
        let (mut off, mut claimed, mut count) = (0.0, 0.0, 0.0);
        for i in 0..3600 {
            let d = 0.35 + 0.001 * f64::from(i);
            let corrected = table.correct(d + response(d, 0.0), 0.0).unwrap();
            off += (corrected.range - d).powi(2);
            claimed += corrected.variance;
            count += 1.0;
        }
        // Without any noise, what is left is what was flattened, and it is owned up to.
        let (off, claimed) = ((off / count).sqrt(), (claimed / count).sqrt());
        assert!(off > 0.03, "nothing was ambiguous: {off}");
        assert!((0.7..2.0).contains(&(claimed / off)), "{claimed} claimed, {off} off");
    }

    #[test]
    fn steep_responses_shrink_the_noise_and_flat_ones_magnify_it() {
        let sd = |gain: f64| {
            let table = RangeTable::new(&table_of(|d, _| gain * d, 0.02));
            table.correct(2.0 * (1.0 + gain), 0.0).unwrap().variance.sqrt()
        };
        assert!((sd(0.25) - 0.02 / 1.25).abs() < 1e-9);
        assert!((sd(-0.2) - 0.02 / 0.8).abs() < 1e-9);
    }
}
