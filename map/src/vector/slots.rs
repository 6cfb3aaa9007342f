//! Things in numbered places, so that those that belong together are found without a search.
//!
//! Maps from identities grow deeper with the level, and every step of a search is a miss in a cache
//! of the processor. Inside the fold things refer to each other by their places; identities are
//! looked up once for each observation that comes or goes. Places depend on the order of arrival,
//! so nothing that is published may depend on them.

/// Things of a block, which are stored side by side.
const BLOCK: usize = 64;

/// A place.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Slot(u32);

impl Slot {
    fn split(self) -> (usize, usize) {
        let at = self.0 as usize;
        (at / BLOCK, at % BLOCK)
    }
}

/// Things by their places. Growing moves none of them.
#[derive(Debug, Clone)]
pub(super) struct Slots<T> {
    blocks: Vec<Vec<Option<T>>>,
    free: Vec<Slot>,
}

impl<T> Default for Slots<T> {
    fn default() -> Self {
        Self { blocks: Vec::new(), free: Vec::new() }
    }
}

impl<T> Slots<T> {
    pub(super) fn get(&self, slot: Slot) -> Option<&T> {
        let (block, at) = slot.split();
        self.blocks.get(block)?.get(at)?.as_ref()
    }

    pub(super) fn get_mut(&mut self, slot: Slot) -> Option<&mut T> {
        let (block, at) = slot.split();
        self.blocks.get_mut(block)?.get_mut(at)?.as_mut()
    }

    /// Puts a thing into a place of its own.
    pub(super) fn add(&mut self, thing: T) -> Slot {
        let slot = self.free.pop().unwrap_or_else(|| {
            let last = self.blocks.last().map_or(0, Vec::len);
            let before = BLOCK * self.blocks.len().saturating_sub(1);
            Slot((before + last) as u32)
        });
        self.put(slot, thing);
        slot
    }

    /// Empties a place that [`Self::add`] gave. It is not given again before [`Self::release`].
    pub(super) fn take(&mut self, slot: Slot) -> Option<T> {
        let (block, at) = slot.split();
        self.blocks.get_mut(block)?.get_mut(at)?.take()
    }

    /// Lets places be given again that are empty by now.
    pub(super) fn release(&mut self, slots: impl IntoIterator<Item = Slot>) {
        self.free.extend(slots);
    }

    /// Puts a thing into a place that another collection has given.
    pub(super) fn put(&mut self, slot: Slot, thing: T) {
        let (block, at) = slot.split();
        while self.blocks.len() <= block {
            self.blocks.push(Vec::with_capacity(BLOCK));
        }
        let things = &mut self.blocks[block];
        while things.len() <= at {
            things.push(None);
        }
        things[at] = Some(thing);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_are_given_once_until_they_are_released() {
        let mut slots = Slots::default();
        let given: Vec<Slot> = (0..200).map(|number| slots.add(number)).collect();
        assert!(given.windows(2).all(|pair| pair[0] < pair[1]));
        for (number, slot) in given.iter().enumerate() {
            assert_eq!(slots.get(*slot), Some(&number));
        }
        assert_eq!(slots.take(given[70]), Some(70));
        assert_eq!(slots.get(given[70]), None);
        assert!(!given.contains(&slots.add(200)));
        slots.release([given[70]]);
        assert_eq!(slots.add(201), given[70]);
        assert_eq!(slots.get_mut(given[70]), Some(&mut 201));
    }

    #[test]
    fn another_collection_may_use_the_same_places() {
        let (mut slots, mut beside) = (Slots::default(), Slots::default());
        let last = (0..130).map(|number| slots.add(number)).last().unwrap();
        beside.put(last, "beside");
        assert_eq!(beside.get(last), Some(&"beside"));
        assert_eq!(beside.get(Slot(5)), None);
        assert_eq!(beside.take(last), Some("beside"));
        assert_eq!(beside.take(last), None);
    }
}
