//! Pairs of landmarks by their length: which could be the two that a robot sees?

use std::f64::consts::{PI, TAU};
use std::ops::Range;

use super::grid::Grid;
use super::{Landmark, LandmarkKind};
use crate::geometry::{Point, difference};

/// Sectors that the direction of a pair's first landmark falls into: whoever knows it to 20 degrees looks
/// at two or three of them.
const SECTORS: usize = 16;

/// Pairs of two kinds whose first landmark opens to one sector, ascending by length. The first is of the
/// kind that comes first in the canonical order.
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
        let turned = |turn: f64| difference(turn, PI);
        Self {
            kinds: [self.kinds[1], self.kinds[0]],
            length: self.length,
            turns: [turned(self.turns[1]), turned(self.turns[0])],
        }
    }
}

/// Where the groups of two kinds begin.
fn first_group([a, b]: [LandmarkKind; 2]) -> usize {
    (a as usize * LandmarkKind::ALL.len() + b as usize) * SECTORS
}

/// The sector of a direction, counted on beyond a whole turn; what looks the same from behind has its
/// half turn for a whole one.
fn sector(kind: LandmarkKind, turn: f64) -> i64 {
    let whole = if kind.is_two_sided() { PI } else { TAU };
    (turn / whole * SECTORS as f64).floor() as i64
}

fn group_of(shape: &Shape) -> usize {
    let sector = sector(shape.kinds[0], shape.turns[0]).rem_euclid(SECTORS as i64);
    first_group(shape.kinds) + sector as usize
}

impl Pairs {
    /// All pairs of `landmarks` from `shortest` to `longest` metres.
    pub(super) fn new(
        landmarks: &[Landmark],
        grid: &Grid,
        (shortest, longest): (f64, f64),
        is_fit: impl Fn(&Landmark) -> bool,
    ) -> Self {
        let count = LandmarkKind::ALL.len().pow(2) * SECTORS;
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
                found[group_of(&shape)].push((shape.length as f32, turns, ends));
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

    /// Bytes that they take.
    pub(super) fn bytes(&self) -> usize {
        self.len() * (size_of::<f32>() + size_of::<[f32; 2]>() + size_of::<[u32; 2]>())
    }

    /// Number of pairs.
    pub(super) fn len(&self) -> usize {
        self.groups.iter().map(|group| group.lengths.len()).sum()
    }

    /// How many pairs have the kinds of `shape`, its length to within `gate` metres, and the direction of one
    /// landmark to within `turn_gate` radians.
    pub(super) fn population(&self, shape: &Shape, gate: f64, turn_gate: f64) -> usize {
        let mut count = 0;
        self.stretches(shape, gate, turn_gate, |_, _, range, _| count += range.len());
        count
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
        self.stretches(shape, gate, turn_gate, |shape, group, range, is_swapped| {
            let fits = |end: usize, turn: f32| {
                shape.kinds[end].turn(f64::from(turn), shape.turns[end]).abs() <= turn_gate
            };
            for (turns, ends) in group.turns[range.clone()].iter().zip(&group.ends[range]) {
                if fits(0, turns[0]) && fits(1, turns[1]) {
                    visit(if is_swapped { [ends[1], ends[0]] } else { *ends });
                }
            }
        });
    }

    /// The stretches of groups that may hold a shape, with the shape in their order and whether that is
    /// the other way round.
    fn stretches(
        &self,
        shape: &Shape,
        gate: f64,
        turn_gate: f64,
        mut visit: impl FnMut(&Shape, &Group, Range<usize>, bool),
    ) {
        let (ordered, is_swapped) = shape.in_order();
        let is_alike = shape.kinds[0] == shape.kinds[1];
        let both = [(ordered, is_swapped), (ordered.reversed(), !is_swapped)];
        for (shape, is_swapped) in both.into_iter().take(1 + usize::from(is_alike)) {
            let (kind, turn) = (shape.kinds[0], shape.turns[0]);
            let (from, to) = (sector(kind, turn - turn_gate), sector(kind, turn + turn_gate));
            for sector in from..=to.min(from + SECTORS as i64 - 1) {
                let sector = sector.rem_euclid(SECTORS as i64) as usize;
                let group = &self.groups[first_group(shape.kinds) + sector];
                let (low, high) = ((shape.length - gate) as f32, (shape.length + gate) as f32);
                let from = group.lengths.partition_point(|length| *length < low);
                let to = group.lengths.partition_point(|length| *length <= high);
                visit(&shape, group, from..to, is_swapped);
            }
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
