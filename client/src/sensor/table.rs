//! A range correction as it is used: from a reading and the incidence of its beam to the distance.
//!
//! The table of a profile says what a target at distance `d` under incidence `beta` reads like,
//! `z = d + b(d, beta)`. Here it is turned round, once: a curve `z -> d` for each incidence,
//! piecewise linear, and linear in the incidence between two curves. Where a head's response is not
//! monotone (its bias falls by more than the distance grows), no curve can tell which of several
//! distances a reading means: such stretches are pooled (pool adjacent violators; Ayer et al. 1955)
//! into one point of the curve, and where several distances read alike, the variance takes in how
//! far the nearest and the farthest of them are from the curve.
//!
//! Up to [`EXTRAPOLATED_M`] outside the table the bias of its edge goes on; a reading farther out is
//! not one that was calibrated, and has no answer.

use mapfold_schema::v1::RangeCorrection;

/// How far the bias at the edge of the table goes on, metres of reading.
pub const EXTRAPOLATED_M: f64 = 0.10;

/// Cells of a curve's index for each of its knots: enough that a cell rarely holds two knots.
const CELLS_PER_KNOT: usize = 3;

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

/// A correction table, ready to use.
#[derive(Debug, Clone, PartialEq)]
pub struct RangeTable {
    incidences: Vec<f64>,
    curves: Vec<Curve>,
    incidence_max: f64,
    flattened: usize,
}

impl RangeTable {
    /// Turns a checked table round.
    pub fn new(correction: &RangeCorrection) -> Self {
        let rows = correction.bias_m.iter().zip(&correction.sd_m);
        let curves: Vec<Curve> =
            rows.map(|(bias, sd)| Curve::new(&correction.distances_m, bias, sd)).collect();
        let nodes = correction.distances_m.len() * curves.len();
        Self {
            incidences: correction.incidences_rad.clone(),
            flattened: nodes - curves.iter().map(|c| c.knots.len()).sum::<usize>(),
            curves,
            incidence_max: correction.incidence_max_rad,
        }
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
        let last = self.incidences.len() - 1;
        // Counted to the end: where to stop is what no branch predictor knows. NaN is beyond all.
        let beyond: usize = self.incidences.iter().map(|i| usize::from(*i > incidence)).sum();
        let next = (self.incidences.len() - beyond).min(last);
        let Some(below) = next.checked_sub(1).filter(|_| incidence < self.incidences[last]) else {
            let (range, variance) = self.curves[next].at(reading)?;
            return Some(CorrectedRange { range, variance, slope: 0.0 });
        };
        let step = self.incidences[next] - self.incidences[below];
        let share = (incidence - self.incidences[below]) / step;
        let (low, high) = (self.curves[below].at(reading)?, self.curves[next].at(reading)?);
        Some(CorrectedRange {
            range: low.0 + share * (high.0 - low.0),
            variance: low.1 + share * (high.1 - low.1),
            slope: (high.0 - low.0) / step,
        })
    }

    /// The variance of what a reading means if its beam met a surface squarely; `None` outside the
    /// table. What [`Self::correct`] says for no incidence, at half the cost.
    pub(crate) fn variance_met_squarely(&self, reading: f64) -> Option<f64> {
        match &self.curves[..] {
            [square, next, ..] if self.incidences[0].total_cmp(&0.0).is_eq() => {
                square.at(reading).filter(|_| next.covers(reading)).map(|(_, variance)| variance)
            }
            _ => self.correct(reading, 0.0).map(|found| found.variance),
        }
    }

    /// The distance if nothing is known of the incidence: that of the curve of least incidence,
    /// and how far apart all curves are at this reading.
    pub fn correct_unknown(&self, reading: f64) -> Option<(CorrectedRange, f64)> {
        let (range, variance) = self.curves[0].at(reading)?;
        let all = self.curves.iter().filter_map(|curve| curve.at(reading));
        let (least, most) =
            all.fold((range, range), |(least, most), (r, _)| (least.min(r), most.max(r)));
        Some((CorrectedRange { range, variance, slope: 0.0 }, most - least))
    }
}

/// One point of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Knot {
    reading: f64,
    range: f64,
    variance: f64,
    /// Change of range and of variance with the reading, up to the next knot.
    rise: (f64, f64),
}

/// The inverse response at one incidence: readings and ranges both strictly ascending.
#[derive(Debug, Clone, PartialEq)]
struct Curve {
    knots: Vec<Knot>,
    /// For each cell of equal width, the last knot at or before its beginning.
    cells: Vec<u32>,
    cells_per_metre: f64,
}

/// Neighbouring nodes that share one reading.
struct Block {
    reading: f64,
    range: f64,
    sd_sq: f64,
    count: f64,
}

