//! All walls of a level: sightings in, published segments out, as a function of the set.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::by_block::ByBlock;
use super::leaders::{Leaders, Member, Rank};
use super::seen_through::{Evidence, SeenThrough, blocks_along, seen_through};
use super::sighting::Sighting;
use super::slots::{Slot, Slots};
use super::squares::{Extent, Squares};
use super::wall::{Facings, Wall};
use super::{EndKind, Segment, SolidInterval, VectorConfig, Work};
use crate::geometry::{Point, subtract_intervals};
use crate::level::{Contribution, FeatureId};
use crate::raster::{Blocks, TileIndex, Touched};

/// A wall with its place in the order of publication.
#[derive(Debug, Clone)]
struct Placed {
    wall: Wall,
    rank: Rank,
    /// Where another wall may be the same one.
    reach: Extent,
    /// The evidence that says which parts of it are seen through.
    depends_on: Vec<(TileIndex, Blocks)>,
    /// `None` if it may have changed.
    through: Option<SeenThrough>,
    published: Option<Arc<Segment>>,
}

/// The state of the fold of segments.
#[derive(Debug, Clone, Default)]
pub(crate) struct Walls {
    sightings: Leaders<Sighting>,
    /// In the places of their leaders.
    placed: Slots<Box<Placed>>,
    places: Squares<Slot>,
    by_block: ByBlock<Slot>,
    work: Work,
}

/// What an update has to do, and what it has done.
struct Progress<'a> {
    unpublished: BTreeMap<Rank, Slot>,
    published: &'a mut BTreeMap<FeatureId, Arc<Segment>>,
    changed: BTreeSet<Member>,
}

impl Walls {
    /// Puts the segments of some contributions in and takes those of others out. `touched` is the
    /// scanner evidence that changed with them. Published segments are brought up to date in
    /// `published`; returns those that are new, different or gone.
    pub(crate) fn update<E: Evidence>(
        &mut self,
        inserted: &[&Contribution],
        removed: &[&Contribution],
        touched: &Touched,
        grid: &E,
        published: &mut BTreeMap<FeatureId, Arc<Segment>>,
        config: &VectorConfig,
    ) -> BTreeSet<Member> {
        let sightings = inserted.iter().flat_map(|look| {
            (0_u16..).zip(&look.segments).map(|(index, segment)| {
                let id = FeatureId { contribution: look.id, index };
                (id, Sighting::new(segment, look, config))
            })
        });
        let gone: Vec<FeatureId> = removed
            .iter()
            .flat_map(|look| {
                (0_u16..)
                    .zip(&look.segments)
                    .map(|(index, _)| FeatureId { contribution: look.id, index })
            })
            .collect();
        let regrouped = self.sightings.update(sightings, &gone, config);

        let mut progress =
            Progress { unpublished: BTreeMap::new(), published, changed: BTreeSet::new() };
        for leader in regrouped {
            self.remake(leader, grid.resolution(), config, &mut progress);
        }
        for slot in self.by_block.touched(touched) {
            if let Some(placed) = self.placed.get_mut(slot) {
                placed.through = None;
                progress.unpublished.insert(placed.rank, slot);
            }
        }
        // In rank order: what is published of a wall depends on what is published of better ones.
        while let Some((_, slot)) = progress.unpublished.pop_first() {
            self.publish(slot, grid, config, &mut progress);
        }
        progress.changed
    }

    /// What this has done so far.
    pub(crate) fn work(&self) -> Work {
        Work { pairings: self.sightings.pairings(), ..self.work }
    }

    /// What is published of a wall, with the rank and the middle of the observation that it is
    /// called after.
    pub(super) fn published(&self, leader: Member) -> Option<(&Arc<Segment>, Rank, Point)> {
        let (founder, rank) = self.sightings.leader(leader)?;
        let segment = self.placed.get(leader.slot)?.published.as_ref()?;
        Some((segment, rank, founder.middle))
    }

    /// Makes the wall of a group anew, or ends it with its group.
    fn remake(
        &mut self,
        leader: Member,
        resolution: f64,
        config: &VectorConfig,
        progress: &mut Progress,
    ) {
        let slot = leader.slot;
        let mut published = None;
        if let Some(mut old) = self.placed.take(slot) {
            self.places.remove(slot, old.reach);
            self.by_block.remove(slot, &old.depends_on);
            progress.unpublished.remove(&old.rank);
            published = old.published.take();
            self.unsettle_neighbours(&old, config, progress);
        }
        let made = self.sightings.leader(leader).and_then(|(sighting, rank)| {
            let group: Vec<(FeatureId, &Sighting)> = self.sightings.group(leader)?.collect();
            Some((Wall::new(group.iter().copied(), sighting, config)?, rank))
        });
        match made {
            Some((wall, rank)) => {
                self.work.walls_fused += 1;
                let depends_on = blocks_along(&wall, resolution);
                let reach = reach(&wall);
                let placed = Placed { wall, rank, reach, depends_on, through: None, published };
                self.unsettle_neighbours(&placed, config, progress);
                self.places.insert(slot, reach);
                self.by_block.insert(slot, &placed.depends_on);
                self.placed.put(slot, Box::new(placed));
                progress.unpublished.insert(rank, slot);
            }
            None => {
                if published.is_some() {
                    progress.published.remove(&leader.id);
                    progress.changed.insert(leader);
                }
            }
        }
    }

