//! Since when each thing of a map is as it is, things that are no more included.
//!
//! Persistent maps: a copy costs nothing and shares all that does not change afterwards. So a
//! snapshot can be published after every batch, however large the map is.

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Bound;
use std::sync::Arc;

use mapfold_map::level::{Changes, ContributionId, FeatureId, Level};
use mapfold_map::raster::{SensorClass, Slice, SliceKey, Sums, Tile, TileIndex, TileKey};
use mapfold_map::vector::{Chain, ChainId, Cluster, Segment};
use rpds::{RedBlackTreeMapSync, RedBlackTreeSetSync};

use super::prior::PriorHistory;
use super::walls::{self, WallHistory};

/// A key that no other comes before.
pub(super) trait Least: Ord + Copy {
    /// That key.
    const LEAST: Self;
}

impl Least for FeatureId {
    const LEAST: Self = Self { contribution: ContributionId([0; 16]), index: 0 };
}

impl Least for ChainId {
    const LEAST: Self = Self { segment: FeatureId::LEAST, piece: i16::MIN };
}

impl Least for TileKey {
    const LEAST: Self =
        Self { class: SensorClass::Scanner, tile: TileIndex { x: i32::MIN, y: i32::MIN } };
}

impl Least for SliceKey {
    const LEAST: Self = Self { key: TileKey::LEAST, slice: Slice(i64::MIN) };
}

/// A thing and the revision of its last change; `None` if it is no more.
#[derive(Debug)]
struct Dated<V> {
    revision: i64,
    value: Option<Arc<V>>,
}

/// All things of one kind that ever were in a map.
#[derive(Debug)]
pub(super) struct History<K: Least, V> {
    things: RedBlackTreeMapSync<K, Dated<V>>,
    by_revision: RedBlackTreeSetSync<(i64, K)>,
    live: usize,
}

impl<K: Least, V> Clone for History<K, V> {
    fn clone(&self) -> Self {
        Self { things: self.things.clone(), by_revision: self.by_revision.clone(), live: self.live }
    }
}

impl<K: Least, V> Default for History<K, V> {
    fn default() -> Self {
        Self {
            things: RedBlackTreeMapSync::new_sync(),
            by_revision: RedBlackTreeSetSync::new_sync(),
            live: 0,
        }
    }
}

impl<K: Least, V: PartialEq> History<K, V> {
    /// Notes that `key` is `value` from `revision` on; whether that is a change. A thing that
    /// never was and is not, is none.
    pub(super) fn record(&mut self, key: K, revision: i64, value: Option<Arc<V>>) -> bool {
        let same = match (self.things.get(&key).map(|dated| &dated.value), &value) {
            (None | Some(None), None) => true,
            (Some(Some(old)), Some(new)) => Arc::ptr_eq(old, new) || old == new,
            _ => false,
        };
        if !same {
            self.put(key, revision, value);
        } else if let Some(old) = self.things.get(&key) {
            // As it is held now: what is packed need not be kept open here.
            let revision = old.revision;
            self.things.insert_mut(key, Dated { revision, value });
        }
        !same
    }

    /// Notes that `key` is `value` and counts as changed at `revision`, whatever was known of it.
    pub(super) fn put(&mut self, key: K, revision: i64, value: Option<Arc<V>>) {
        if let Some(old) = self.things.get(&key) {
            self.by_revision.remove_mut(&(old.revision, key));
            self.live -= usize::from(old.value.is_some());
        }
        self.by_revision.insert_mut((revision, key));
        self.live += usize::from(value.is_some());
        self.things.insert_mut(key, Dated { revision, value });
    }

    /// The revision of the last change of all; 0 before the first.
    pub(super) fn changed_at(&self) -> i64 {
        self.by_revision.last().map_or(0, |(revision, _)| *revision)
    }

    /// Number of things that are.
    pub(super) fn live_count(&self) -> usize {
        self.live
    }

