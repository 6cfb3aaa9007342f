//! All chains of a level: published segments in, published chains out, as a function of the set.
//!
//! Of all possible joints the best is made first, every end once: a greedy matching, which falls
//! apart into the connected components of the graph of possible joints. A component is a few ends in one
//! place, so a changed segment settles the ends next to it anew and no others; then the chains through
//! whatever is joined otherwise than before are formed anew. That last step costs O(n log n) in
//! the pieces of those chains, and no chain has more than `config.chain_pieces_max`.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::by_block::ByBlock;
use super::chain::{Chain, ChainId};
use super::ends::Ends;
use super::gap::Gap;
use super::joinable::{Joinable, Joined, Possible};
use super::joint::Joint;
use super::leaders::Member;
use super::outline::{self, Link};
use super::piece::{PieceAt, PieceKey};
use super::seen_through::Evidence;
use super::slots::Slots;
use super::walls::Walls;
use super::{VectorConfig, Work};
use crate::raster::Touched;

/// A joint from the head of one piece to the tail of another.
type JointAt = (PieceAt, PieceAt);

/// The state of the chains.
#[derive(Debug, Clone, Default)]
pub(crate) struct Chains {
    /// In the places of the segments' walls.
    joinable: Slots<Box<Joinable>>,
    heads: Ends,
    tails: Ends,
    by_block: ByBlock<JointAt>,
    work: Work,
}

/// What an update has to look at again.
#[derive(Default)]
struct Unsettled {
    /// Pieces that a joint could leave or reach otherwise than before.
    pieces: BTreeSet<PieceAt>,
    /// Pieces whose chains have to be formed anew.
    chains: BTreeSet<PieceAt>,
    /// Chains that may be no more.
    gone: BTreeSet<ChainId>,
}

impl Chains {
    /// Follows what [`Walls::update`] changed. Published chains are brought up to date in
    /// `published`; returns those that are new, different or gone.
    pub(crate) fn update<E: Evidence>(
        &mut self,
        changed: &BTreeSet<Member>,
        touched: &Touched,
        walls: &Walls,
        grid: &E,
        published: &mut BTreeMap<ChainId, Arc<Chain>>,
        config: &VectorConfig,
    ) -> BTreeSet<ChainId> {
        let mut unsettled = Unsettled::default();
        for member in changed {
            self.take_out(*member, &mut unsettled);
        }
        for member in changed {
            if let Some((segment, rank, middle)) = walls.published(*member) {
                self.put_in(*member, Joinable::new(segment, rank, &middle, config));
            }
        }
        for member in changed {
            self.find_joints(*member, grid, config, &mut unsettled);
        }
        self.look_again(touched, grid, config, &mut unsettled);
        self.settle(&mut unsettled);
        self.form(unsettled, published, config)
    }

    /// What this has done so far.
    pub(crate) fn work(&self) -> Work {
        self.work
    }

    /// Forgets a segment's pieces, their joints, and the chains through them.
    fn take_out(&mut self, member: Member, unsettled: &mut Unsettled) {
        let slot = member.slot;
        if self.joinable.get(slot).is_none_or(|old| old.rank.id != member.id) {
            return;
        }
        let Some(old) = self.joinable.take(slot) else { return };
        for (part, joined) in (0_u16..).zip(old.pieces) {
            let own = PieceAt { slot, part };
            self.heads.remove(own, joined.piece.head.at);
            self.tails.remove(own, joined.piece.tail.at);
            for possible in joined.possible {
                self.by_block.remove((own, possible.to), &possible.depends_on);
                if let Some(other) = self.joined_mut(possible.to) {
                    other.before.retain(|piece| *piece != own);
                    unsettled.pieces.insert(possible.to);
                }
            }
            for before in joined.before {
                let Some(other) = self.joined_mut(before) else { continue };
                let at = other.possible.iter().position(|possible| possible.to == own);
                if let Some(possible) = at.map(|at| other.possible.swap_remove(at)) {
                    self.by_block.remove((before, own), &possible.depends_on);
                    unsettled.pieces.insert(before);
                }
            }
            if let Some(next) = joined.next
                && let Some(other) = self.joined_mut(next)
            {
                other.previous = None;
                unsettled.chains.insert(next);
            }
            if let Some(previous) = joined.previous
                && let Some(other) = self.joined_mut(previous)
            {
                other.next = None;
                unsettled.chains.insert(previous);
            }
            unsettled.gone.extend(joined.chain);
        }
    }

