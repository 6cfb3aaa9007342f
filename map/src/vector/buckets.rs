//! Things in lists by where they belong: a list that is empty is none.

use std::collections::BTreeMap;

/// Lists of things.
#[derive(Debug, Clone)]
pub(super) struct Buckets<P, T> {
    lists: BTreeMap<P, Vec<T>>,
}

impl<P, T> Default for Buckets<P, T> {
    fn default() -> Self {
        Self { lists: BTreeMap::new() }
    }
}

impl<P: Ord, T> Buckets<P, T> {
    pub(super) fn insert(&mut self, place: P, thing: T) {
        self.lists.entry(place).or_default().push(thing);
    }

    /// Removes the first thing there that `is_it`.
    pub(super) fn remove(&mut self, place: &P, is_it: impl FnMut(&T) -> bool) {
        if let Some(things) = self.lists.get_mut(place) {
            if let Some(at) = things.iter().position(is_it) {
                things.swap_remove(at);
            }
            if things.is_empty() {
                self.lists.remove(place);
            }
        }
    }

    /// What is there, in no order that may be relied upon.
    pub(super) fn at(&self, place: &P) -> &[T] {
        self.lists.get(place).map_or(&[], Vec::as_slice)
    }

    #[cfg(test)]
    pub(super) fn is_empty(&self) -> bool {
        self.lists.is_empty()
    }
}
