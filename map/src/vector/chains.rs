//! All chains of a level: published segments in, published chains out, as a function of the set.
//!
//! Of all possible joints the best is made first, every end once: a greedy matching, which falls
//! apart into the connected components of the graph of possible joints. A component is a few ends in one
//! place, so a changed segment settles the ends next to it anew and no others; then the chains through
//! whatever is joined otherwise than before are formed anew. That last step costs O(n log n) in
//! the pieces of those chains, and no chain has more than `config.chain_pieces_max`.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::by_tile::ByTile;
use super::chain::{Chain, ChainId};
use super::gap::Gap;
use super::joint::Joint;
use super::leaders::Rank;
use super::outline::{self, Link};
use super::piece::{Piece, PieceKey};
use super::seen_through::Evidence;
use super::walls::Walls;
use super::{Segment, VectorConfig};
use crate::geometry::Point;
use crate::level::FeatureId;
use crate::raster::TileIndex;

/// The pieces of a published segment.
#[derive(Debug, Clone)]
pub(super) struct Published {
    pub(super) pieces: Vec<Piece>,
    /// Of the founding observation.
    pub(super) rank: Rank,
    /// The piece nearest to the middle of the founding observation.
    founding: u16,
}

impl Published {
    /// The identity of a chain that is called after one of these pieces.
    pub(super) fn chain_id(&self, key: PieceKey) -> ChainId {
        let piece = i32::from(key.part) - i32::from(self.founding);
        ChainId { segment: key.segment, piece: piece.clamp(-32_768, 32_767) as i16 }
    }
}

/// A joint from the head of one piece to the tail of another.
type JointKey = (PieceKey, PieceKey);

/// A joint that could be made.
#[derive(Debug, Clone)]
struct Possible {
    joint: Joint,
    gap: Gap,
    tiles: Vec<TileIndex>,
    is_seen_through: bool,
}

/// The state of the chains.
#[derive(Debug, Clone, Default)]
pub(crate) struct Chains {
    published: BTreeMap<FeatureId, Published>,
    heads: EndIndex,
    tails: EndIndex,
    possible: BTreeMap<JointKey, Possible>,
    /// The same joints, tail first.
    by_tail: BTreeSet<(PieceKey, PieceKey)>,
    by_tile: ByTile<JointKey>,
    /// The joints that are made, by the piece that they leave and by the one that they reach.
    next: BTreeMap<PieceKey, PieceKey>,
    previous: BTreeMap<PieceKey, PieceKey>,
    chain_of: BTreeMap<PieceKey, ChainId>,
}

/// What an update has to look at again.
#[derive(Default)]
struct Unsettled {
    /// Pieces that a joint could leave or reach otherwise than before.
    pieces: BTreeSet<PieceKey>,
    /// Pieces whose chains have to be formed anew.
    chains: BTreeSet<PieceKey>,
    /// Chains that may be no more.
    gone: BTreeSet<ChainId>,
}

impl Chains {
    /// Follows what [`Walls::update`] changed. Published chains are brought up to date in
    /// `published`; returns those that are new, different or gone.
    #[expect(clippy::too_many_arguments, reason = "the map's layers and what changed in them")]
    pub(crate) fn update<E: Evidence>(
        &mut self,
        changed: &BTreeSet<FeatureId>,
        touched: &BTreeSet<TileIndex>,
        walls: &Walls,
        segments: &BTreeMap<FeatureId, Arc<Segment>>,
        grid: &E,
        published: &mut BTreeMap<ChainId, Arc<Chain>>,
        config: &VectorConfig,
    ) -> BTreeSet<ChainId> {
        let mut unsettled = Unsettled::default();
        for id in changed {
            self.take_out(*id, &mut unsettled);
        }
        for id in changed {
            if let (Some(segment), Some((rank, middle))) = (segments.get(id), walls.founder(*id)) {
                self.put_in(*id, segment, rank, &middle, config);
            }
        }
        for id in changed {
            self.find_joints(*id, grid, config, &mut unsettled);
        }
        self.look_again(touched, grid, config, &mut unsettled);
        self.settle(&mut unsettled);
        self.form(unsettled, published, config)
    }

