//! Evidence through time: sums for each stretch of time, and what they read as one after the other.
//!
//! A plain sum never forgets: a shelf that was seen for a month has to be seen gone for a month.
//! So evidence is summed per *slice*, a stretch of time of fixed length, and a cell is read from the
//! oldest slice to the newest: what the earlier ones come to is carried on, but for no more than a
//! limit ([`SliceConfig`]), and the next one's sum is added. What has changed is
//! believed after as many looks as overcome the limit, however long it was otherwise; what is not
//! looked at any more stays as it was last seen, for no clock is asked.
//!
//! Sums are exact and are never limited themselves: contributions add up in any order within a
//! slice, slices are put in order by their time, and taking one out leaves what would have been
//! without it. Limiting while adding, as grids do elsewhere, would depend on the order.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{LogOdds, Tile, TileKey};

/// How evidence is put into slices and read from them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct SliceConfig {
    /// Length of a slice, seconds. Slices begin at its multiples since 1970 (UTC).
    pub length_s: u32,
    /// Most that a cell's earlier slices count for "free", once a later one speaks of it.
    pub free_carried: LogOdds,
    /// Most that they count for "occupied".
    pub occupied_carried: LogOdds,
}

impl SliceConfig {
    /// A day. What was occupied counts 2 nat (0.88), which a look that saw it free from nearby takes back, or a few
    /// from afar. What was free counts 1.1 nat (0.25), so that a few hits overcome it, and yet one look that
    /// sees it free again reads as free everywhere (0.18; Nav2 draws the line at 0.196).
    pub const STANDARD: Self =
        Self { length_s: 86_400, free_carried: LogOdds(-110), occupied_carried: LogOdds(200) };

    /// The slice of what was observed then, in microseconds since 1970.
    pub fn slice(self, observed_at_us: i64) -> Slice {
        Slice(observed_at_us.div_euclid(i64::from(self.length_s.max(1)) * 1_000_000))
    }

    /// `earlier`, with a later slice's sums on top.
    fn on_top(self, earlier: &Tile, later: &Tile) -> Tile {
        let (least, most) = (self.free_carried.0, self.occupied_carried.0);
        let mut cells = Box::new(*earlier.cells());
        for (cell, sum) in cells.iter_mut().zip(later.cells()) {
            // A slice that says nothing of a cell is, for it, as if it were not.
            let carried = (*cell).max(least).min(most).wrapping_add(*sum);
            *cell = if *sum == 0 { *cell } else { carried };
        }
        Tile::new(cells)
    }
}

/// A stretch of time: its number, counted from 1970 in lengths of the level's slices.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Slice(pub i64);

/// One layer's tile in one slice.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SliceKey {
    /// The layer and the place.
    pub key: TileKey,
    /// The time.
    pub slice: Slice,
}

/// The slices of one layer's tile.
#[derive(Debug, Clone, Default)]
pub(crate) struct Stack {
    /// Sums; none without evidence.
    slices: BTreeMap<Slice, Arc<Tile>>,
    /// What all but the newest read as, if there are others.
    below_newest: Option<Arc<Tile>>,
}

impl Stack {
    /// The sums of one slice.
    pub(crate) fn sums(&self, slice: Slice) -> Option<&Arc<Tile>> {
        self.slices.get(&slice)
    }

    /// Whether there is no evidence.
    pub(crate) fn is_empty(&self) -> bool {
        self.slices.is_empty()
    }

    /// Changes the sums of one slice.
    pub(crate) fn change(
        &mut self,
        slice: Slice,
        config: SliceConfig,
        change: impl FnOnce(&mut Tile),
    ) {
        let newest = self.slices.last_key_value().map(|(newest, _)| *newest);
        if newest.is_some_and(|newest| newest < slice) {
            self.below_newest = self.reading(config);
        }
        let sums = self.slices.entry(slice).or_default();
        change(Arc::make_mut(sums));
        let is_empty = sums.is_empty();
        if is_empty {
            self.slices.remove(&slice);
        }
        // As it mostly is: the newest slice grows, and what lies below it stays.
        if is_empty || newest.is_some_and(|newest| newest > slice) {
            self.below_newest = self.read_below_newest(config);
        }
    }

    /// What the tile reads as; `None` without evidence.
    pub(crate) fn reading(&self, config: SliceConfig) -> Option<Arc<Tile>> {
        let (_, newest) = self.slices.last_key_value()?;
        let Some(below) = &self.below_newest else { return Some(Arc::clone(newest)) };
        Some(Arc::new(config.on_top(below, newest)))
    }

