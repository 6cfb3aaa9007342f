//! The inverse response of a head at one incidence.
//!
//! Where the response is not monotone (its bias falls by more than the distance grows), no curve can
//! tell which of several distances a reading means: such stretches are pooled (pool adjacent
//! violators; Ayer et al. 1955) into one point of the curve, and where several distances read alike,
//! the variance takes in how far the nearest and the farthest of them are from the curve.

use super::EXTRAPOLATED_M;

/// A point of a curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Node {
    pub(super) reading: f64,
    pub(super) range: f64,
    pub(super) variance: f64,
}

/// Neighbouring nodes of the table that share one reading.
struct Block {
    reading: f64,
    range: f64,
    sd_sq: f64,
    count: f64,
}

/// The curve of a response: readings and ranges both strictly ascending. Its first and its last node are
/// where the bias of the table's edges ends to go on.
pub(super) fn turned_round(distances: &[f64], bias: &[f64], sd: &[f64]) -> Vec<Node> {
    let nodes = distances.iter().zip(bias).zip(sd);
    let blocks = pooled(nodes.map(|((&d, &b), &sd)| Block {
        reading: d + b,
        range: d,
        sd_sq: sd * sd,
        count: 1.0,
    }));
    let node = |b: &Block| Node { reading: b.reading, range: b.range, variance: 0.0 };
    let mut curve: Vec<Node> = blocks.iter().map(node).collect();
    let (first, last) = (curve[0], curve[curve.len() - 1]);
    // The bias of the edges going on for ever.
    let range = |reading: f64| {
        let inside = reading.clamp(first.reading, last.reading);
        at(&curve, inside).0 + (reading - inside)
    };
    // What a deviation of the reading comes to in the distance: by how far the curve rises
    // over one deviation either way, which holds where the curve is steep only for a bit.
    let variance = |b: &Block| {
        let sd = b.sd_sq.sqrt();
        let half = 0.5 * (range(b.reading + sd) - range(b.reading - sd));
        let (nearest, farthest) = alike(distances, bias, b.reading);
        let ambiguous = (b.range - nearest).powi(2) + (farthest - b.range).powi(2);
        half * half + 0.5 * ambiguous
    };
    let variances: Vec<f64> = blocks.iter().map(variance).collect();
    for (node, variance) in curve.iter_mut().zip(variances) {
        node.variance = variance;
    }
    let beyond =
        |node: Node, by: f64| Node { reading: node.reading + by, range: node.range + by, ..node };
    let (first, last) = (curve[0], curve[curve.len() - 1]);
    curve.insert(0, beyond(first, -EXTRAPOLATED_M));
    curve.push(beyond(last, EXTRAPOLATED_M));
    curve
}

/// Range and variance at a reading that lies on the curve.
pub(super) fn at(curve: &[Node], reading: f64) -> (f64, f64) {
    let after =
        curve.partition_point(|node| node.reading <= reading).clamp(1, curve.len().max(2) - 1);
    let low = &curve[after - 1];
    let Some(high) = curve.get(after) else { return (low.range, low.variance) };
    let share = (reading - low.reading) / (high.reading - low.reading);
    (
        low.range + share * (high.range - low.range),
        low.variance + share * (high.variance - low.variance),
    )
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
