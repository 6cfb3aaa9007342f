//! Landmarks that robots taught: those of the map's walls, as far as enough looks support them.
//!
//! A function of the published segments, like all that is read from the map: a landmark goes when its walls
//! do, and with a revert.

use std::collections::{BTreeMap, BTreeSet};
use std::f64::consts::{FRAC_PI_2, PI};

use super::both_sides::{Thing, things};
use super::faces::{self, Face};
use super::{BothSidesConfig, FacesConfig, Landmark, LandmarkKind};
use crate::level::{FeatureId, RobotName};
use crate::vector::{ConfirmedConfig, EndKind, Segment};

/// When walls of the map make landmarks.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LearnedConfig {
    /// Which faces make one.
    pub faces: FacesConfig,
    /// Which of them are one thing seen from two sides.
    pub both_sides: BothSidesConfig,
    /// Which walls are well supported: only their confirmed parts count.
    pub confirmed: ConfirmedConfig,
    /// Deviation along the wall of an end of the map, metres.
    pub end_sd: f64,
}

impl LearnedConfig {
    /// The defaults: confirmed like walls that explain cells.
    pub const STANDARD: Self = Self {
        faces: FacesConfig::STANDARD,
        both_sides: BothSidesConfig::STANDARD,
        confirmed: ConfirmedConfig::STANDARD,
        end_sd: 0.05,
    };
}

/// Identity of a learned landmark: what it is, and of which walls. Where it lies moves a little with every
/// look, so its place is no part of it; only of several ends of one wall it tells which.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct LearnedId {
    /// What it is.
    pub kind: LandmarkKind,
    /// The wall before and the wall after it, free space on the left; the same twice if there is one only. Of a doorway
    /// those of its side with the smaller ones.
    pub walls: [FeatureId; 2],
    /// Of ends and doorways: twice the coordinate along the first wall in half metres, and one more for an end
    /// where its only face begins. Of corners 0: two walls meet once.
    pub place: i32,
}

/// A landmark of the map.
#[derive(Debug, Clone, PartialEq)]
pub struct LearnedLandmark {
    /// Which one.
    pub id: LearnedId,
    /// What, where and with which direction; that of a doorway is in (-pi/2, pi/2].
    pub landmark: Landmark,
    /// The angle of free space at a corner, radians; the width of a doorway or of an end, metres (0 for an end of which one
    /// side is known).
    pub extent: f64,
    /// All its walls, ascending.
    pub walls: Vec<FeatureId>,
    /// Quality: of each side the least of its walls' numbers of looks, added up: no look sees both sides of a wall.
    pub looks: u32,
    /// Who saw any of its walls, ascending.
    pub robots: Vec<RobotName>,
}

/// The landmarks of a map's walls, in the level frame, by identity.
pub fn landmarks_of_map<'a>(
    segments: impl IntoIterator<Item = (&'a FeatureId, &'a Segment)>,
    config: &LearnedConfig,
) -> BTreeMap<LearnedId, LearnedLandmark> {
    let segments: Vec<(&FeatureId, &Segment)> = segments.into_iter().collect();
    let mut faces = Vec::new();
    for (wall, (_, segment)) in segments.iter().enumerate() {
        // Between two physical ends beams went through; where the view ended nobody knows.
        let open: Vec<(f64, f64)> = segment
            .solid
            .windows(2)
            .filter(|parts| [parts[0].ends[1], parts[1].ends[0]] == [EndKind::Jump; 2])
            .map(|parts| (parts[0].span.to_m(), parts[1].span.from_m()))
            .collect();
        for part in config.confirmed.parts(segment) {
            let ends = [
                (part.span.from_m(), part.ends[0], config.end_sd),
                (part.span.to_m(), part.ends[1], config.end_sd),
            ];
            let covariance = segment.independent + segment.dependent;
            let facing = segment.facing;
            let face = Face::new(wall, &segment.line, covariance, facing, ends, open.clone());
            faces.push(face.of_map());
        }
    }
    let mut learned = BTreeMap::new();
    for thing in things(faces::landmarks(faces, &config.faces), &config.both_sides) {
        let made = known(&thing, &segments);
        learned.entry(made.id).or_insert(made);
    }
    learned
}

fn known(thing: &Thing, segments: &[(&FeatureId, &Segment)]) -> LearnedLandmark {
    let mut landmark = thing.landmark;
    let kind = landmark.kind;
    let ids = |walls: [usize; 2]| walls.map(|wall| *segments[wall].0);
    let front = thing.front;
    let (walls, is_tail) = match thing.back {
        // Round the end, from the one face to the other.
        Some(back) if kind == LandmarkKind::WallEnd => ([front.walls[0], back.walls[0]], false),
        Some(back) if ids(back.walls) < ids(front.walls) => (back.walls, back.is_tail),
        _ => (front.walls, front.is_tail),
    };
    let along = segments[walls[0]].1.line.along(&landmark.at);
    let place = match kind {
        LandmarkKind::ConvexCorner | LandmarkKind::ConcaveCorner => 0,
        LandmarkKind::WallEnd | LandmarkKind::Doorway => {
            2 * (2.0 * along).round() as i32 + i32::from(is_tail)
        }
    };
    if kind.is_two_sided() {
        landmark.direction = one_of_two(landmark.direction);
    }
    let sides = || std::iter::once(&front).chain(&thing.back);
    let all: BTreeSet<usize> = sides().flat_map(|side| side.walls).collect();
    let seen = |wall: &usize| segments[*wall].1;
    let robots: BTreeSet<&RobotName> = all.iter().flat_map(|wall| &seen(wall).robots).collect();
    let looks = sides().map(|side| side.walls.map(|wall| seen(&wall).looks));
    let mut all: Vec<FeatureId> = all.iter().map(|wall| *segments[*wall].0).collect();
    all.sort_unstable();
    LearnedLandmark {
        id: LearnedId { kind, walls: ids(walls), place },
        landmark,
        extent: thing.extent,
        walls: all,
        looks: looks.map(|[a, b]| a.min(b)).fold(0, u32::saturating_add),
        robots: robots.into_iter().cloned().collect(),
    }
}

/// Of a direction and its opposite the one in (-pi/2, pi/2].
fn one_of_two(direction: f64) -> f64 {
    if direction > FRAC_PI_2 {
        direction - PI
    } else if direction <= -FRAC_PI_2 {
        direction + PI
    } else {
        direction
    }
}
