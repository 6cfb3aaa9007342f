//! Walls and clusters of the map beside the surfaces of the plan: what holds a surface, and what none explains.

use std::collections::{BTreeMap, BTreeSet};

use super::probe::count;
use super::surfaces::{Surface, Surfaces};
use super::{ChangeConfig, Feature};
use crate::gdb::{Kind, Plan};
use crate::geometry::{
    Covariance, Point, convex_hull, distance_to_hull, offset_variance, unit_normal,
};
use crate::level::{LevelMap, RobotName};
use crate::vector::{Cluster, Facing, Segment};

/// A place of the surface of a thing.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Place {
    pub(super) at: Point,
    /// Unit vector to where it is seen from; none of a cluster's corner.
    pub(super) normal: Option<Point>,
}

/// What no surface explains, and what belongs together of it.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Thing {
    pub(super) places: Vec<Place>,
    /// Sorted, at least one.
    pub(super) features: Vec<Feature>,
}

impl Thing {
    /// Greatest distance between two of its places, within a tenth of it.
    pub(super) fn extent(&self) -> f64 {
        extent(self.places.iter().map(|place| place.at))
    }
}

/// How often and by whom a feature was seen.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sighted<'a> {
    pub(super) looks: u32,
    pub(super) robots: &'a [RobotName],
    pub(super) last_seen_us: i64,
}

/// The features of a map beside a plan.
#[derive(Debug)]
pub(super) struct Found<'a> {
    map: &'a LevelMap,
    /// Of each surface, the probes that lie on walls or clusters of the map.
    pub(super) held: Vec<Vec<bool>>,
    /// Of each owner, the places of the map that it explains.
    pub(super) in_place: Vec<Vec<Place>>,
    pub(super) things: Vec<Thing>,
}

/// Most that a wall of the map may lie off a surface that explains it, metres, however unsure it is.
const OFF_MAX: f64 = 0.3;
/// How far beyond its end a surface explains walls, metres: corners are rounded.
const BEYOND: f64 = 0.1;

impl<'a> Found<'a> {
    pub(super) fn of(
        map: &'a LevelMap,
        plan: &Plan,
        surfaces: &Surfaces,
        config: &ChangeConfig,
    ) -> Self {
        let held = surfaces.all.iter().map(|s| vec![false; count(s, config.resolution)]).collect();
        let in_place = vec![Vec::new(); surfaces.owners.len()];
        let mut found = Self { map, held, in_place, things: Vec::new() };
        let doors = Doors::of(plan, config);
        let building = convex_hull(&surfaces.all.iter().map(|s| s.from).collect::<Vec<_>>());
        let mut pieces = Vec::new();
        for (id, segment) in map.segments.iter().filter(|(_, s)| s.looks >= config.looks_min) {
            for run in found.unexplained_of_wall(segment, surfaces, config) {
                if !doors.explain(&run) {
                    pieces.push(Thing { places: run, features: vec![Feature::Segment(*id)] });
                }
            }
        }
        for (id, cluster) in map.clusters.iter().filter(|(_, c)| c.looks >= config.looks_min) {
            let places = found.unexplained_of_cluster(cluster, surfaces, config);
            if !places.is_empty() && !doors.explain(&places) {
                pieces.push(Thing { places, features: vec![Feature::Cluster(*id)] });
            }
        }
        // What is seen outside, through windows, is not the model's.
        let is_inside = |thing: &Thing| {
            thing.places.iter().any(|place| distance_to_hull(&place.at, &building) <= 0.0)
        };
        pieces.retain(|piece| building.len() >= 3 && is_inside(piece));
        found.things = joined(pieces, config.join);
        found
    }