    /// A wall comes or goes: those that it is the other face of, and later ones that may publish
    /// what it saw too, have to be looked at again.
    fn unsettle_neighbours(
        &mut self,
        placed: &Placed,
        config: &VectorConfig,
        progress: &mut Progress,
    ) {
        for slot in self.places.near(placed.reach) {
            let Some(other) = self.placed.get_mut(slot) else { continue };
            match placed.wall.facings(&other.wall, config) {
                Facings::Opposite => other.through = None,
                Facings::Same if other.rank > placed.rank => {}
                Facings::Same | Facings::Across => continue,
            }
            progress.unpublished.insert(other.rank, slot);
        }
    }

    /// All walls whose reach overlaps that of `placed`.
    fn near(&self, placed: &Placed) -> impl Iterator<Item = (Slot, &Placed)> {
        let (low, high) = placed.reach;
        self.places
            .near(placed.reach)
            .filter_map(|slot| Some((slot, self.placed.get(slot)?.as_ref())))
            .filter(move |(_, other)| {
                let (from, to) = other.reach;
                from.x <= high.x && low.x <= to.x && from.y <= high.y && low.y <= to.y
            })
    }

    fn publish<E: Evidence>(
        &mut self,
        slot: Slot,
        grid: &E,
        config: &VectorConfig,
        progress: &mut Progress,
    ) {
        let Some(mut placed) = self.placed.take(slot) else { return };
        if placed.through.is_none() {
            self.work.walls_against_grid += 1;
            placed.through = Some(self.through(&placed, grid, config));
        }
        self.work.walls_published += 1;
        let segment = self.segment(&placed, config);
        if placed.published.as_deref() != segment.as_ref() {
            let id = placed.rank.id;
            placed.published = segment.map(Arc::new);
            match &placed.published {
                Some(segment) => progress.published.insert(id, Arc::clone(segment)),
                None => progress.published.remove(&id),
            };
            progress.changed.insert(Member { id, slot });
            // Later walls may publish what this one saw too.
            let later = self.near(&placed).filter(|(_, other)| {
                let facings = placed.wall.facings(&other.wall, config);
                other.rank > placed.rank && facings == Facings::Same
            });
            progress.unpublished.extend(later.map(|(slot, other)| (other.rank, slot)));
        }
        self.placed.put(slot, placed);
    }

    /// What the grid says against a wall.
    fn through<E: Evidence>(
        &self,
        placed: &Placed,
        grid: &E,
        config: &VectorConfig,
    ) -> SeenThrough {
        let wall = &placed.wall;
        let others = self.near(placed).map(|(_, other)| &other.wall);
        let backs: Vec<&Wall> = others.filter(|other| wall.is_backed_by(other, config)).collect();
        seen_through(wall, &backs, grid, config)
    }

    /// What is published of a wall: what was seen of it, without what scanners look through and
    /// without what better walls nearby already publish.
    fn segment(&self, placed: &Placed, config: &VectorConfig) -> Option<Segment> {
        let (wall, through) = (&placed.wall, placed.through.as_ref()?);
        let mut pieces = subtract_intervals(&wall.seen, &through.open);
        let mut better: Vec<&Placed> = self
            .near(placed)
            .filter(|(_, other)| other.rank < placed.rank && other.published.is_some())
            .filter(|(_, other)| wall.facings(&other.wall, config) == Facings::Same)
            .map(|(_, other)| other)
            .collect();
        better.sort_unstable_by_key(|other| other.rank.id);
        for other in better {
            let solid = other.published.iter().flat_map(|segment| &segment.solid);
            let twice = wall.duplicated(&pieces, &other.wall, solid.map(|s| s.span), config);
            pieces = subtract_intervals(&pieces, &twice);
        }
        let least = (config.length_min * 1e3).round() as i64;
        let solid: Vec<SolidInterval> = pieces
            .into_iter()
            .filter(|piece| piece.length() >= least)
            .map(|span| {
                let end = |at| wall.end_kind(at).unwrap_or(EndKind::Jump);
                let ends = [end(span.from), end(span.to)];
                SolidInterval { span, ends, existence: wall.existence(span, through, config) }
            })
            .filter(|piece| piece.existence.nat() > config.existence_min)
            .collect();
        (!solid.is_empty()).then(|| Segment {
            line: wall.line,
            independent: wall.independent,
            dependent: wall.dependent,
            facing: wall.facing,
            solid,
            looks: wall.looks,
            robots: wall.robots.clone(),
            first_seen_us: wall.first_seen_us,
            last_seen_us: wall.last_seen_us,
        })
    }
}

/// The surroundings in which another wall may be the same one.
fn reach(wall: &Wall) -> Extent {
    const MARGIN: f64 = 0.25;
    let (low, high) = wall.extent();
    let margin = Point::new(MARGIN, MARGIN);
    (low - margin, high + margin)
}
