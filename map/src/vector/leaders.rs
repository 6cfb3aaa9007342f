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

use super::slots::{Slot, Slots};
use super::squares::{Extent, Squares};
use crate::level::FeatureId;

/// An observation that can be grouped.
pub(super) trait Groupable {
    /// What pairing depends on besides the two observations.
    type Config;
    /// Lower left and upper right corner of what it can pair with.
    fn reach(&self) -> Extent;
    /// Higher merit leads. Not NaN.
    fn merit(&self) -> f64;
    /// The cost of `follower` following `self`, lower is better; `None` if they do not pair. Only
    /// what overlaps in reach pairs.
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

/// An observation and the place where it is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Member {
    pub(crate) id: FeatureId,
    pub(super) slot: Slot,
}

#[derive(Debug, Clone)]
struct Entry<T> {
    item: T,
    rank: Rank,
    /// The leader it follows; itself if it leads; `None` while that is not settled.
    leader: Option<Member>,
    /// Of a leader: who follows it, itself among them, in canonical order.
    group: Vec<Member>,
}

/// Observations and their groups.
#[derive(Debug, Clone)]
pub(super) struct Leaders<T> {
    slots: BTreeMap<FeatureId, Slot>,
    entries: Slots<Entry<T>>,
    everyone: Squares<Slot>,
    leading: Squares<Slot>,
    pairings: u64,
}

impl<T> Default for Leaders<T> {
    fn default() -> Self {
        Self {
            slots: BTreeMap::new(),
            entries: Slots::default(),
            everyone: Squares::default(),
            leading: Squares::default(),
            pairings: 0,
        }
    }
}

/// What an update has to do, and what it has done.
#[derive(Default)]
struct Progress {
    changed: BTreeSet<Member>,
    unsettled: BTreeMap<Rank, Slot>,
    pairings: u64,
}

impl<T: Groupable> Leaders<T> {
    /// Puts observations in and takes others out. Returns the leaders whose groups are new, changed
    /// or gone.
    pub(super) fn update(
        &mut self,
        inserted: impl Iterator<Item = (FeatureId, T)>,
        removed: &[FeatureId],
        config: &T::Config,
    ) -> BTreeSet<Member> {
        let mut progress = Progress::default();
        // Their places may be given to others only when nobody refers to them any more.
        let emptied: Vec<Slot> =
            removed.iter().filter_map(|id| self.take_out(*id, &mut progress)).collect();
        for (id, item) in inserted {
            if self.slots.contains_key(&id) {
                continue;
            }
            let rank = Rank::of(item.merit(), id);
            let reach = item.reach();
            let slot = self.entries.add(Entry { item, rank, leader: None, group: Vec::new() });
            self.slots.insert(id, slot);
            self.everyone.insert(slot, reach);
            progress.unsettled.insert(rank, slot);
        }
        while let Some((_, slot)) = progress.unsettled.pop_first() {
            self.settle(slot, config, &mut progress);
        }
        self.entries.release(emptied);
        self.pairings += progress.pairings;
        progress.changed
    }

    /// How many pairs have been held against each other.
    pub(super) fn pairings(&self) -> u64 {
        self.pairings
    }

    /// The group of a leader in canonical order, the leader included; `None` if it leads none.
    pub(super) fn group(&self, leader: Member) -> Option<impl Iterator<Item = (FeatureId, &T)>> {
        let entry = self.entries.get(leader.slot).filter(|entry| entry.leader == Some(leader))?;
        let members = entry.group.iter();
        Some(members.filter_map(|m| self.entries.get(m.slot).map(|entry| (m.id, &entry.item))))
    }

    /// The observation of a leader and its rank.
    pub(super) fn leader(&self, leader: Member) -> Option<(&T, Rank)> {
        let entry = self.entries.get(leader.slot).filter(|entry| entry.leader == Some(leader))?;
        Some((&entry.item, entry.rank))
    }

