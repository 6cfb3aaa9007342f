//! Makes segments that cross into segments that only meet at their ends, by snap rounding.
//!
//! Every end and every crossing, rounded to the grid, is a hot pixel; each segment is bent to the centres of the hot
//! pixels that it runs through, in order (Hobby 1999; Guibas and Marimont 1998). No segment moves by more than 0.71
//! steps, none passes over a vertex, and the result has no crossings left. It depends on the set of segments only.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use super::exact::{PlanPoint, along, crossing, meets_pixel, nearest_quotient};

/// Pairs of segments that are looked at: a few for each where buildings are drawn. They are the square of the number of
/// segments where these are long and run beside each other.
const PAIRS_MAX: u64 = 50_000_000;

/// A square of the grid that finds neighbours: column and row.
type Square = (i64, i64);

/// Which segments pass through which squares.
pub(super) struct Squares {
    side: i64,
    /// (square, segment), sorted.
    entries: Vec<(Square, u32)>,
}

impl Squares {
    /// Squares as wide as segments are long on average: all together pass through a few squares each, however
    /// their lengths are distributed.
    pub(super) fn of(segments: &[[PlanPoint; 2]]) -> Self {
        let length = |[a, b]: &[PlanPoint; 2]| i128::from((a.x - b.x).abs() + (a.y - b.y).abs());
        let total: i128 = segments.iter().map(length).sum();
        let side = (total / (segments.len() as i128).max(1)).max(8) as i64;
        let mut entries = Vec::with_capacity(3 * segments.len());
        for (index, segment) in segments.iter().enumerate() {
            each_square(*segment, side, |square| entries.push((square, index as u32)));
        }
        entries.sort_unstable();
        Self { side, entries }
    }

    /// Calls `meet` for pairs of segments whose boxes meet, at least once for each that share a point, until it breaks;
    /// tells how many pairs were looked at. `None` after more than [`PAIRS_MAX`]: then not all were.
    pub(super) fn each_pair(
        &self,
        segments: &[[PlanPoint; 2]],
        mut meet: impl FnMut(u32, u32) -> ControlFlow<()>,
    ) -> Option<u64> {
        let mut looked_at = 0;
        let mut members: Vec<(i64, u32)> = Vec::new();
        for same in self.entries.chunk_by(|a, b| a.0 == b.0) {
            members.clear();
            members.extend(same.iter().map(|(_, index)| {
                let [a, b] = segments[*index as usize];
                (a.x.min(b.x), *index)
            }));
            members.sort_unstable();
            for (position, (_, first)) in members.iter().enumerate() {
                let [a, b] = segments[*first as usize];
                let (right, low, high) = (a.x.max(b.x), a.y.min(b.y), a.y.max(b.y));
                let others = members[position + 1..].iter().take_while(|(left, _)| *left <= right);
                for (_, second) in others {
                    looked_at += 1;
                    let [c, d] = segments[*second as usize];
                    if c.y.min(d.y) <= high
                        && c.y.max(d.y) >= low
                        && meet(*first, *second).is_break()
                    {
                        return Some(looked_at);
                    }
                }
                if looked_at > PAIRS_MAX {
                    return None;
                }
            }
        }
        Some(looked_at)
    }
}

/// The squares that a segment comes within a step of.
fn each_square([a, b]: [PlanPoint; 2], side: i64, mut visit: impl FnMut(Square)) {
    let (a, b) = if a.x <= b.x { (a, b) } else { (b, a) };
    let y_at = |x: i64| {
        if a.x == b.x {
            return a.y;
        }
        let run = i128::from(x.clamp(a.x, b.x) - a.x);
        a.y + nearest_quotient(i128::from(b.y - a.y) * run, i128::from(b.x - a.x))
    };
    for column in (a.x - 1).div_euclid(side)..=(b.x + 1).div_euclid(side) {
        // A step beyond the column on either side: rounding and the pixel's width stay within.
        let mut ends = [y_at(column * side - 2), y_at((column + 1) * side + 2)];
        if a.x == b.x {
            ends = [a.y, b.y];
        }
        let (low, high) = (ends[0].min(ends[1]) - 2, ends[0].max(ends[1]) + 2);
        for row in low.div_euclid(side)..=high.div_euclid(side) {
            visit((column, row));
        }
    }
}