    fn put_in(&mut self, member: Member, joinable: Joinable) {
        let slot = member.slot;
        for (part, joined) in (0_u16..).zip(&joinable.pieces) {
            self.heads.insert(PieceAt { slot, part }, joined.piece.head.at);
            self.tails.insert(PieceAt { slot, part }, joined.piece.tail.at);
        }
        self.joinable.put(slot, Box::new(joinable));
    }

    /// Finds all joints that could be made with a segment's pieces.
    fn find_joints<E: Evidence>(
        &mut self,
        member: Member,
        grid: &E,
        config: &VectorConfig,
        unsettled: &mut Unsettled,
    ) {
        let slot = member.slot;
        let Some(segment) = self.joinable.get(slot) else { return };
        let mut found = Vec::new();
        let reach = (2.0 * config.joint_max).max(config.gap_max + config.duplicate_offset);
        for (part, joined) in (0_u16..).zip(&segment.pieces) {
            let own = PieceAt { slot, part };
            unsettled.pieces.insert(own);
            unsettled.chains.insert(own);
            found.extend(self.tails.near(joined.piece.head.at, reach).map(|other| (own, other)));
            found.extend(self.heads.near(joined.piece.tail.at, reach).map(|other| (other, own)));
        }
        self.work.joints += found.len() as u64;
        for (from, to) in found {
            let Some((a, b)) = self.joined(from).zip(self.joined(to)) else { continue };
            if from == to || b.before.contains(&from) {
                continue;
            }
            let Some(joint) = Joint::new(&a.piece, &b.piece, config) else { continue };
            let gap = Gap::new(&a.piece, &b.piece, &joint.vertex.at, config);
            self.work.gaps_against_grid += 1;
            let depends_on = gap.blocks(grid.resolution());
            let is_seen_through = gap.is_seen_through(grid, config);
            unsettled.pieces.extend([from, to]);
            self.by_block.insert((from, to), &depends_on);
            if let Some(a) = self.joined_mut(from) {
                a.possible.push(Possible { to, joint, gap, depends_on, is_seen_through });
            }
            if let Some(b) = self.joined_mut(to) {
                b.before.push(from);
            }
        }
    }

    /// Looks again through the gaps whose evidence has changed.
    fn look_again<E: Evidence>(
        &mut self,
        touched: &Touched,
        grid: &E,
        config: &VectorConfig,
        unsettled: &mut Unsettled,
    ) {
        let joints: BTreeSet<JointAt> = self.by_block.touched(touched).collect();
        self.work.gaps_against_grid += joints.len() as u64;
        for (from, to) in joints {
            let Some(joined) = self.joined_mut(from) else { continue };
            for possible in joined.possible.iter_mut().filter(|possible| possible.to == to) {
                let is_seen_through = possible.gap.is_seen_through(grid, config);
                if is_seen_through != possible.is_seen_through {
                    possible.is_seen_through = is_seen_through;
                    unsettled.pieces.extend([from, to]);
                }
            }
        }
    }

    /// Makes the joints anew in every component that holds an unsettled piece's end.
    fn settle(&mut self, unsettled: &mut Unsettled) {
        let mut component: Vec<JointAt> = unsettled
            .pieces
            .iter()
            .flat_map(|at| self.joints_from(*at).chain(self.joints_to(*at)))
            .collect();
        let mut done: BTreeSet<JointAt> = BTreeSet::new();
        let mut at = 0;
        while let Some(joint) = component.get(at).copied() {
            at += 1;
            if done.insert(joint) {
                component.extend(self.joints_from(joint.0));
                component.extend(self.joints_to(joint.1));
            }
        }
        let mut best_first: Vec<(f64, [PieceKey; 2], JointAt)> = done
            .iter()
            .filter_map(|joint| {
                let possible = self.possible(*joint).filter(|p| !p.is_seen_through)?;
                let keys = [self.key(joint.0)?, self.key(joint.1)?];
                Some((possible.joint.cost, keys, *joint))
            })
            .collect();
        best_first.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut before: BTreeSet<JointAt> = BTreeSet::new();
        for (from, to) in done {
            if self.joined(from).is_some_and(|joined| joined.next == Some(to)) {
                before.insert((from, to));
                self.join((from, to), false);
            }
        }
        let mut after: BTreeSet<JointAt> = BTreeSet::new();
        for (_, _, (from, to)) in best_first {
            let is_free = self.joined(from).is_some_and(|joined| joined.next.is_none())
                && self.joined(to).is_some_and(|joined| joined.previous.is_none());
            if is_free {
                self.join((from, to), true);
                after.insert((from, to));
            }
        }
        for joint in before.symmetric_difference(&after) {
            unsettled.chains.extend([joint.0, joint.1]);
        }
    }