    /// Returns the place that is empty now.
    fn take_out(&mut self, id: FeatureId, progress: &mut Progress) -> Option<Slot> {
        let slot = self.slots.remove(&id)?;
        let entry = self.entries.take(slot)?;
        let (reach, own) = (entry.item.reach(), Member { id, slot });
        self.everyone.remove(slot, reach);
        progress.unsettled.remove(&entry.rank);
        match entry.leader {
            Some(leader) if leader == own => {
                self.leading.remove(slot, reach);
                self.disband(own, entry.group, progress);
            }
            Some(leader) => self.leave(own, leader, progress),
            None => {}
        }
        Some(slot)
    }

    /// Ends the group of `leader`; all who followed have to settle anew.
    fn disband(&mut self, leader: Member, group: Vec<Member>, progress: &mut Progress) {
        progress.changed.insert(leader);
        for follower in group {
            if follower != leader
                && let Some(entry) = self.entries.get_mut(follower.slot)
            {
                entry.leader = None;
                progress.unsettled.insert(entry.rank, follower.slot);
            }
        }
    }

    fn leave(&mut self, own: Member, leader: Member, progress: &mut Progress) {
        if let Some(entry) = self.entries.get_mut(leader.slot) {
            entry.group.retain(|member| *member != own);
            progress.changed.insert(leader);
        }
    }

    /// Settles one observation; everything before it in rank is settled already.
    fn settle(&mut self, slot: Slot, config: &T::Config, progress: &mut Progress) {
        let Some(entry) = self.entries.get(slot) else { return };
        let (before, reach, rank) = (entry.leader, entry.item.reach(), entry.rank);
        let own = Member { id: rank.id, slot };
        let now = self.best_leader(entry, config, &mut progress.pairings).unwrap_or(own);
        if before == Some(now) {
            return;
        }
        match before {
            Some(leader) if leader == own => {
                self.leading.remove(slot, reach);
                let group = self.entries.get_mut(slot).map(|e| std::mem::take(&mut e.group));
                self.disband(own, group.unwrap_or_default(), progress);
            }
            Some(leader) => self.leave(own, leader, progress),
            None => {}
        }
        if let Some(entry) = self.entries.get_mut(slot) {
            entry.leader = Some(now);
        }
        if let Some(leader) = self.entries.get_mut(now.slot) {
            let at = leader.group.partition_point(|member| member.id < own.id);
            leader.group.insert(at, own);
        }
        progress.changed.insert(now);
        if now == own {
            self.leading.insert(slot, reach);
            self.unsettle_followers(slot, config, progress);
        }
    }

    fn best_leader(
        &self,
        follower: &Entry<T>,
        config: &T::Config,
        pairings: &mut u64,
    ) -> Option<Member> {
        let mut best: Option<(f64, Member)> = None;
        for slot in self.leading.near(follower.item.reach()) {
            let Some(leader) = self.entries.get(slot).filter(|entry| entry.rank < follower.rank)
            else {
                continue;
            };
            let member = Member { id: leader.rank.id, slot };
            *pairings += 1;
            if let Some(cost) = leader.item.pairing(&follower.item, config)
                && best.is_none_or(|(least, other)| {
                    cost < least || (cost <= least && member.id < other.id)
                })
            {
                best = Some((cost, member));
            }
        }
        best.map(|(_, member)| member)
    }

    /// A new leader: whoever comes later and pairs with it may want to follow it.
    fn unsettle_followers(&self, slot: Slot, config: &T::Config, progress: &mut Progress) {
        let Some(leader) = self.entries.get(slot) else { return };
        for slot in self.everyone.near(leader.item.reach()) {
            let Some(other) = self.entries.get(slot).filter(|other| other.rank > leader.rank)
            else {
                continue;
            };
            progress.pairings += 1;
            if leader.item.pairing(&other.item, config).is_some() {
                progress.unsettled.insert(other.rank, slot);
            }
        }
    }
}