    /// The things that are, by key.
    pub(super) fn live(&self) -> impl Iterator<Item = (&K, &Arc<V>)> {
        self.things.iter().filter_map(|(key, dated)| Some((key, dated.value.as_ref()?)))
    }

    /// The things from `first` to `last` that are, by key.
    pub(super) fn live_between(&self, first: K, last: K) -> impl Iterator<Item = (&K, &Arc<V>)> {
        self.things
            .range((Bound::Included(first), Bound::Included(last)))
            .filter_map(|(key, dated)| Some((key, dated.value.as_ref()?)))
    }

    /// A thing, if it is or ever was, and the revision of its last change.
    pub(super) fn get(&self, key: &K) -> Option<(i64, Option<&Arc<V>>)> {
        self.things.get(key).map(|dated| (dated.revision, dated.value.as_ref()))
    }

    /// What changed after `since` and not after `until`, by revision.
    pub(super) fn changed(
        &self,
        since: i64,
        until: i64,
    ) -> impl Iterator<Item = (i64, K, Option<&Arc<V>>)> {
        let from = (since.saturating_add(1), K::LEAST);
        self.by_revision
            .range((Bound::Included(from), Bound::Unbounded))
            .take_while(move |(revision, _)| *revision <= until)
            .filter_map(|(revision, key)| {
                self.things.get(key).map(|dated| (*revision, *key, dated.value.as_ref()))
            })
    }
}

/// How much a step changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub(crate) struct ChangeCounts {
    /// Changed or removed segments, clusters and chains.
    pub(crate) features: u32,
    /// Changed or removed tiles.
    pub(crate) tiles: u32,
}

impl std::ops::AddAssign for ChangeCounts {
    fn add_assign(&mut self, other: Self) {
        self.features += other.features;
        self.tiles += other.tiles;
    }
}

/// The histories of a whole map.
#[derive(Debug, Clone, Default)]
pub(crate) struct MapHistory {
    /// Segments.
    pub(super) segments: History<FeatureId, Segment>,
    /// Clusters.
    pub(super) clusters: History<FeatureId, Cluster>,
    /// Chains.
    pub(super) chains: History<ChainId, Chain>,
    /// Tiles.
    pub(super) tiles: History<TileKey, Tile>,
    /// The sums that tiles are read from. Nobody is told of them; the store keeps them.
    pub(super) slices: History<SliceKey, Sums>,
    /// Tiles of the prior: of the log's imports, not of the fold.
    pub(super) prior: PriorHistory,
    /// What confirmed walls say, told from the segments.
    pub(super) walls: WallHistory,
}

impl MapHistory {
    /// Notes what a fold changed in `level` at `revision`.
    pub(super) fn record(
        &mut self,
        changes: &Changes,
        level: &Level,
        revision: i64,
    ) -> ChangeCounts {
        fn all<K: Least, V: PartialEq>(
            history: &mut History<K, V>,
            changed: &BTreeSet<K>,
            map: &BTreeMap<K, Arc<V>>,
            revision: i64,
        ) -> u32 {
            let mut count = 0;
            for key in changed {
                count += u32::from(history.record(*key, revision, map.get(key).cloned()));
            }
            count
        }
        for at in &changes.slices {
            self.slices.record(*at, revision, level.sums(at).cloned().map(Arc::new));
        }
        let map = level.map();
        let resolution = level.config().resolution;
        walls::follow(self, &changes.segments, map, resolution, revision);
        ChangeCounts {
            features: all(&mut self.segments, &changes.segments, &map.segments, revision)
                + all(&mut self.clusters, &changes.clusters, &map.clusters, revision)
                + all(&mut self.chains, &changes.chains, &map.chains, revision),
            tiles: all(&mut self.tiles, &changes.tiles, &map.tiles, revision),
        }
    }

