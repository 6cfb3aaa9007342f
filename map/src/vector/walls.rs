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
            self.places.remove(id, reach(&old.wall));
            self.by_tile.remove(id, &old.tiles);
            unpublished.remove(&old.rank);
            self.unpublish_near(&old.wall, unpublished);
        }
        let made = self.sightings.get(id).and_then(|(leader, rank)| {
            let group: Vec<(FeatureId, &Sighting)> = self.sightings.group(id)?.collect();
            Some((Wall::new(group.iter().copied(), leader, config)?, rank))
        });
        match made {
            Some((wall, rank)) => {
                let tiles = tiles_along(&wall, resolution);
                self.places.insert(id, reach(&wall));
                self.by_tile.insert(id, &tiles);
                self.unpublish_near(&wall, unpublished);
                self.placed.insert(id, Placed { wall, rank, tiles });
                unpublished.insert(rank);
            }
            None => {
                if published.remove(&id).is_some() {
                    changed.insert(id);
                }
            }
        }
    }

    /// All walls near `wall` have to be published anew: it may be their other face.
    fn unpublish_near(&self, wall: &Wall, unpublished: &mut BTreeSet<Rank>) {
        let near = self.places.near(reach(wall));
        unpublished.extend(near.iter().filter_map(|id| Some(self.placed.get(id)?.rank)));
    }

    /// Later walls near `wall` have to be published anew: it may publish what they saw too.
    fn unpublish_later(&self, wall: &Wall, rank: Rank, unpublished: &mut BTreeSet<Rank>) {
        for id in self.places.near(reach(wall)) {
            if let Some(other) = self.placed.get(&id)
                && other.rank > rank
            {
                unpublished.insert(other.rank);
            }
        }
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
        self.unpublish_later(&placed.wall, rank, unpublished);
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
        let neighbours: Vec<(FeatureId, &Placed)> = self
            .places
            .near(reach(wall))
            .into_iter()
            .filter_map(|id| Some((id, self.placed.get(&id)?)))
            .collect();
        let backs: Vec<&Wall> = neighbours
            .iter()
            .map(|(_, other)| &other.wall)
            .filter(|other| wall.is_backed_by(other, config))
            .collect();
        let through = seen_through(wall, &wall.seen, &backs, grid, config);
        let mut pieces = subtract_intervals(&wall.seen, &through);
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
                SolidInterval { span, ends: [end(span.from), end(span.to)] }
            })
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