    fn read_below_newest(&self, config: SliceConfig) -> Option<Arc<Tile>> {
        let mut earlier = self.slices.values().rev().skip(1).rev();
        let first = Arc::clone(earlier.next()?);
        Some(earlier.fold(first, |below, sums| Arc::new(config.on_top(&below, sums))))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::super::{EvidenceRun, TilePatch};
    use super::*;

    const CONFIG: SliceConfig = SliceConfig::STANDARD;

    fn patch(value: i16) -> TilePatch {
        TilePatch::new(vec![EvidenceRun { start: 5, length: 1, value }]).unwrap_or_default()
    }

    fn read(stack: &Stack) -> i32 {
        stack.reading(CONFIG).map_or(0, |tile| tile.cells()[5])
    }

    fn add(stack: &mut Stack, slice: i64, value: i16) {
        stack.change(Slice(slice), CONFIG, |sums| sums.add(&patch(value)));
    }

    fn subtract(stack: &mut Stack, slice: i64, value: i16) {
        stack.change(Slice(slice), CONFIG, |sums| sums.subtract(&patch(value)));
    }

    #[test]
    fn slices_begin_at_midnight_before_1970_too() {
        let day_us = 86_400_000_000;
        for (at, slice) in [(0, 0), (day_us - 1, 0), (day_us, 1), (-1, -1), (-day_us, -1)] {
            assert_eq!(CONFIG.slice(at), Slice(slice), "{at}");
        }
    }

    #[test]
    fn what_has_changed_is_believed_after_a_few_looks_however_long_it_was_otherwise() {
        let mut stack = Stack::default();
        for day in 0..30 {
            (0..100).for_each(|_| add(&mut stack, day, 85));
        }
        assert_eq!(read(&stack), 200 + 8500);
        (0..6).for_each(|_| add(&mut stack, 30, -40));
        assert_eq!(read(&stack), -40, "six beams through it, and it is gone");
        (0..100).for_each(|_| add(&mut stack, 30, -40));
        (0..2).for_each(|_| add(&mut stack, 31, 85));
        assert_eq!(read(&stack), 60, "two hits, and it is back");
    }

    #[test]
    fn what_is_not_looked_at_stays_as_it_was_last_seen() {
        let mut stack = Stack::default();
        (0..100).for_each(|_| add(&mut stack, 0, 85));
        let elsewhere = TilePatch::new(vec![EvidenceRun { start: 9, length: 1, value: -40 }]);
        let elsewhere = elsewhere.unwrap_or_default();
        stack.change(Slice(9), CONFIG, |sums| sums.add(&elsewhere));
        assert_eq!(read(&stack), 8500);
    }

    /// The definition, cell by cell.
    fn by_the_book(looks: &[(i64, i16)]) -> i32 {
        let mut slices: BTreeMap<i64, i32> = BTreeMap::new();
        for (slice, value) in looks {
            *slices.entry(*slice).or_default() += i32::from(*value);
        }
        let mut read = None;
        for sum in slices.into_values().filter(|sum| *sum != 0) {
            read = Some(read.map_or(sum, |before: i32| before.clamp(-110, 200) + sum));
        }
        read.unwrap_or(0)
    }

    proptest! {
        #[test]
        fn readings_are_a_function_of_the_set(
            looks in prop::collection::vec((0..6_i64, prop::sample::select(vec![-200_i16, -40, 85, 300])), 1..40),
            gone in prop::collection::vec(any::<prop::sample::Index>(), 0..20),
        ) {
            let mut stack = Stack::default();
            for (slice, value) in &looks {
                add(&mut stack, *slice, *value);
            }
            prop_assert_eq!(read(&stack), by_the_book(&looks));
            let mut reversed = Stack::default();
            for (slice, value) in looks.iter().rev() {
                add(&mut reversed, *slice, *value);
            }
            prop_assert_eq!(read(&reversed), read(&stack));
            // Taking some out leaves what would have been without them.
            let mut left = looks;
            for index in gone {
                if !left.is_empty() {
                    let (slice, value) = left.swap_remove(index.index(left.len()));
                    subtract(&mut stack, slice, value);
                    prop_assert_eq!(read(&stack), by_the_book(&left));
                }
            }
            prop_assert!(stack.slices.values().all(|sums| !sums.is_empty()));
        }
    }
}