    /// Forgets a segment's pieces, their joints, and the chains through them.
    fn take_out(&mut self, id: FeatureId, unsettled: &mut Unsettled) {
        let Some(old) = self.published.remove(&id) else { return };
        for (part, piece) in (0_u16..).zip(&old.pieces) {
            let key = PieceKey { segment: id, part };
            self.heads.remove(key, &piece.head.at);
            self.tails.remove(key, &piece.tail.at);
            for joint in self.joints_of(key) {
                self.forget(joint);
                let other = if joint.0 == key { joint.1 } else { joint.0 };
                unsettled.pieces.insert(other);
            }
            if let Some(next) = self.next.remove(&key) {
                self.previous.remove(&next);
                unsettled.chains.insert(next);
            }
            if let Some(previous) = self.previous.remove(&key) {
                self.next.remove(&previous);
                unsettled.chains.insert(previous);
            }
            unsettled.gone.extend(self.chain_of.remove(&key));
            // It may come back under the same name and be joined or not.
            unsettled.pieces.remove(&key);
            unsettled.chains.remove(&key);
        }
    }

    fn put_in(
        &mut self,
        id: FeatureId,
        segment: &Arc<Segment>,
        rank: Rank,
        middle: &Point,
        config: &VectorConfig,
    ) {
        let pieces: Vec<Piece> = Piece::of(segment, config).take(usize::from(u16::MAX)).collect();
        let at = (segment.line.along(middle) * 1e3).round() as i64;
        let away = |part: &u16| {
            let span = segment.solid[usize::from(*part)].span;
            (span.from - at).max(at - span.to).max(0)
        };
        let founding = (0..pieces.len() as u16).min_by_key(away).unwrap_or(0);
        for (part, piece) in (0_u16..).zip(&pieces) {
            let key = PieceKey { segment: id, part };
            self.heads.insert(key, &piece.head.at);
            self.tails.insert(key, &piece.tail.at);
        }
        self.published.insert(id, Published { pieces, rank, founding });
    }

    /// Finds all joints that could be made with a segment's pieces.
    fn find_joints<E: Evidence>(
        &mut self,
        id: FeatureId,
        grid: &E,
        config: &VectorConfig,
        unsettled: &mut Unsettled,
    ) {
        let Some(segment) = self.published.get(&id) else { return };
        let mut found = Vec::new();
        for (part, piece) in (0_u16..).zip(&segment.pieces) {
            let key = PieceKey { segment: id, part };
            unsettled.pieces.insert(key);
            unsettled.chains.insert(key);
            let reach = (2.0 * config.joint_max).max(config.gap_max + config.duplicate_offset);
            found.extend(self.tails.near(&piece.head.at, reach).map(|other| (key, other)));
            found.extend(self.heads.near(&piece.tail.at, reach).map(|other| (other, key)));
        }
        for key in found {
            if key.0 == key.1 || self.possible.contains_key(&key) {
                continue;
            }
            let Some((a, b)) = self.piece(key.0).zip(self.piece(key.1)) else { continue };
            let Some(joint) = Joint::new(a, b, config) else { continue };
            let gap = Gap::new(a, b, &joint.vertex.at, config);
            let tiles = gap.tiles(grid.resolution());
            let is_seen_through = gap.is_seen_through(grid, config);
            unsettled.pieces.extend([key.0, key.1]);
            self.by_tile.insert(key, &tiles);
            self.by_tail.insert((key.1, key.0));
            self.possible.insert(key, Possible { joint, gap, tiles, is_seen_through });
        }
    }

    /// Looks again through the gaps in tiles whose evidence has changed.
    fn look_again<E: Evidence>(
        &mut self,
        touched: &BTreeSet<TileIndex>,
        grid: &E,
        config: &VectorConfig,
        unsettled: &mut Unsettled,
    ) {
        let keys: BTreeSet<JointKey> =
            touched.iter().flat_map(|tile| self.by_tile.of(*tile)).collect();
        for key in keys {
            let Some(possible) = self.possible.get_mut(&key) else { continue };
            let is_seen_through = possible.gap.is_seen_through(grid, config);
            if is_seen_through != possible.is_seen_through {
                possible.is_seen_through = is_seen_through;
                unsettled.pieces.extend([key.0, key.1]);
            }
        }
    }

