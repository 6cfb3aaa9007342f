//! All edges of a plan at once: where they lie, what lies on either side of them, and who drew them.

use super::exact::{PlanPoint, along, side};
use super::snapping::snap;
use super::winding::{Cover, covers};

/// A directed edge of something that covers what is on its left.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Drawn {
    pub(super) ends: [PlanPoint; 2],
    /// What it covers: one of the layers, or none of them for what only has a border.
    pub(super) layer: Option<usize>,
    /// Whose edge it is.
    pub(super) owner: u32,
}

/// One of the edges that lie on a part.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Copy {
    pub(super) layer: Option<usize>,
    pub(super) owner: u32,
    /// Whether it runs from left to right, and so covers what is above.
    pub(super) covers_above: bool,
    /// Which of the drawn edges it is a part of, in canonical order.
    pub(super) drawn: u32,
}

/// A stretch between two vertices of the arrangement.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Part<const N: usize> {
    pub(super) left: PlanPoint,
    pub(super) right: PlanPoint,
    pub(super) below: Cover<N>,
    pub(super) above: Cover<N>,
    /// The edges that lie on it, in canonical order.
    pub(super) copies: Vec<Copy>,
}

/// What making a plan took, in counts: a function of the model, not of the machine.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct PlanWork {
    /// Edges of solids that the plan is made of.
    pub edges: u64,
    /// Pairs of edges, and of edges and vertices, that were held against each other.
    pub pairs: u64,
    /// Stretches between two vertices, each swept once.
    pub parts: u64,
}

/// Arranges edges. The parts come in the order of their ends, and depend on the set of edges only.
pub(super) fn arrange<const N: usize>(drawn: Vec<Drawn>) -> (Vec<Part<N>>, PlanWork) {
    arrange_within(drawn, usize::MAX).unwrap_or_default()
}

/// The same; `None` if there are more than `most` crossings or stretches.
pub(super) fn arrange_within<const N: usize>(
    mut drawn: Vec<Drawn>,
    most: usize,
) -> Option<(Vec<Part<N>>, PlanWork)> {
    drawn.retain(|edge| edge.ends[0] != edge.ends[1]);
    drawn.sort_unstable();
    let segments: Vec<_> = drawn.iter().map(|edge| edge.ends).collect();
    let snapped = snap(&segments, most)?;
    let mut copies: Vec<(PlanPoint, PlanPoint, Copy)> = snapped
        .parts
        .into_iter()
        .map(|(from, to, index)| {
            let Drawn { layer, owner, .. } = drawn[index as usize];
            let covers_above = from < to;
            let copy = Copy { layer, owner, covers_above, drawn: index };
            (from.min(to), from.max(to), copy)
        })
        .collect();
    copies.sort_unstable();
    let mut edges = Vec::new();
    let mut on_each = Vec::new();
    for same in copies.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let mut added = [0; N];
        for (_, _, copy) in same {
            if let Some(layer) = copy.layer {
                added[layer] += if copy.covers_above { 1 } else { -1 };
            }
        }
        edges.push((same[0].0, same[0].1, added));
        on_each.push(same.iter().map(|(_, _, copy)| *copy).collect::<Vec<_>>());
    }
    let covers = covers(&edges);
    let work =
        PlanWork { edges: drawn.len() as u64, pairs: snapped.pairs, parts: edges.len() as u64 };
    let parts = edges.into_iter().zip(covers).zip(on_each);
    let parts = parts.map(|(((left, right, _), [below, above]), copies)| Part {
        left,
        right,
        below,
        above,
        copies,
    });
    Some((parts.collect(), work))
}

/// Area of the places with a property, square micrometres.
pub(super) fn area<const N: usize>(parts: &[Part<N>], has: impl Fn(&Cover<N>) -> bool) -> f64 {
    let Some(origin) = parts.first().map(|part| part.left) else { return 0.0 };
    let twice = parts.iter().map(|part| match (has(&part.below), has(&part.above)) {
        (false, true) => side(origin, part.left, part.right),
        (true, false) => -side(origin, part.left, part.right),
        _ => 0,
    });
    twice.sum::<i128>() as f64 / 2.0
}

/// Whether two segments have a point in common.
pub(super) fn touch(a: [PlanPoint; 2], b: [PlanPoint; 2]) -> bool {
    let on = |s: [PlanPoint; 2], p: PlanPoint| {
        side(s[0], s[1], p) == 0 && along(s[0], s[1], p) >= 0 && along(s[1], s[0], p) >= 0
    };
    super::exact::crossing(a, b).is_some()
        || a.iter().any(|p| on(b, *p))
        || b.iter().any(|p| on(a, *p))
}