    /// Makes a joint or opens it.
    fn join(&mut self, (from, to): JointAt, is_joined: bool) {
        if let Some(joined) = self.joined_mut(from) {
            joined.next = is_joined.then_some(to);
        }
        if let Some(joined) = self.joined_mut(to) {
            joined.previous = is_joined.then_some(from);
        }
    }

    /// Forms the chains through the unsettled pieces anew and publishes them.
    fn form(
        &mut self,
        unsettled: Unsettled,
        published: &mut BTreeMap<ChainId, Arc<Chain>>,
        config: &VectorConfig,
    ) -> BTreeSet<ChainId> {
        let Unsettled { chains, mut gone, .. } = unsettled;
        let mut formed: BTreeMap<ChainId, Chain> = BTreeMap::new();
        let mut seen: BTreeSet<PieceAt> = BTreeSet::new();
        for at in chains {
            if seen.contains(&at) || self.joined(at).is_none() {
                continue;
            }
            let (links, is_closed) = self.links_through(at);
            self.work.chain_pieces += links.len() as u64;
            for link in &links {
                seen.insert(link.at);
                gone.extend(self.joined_mut(link.at).and_then(|joined| joined.chain.take()));
            }
            for part in outline::simple_parts(links, is_closed, config) {
                let (id, chain) = part.chain(&self.joinable);
                for link in &part.links {
                    if let Some(joined) = self.joined_mut(link.at) {
                        joined.chain = Some(id);
                    }
                }
                formed.insert(id, chain);
            }
        }
        let mut changed = BTreeSet::new();
        for id in gone {
            if !formed.contains_key(&id) && published.remove(&id).is_some() {
                changed.insert(id);
            }
        }
        for (id, chain) in formed {
            if published.get(&id).is_none_or(|old| **old != chain) {
                published.insert(id, Arc::new(chain));
                changed.insert(id);
            }
        }
        changed
    }

    /// The pieces that are joined with one, in order, each with the joint that leaves it, and
    /// whether they come full circle. A circle begins with its least piece.
    fn links_through(&self, at: PieceAt) -> (Vec<Link>, bool) {
        let mut first = at;
        while let Some(previous) = self.joined(first).and_then(|joined| joined.previous) {
            first = previous;
            if first == at {
                break;
            }
        }
        let mut links = Vec::new();
        let (mut next, mut is_closed) = (Some(first), false);
        while let Some(at) = next {
            let Some((joined, key)) = self.joined(at).zip(self.key(at)) else { break };
            let joint = joined.next.and_then(|next| Some(self.possible((at, next))?.joint));
            links.push(Link { key, at, piece: joined.piece.clone(), joint });
            is_closed = joined.next == Some(first);
            next = joined.next.filter(|_| !is_closed);
        }
        let least = (0..links.len()).min_by_key(|link| links[*link].key);
        if let Some(least) = least.filter(|_| is_closed) {
            links.rotate_left(least);
        }
        (links, is_closed)
    }

    fn joined(&self, at: PieceAt) -> Option<&Joined> {
        self.joinable.get(at.slot)?.pieces.get(usize::from(at.part))
    }

    fn joined_mut(&mut self, at: PieceAt) -> Option<&mut Joined> {
        self.joinable.get_mut(at.slot)?.pieces.get_mut(usize::from(at.part))
    }

    fn key(&self, at: PieceAt) -> Option<PieceKey> {
        Some(self.joinable.get(at.slot)?.key(at.part))
    }

    fn possible(&self, (from, to): JointAt) -> Option<&Possible> {
        self.joined(from)?.possible.iter().find(|possible| possible.to == to)
    }

    fn joints_from(&self, at: PieceAt) -> impl Iterator<Item = JointAt> + '_ {
        let possible = self.joined(at).into_iter().flat_map(|joined| &joined.possible);
        possible.map(move |possible| (at, possible.to))
    }

    fn joints_to(&self, at: PieceAt) -> impl Iterator<Item = JointAt> + '_ {
        let before = self.joined(at).into_iter().flat_map(|joined| &joined.before);
        before.map(move |before| (*before, at))
    }
}