    /// Makes the joints anew in every component that holds an unsettled piece's end.
    fn settle(&mut self, unsettled: &mut Unsettled) {
        let mut done: BTreeSet<JointKey> = BTreeSet::new();
        let mut component: Vec<JointKey> =
            unsettled.pieces.iter().flat_map(|key| self.joints_of(*key)).collect();
        let mut at = 0;
        while let Some(key) = component.get(at).copied() {
            at += 1;
            if done.insert(key) {
                component.extend(self.joints_from(key.0));
                component.extend(self.joints_to(key.1));
            }
        }
        let before: BTreeSet<JointKey> =
            done.iter().copied().filter(|key| self.next.get(&key.0) == Some(&key.1)).collect();
        let mut best_first: Vec<(f64, JointKey)> = done
            .iter()
            .filter_map(|key| {
                let possible = self.possible.get(key)?;
                (!possible.is_seen_through).then_some((possible.joint.cost, *key))
            })
            .collect();
        best_first.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for key in &before {
            self.next.remove(&key.0);
            self.previous.remove(&key.1);
        }
        let mut after: BTreeSet<JointKey> = BTreeSet::new();
        for (_, key) in best_first {
            if !self.next.contains_key(&key.0) && !self.previous.contains_key(&key.1) {
                self.next.insert(key.0, key.1);
                self.previous.insert(key.1, key.0);
                after.insert(key);
            }
        }
        for key in before.symmetric_difference(&after) {
            unsettled.chains.extend([key.0, key.1]);
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
        let mut seen: BTreeSet<PieceKey> = BTreeSet::new();
        for key in chains {
            if seen.contains(&key) || self.piece(key).is_none() {
                continue;
            }
            let (links, is_closed) = self.links_through(key);
            for link in &links {
                seen.insert(link.key);
                gone.extend(self.chain_of.remove(&link.key));
            }
            for part in outline::simple_parts(links, is_closed, config) {
                let (id, chain) = part.chain(&self.published);
                for link in &part.links {
                    self.chain_of.insert(link.key, id);
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
    /// whether they come full circle.
    fn links_through(&self, key: PieceKey) -> (Vec<Link>, bool) {
        let mut first = key;
        while let Some(previous) = self.previous.get(&first) {
            first = *previous;
            if first == key {
                break;
            }
        }
        let mut links = Vec::new();
        let (mut at, mut is_closed) = (Some(first), false);
        while let Some(key) = at {
            let Some(piece) = self.piece(key) else { break };
            let next = self.next.get(&key).copied();
            let joint = next.and_then(|next| Some(self.possible.get(&(key, next))?.joint));
            links.push(Link { key, piece: piece.clone(), joint });
            is_closed = next == Some(first);
            at = next.filter(|_| !is_closed);
        }
        (links, is_closed)
    }

    fn piece(&self, key: PieceKey) -> Option<&Piece> {
        self.published.get(&key.segment)?.pieces.get(usize::from(key.part))
    }

    fn forget(&mut self, key: JointKey) {
        if let Some(old) = self.possible.remove(&key) {
            self.by_tile.remove(key, &old.tiles);
            self.by_tail.remove(&(key.1, key.0));
        }
    }

    /// All joints that could be made with a piece.
    fn joints_of(&self, key: PieceKey) -> Vec<JointKey> {
        self.joints_from(key).chain(self.joints_to(key)).collect()
    }

    fn joints_from(&self, head: PieceKey) -> impl Iterator<Item = JointKey> + '_ {
        let others = (head, PieceKey::FIRST)..=(head, PieceKey::LAST);
        self.possible.range(others).map(|(key, _)| *key)
    }

    fn joints_to(&self, tail: PieceKey) -> impl Iterator<Item = JointKey> + '_ {
        let others = (tail, PieceKey::FIRST)..=(tail, PieceKey::LAST);
        self.by_tail.range(others).map(|(tail, head)| (*head, *tail))
    }
}

/// Edge of a square of the index of ends, metres.
const SQUARE_SIDE: f64 = 1.0;

/// Ends of pieces by the square that they lie in.
#[derive(Debug, Clone, Default)]
struct EndIndex {
    squares: BTreeMap<(i32, i32), BTreeSet<PieceKey>>,
}

impl EndIndex {
    fn square(v: f64) -> i32 {
        (v / SQUARE_SIDE).floor() as i32
    }

    fn insert(&mut self, key: PieceKey, at: &Point) {
        let square = (Self::square(at.x), Self::square(at.y));
        self.squares.entry(square).or_default().insert(key);
    }

    fn remove(&mut self, key: PieceKey, at: &Point) {
        let square = (Self::square(at.x), Self::square(at.y));
        if let Some(keys) = self.squares.get_mut(&square) {
            keys.remove(&key);
            if keys.is_empty() {
                self.squares.remove(&square);
            }
        }
    }

    /// All in the squares that `reach` metres around `at` touch.
    fn near(&self, at: &Point, reach: f64) -> impl Iterator<Item = PieceKey> + '_ {
        let (x0, x1) = (Self::square(at.x - reach), Self::square(at.x + reach));
        let (y0, y1) = (Self::square(at.y - reach), Self::square(at.y + reach));
        (x0..=x1)
            .flat_map(move |x| (y0..=y1).map(move |y| (x, y)))
            .filter_map(|square| self.squares.get(&square))
            .flatten()
            .copied()
    }
}
