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
use std::mem;
use std::sync::Arc;

use super::{LogOdds, Sums, Tile, TileKey};

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

/// How many slices of a tile are held open: the newest, to which nearly all looks are added, and the one before it, for
/// robots that come back with yesterday's.
const OPEN: usize = 2;

/// The slices of one layer's tile.
#[derive(Debug, Clone, Default)]
pub(crate) struct Stack {
    /// Sums; none without evidence. The newest [`OPEN`] are open, all before them packed.
    slices: BTreeMap<Slice, Sums>,
    /// What those before the open ones read as, if there are any.
    below_open: Option<Arc<Tile>>,
    /// What all but the newest read as, if there are others.
    below_newest: Option<Arc<Tile>>,
}

impl Stack {
    /// The slices that hold `sums`.
    pub(crate) fn new(sums: BTreeMap<Slice, Sums>, config: SliceConfig) -> Self {
        let mut stack = Self { slices: sums, ..Self::default() };
        stack.hold(config);
        stack
    }

    /// The sums of one slice.
    pub(crate) fn sums(&self, slice: Slice) -> Option<&Sums> {
        self.slices.get(&slice)
    }

    /// Changes the sums of one slice. Returns the slices whose sums are held in another way now.
    pub(crate) fn change(
        &mut self,
        slice: Slice,
        config: SliceConfig,
        change: impl FnOnce(&mut Tile),
    ) -> Vec<Slice> {
        let [newest, second] = self.newest();
        let sums = self.slices.remove(&slice);
        let was_there = sums.is_some();
        let mut tile = sums.map_or_else(Arc::default, Sums::into_tile);
        change(Arc::make_mut(&mut tile));
        let is_there = !tile.is_empty();
        if is_there {
            self.slices.insert(slice, Sums::Open(tile));
        }
        if !was_there && !is_there {
            return Vec::new();
        }
        if was_there && is_there && newest == Some(slice) {
            // As it mostly is: the newest slice grows, and what lies below it stays.
            return Vec::new();
        }
        if was_there && is_there && second == Some(slice) {
            self.below_newest = self.on_top_of(self.below_open.as_ref(), slice, config);
            return Vec::new();
        }
        if is_there && newest < Some(slice) {
            // A slice begins.
            self.below_open = mem::take(&mut self.below_newest);
            if let Some(newest) = newest {
                self.below_newest = self.on_top_of(self.below_open.as_ref(), newest, config);
            }
            return second.filter(|second| self.pack(*second)).into_iter().collect();
        }
        self.hold(config)
    }

    /// What the tile reads as; `None` without evidence.
    pub(crate) fn reading(&self, config: SliceConfig) -> Option<Arc<Tile>> {
        let (newest, _) = self.slices.last_key_value()?;
        self.on_top_of(self.below_newest.as_ref(), *newest, config)
    }

    /// `below`, with the sums of a slice on top.
    fn on_top_of(
        &self,
        below: Option<&Arc<Tile>>,
        slice: Slice,
        config: SliceConfig,
    ) -> Option<Arc<Tile>> {
        let sums = self.slices.get(&slice)?.tile();
        Some(below.map_or(Arc::clone(&sums), |below| Arc::new(config.on_top(below, &sums))))
    }

    /// The newest slices, newest first.
    fn newest(&self) -> [Option<Slice>; OPEN] {
        let mut newest = self.slices.keys().rev().copied();
        std::array::from_fn(|_| newest.next())
    }

    /// Packs a slice; whether it was open.
    fn pack(&mut self, slice: Slice) -> bool {
        let Some(sums) = self.slices.get_mut(&slice).filter(|sums| matches!(sums, Sums::Open(_)))
        else {
            return false;
        };
        *sums = sums.clone().packed();
        true
    }

    /// Holds every slice as it should be, and reads anew what lies below the open ones. Returns the
    /// slices that were held in another way.
    fn hold(&mut self, config: SliceConfig) -> Vec<Slice> {
        let open = self.newest();
        let mut held_anew = Vec::new();
        let [newest, second] = open;
        (self.below_open, self.below_newest) = (None, None);
        let slices: Vec<Slice> = self.slices.keys().copied().collect();
        for slice in slices {
            let is_open = open.contains(&Some(slice));
            if is_open {
                let packed =
                    self.slices.get_mut(&slice).filter(|sums| matches!(sums, Sums::Packed(_)));
                if let Some(sums) = packed {
                    *sums = sums.clone().open();
                    held_anew.push(slice);
                }
            } else {
                self.below_open = self.on_top_of(self.below_open.as_ref(), slice, config);
                if self.pack(slice) {
                    held_anew.push(slice);
                }
            }
        }
        if let Some(second) = second.filter(|_| newest.is_some()) {
            self.below_newest = self.on_top_of(self.below_open.as_ref(), second, config);
        }
        held_anew
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

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
        change(stack, slice, |sums| sums.add(&patch(value)));
    }

    fn subtract(stack: &mut Stack, slice: i64, value: i16) {
        change(stack, slice, |sums| sums.subtract(&patch(value)));
    }

    /// Changes a slice, and sees that the stack is as one that is made of its sums, and that what it says is
    /// held in another way is just that.
    fn change(stack: &mut Stack, slice: i64, change: impl FnOnce(&mut Tile)) {
        let was_open = open(stack);
        let held_anew = stack.change(Slice(slice), CONFIG, change);
        let is_open = open(stack);
        let others = was_open.symmetric_difference(&is_open).filter(|other| other.0 != slice);
        let others: BTreeSet<Slice> =
            others.copied().filter(|other| stack.slices.contains_key(other)).collect();
        assert!(
            others.is_subset(&held_anew.iter().copied().collect()),
            "{held_anew:?}, {others:?}"
        );
        let anew = Stack::new(stack.slices.clone(), CONFIG);
        assert_eq!(is_open, open(&anew));
        assert_eq!(stack.slices, anew.slices);
        assert_eq!(stack.below_open, anew.below_open);
        assert_eq!(stack.below_newest, anew.below_newest);
    }

    fn open(stack: &Stack) -> BTreeSet<Slice> {
        let open = stack.slices.iter().filter(|(_, sums)| matches!(sums, Sums::Open(_)));
        open.map(|(slice, _)| *slice).collect()
    }

    #[test]
    fn only_the_newest_two_slices_are_held_open() {
        let mut stack = Stack::default();
        for day in 0..365 {
            add(&mut stack, day, 85);
        }
        assert_eq!(open(&stack), [Slice(363), Slice(364)].into());
        let bytes: usize = stack.slices.values().map(Sums::bytes).sum();
        assert_eq!(bytes, 2 * 16_384 + 363 * 9, "a run, two steps of two bytes, a run");
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
            prop_assert!(stack.slices.values().all(|sums| !sums.tile().is_empty()));
        }
    }
}