    /// Whether all that `changes` names is in `level` as it is here.
    pub(super) fn agrees(&self, changes: &Changes, level: &Level) -> bool {
        fn all<K: Least, V: PartialEq>(
            history: &History<K, V>,
            changed: &BTreeSet<K>,
            map: &BTreeMap<K, Arc<V>>,
        ) -> bool {
            changed.iter().all(|key| history.get(key).and_then(|(_, value)| value) == map.get(key))
        }
        let sums_agree = |at: &SliceKey| {
            let noted = self.slices.get(at).and_then(|(_, sums)| sums);
            noted.map(AsRef::as_ref) == level.sums(at)
        };
        let map = level.map();
        changes.slices.iter().all(sums_agree)
            && all(&self.segments, &changes.segments, &map.segments)
            && all(&self.clusters, &changes.clusters, &map.clusters)
            && all(&self.chains, &changes.chains, &map.chains)
            && all(&self.tiles, &changes.tiles, &map.tiles)
    }

    /// The largest revision such that at most `limit` things changed after `since` and up to it,
    /// but never less than the first at which something changed; `None` if no more than `limit`
    /// changed in all.
    pub(super) fn cut(&self, since: i64, limit: usize) -> Option<i64> {
        fn revisions<K: Least, V: PartialEq>(
            history: &History<K, V>,
            since: i64,
            limit: usize,
            to: &mut Vec<i64>,
        ) {
            to.extend(
                history.changed(since, i64::MAX).take(limit.saturating_add(1)).map(|(r, ..)| r),
            );
        }
        let mut changed = Vec::new();
        revisions(&self.segments, since, limit, &mut changed);
        revisions(&self.clusters, since, limit, &mut changed);
        revisions(&self.chains, since, limit, &mut changed);
        revisions(&self.tiles, since, limit, &mut changed);
        revisions(&self.prior, since, limit, &mut changed);
        if changed.len() <= limit {
            return None;
        }
        changed.sort_unstable();
        let first = changed[0];
        let beyond = changed[limit];
        // All of `beyond`'s changes do not fit; those before it do.
        Some(changed.iter().rev().copied().find(|r| *r < beyond).unwrap_or(first))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(index: u16) -> FeatureId {
        FeatureId { contribution: ContributionId([1; 16]), index }
    }

    fn changed(history: &History<FeatureId, u8>, since: i64) -> Vec<(i64, u16, Option<u8>)> {
        history
            .changed(since, i64::MAX)
            .map(|(revision, key, value)| (revision, key.index, value.map(|v| **v)))
            .collect()
    }

    #[test]
    fn a_history_keeps_the_last_change_of_each_thing_and_tombstones() {
        let mut history = History::default();
        assert!(history.record(key(0), 1, Some(Arc::new(7))));
        assert!(history.record(key(1), 1, Some(Arc::new(8))));
        assert!(history.record(key(0), 2, Some(Arc::new(9))));
        assert!(history.record(key(1), 3, None));
        assert_eq!(changed(&history, 0), [(2, 0, Some(9)), (3, 1, None)]);
        assert_eq!(changed(&history, 2), [(3, 1, None)]);
        assert_eq!(history.live_count(), 1);
        assert_eq!(history.get(&key(1)), Some((3, None)));
    }

    #[test]
    fn what_stays_equal_or_never_was_is_no_change() {
        let mut history = History::default();
        assert!(history.record(key(0), 1, Some(Arc::new(7))));
        assert!(!history.record(key(0), 2, Some(Arc::new(7))));
        assert!(!history.record(key(5), 2, None));
        assert_eq!(changed(&history, 0), [(1, 0, Some(7))]);
    }

    #[test]
    fn a_copy_stays_as_it_was() {
        let mut history = History::default();
        history.record(key(0), 1, Some(Arc::new(7)));
        let before = history.clone();
        history.record(key(0), 2, None);
        assert_eq!(changed(&before, 0), [(1, 0, Some(7))]);
        assert_eq!(before.live_count(), 1);
        assert_eq!(history.live_count(), 0);
    }
}
