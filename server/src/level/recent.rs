//! A few things that cost something to make and were asked for last.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Things by their keys, so many at the most: a new one takes the place of the one that was not asked for longest.
/// Few enough to be looked through one by one.
#[derive(Debug)]
pub(super) struct Recent<K, V> {
    most: usize,
    /// The last one asked for last.
    kept: Mutex<Vec<(K, Arc<V>)>>,
}

impl<K: PartialEq, V> Recent<K, V> {
    /// Keeps at most so many.
    pub(super) fn new(most: usize) -> Self {
        Self { most, kept: Mutex::default() }
    }

    /// The thing of a key, if it is kept.
    pub(super) fn get(&self, key: &K) -> Option<Arc<V>> {
        let mut kept = self.kept();
        let at = kept.iter().position(|(other, _)| other == key)?;
        let found = kept.remove(at);
        let thing = Arc::clone(&found.1);
        kept.push(found);
        Some(thing)
    }

    /// Keeps a thing under a key, in the place of what was there.
    pub(super) fn put(&self, key: K, thing: &Arc<V>) {
        let mut kept = self.kept();
        kept.retain(|(other, _)| *other != key);
        if kept.len() >= self.most {
            kept.remove(0);
        }
        kept.push((key, Arc::clone(thing)));
    }

    fn kept(&self) -> MutexGuard<'_, Vec<(K, Arc<V>)>> {
        // Nothing that runs under this lock can leave it half done.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_asked_for_longest_makes_room() {
        let recent = Recent::new(2);
        recent.put("a", &Arc::new(1));
        recent.put("b", &Arc::new(2));
        assert_eq!(recent.get(&"a").as_deref(), Some(&1));
        recent.put("c", &Arc::new(3));
        assert_eq!(["a", "b", "c"].map(|key| recent.get(&key).is_some()), [true, false, true]);
        recent.put("c", &Arc::new(4));
        assert_eq!(recent.get(&"c").as_deref(), Some(&4));
        assert_eq!(
            recent.get(&"a").as_deref(),
            Some(&1),
            "another of its own key takes nobody's place"
        );
    }
}
