//! On which side of which edges what lies: a sweep over edges that meet only at their ends.
//!
//! The plane is swept from left to right as if it were sheared by an infinitesimal angle, so that points
//! come in the order of (x, y), no edge is vertical, and one rule fits all (Shamos and Hoey 1976).

use std::cmp::Ordering;
use std::collections::BTreeSet;

use super::exact::{PlanPoint, side};

/// How many times each layer of solids covers a place.
pub(super) type Cover<const N: usize> = [i32; N];

/// An edge as the sweep sees it: from its left end to its right one.
#[derive(Clone, Copy)]
struct Crossed {
    left: PlanPoint,
    right: PlanPoint,
    index: usize,
}

impl Crossed {
    /// The order from below to above of two edges that one sweep line crosses.
    fn height_order(&self, other: &Self) -> Ordering {
        if self.index == other.index {
            return Ordering::Equal;
        }
        if self.left > other.left {
            return other.height_order(self).reverse();
        }
        let start = side(self.left, self.right, other.left);
        let decisive = if start == 0 { side(self.left, self.right, other.right) } else { start };
        0.cmp(&decisive)
    }
}

impl PartialEq for Crossed {
    fn eq(&self, other: &Self) -> bool {
        self.index == other.index
    }
}

impl Eq for Crossed {}

impl PartialOrd for Crossed {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Crossed {
    fn cmp(&self, other: &Self) -> Ordering {
        self.height_order(other)
    }
}

/// The cover below and above each edge. An edge is (left end, right end, what its crossing upwards adds);
/// edges are distinct, sorted, and meet only at their ends.
pub(super) fn covers<const N: usize>(
    edges: &[(PlanPoint, PlanPoint, Cover<N>)],
) -> Vec<[Cover<N>; 2]> {
    let crossed = |index: usize| Crossed { left: edges[index].0, right: edges[index].1, index };
    let mut starts: Vec<usize> = (0..edges.len()).collect();
    starts.sort_by(|a, b| {
        edges[*a].0.cmp(&edges[*b].0).then_with(|| crossed(*a).height_order(&crossed(*b)))
    });
    let mut ends: Vec<usize> = (0..edges.len()).collect();
    ends.sort_by_key(|index| edges[*index].1);
    let mut ends = ends.into_iter().peekable();
    let mut line: BTreeSet<Crossed> = BTreeSet::new();
    let mut covers = vec![[[0; N]; 2]; edges.len()];
    for index in starts {
        let edge = crossed(index);
        while let Some(gone) = ends.next_if(|gone| edges[*gone].1 <= edge.left) {
            line.remove(&crossed(gone));
        }
        let below = line.range(..edge).next_back().map_or([0; N], |under| covers[under.index][1]);
        let added = edges[index].2;
        covers[index] = [below, std::array::from_fn(|layer| below[layer] + added[layer])];
        line.insert(edge);
    }
    covers
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(x: i64, y: i64) -> PlanPoint {
        PlanPoint { x, y }
    }

    #[test]
    fn a_square_with_a_square_in_it_is_covered_twice_there() {
        // Counter-clockwise: lower sides run left to right, upper ones back, right ones up.
        let square = |a: i64, b: i64| {
            [
                (at(a, a), at(a, b), [-1]),
                (at(a, a), at(b, a), [1]),
                (at(a, b), at(b, b), [-1]),
                (at(b, a), at(b, b), [1]),
            ]
        };
        let mut edges: Vec<_> = square(0, 9).into_iter().chain(square(3, 5)).collect();
        edges.sort_unstable();
        let covers = covers(&edges);
        for ((left, right, _), [below, above]) in edges.iter().zip(covers) {
            let inner = left.x >= 3 && right.x <= 5;
            let (outside, inside) = if inner { (1, 2) } else { (0, 1) };
            // A vertical edge is tilted to the right at its top: what is on its left is above it.
            let solid_above =
                right.y == left.y && left.y < 4 && left.y != 9 || left.x == right.x && left.x >= 5;
            let want = if solid_above { (outside, inside) } else { (inside, outside) };
            assert_eq!((below[0], above[0]), want, "{left:?} {right:?}");
        }
    }
}