impl Curve {
    fn new(distances: &[f64], bias: &[f64], sd: &[f64]) -> Self {
        let nodes = distances.iter().zip(bias).zip(sd);
        let blocks = pooled(nodes.map(|((&d, &b), &sd)| Block {
            reading: d + b,
            range: d,
            sd_sq: sd * sd,
            count: 1.0,
        }));
        let mut curve = Self {
            knots: blocks
                .iter()
                .map(|b| Knot {
                    reading: b.reading,
                    range: b.range,
                    variance: 0.0,
                    rise: (0.0, 0.0),
                })
                .collect(),
            cells: Vec::new(),
            cells_per_metre: 0.0,
        };
        let (first, last) = (curve.knots[0].reading, curve.knots[curve.knots.len() - 1].reading);
        curve.lean();
        if last > first {
            let count = CELLS_PER_KNOT * curve.knots.len();
            curve.cells_per_metre = count as f64 / (last - first);
            curve.cells = (0..count)
                .map(|cell| {
                    let begin = first + cell as f64 / curve.cells_per_metre;
                    let before = curve.knots.iter().rposition(|k| k.reading <= begin);
                    before.unwrap_or(0) as u32
                })
                .collect();
        }
        // What a deviation of the reading comes to in the distance: by how far the curve rises
        // over one deviation either way, which holds where the curve is steep only for a bit.
        let variances: Vec<f64> = blocks
            .iter()
            .map(|b| {
                let sd = b.sd_sq.sqrt();
                let half = 0.5 * (curve.range(b.reading + sd) - curve.range(b.reading - sd));
                let (nearest, farthest) = alike(distances, bias, b.reading);
                let ambiguous = (b.range - nearest).powi(2) + (farthest - b.range).powi(2);
                half * half + 0.5 * ambiguous
            })
            .collect();
        for (knot, variance) in curve.knots.iter_mut().zip(variances) {
            knot.variance = variance;
        }
        curve.lean();
        curve
    }

    /// Notes how range and variance rise from each knot to the next.
    fn lean(&mut self) {
        for at in 1..self.knots.len() {
            let (low, high) = (self.knots[at - 1], self.knots[at]);
            let step = high.reading - low.reading;
            self.knots[at - 1].rise =
                ((high.range - low.range) / step, (high.variance - low.variance) / step);
        }
    }

    /// Whether a reading is one of the table; NaN is not.
    #[inline]
    fn covers(&self, reading: f64) -> bool {
        let (first, last) = (&self.knots[0], &self.knots[self.knots.len() - 1]);
        reading >= first.reading - EXTRAPOLATED_M && reading <= last.reading + EXTRAPOLATED_M
    }

    /// Range and variance at a reading, if it is one of the table.
    #[inline]
    fn at(&self, reading: f64) -> Option<(f64, f64)> {
        if !self.covers(reading) {
            return None;
        }
        let (first, last) = (&self.knots[0], &self.knots[self.knots.len() - 1]);
        if reading <= first.reading {
            return Some((first.range + (reading - first.reading), first.variance));
        }
        if reading >= last.reading {
            return Some((last.range + (reading - last.reading), last.variance));
        }
        let cell = ((reading - first.reading) * self.cells_per_metre) as usize;
        let mut at = self.cells[cell.min(self.cells.len() - 1)] as usize;
        // One step at most, nearly always; whether it is taken is chance, so it is no branch.
        let knots_before_last = self.knots.len() - 2;
        at += usize::from(at < knots_before_last && self.knots[at + 1].reading <= reading);
        while at < knots_before_last && self.knots[at + 1].reading <= reading {
            at += 1;
        }
        let low = &self.knots[at];
        let past = reading - low.reading;
        Some((low.range + past * low.rise.0, low.variance + past * low.rise.1))
    }

    /// The range at a reading, the bias of the edges going on for ever.
    fn range(&self, reading: f64) -> f64 {
        let (first, last) = (&self.knots[0], &self.knots[self.knots.len() - 1]);
        let inside = reading.clamp(first.reading, last.reading);
        let (range, _) = self.at(inside).unwrap_or((inside, 0.0));
        range + (reading - inside)
    }
}

/// The nearest and the farthest distance that read like this; one and the same where the response
/// is monotone.
fn alike(distances: &[f64], bias: &[f64], reading: f64) -> (f64, f64) {
    let reads = |i: usize| distances[i] + bias[i];
    let between = |i: usize, j: usize| {
        let rise = reads(j) - reads(i);
        let share = if rise > 0.0 { ((reading - reads(i)) / rise).clamp(0.0, 1.0) } else { 1.0 };
        distances[i] + share * (distances[j] - distances[i])
    };
    let (count, last) = (distances.len(), distances.len() - 1);
    let nearest = match (0..count).position(|i| reads(i) >= reading) {
        Some(0) => distances[0],
        Some(i) => between(i - 1, i),
        None => distances[last],
    };
    let farthest = match (0..count).rposition(|i| reads(i) <= reading) {
        Some(i) if i < last => between(i, i + 1),
        Some(_) => distances[last],
        None => distances[0],
    };
    // Rounding may turn one and the same about.
    (nearest.min(farthest), farthest.max(nearest))
}

/// Pools neighbours until their readings ascend.
fn pooled(nodes: impl Iterator<Item = Block>) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    for mut block in nodes {
        while let Some(before) = blocks.pop_if(|before| before.reading >= block.reading) {
            let count = before.count + block.count;
            let mean = |a: f64, b: f64| (a * before.count + b * block.count) / count;
            block = Block {
                reading: mean(before.reading, block.reading),
                range: mean(before.range, block.range),
                sd_sq: mean(before.sd_sq, block.sd_sq),
                count,
            };
        }
        blocks.push(block);
    }
    blocks
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
        fn what_is_met_squarely_has_the_variance_of_no_incidence(
            amplitude in 0.0..0.05,
            reading in 0.0..4.5,
            first_incidence in prop::sample::select(vec![0.0, 0.05]),
        ) {
            let mut correction = table_of(head(amplitude, 0.7, 0.05), 0.02);
            correction.incidences_rad[0] = first_incidence;
            let table = RangeTable::new(&correction);
            let whole = table.correct(reading, 0.0).map(|found| found.variance.to_bits());
            prop_assert_eq!(table.variance_met_squarely(reading).map(f64::to_bits), whole);
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
