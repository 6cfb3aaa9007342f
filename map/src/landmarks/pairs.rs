//! Pairs of landmarks by their length: which could be the two that a robot sees?

use super::grid::Grid;
use super::{Landmark, LandmarkKind};
use crate::geometry::{Point, difference};

/// Pairs of two kinds, ascending by length. The first is of the kind that comes first in the canonical
/// order.
#[derive(Debug, Clone, PartialEq, Default)]
struct Group {
    /// Metres.
    lengths: Vec<f32>,
    /// The direction of each landmark, less that from the first to the second: radians.
    turns: Vec<[f32; 2]>,
    /// The two landmarks' numbers.
    ends: Vec<[u32; 2]>,
}

/// One of them: length, turns, ends.
type Pair = (f32, [f32; 2], [u32; 2]);

/// All pairs of a table that are neither too close to tell a direction nor too far to be seen together.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Pairs {
    groups: Vec<Group>,
}

/// Two landmarks, as far as a turn and a shift leave them alone.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Shape {
    pub(super) kinds: [LandmarkKind; 2],
    pub(super) length: f64,
    pub(super) turns: [f64; 2],
}

impl Shape {
    /// Of two landmarks, in this order.
    pub(super) fn of(a: &Landmark, b: &Landmark) -> Self {
        let arm = b.at - a.at;
        let bearing = arm.y.atan2(arm.x);
        Self {
            kinds: [a.kind, b.kind],
            length: arm.norm(),
            turns: [a, b].map(|end| difference(end.direction, bearing)),
        }
    }

    /// The same two the other way round.
    fn reversed(&self) -> Self {
        let turned = |turn: f64| difference(turn, std::f64::consts::PI);
        Self {
            kinds: [self.kinds[1], self.kinds[0]],
            length: self.length,
            turns: [turned(self.turns[1]), turned(self.turns[0])],
        }
    }
}

fn group_of([a, b]: [LandmarkKind; 2]) -> usize {
    a as usize * LandmarkKind::ALL.len() + b as usize
}

impl Pairs {
    /// All pairs of `landmarks` from `shortest` to `longest` metres.
    pub(super) fn new(
        landmarks: &[Landmark],
        grid: &Grid,
        (shortest, longest): (f64, f64),
        is_fit: impl Fn(&Landmark) -> bool,
    ) -> Self {
        let count = LandmarkKind::ALL.len().pow(2);
        let mut found: Vec<Vec<Pair>> = vec![Vec::new(); count];
        for (i, a) in landmarks.iter().enumerate().filter(|(_, a)| is_fit(a)) {
            for j in grid.near(&a.at, longest) {
                let b = &landmarks[j as usize];
                let distance_sq = (b.at - a.at).norm_squared();
                if (j as usize) <= i
                    || distance_sq < shortest * shortest
                    || distance_sq > longest * longest
                    || !is_fit(b)
                {
                    continue;
                }
                let (shape, ends) = if a.kind <= b.kind {
                    (Shape::of(a, b), [i as u32, j])
                } else {
                    (Shape::of(b, a), [j, i as u32])
                };
                let turns = shape.turns.map(|turn| turn as f32);
                found[group_of(shape.kinds)].push((shape.length as f32, turns, ends));
            }
        }
        let groups = found.into_iter().map(|mut pairs| {
            pairs.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
            Group {
                lengths: pairs.iter().map(|p| p.0).collect(),
                turns: pairs.iter().map(|p| p.1).collect(),
                ends: pairs.iter().map(|p| p.2).collect(),
            }
        });
        Self { groups: groups.collect() }
    }

    /// Number of pairs.
    pub(super) fn len(&self) -> usize {
        self.groups.iter().map(|group| group.lengths.len()).sum()
    }

    /// How many pairs have the kinds of `shape` and its length to within `gate` metres.
    pub(super) fn population(&self, shape: &Shape, gate: f64) -> usize {
        let (group, from, to) = self.stretch(&shape.in_order().0, gate);
        let once = to - from;
        if group < self.groups.len() && shape.kinds[0] == shape.kinds[1] { 2 * once } else { once }
    }

    fn stretch(&self, shape: &Shape, gate: f64) -> (usize, usize, usize) {
        let group = group_of(shape.kinds);
        let lengths = &self.groups[group].lengths;
        let (low, high) = ((shape.length - gate) as f32, (shape.length + gate) as f32);
        let from = lengths.partition_point(|length| *length < low);
        let to = lengths.partition_point(|length| *length <= high);
        (group, from, to)
    }

    /// Visits the pairs that may be the two of `shape`, as numbers of landmarks in the order of the
    /// shape's: lengths to within `gate` metres, directions to within `turn_gate` radians.
    pub(super) fn alike(
        &self,
        shape: &Shape,
        gate: f64,
        turn_gate: f64,
        mut visit: impl FnMut([u32; 2]),
    ) {
        let (ordered, is_swapped) = shape.in_order();
        let mut look = |shape: &Shape, is_swapped: bool| {
            let (group, from, to) = self.stretch(shape, gate);
            let Group { turns, ends, .. } = &self.groups[group];
            let fits = |end: usize, turn: f32| {
                shape.kinds[end].turn(f64::from(turn), shape.turns[end]).abs() <= turn_gate
            };
            for (turns, ends) in turns[from..to].iter().zip(&ends[from..to]) {
                if fits(0, turns[0]) && fits(1, turns[1]) {
                    visit(if is_swapped { [ends[1], ends[0]] } else { *ends });
                }
            }
        };
        look(&ordered, is_swapped);
        if shape.kinds[0] == shape.kinds[1] {
            look(&ordered.reversed(), !is_swapped);
        }
    }
}

impl Shape {
    /// With its kinds in the canonical order, and whether it had to be reversed for that.
    fn in_order(&self) -> (Self, bool) {
        if self.kinds[0] <= self.kinds[1] { (*self, false) } else { (self.reversed(), true) }
    }
}

/// The middle of two places.
pub(super) fn middle(a: &Point, b: &Point) -> Point {
    (a + b) * 0.5
}
