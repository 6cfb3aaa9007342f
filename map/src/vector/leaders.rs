//! Grouping as a function of the set: leaders and those who follow them.
//!
//! All observations are ranked by merit, then by identity. The best is a leader; every next one
//! follows the leader before it that it pairs with best, and becomes a leader itself if it pairs
//! with none: the leaders are the lexicographically first maximal independent set of the pairing
//! graph. There is one such set for each set of observations, so arrival order does not matter, nor
//! does what was once there and has been taken out; and since everything in a group pairs with
//! the group's best member, groups cannot creep along chains of near neighbours.
//!
//! An insertion or removal is settled in rank order and touches only what comes later and pairs
//! with what has changed (compare Blelloch, Fineman and Shun 2012 on greedy maximal independent sets).

use std::collections::{BTreeMap, BTreeSet};

use crate::geometry::Point;
use crate::level::FeatureId;

/// An observation that can be grouped.
pub(super) trait Groupable {
    /// What pairing depends on besides the two observations.
    type Config;
    /// Lower left and upper right corner of what it can pair with.
    fn reach(&self) -> (Point, Point);
    /// Higher merit leads. Not NaN.
    fn merit(&self) -> f64;
    /// The cost of `follower` following `self`, lower is better; `None` if they do not pair.
    fn pairing(&self, follower: &Self, config: &Self::Config) -> Option<f64>;
}

/// Place in the order of merit; the smallest leads.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Rank {
    demerit: u64,
    pub(super) id: FeatureId,
}

impl Rank {
    fn of(merit: f64, id: FeatureId) -> Self {
        // The usual order-preserving map from floats to integers, turned round.
        let bits = merit.to_bits();
        let ascending = if bits >> 63 == 0 { bits | 1 << 63 } else { !bits };
        Self { demerit: !ascending, id }
    }
}

#[derive(Debug, Clone)]
struct Entry<T> {
    item: T,
    rank: Rank,
    /// The leader it follows; itself if it leads; `None` while that is not settled.
    leader: Option<FeatureId>,
}

/// Edge of a square of the spatial index, metres.
const INDEX_SIDE: f64 = 4.0;

/// A spatial index of identities by the squares that they reach into.
#[derive(Debug, Clone, Default)]
pub(super) struct SquareIndex {
    squares: BTreeMap<(i32, i32), Vec<FeatureId>>,
}

impl SquareIndex {
    fn squares((low, high): (Point, Point)) -> impl Iterator<Item = (i32, i32)> {
        let square = |v: f64| (v / INDEX_SIDE).floor() as i32;
        let (x0, x1, y0, y1) = (square(low.x), square(high.x), square(low.y), square(high.y));
        (x0..=x1).flat_map(move |x| (y0..=y1).map(move |y| (x, y)))
    }

    pub(super) fn insert(&mut self, id: FeatureId, reach: (Point, Point)) {
        for square in Self::squares(reach) {
            self.squares.entry(square).or_default().push(id);
        }
    }

    pub(super) fn remove(&mut self, id: FeatureId, reach: (Point, Point)) {
        for square in Self::squares(reach) {
            if let Some(ids) = self.squares.get_mut(&square) {
                ids.retain(|other| *other != id);
                if ids.is_empty() {
                    self.squares.remove(&square);
                }
            }
        }
    }

    /// All that reach into the same squares, ascending, each once.
    pub(super) fn near(&self, reach: (Point, Point)) -> Vec<FeatureId> {
        let mut ids: Vec<FeatureId> = Self::squares(reach)
            .filter_map(|square| self.squares.get(&square))
            .flatten()
            .copied()
            .collect();
        ids.sort_unstable();
        ids.dedup();
        ids
    }
}

/// Observations and their groups.
#[derive(Debug, Clone)]
pub(super) struct Leaders<T> {
    entries: BTreeMap<FeatureId, Entry<T>>,
    /// Who follows whom, by leader; a leader is in its own group.
    groups: BTreeMap<FeatureId, BTreeSet<FeatureId>>,
    everyone: SquareIndex,
    leading: SquareIndex,
}

impl<T> Default for Leaders<T> {
    fn default() -> Self {
        Self {
            entries: BTreeMap::new(),
            groups: BTreeMap::new(),
            everyone: SquareIndex::default(),
            leading: SquareIndex::default(),
        }
    }
}

