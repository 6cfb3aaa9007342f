//! All walls of a level: sightings in, published segments out, as a function of the set.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::by_tile::ByTile;
use super::leaders::{Leaders, Rank, SquareIndex};
use super::seen_through::{Evidence, seen_through, tiles_along};
use super::sighting::Sighting;
use super::wall::Wall;
use super::{EndKind, Segment, SolidInterval, VectorConfig};
use crate::geometry::{Point, subtract_intervals};
use crate::level::{Contribution, FeatureId};
use crate::raster::TileIndex;

/// A wall with its place in the order of publication.
#[derive(Debug, Clone)]
struct Placed {
    wall: Wall,
    rank: Rank,
    /// Lower left and upper right corner of where another wall may be the same one.
    reach: (Point, Point),
    tiles: Vec<TileIndex>,
}

/// The state of the fold of segments.
#[derive(Debug, Clone, Default)]
pub(crate) struct Walls {
    sightings: Leaders<Sighting>,
    placed: BTreeMap<FeatureId, Placed>,
    places: SquareIndex,
    by_tile: ByTile,
}

impl Walls {
    /// Puts the segments of some contributions in and takes those of others out. `touched` are
    /// the scanner tiles that changed with them. Published segments are brought up to date in
    /// `published`; returns those that are new, different or gone.
    pub(crate) fn update<E: Evidence>(
        &mut self,
        inserted: &[&Contribution],
        removed: &[&Contribution],
        touched: &BTreeSet<TileIndex>,
        grid: &E,
        published: &mut BTreeMap<FeatureId, Arc<Segment>>,
        config: &VectorConfig,
    ) -> BTreeSet<FeatureId> {
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
        let regrouped = self.sightings.update(sightings.collect(), &gone, config);

        let mut changed = BTreeSet::new();
        let mut unpublished: BTreeSet<Rank> = BTreeSet::new();
        for id in regrouped {
            self.remake(id, grid.resolution(), config, &mut unpublished, published, &mut changed);
        }
        for tile in touched {
            for id in self.by_tile.of(*tile) {
                if let Some(placed) = self.placed.get(&id) {
                    unpublished.insert(placed.rank);
                }
            }
        }
        // In rank order: what is published of a wall depends on what is published of better ones.
        while let Some(rank) = unpublished.pop_first() {
            self.publish(rank, grid, config, &mut unpublished, published, &mut changed);
        }
        changed
    }

    /// The rank and the middle of the observation that a wall is called after.
    pub(super) fn founder(&self, id: FeatureId) -> Option<(Rank, Point)> {
        self.sightings.get(id).map(|(leader, rank)| (rank, leader.middle))
    }

    /// Makes the wall of a group anew, or ends it with its group.
    fn remake(
        &mut self,
        id: FeatureId,
        resolution: f64,
        config: &VectorConfig,
        unpublished: &mut BTreeSet<Rank>,
        published: &mut BTreeMap<FeatureId, Arc<Segment>>,
        changed: &mut BTreeSet<FeatureId>,
    ) {
        if let Some(old) = self.placed.remove(&id) {
            self.places.remove(id, old.reach);
            self.by_tile.remove(id, &old.tiles);
            unpublished.remove(&old.rank);
            unpublished.extend(self.near(old.reach).map(|(_, placed)| placed.rank));
        }
        let made = self.sightings.get(id).and_then(|(leader, rank)| {
            let group: Vec<(FeatureId, &Sighting)> = self.sightings.group(id)?.collect();
            Some((Wall::new(group.iter().copied(), leader, config)?, rank))
        });
        match made {
            Some((wall, rank)) => {
                let tiles = tiles_along(&wall, resolution);
                let reach = reach(&wall);
                self.places.insert(id, reach);
                self.by_tile.insert(id, &tiles);
                self.placed.insert(id, Placed { wall, rank, reach, tiles });
                // It may be the other face of any of them; the wall itself is among them.
                unpublished.extend(self.near(reach).map(|(_, placed)| placed.rank));
            }
            None => {
                if published.remove(&id).is_some() {
                    changed.insert(id);
                }
            }
        }
    }

    /// All walls whose reach overlaps `reach`.
    fn near(&self, reach: (Point, Point)) -> impl Iterator<Item = (FeatureId, &Placed)> {
        let (low, high) = reach;
        self.places
            .near(reach)
            .into_iter()
            .filter_map(|id| Some((id, self.placed.get(&id)?)))
            .filter(move |(_, placed)| {
                let (from, to) = placed.reach;
                from.x <= high.x && low.x <= to.x && from.y <= high.y && low.y <= to.y
            })
    }

    fn publish<E: Evidence>(
        &self,
        rank: Rank,
        grid: &E,
        config: &VectorConfig,
        unpublished: &mut BTreeSet<Rank>,
        published: &mut BTreeMap<FeatureId, Arc<Segment>>,
        changed: &mut BTreeSet<FeatureId>,
    ) {
        let Some(placed) = self.placed.get(&rank.id) else { return };
        let segment = self.segment(placed, grid, published, config);
        if published.get(&rank.id).map(AsRef::as_ref) == segment.as_ref() {
            return;
        }
        match segment {
            Some(segment) => published.insert(rank.id, Arc::new(segment)),
            None => published.remove(&rank.id),
        };
        changed.insert(rank.id);
        // Later walls may publish what this one saw too.
        let later = self.near(placed.reach).filter(|(_, other)| other.rank > rank);
        unpublished.extend(later.map(|(_, other)| other.rank));
    }

    /// What is published of a wall: what was seen of it, without what scanners look through and
    /// without what better walls nearby already publish.
    fn segment<E: Evidence>(
        &self,
        placed: &Placed,
        grid: &E,
        published: &BTreeMap<FeatureId, Arc<Segment>>,
        config: &VectorConfig,
    ) -> Option<Segment> {
        let wall = &placed.wall;
        let neighbours: Vec<(FeatureId, &Placed)> = self.near(placed.reach).collect();
        let backs: Vec<&Wall> = neighbours
            .iter()
            .map(|(_, other)| &other.wall)
            .filter(|other| wall.is_backed_by(other, config))
            .collect();
        let through = seen_through(wall, &wall.seen, &backs, grid, config);
        let mut pieces = subtract_intervals(&wall.seen, &through.open);
        for (id, other) in neighbours {
            if other.rank < placed.rank
                && let Some(segment) = published.get(&id)
            {
                let theirs = segment.solid.iter().map(|s| s.span);
                let twice = wall.duplicated(&pieces, &other.wall, theirs, config);
                pieces = subtract_intervals(&pieces, &twice);
            }
        }
        let least = (config.length_min * 1e3).round() as i64;
        let solid: Vec<SolidInterval> = pieces
            .into_iter()
            .filter(|piece| piece.length() >= least)
            .map(|span| {
                let end = |at| wall.end_kind(at).unwrap_or(EndKind::Jump);
                let ends = [end(span.from), end(span.to)];
                SolidInterval { span, ends, existence: wall.existence(span, &through, config) }
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
fn reach(wall: &Wall) -> (Point, Point) {
    const MARGIN: f64 = 0.25;
    let (low, high) = wall.extent();
    let margin = Point::new(MARGIN, MARGIN);
    (low - margin, high + margin)
}
