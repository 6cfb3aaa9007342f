//! Closed intervals of integer millimetres, so that their arithmetic is exact.

/// From `from` to `to`, in millimetres along some line; empty unless `from < to`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct Interval {
    /// Lower end, millimetres.
    pub from: i64,
    /// Upper end, millimetres.
    pub to: i64,
}

impl Interval {
    /// The interval between two coordinates in metres, in either order, to the nearest millimetre.
    pub fn from_metres(a: f64, b: f64) -> Self {
        let (a, b) = ((a * 1e3).round() as i64, (b * 1e3).round() as i64);
        Self { from: a.min(b), to: a.max(b) }
    }

    /// Length in millimetres, never negative.
    pub fn length(&self) -> i64 {
        (self.to - self.from).max(0)
    }

    /// Lower end in metres: the double nearest to the millimetres, so that it reads `1.149` and
    /// [`Self::from_metres`] leads back exactly.
    pub fn from_m(&self) -> f64 {
        self.from as f64 / 1e3
    }

    /// Upper end in metres.
    pub fn to_m(&self) -> f64 {
        self.to as f64 / 1e3
    }

    /// Length of what both cover, millimetres.
    pub fn overlap(&self, other: &Self) -> i64 {
        (-self.gap(other)).max(0)
    }

    /// Distance between the two intervals, negative where they overlap.
    pub fn gap(&self, other: &Self) -> i64 {
        self.from.max(other.from) - self.to.min(other.to)
    }
}

/// The union as disjoint intervals in ascending order; pieces not more than `bridge`
/// millimetres apart become one.
pub fn union_intervals(intervals: &[Interval], bridge: i64) -> Vec<Interval> {
    let mut sorted: Vec<Interval> = intervals.iter().copied().filter(|i| i.from < i.to).collect();
    sorted.sort_unstable();
    let mut union: Vec<Interval> = Vec::new();
    for next in sorted {
        match union.last_mut() {
            Some(last) if next.from - last.to <= bridge => last.to = last.to.max(next.to),
            _ => union.push(next),
        }
    }
    union
}

/// What is left of `minuend` (disjoint, ascending) without `subtrahend` (disjoint, ascending).
pub fn subtract_intervals(minuend: &[Interval], subtrahend: &[Interval]) -> Vec<Interval> {
    let mut left = Vec::new();
    for piece in minuend {
        let mut from = piece.from;
        for cut in subtrahend {
            if cut.to <= from || cut.from >= piece.to {
                continue;
            }
            if cut.from > from {
                left.push(Interval { from, to: cut.from });
            }
            from = from.max(cut.to);
        }
        if from < piece.to {
            left.push(Interval { from, to: piece.to });
        }
    }
    left
}