impl<T: Groupable> Leaders<T> {
    /// Puts observations in and takes others out. Returns the leaders whose groups are new, changed
    /// or gone.
    pub(super) fn update(
        &mut self,
        inserted: Vec<(FeatureId, T)>,
        removed: &[FeatureId],
        config: &T::Config,
    ) -> BTreeSet<FeatureId> {
        let mut changed = BTreeSet::new();
        let mut unsettled: BTreeSet<Rank> = BTreeSet::new();
        for id in removed {
            self.take_out(*id, &mut changed, &mut unsettled);
        }
        for (id, item) in inserted {
            if self.entries.contains_key(&id) {
                continue;
            }
            let rank = Rank::of(item.merit(), id);
            self.everyone.insert(id, item.reach());
            self.entries.insert(id, Entry { item, rank, leader: None });
            unsettled.insert(rank);
        }
        while let Some(rank) = unsettled.pop_first() {
            self.settle(rank, config, &mut changed, &mut unsettled);
        }
        changed
    }

    /// The group of a leader in canonical order, the leader included; `None` if it leads none.
    pub(super) fn group(&self, leader: FeatureId) -> Option<impl Iterator<Item = (FeatureId, &T)>> {
        self.groups.get(&leader).map(|ids| {
            ids.iter().filter_map(|id| self.entries.get(id).map(|entry| (*id, &entry.item)))
        })
    }

    /// An observation and its rank.
    pub(super) fn get(&self, id: FeatureId) -> Option<(&T, Rank)> {
        self.entries.get(&id).map(|entry| (&entry.item, entry.rank))
    }

    fn take_out(
        &mut self,
        id: FeatureId,
        changed: &mut BTreeSet<FeatureId>,
        unsettled: &mut BTreeSet<Rank>,
    ) {
        let Some(entry) = self.entries.remove(&id) else { return };
        let reach = entry.item.reach();
        self.everyone.remove(id, reach);
        unsettled.remove(&entry.rank);
        match entry.leader {
            Some(leader) if leader == id => {
                self.leading.remove(id, reach);
                self.disband(id, changed, unsettled);
            }
            Some(leader) => {
                self.leave(id, leader, changed);
            }
            None => {}
        }
    }

    /// Ends the group of `leader`; all who followed have to settle anew.
    fn disband(
        &mut self,
        leader: FeatureId,
        changed: &mut BTreeSet<FeatureId>,
        unsettled: &mut BTreeSet<Rank>,
    ) {
        changed.insert(leader);
        for follower in self.groups.remove(&leader).unwrap_or_default() {
            if let Some(entry) = self.entries.get_mut(&follower)
                && follower != leader
            {
                entry.leader = None;
                unsettled.insert(entry.rank);
            }
        }
    }

    fn leave(&mut self, id: FeatureId, leader: FeatureId, changed: &mut BTreeSet<FeatureId>) {
        if let Some(group) = self.groups.get_mut(&leader) {
            group.remove(&id);
            changed.insert(leader);
        }
    }

    /// Settles one observation; everything before it in rank is settled already.
    fn settle(
        &mut self,
        rank: Rank,
        config: &T::Config,
        changed: &mut BTreeSet<FeatureId>,
        unsettled: &mut BTreeSet<Rank>,
    ) {
        let id = rank.id;
        let Some(entry) = self.entries.get(&id) else { return };
        let (before, reach) = (entry.leader, entry.item.reach());
        let now = self.best_leader(rank, config).unwrap_or(id);
        if before == Some(now) {
            return;
        }
        match before {
            Some(leader) if leader == id => {
                self.leading.remove(id, reach);
                self.disband(id, changed, unsettled);
            }
            Some(leader) => self.leave(id, leader, changed),
            None => {}
        }
        if let Some(entry) = self.entries.get_mut(&id) {
            entry.leader = Some(now);
        }
        self.groups.entry(now).or_default().insert(id);
        changed.insert(now);
        if now == id {
            self.leading.insert(id, reach);
            self.unsettle_followers(rank, config, unsettled);
        }
    }

    fn best_leader(&self, rank: Rank, config: &T::Config) -> Option<FeatureId> {
        let follower = &self.entries.get(&rank.id)?.item;
        let mut best: Option<(f64, FeatureId)> = None;
        for id in self.leading.near(follower.reach()) {
            let Some(leader) = self.entries.get(&id).filter(|leader| leader.rank < rank) else {
                continue;
            };
            if let Some(cost) = leader.item.pairing(follower, config)
                && best.is_none_or(|(least, _)| cost < least)
            {
                best = Some((cost, id));
            }
        }
        best.map(|(_, id)| id)
    }

    /// A new leader: whoever comes later and pairs with it may want to follow it.
    fn unsettle_followers(&self, rank: Rank, config: &T::Config, unsettled: &mut BTreeSet<Rank>) {
        let Some(leader) = self.entries.get(&rank.id) else { return };
        for id in self.everyone.near(leader.item.reach()) {
            if let Some(other) = self.entries.get(&id)
                && other.rank > rank
                && leader.item.pairing(&other.item, config).is_some()
            {
                unsettled.insert(other.rank);
            }
        }
    }
}
