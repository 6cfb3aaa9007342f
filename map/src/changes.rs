//! What robots found against the a-priori model: objects that are missing, opened, or stand elsewhere, and things
//! that it does not know.
//!
//! A function of a plan of the model and of a level's map, and so of the set of contributions: nothing is counted
//! along the way, and what robots see again or no longer see corrects itself.
//!
//! * *Surfaces* of the plan are probed in the scanners' evidence, across each at short steps: something occupied
//!   near it, or free all the way through. An object most of whose surface is seen through is missing; one
//!   with a stretch that is, is opened.
//! * *Walls and clusters* of the map that no surface explains, within what model and map may be wrong by, are new;
//!   those that lie near each other are one thing.
//! * What is missing, or has nothing left where it should be, and a new thing of the same outline are one object
//!   that has moved.
//!
//! The model itself is never touched: a change is for an operator to accept or to dismiss.

mod evidence;
mod found;
mod moved;
mod probe;
mod surfaces;

use std::collections::{BTreeMap, BTreeSet};

use crate::gdb::{Kind, ObjectId, Plan};
use crate::geometry::{Level, Point, Pose, convex_hull};
use crate::level::{FeatureId, LevelMap, RobotName};
use crate::raster::LogOdds;

use evidence::Scanned;
use found::{Found, Thing};
use moved::Motion;
use probe::Probed;
use surfaces::Surfaces;

/// When a change is believed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChangeConfig {
    /// Cell size of the level, metres.
    pub resolution: f64,
    /// Looks that must support a wall or a cluster of the map before it counts.
    pub looks_min: u32,
    /// What the log-odds that a part of a wall is there must come to.
    pub existence_min: LogOdds,
    /// A cell is free if scanners say no more than this: three looks' worth.
    pub free_max: LogOdds,
    /// How far from where a surface should be something occupied is still taken for it, metres, besides
    /// [`Self::tolerance_sds`].
    pub slack: f64,
    /// And so many of its object's tolerances.
    pub tolerance_sds: f64,
    /// Share of the probed surface that must be seen through for an object to be missing.
    pub missing_share: f64,
    /// Share of an object's surface that must have been probed before all of it is said to be missing.
    pub probed_share: f64,
    /// Least length of surface that is told of, metres.
    pub length_min: f64,
    /// Gate on (offset / sd)^2 between a wall of the map and a surface: chi-square, one degree of freedom, 99.9 %.
    pub gate: f64,
    /// Deviation of where hits lie on a surface that is not quite plane, metres.
    pub offset_noise: f64,
    /// Deviation of the corners of a cluster, metres.
    pub hull_noise: f64,
    /// Walls and clusters no farther apart than this are one thing, metres.
    pub join: f64,
    /// Objects are looked for as far from where they should be as this, metres.
    pub move_max: f64,
    /// The most surface that a plan may have, metres: all of it is probed.
    pub surface_max: f64,
}

impl ChangeConfig {
    /// The defaults for a level's cell size, metres.
    pub const fn standard(resolution: f64) -> Self {
        Self {
            resolution,
            looks_min: 2,
            existence_min: LogOdds(150),
            free_max: LogOdds(-100),
            slack: 0.1,
            tolerance_sds: 3.0,
            missing_share: 0.7,
            probed_share: 0.4,
            length_min: 0.25,
            gate: 10.83,
            offset_noise: 0.01,
            hull_noise: 0.03,
            join: 0.3,
            move_max: 10.0,
            surface_max: 1e6,
        }
    }

    /// How far a surface of an object with this tolerance may lie from where it should, metres.
    fn reach(&self, tolerance: f64) -> f64 {
        self.slack + self.tolerance_sds * tolerance
    }
}

/// A feature of the map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Feature {
    /// A wall.
    Segment(FeatureId),
    /// What no line explains.
    Cluster(FeatureId),
}

/// Which change it is: the same for as long as it is the same thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum ChangeId {
    /// This object is not there.
    Missing(ObjectId),
    /// This object is open in places.
    Opened(ObjectId),
    /// This object stands elsewhere.
    Moved(ObjectId),
    /// A thing that the model does not know, by the smallest of its features.
    New(Feature),
}

/// A stretch of an object's surface that is seen through.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stretch {
    /// Where it begins; the object is on the right of the way to its end.
    pub from: Point,
    /// Where it ends.
    pub to: Point,
    /// How thick the object is there, metres; 0 for a sheet.
    pub depth: f64,
}

/// What has changed.
#[derive(Debug, Clone, PartialEq)]
pub enum What {
    /// All of the object is gone.
    Missing,
    /// Beams pass where the object should be closed.
    Opened {
        /// Where.
        stretches: Vec<Stretch>,
    },
    /// The object stands elsewhere.
    Moved {
        /// The motion that takes it from where the model has it to where it is.
        motion: Pose<Level, Level>,
        /// How far it takes the middle of the object, metres.
        distance: f64,
    },
    /// A thing that the model does not know.
    New,
}