/// What snapping made, and what it took.
pub(super) struct Snapped {
    /// (from, to, index of the segment that it is a part of), each in the direction of its segment.
    pub(super) parts: Vec<(PlanPoint, PlanPoint, u32)>,
    /// Pairs of segments and of segments and hot pixels that were looked at.
    pub(super) pairs: u64,
}

/// Bends segments (none of length 0) so that they meet only at their ends. `None` if there are more than `most`
/// crossings or parts, or pairs without end: they are the square of the number of segments if these are drawn so.
pub(super) fn snap(segments: &[[PlanPoint; 2]], most: usize) -> Option<Snapped> {
    let squares = Squares::of(segments);
    let mut pixels: Vec<PlanPoint> = segments.iter().flatten().copied().collect();
    let mut crossings = 0;
    let mut pairs = squares.each_pair(segments, |a, b| {
        let crossing = crossing(segments[a as usize], segments[b as usize]);
        crossings += usize::from(crossing.is_some());
        pixels.extend(crossing);
        if crossings < most { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    })?;
    if crossings >= most {
        return None;
    }
    pixels.sort_unstable();
    pixels.dedup();
    let mut by_square: BTreeMap<Square, Vec<PlanPoint>> = BTreeMap::new();
    for pixel in pixels {
        let square = (pixel.x.div_euclid(squares.side), pixel.y.div_euclid(squares.side));
        by_square.entry(square).or_default().push(pixel);
    }
    let mut parts = Vec::with_capacity(2 * segments.len());
    let mut on_the_way: Vec<PlanPoint> = Vec::new();
    for (index, segment) in segments.iter().enumerate() {
        let [from, to] = *segment;
        on_the_way.clear();
        each_square(*segment, squares.side, |square| {
            let Some(held) = by_square.get(&square) else { return };
            // They are sorted: only those within the segment's reach.
            let (left, right) = (from.x.min(to.x), from.x.max(to.x));
            let start = held.partition_point(|p| p.x < left);
            for pixel in held[start..].iter().take_while(|p| p.x <= right) {
                pairs += 1;
                if meets_pixel(*segment, *pixel) {
                    on_the_way.push(*pixel);
                }
            }
        });
        on_the_way.sort_unstable_by_key(|p| along(from, to, *p));
        on_the_way.dedup();
        if parts.len() + on_the_way.len() > most {
            return None;
        }
        parts.extend(on_the_way.windows(2).map(|w| (w[0], w[1], index as u32)));
    }
    Some(Snapped { parts, pairs })
}

#[cfg(test)]
mod tests {
    use super::super::exact::side;
    use super::*;
    use proptest::prelude::*;

    proptest! {
        /// On a tiny grid nearly everything is degenerate.
        #[test]
        fn nothing_crosses_afterwards_and_no_vertex_lies_within_a_part(
            ends in prop::collection::vec(prop::array::uniform4(-12_i64..12), 1..24),
        ) {
            let segments: Vec<_> = ends
                .iter()
                .map(|v| [PlanPoint { x: v[0], y: v[1] }, PlanPoint { x: v[2], y: v[3] }])
                .filter(|[a, b]| a != b)
                .collect();
            let snapped = snap(&segments, usize::MAX).map_or_else(Vec::new, |snapped| snapped.parts);
            prop_assert!(snapped.len() >= segments.len());
            for (i, (a, b, index)) in snapped.iter().enumerate() {
                prop_assert!(a != b);
                let whole = segments[*index as usize];
                prop_assert!(meets_pixel(whole, *a) && meets_pixel(whole, *b));
                for (c, d, _) in &snapped[i + 1..] {
                    prop_assert_eq!(crossing([*a, *b], [*c, *d]), None);
                    for p in [c, d] {
                        let inside = side(*a, *b, *p) == 0
                            && along(*a, *b, *p) > 0
                            && along(*b, *a, *p) > 0;
                        prop_assert!(!inside, "{:?} within {:?} {:?}", p, a, b);
                    }
                }
            }
        }
    }
}