    pub(super) fn sighting(&self, feature: Feature) -> Option<Sighted<'_>> {
        match feature {
            Feature::Segment(id) => self.map.segments.get(&id).map(|s| Sighted {
                looks: s.looks,
                robots: &s.robots,
                last_seen_us: s.last_seen_us,
            }),
            Feature::Cluster(id) => self.map.clusters.get(&id).map(|c| Sighted {
                looks: c.looks,
                robots: &c.robots,
                last_seen_us: c.last_seen_us,
            }),
        }
    }

    /// The stretches of a wall of the map that no surface explains, place by place.
    fn unexplained_of_wall(
        &mut self,
        segment: &Segment,
        surfaces: &Surfaces,
        config: &ChangeConfig,
    ) -> Vec<Vec<Place>> {
        let outward = unit_normal(segment.line.alpha());
        let normal = if segment.facing == Facing::Origin { -outward } else { outward };
        let mut runs: Vec<Vec<Place>> = Vec::new();
        let sure = segment.solid.iter().filter(|part| part.existence >= config.existence_min);
        for part in sure {
            let (from, to) = (part.span.from_m(), part.span.to_m());
            let steps = ((to - from) / config.resolution).ceil().max(1.0) as u32;
            let mut run = Vec::new();
            for step in 0..=steps {
                let along = from + (to - from) * f64::from(step) / f64::from(steps);
                let at = segment.line.at(along);
                let variance = offset_variance(&segment.independent, along)
                    + offset_variance(&segment.dependent, along)
                    + config.offset_noise * config.offset_noise;
                let explaining = surfaces.near(&at).filter(|(_, surface)| {
                    let tolerance = surfaces.owners[surface.owner].tolerance;
                    let gate = (config.gate * (variance + tolerance * tolerance)).sqrt();
                    let [along, out] = surface.coordinates(&at);
                    surface.faces(&normal)
                        && out.abs() <= gate.min(OFF_MAX)
                        && (-BEYOND..=surface.length + BEYOND).contains(&along)
                });
                let place = Place { at, normal: Some(normal) };
                if self.hold(explaining, place) {
                    runs.push(std::mem::take(&mut run));
                } else {
                    run.push(place);
                }
            }
            runs.push(run);
        }
        // A length, and what a corner's rounding leaves over.
        runs.retain(|run| extent(run.iter().map(|p| p.at)) >= BEYOND);
        runs
    }

    /// The corners of a cluster if surfaces do not explain nearly all of them.
    fn unexplained_of_cluster(
        &mut self,
        cluster: &Cluster,
        surfaces: &Surfaces,
        config: &ChangeConfig,
    ) -> Vec<Place> {
        let own = largest_variance(&cluster.covariance) + config.hull_noise * config.hull_noise;
        let mut explained = 0;
        for at in &cluster.hull {
            let explaining = surfaces.near(at).filter(|(_, surface)| {
                let tolerance = surfaces.owners[surface.owner].tolerance;
                let gate = (config.gate * (own + tolerance * tolerance)).sqrt();
                (surface.nearest(at) - at).norm() <= gate.min(OFF_MAX)
            });
            explained += usize::from(self.hold(explaining, Place { at: *at, normal: None }));
        }
        if 5 * explained >= 4 * cluster.hull.len() {
            return Vec::new();
        }
        cluster.hull.iter().map(|at| Place { at: *at, normal: None }).collect()
    }

    /// Takes note of which surfaces a place holds; whether any explains it.
    fn hold<'s>(
        &mut self,
        explaining: impl Iterator<Item = (usize, &'s Surface)>,
        place: Place,
    ) -> bool {
        let mut owners = BTreeSet::new();
        for (index, surface) in explaining {
            let probes = &mut self.held[index];
            let each = surface.length / probes.len() as f64;
            let at = (surface.coordinates(&place.at)[0] / each).floor();
            if at >= 0.0 && (at as usize) < probes.len() {
                probes[at as usize] = true;
            }
            owners.insert(surface.owner);
        }
        for owner in &owners {
            self.in_place[*owner].push(place);
        }
        !owners.is_empty()
    }
}

fn largest_variance(covariance: &Covariance<2>) -> f64 {
    let m = covariance.matrix();
    m[(0, 0)].max(m[(1, 1)])
}