/// A difference between the model and what robots found, with its evidence.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// Which one.
    pub id: ChangeId,
    /// What it is.
    pub what: What,
    /// Where: the convex hull of what is missing, new, or where it stands now, counter-clockwise.
    pub hull: Vec<Point>,
    /// Surface that was probed, metres.
    pub probed: f64,
    /// Surface of it that is seen through, metres.
    pub through: f64,
    /// The walls and clusters of the map that show it, sorted.
    pub features: Vec<Feature>,
    /// Distinct looks at the feature that was seen most.
    pub looks: u32,
    /// Who saw the features, sorted.
    pub robots: Vec<RobotName>,
    /// Latest look at them, microseconds since 1970; `None` without features.
    pub last_seen_us: Option<i64>,
}

/// A plan with more surface than is probed.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "the plan has {surface:.0} m of surface, and at most {surface_max:.0} m are held against the map: cut the level \
     into smaller ones"
)]
pub struct TooMuchSurface {
    /// What it has, metres.
    pub surface: f64,
    /// The limit, metres.
    pub surface_max: f64,
}

/// What a level's map says against a plan of its model; by identity. The map's scale and frame are the plan's.
///
/// # Errors
/// [`TooMuchSurface`].
pub fn changes(
    plan: &Plan,
    map: &LevelMap,
    config: &ChangeConfig,
) -> Result<BTreeMap<ChangeId, Change>, TooMuchSurface> {
    let surface = plan.edges().map(|edge| edge.from.distance(edge.to)).sum();
    let surface_max = config.surface_max;
    if surface > surface_max {
        return Err(TooMuchSurface { surface, surface_max });
    }
    let surfaces = Surfaces::of(plan);
    let found = Found::of(map, plan, &surfaces, config);
    let mut scanned = Scanned::new(&map.tiles, config.resolution);
    let probed = Probed::of(&surfaces, &found.held, &mut scanned, config);
    let mut changes = BTreeMap::new();
    let mut taken: BTreeSet<usize> = BTreeSet::new();
    let motions = moved::motions(&surfaces, &probed, &found, &mut scanned, config);
    for Motion { owner, there_from_meant: motion, things } in motions {
        let object = surfaces.owners[owner].id;
        let outline: Vec<Point> = surfaces.ends_of(owner).map(|p| motion.act(&p)).collect();
        let id = ChangeId::Moved(object);
        let what = What::Moved { motion, distance: moved::distance(&surfaces, owner, &motion) };
        changes.insert(id, told(id, what, &outline, probed.of_owner(owner), &found, &things));
        taken.extend(things);
    }
    for (owner, said) in surfaces.owners.iter().enumerate() {
        if said.kind == Kind::Doorway || changes.contains_key(&ChangeId::Moved(said.id)) {
            continue;
        }
        let of_owner = probed.of_owner(owner);
        if of_owner.is_missing(config) {
            let outline: Vec<Point> = surfaces.ends_of(owner).collect();
            let id = ChangeId::Missing(said.id);
            changes
                .insert(id, told(id, What::Missing, &outline, of_owner, &found, &BTreeSet::new()));
            continue;
        }
        let stretches = probed.stretches(&surfaces, owner, config);
        if !stretches.is_empty() {
            let outline: Vec<Point> = stretches.iter().flat_map(|s| [s.from, s.to]).collect();
            let id = ChangeId::Opened(said.id);
            let what = What::Opened { stretches };
            changes.insert(id, told(id, what, &outline, of_owner, &found, &BTreeSet::new()));
        }
    }
    for (index, thing) in found.things.iter().enumerate() {
        if taken.contains(&index) || thing.extent() < config.length_min {
            continue;
        }
        let id = ChangeId::New(thing.features[0]);
        let things = BTreeSet::from([index]);
        changes.insert(id, told(id, What::New, &[], probe::OfOwner::default(), &found, &things));
    }
    Ok(changes)
}

fn told(
    id: ChangeId,
    what: What,
    outline: &[Point],
    probed: probe::OfOwner,
    found: &Found<'_>,
    things: &BTreeSet<usize>,
) -> Change {
    let things: Vec<&Thing> = things.iter().filter_map(|index| found.things.get(*index)).collect();
    let seen = || things.iter().flat_map(|thing| &thing.features);
    let sightings = || seen().filter_map(|feature| found.sighting(*feature));
    let mut places = outline.to_vec();
    if places.is_empty() {
        places.extend(things.iter().flat_map(|thing| thing.places.iter().map(|place| place.at)));
    }
    let features: BTreeSet<Feature> = seen().copied().collect();
    let robots: BTreeSet<RobotName> =
        sightings().flat_map(|sighting| sighting.robots.iter().cloned()).collect();
    Change {
        id,
        what,
        hull: convex_hull(&places),
        probed: probed.probed,
        through: probed.through,
        features: features.into_iter().collect(),
        looks: sightings().map(|sighting| sighting.looks).max().unwrap_or(0),
        robots: robots.into_iter().collect(),
        last_seen_us: sightings().map(|sighting| sighting.last_seen_us).max(),
    }
}
