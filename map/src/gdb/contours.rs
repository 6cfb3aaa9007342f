//! Edges joined to closed outlines, and straightened.

use std::collections::BTreeMap;

use super::exact::{PlanPoint, along, side};

/// A directed edge of a region's border, with the region on its right.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Bordering {
    pub(super) from: PlanPoint,
    pub(super) to: PlanPoint,
    pub(super) owner: u32,
    /// Which drawn edge it is a part of.
    pub(super) drawn: u32,
}

/// Joins the whole border of a region to rings that pass no vertex twice. Each starts at its smallest vertex; rings
/// are sorted.
pub(super) fn rings(mut border: Vec<Bordering>) -> Vec<Vec<Bordering>> {
    border.sort_unstable();
    let starts: Vec<PlanPoint> = border.iter().map(|edge| edge.from).collect();
    let leaving =
        |at: PlanPoint| starts.partition_point(|p| *p < at)..starts.partition_point(|p| *p <= at);
    let mut used = vec![false; border.len()];
    let mut rings = Vec::new();
    for first in 0..border.len() {
        let mut path: Vec<Bordering> = Vec::new();
        let mut position: BTreeMap<PlanPoint, usize> = BTreeMap::new();
        let mut next = (!used[first]).then_some(first);
        while let Some(index) = next {
            used[index] = true;
            let edge = border[index];
            position.insert(edge.from, path.len());
            path.push(edge);
            if let Some(start) = position.get(&edge.to).copied() {
                for done in &path[start..] {
                    position.remove(&done.from);
                }
                rings.push(from_smallest(path.split_off(start)));
            }
            // The next edge along the same piece of the region: the first one counter-clockwise from
            // where this one came.
            next = leaving(edge.to)
                .filter(|candidate| !used[*candidate])
                .min_by(|a, b| turn_order(edge.to, edge.from, border[*a].to, border[*b].to))
                .filter(|_| !path.is_empty());
        }
    }
    rings.sort_unstable();
    rings
}

/// Which of two directions from `at` comes first counter-clockwise from the direction to `back`.
fn turn_order(at: PlanPoint, back: PlanPoint, a: PlanPoint, b: PlanPoint) -> std::cmp::Ordering {
    // 0: less than half a turn, or half a turn; 1: more.
    let half = |p: PlanPoint| side(at, back, p) < 0;
    half(a).cmp(&half(b)).then_with(|| 0.cmp(&side(at, a, b)))
}

fn from_smallest(mut ring: Vec<Bordering>) -> Vec<Bordering> {
    let smallest = (0..ring.len()).min_by_key(|index| ring[*index].from).unwrap_or(0);
    ring.rotate_left(smallest);
    ring
}

/// A ring or path without the vertices at which nothing happens: those within one straight edge of the
/// same owner, up to the step of the grid that snapping may have moved them by.
pub(super) fn straightened(edges: &[Bordering], closed: bool) -> Vec<Bordering> {
    let mut kept: Vec<Bordering> = Vec::with_capacity(edges.len());
    for edge in edges {
        match kept.last_mut() {
            Some(last) if goes_on(last, edge) => last.to = edge.to,
            _ => kept.push(*edge),
        }
    }
    if closed && kept.len() > 3 {
        // The smallest vertex is nearly always a corner.
        let last = kept[kept.len() - 1];
        if goes_on(&last, &kept[0]) {
            kept[0].from = last.from;
            kept.pop();
            let start = from_smallest(kept);
            return start;
        }
    }
    kept
}

/// Whether `next` continues `last` in a straight line.
fn goes_on(last: &Bordering, next: &Bordering) -> bool {
    if last.owner != next.owner || along(last.to, last.from, next.to) >= 0 {
        return false;
    }
    // Within one step of the chord: area <= chord * 1.
    let off = side(last.from, next.to, last.to);
    let chord = along(last.from, next.to, next.to);
    // Not squared: what is off by kilometres would not fit into 128 bits.
    last.drawn == next.drawn || off.abs() <= chord.isqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn border(corners: &[(i64, i64)]) -> impl Iterator<Item = Bordering> {
        let at = |(x, y): (i64, i64)| PlanPoint { x, y };
        let ends = corners.iter().copied().zip(corners.iter().copied().cycle().skip(1));
        let edge = |(k, (a, b))| Bordering { from: at(a), to: at(b), owner: 0, drawn: k as u32 };
        ends.enumerate().map(edge).collect::<Vec<_>>().into_iter()
    }

    #[test]
    fn squares_that_touch_in_a_corner_stay_two() {
        let (a, b) =
            ([(0, 0), (0, 10), (10, 10), (10, 0)], [(10, 10), (10, 20), (20, 20), (20, 10)]);
        let rings = rings(border(&b).chain(border(&a)).collect());
        let corners =
            |ring: &Vec<Bordering>| ring.iter().map(|e| (e.from.x, e.from.y)).collect::<Vec<_>>();
        assert_eq!(rings.iter().map(corners).collect::<Vec<_>>(), [a.to_vec(), b.to_vec()]);
    }

    #[test]
    fn corners_kilometres_apart_stay_corners() {
        let far = 9_000_000_000;
        let edges: Vec<Bordering> = border(&[(-far, -far), (0, -far), (far, far)]).collect();
        assert_eq!(straightened(&edges[..2], false), edges[..2]);
    }

    #[test]
    fn a_hole_that_touches_the_outer_ring_is_a_ring_of_its_own() {
        let outer = [(0, 0), (0, 10), (10, 10), (10, 0)];
        // Free space inside: counter-clockwise.
        let hole = [(0, 0), (5, 2), (2, 5)];
        let rings = rings(border(&hole).chain(border(&outer)).collect());
        assert_eq!(rings.iter().map(Vec::len).collect::<Vec<_>>(), [4, 3]);
    }

    #[test]
    fn joints_vanish_and_corners_stay() {
        let ring: Vec<_> =
            border(&[(0, 0), (0, 50), (1, 100), (100, 100), (100, 0), (40, 0)]).collect();
        let corners: Vec<_> =
            straightened(&ring, true).iter().map(|e| (e.from.x, e.from.y)).collect();
        assert_eq!(corners, [(0, 0), (1, 100), (100, 100), (100, 0)]);
    }
}