/// Greatest distance between two of some places, within a tenth of it: across eight directions.
pub(super) fn extent(places: impl Iterator<Item = Point>) -> f64 {
    let directions: [Point; 8] =
        std::array::from_fn(|k| unit_normal(k as f64 * std::f64::consts::FRAC_PI_8));
    let mut spreads = [[f64::INFINITY, f64::NEG_INFINITY]; 8];
    for p in places {
        for ([low, high], direction) in spreads.iter_mut().zip(&directions) {
            let along = p.dot(direction);
            (*low, *high) = (low.min(along), high.max(along));
        }
    }
    spreads.iter().map(|[low, high]| high - low).fold(0.0, f64::max)
}

/// Doorways, and what their leaves explain.
struct Doors {
    /// Hull of the opening, its width, the slack of what closes it.
    doors: Vec<(Vec<Point>, f64)>,
    slack: f64,
}

impl Doors {
    fn of(plan: &Plan, config: &ChangeConfig) -> Self {
        let door = |opening: &crate::gdb::Opening| {
            let jambs = opening.sides.iter().flat_map(|side| [side.from, side.to]);
            let jambs: Vec<Point> = jambs.map(crate::gdb::PlanPoint::metres).collect();
            (convex_hull(&jambs), opening.width())
        };
        let slack = config.slack + config.tolerance_sds * crate::gdb::Object::TOLERANCE;
        Self { doors: plan.openings().iter().map(door).collect(), slack }
    }

    /// Whether the places may be a leaf: all of them within an opening, or no longer than it is wide and
    /// hung on one of its jambs.
    fn explain(&self, places: &[Place]) -> bool {
        let length = extent(places.iter().map(|place| place.at));
        let (Some(first), Some(last)) = (places.first(), places.last()) else { return false };
        self.doors.iter().any(|(hull, width)| {
            let near = |p: &Point| distance_to_hull(p, hull) <= self.slack;
            let hangs = |p: &Point| hull.iter().any(|jamb| (jamb - p).norm() <= self.slack);
            let is_in = || places.iter().all(|place| near(&place.at));
            let is_leaf = || length <= width + self.slack && (hangs(&first.at) || hangs(&last.at));
            (first.at - hull[0]).norm() <= 2.0 * width + length + 1.0 && (is_in() || is_leaf())
        })
    }
}

/// Pieces that come as near to each other as `join`, as one; in the order of their smallest features.
fn joined(pieces: Vec<Thing>, join: f64) -> Vec<Thing> {
    let mut leaders: Vec<usize> = (0..pieces.len()).collect();
    let mut squares: BTreeMap<(i64, i64), Vec<(Point, usize)>> = BTreeMap::new();
    let square = |p: &Point| ((p.x / join).floor() as i64, (p.y / join).floor() as i64);
    for (index, piece) in pieces.iter().enumerate() {
        for place in &piece.places {
            let (x, y) = square(&place.at);
            for neighbour in (x - 1..=x + 1).flat_map(|x| (y - 1..=y + 1).map(move |y| (x, y))) {
                for (p, other) in squares.get(&neighbour).into_iter().flatten() {
                    if (p - place.at).norm() <= join {
                        let (a, b) = (leader(&mut leaders, index), leader(&mut leaders, *other));
                        leaders[a.max(b)] = a.min(b);
                    }
                }
            }
            squares.entry((x, y)).or_default().push((place.at, index));
        }
    }
    let mut things: BTreeMap<usize, Thing> = BTreeMap::new();
    for (index, piece) in pieces.into_iter().enumerate() {
        let thing = things
            .entry(leader(&mut leaders, index))
            .or_insert_with(|| Thing { places: Vec::new(), features: Vec::new() });
        thing.places.extend(piece.places);
        thing.features.extend(piece.features);
    }
    let mut things: Vec<Thing> = things.into_values().collect();
    for thing in &mut things {
        thing.features.sort_unstable();
        thing.features.dedup();
    }
    things.sort_by(|a, b| a.features.cmp(&b.features));
    things
}

/// The one that speaks for a piece.
fn leader(leaders: &mut [usize], mut index: usize) -> usize {
    while leaders[index] != index {
        leaders[index] = leaders[leaders[index]];
        index = leaders[index];
    }
    index
}

/// Whether objects of this kind are moved by people; openings and floors are not things.
pub(super) fn is_movable(kind: Kind) -> bool {
    !matches!(kind, Kind::Doorway | Kind::Corridor)
}
