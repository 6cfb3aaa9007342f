//! Objects that stand elsewhere: rigid motions that lay an object's surfaces on what was found.

use std::collections::BTreeSet;
use std::f64::consts::{FRAC_PI_4, PI, TAU};

use nalgebra::{Matrix3, Vector3};

use super::ChangeConfig;
use super::evidence::Scanned;
use super::found::{Found, Place, extent, is_movable};
use super::probe::{Met, Probed, count, probe};
use super::surfaces::{NEAR, Surface, Surfaces};
use crate::gdb::Kind;
use crate::geometry::{Level, Point, Pose, difference, tangent, unit_normal};

/// An object that has moved.
#[derive(Debug)]
pub(super) struct Motion {
    pub(super) owner: usize,
    /// From where the model has it to where it is.
    pub(super) there_from_meant: Pose<Level, Level>,
    /// The things that are this object.
    pub(super) things: BTreeSet<usize>,
}

/// Objects that are but drawn a little off are looked for this far, metres.
const ASIDE_MAX: f64 = 0.5;
/// Walls, which hide behind what is put before them, this far if no more than one face of them is seen.
const WALL_ASIDE_MAX: f64 = 0.25;
/// Walls that are gone are looked for this far, metres, and turned by no more than this, radians: in the same room, along the
/// same axes. Beyond that a wall is another one, for many are alike.
const WALL_MOVE_MAX: (f64, f64) = (3.0, 0.1);
/// How much of a wall must have been found elsewhere, as a share of its extent: a piece is that of many walls.
const WALL_SEEN_MIN: f64 = 0.8;
/// Less is no motion, metres and radians.
const MOTION_MIN: (f64, f64) = (0.02, 0.02);
/// A place lies on a moved surface if it is no farther off, metres.
const FITS: f64 = 0.06;
/// Share of a thing's places that have to.
const SHARE_MIN: f64 = 0.85;
/// Share of the moved surface's probes that must be hit, of those that met something or saw through.
const HIT_SHARE_MIN: f64 = 0.7;
/// Share of the outline that must be hit for an object to be told elsewhere: one face is that of many things.
const OUTLINE_SHARE_MIN: f64 = 0.5;
/// Directions of a thing's walls that are tried.
const NORMALS_MAX: usize = 3;

/// A motion with how well it lays the object on the places.
#[derive(Debug, Clone, Copy)]
struct Fitted {
    motion: Pose<Level, Level>,
    share: f64,
}

/// The objects that have moved, each to other things: those a little aside first, then those that are missing where
/// they should be.
pub(super) fn motions(
    surfaces: &Surfaces,
    probed: &Probed,
    found: &Found<'_>,
    scanned: &mut Scanned<'_>,
    config: &ChangeConfig,
) -> Vec<Motion> {
    let mut motions = Vec::new();
    let mut taken = BTreeSet::new();
    for (owner, things) in things_near(surfaces, found) {
        let mut tried = |most| aside(surfaces, owner, &things, most, found, scanned, config);
        let motion = match surfaces.owners[owner].kind {
            kind if !is_movable(kind) => None,
            // What stands before a wall would spoil the fit of one that is but a little off.
            Kind::Wall => tried(WALL_ASIDE_MAX).or_else(|| tried(ASIDE_MAX)),
            _ => tried(ASIDE_MAX),
        };
        if let Some(motion) = motion {
            taken.extend(motion.things.iter().copied());
            motions.push(motion);
        }
    }
    let mut candidates = Vec::new();
    for (owner, said) in surfaces.owners.iter().enumerate() {
        let is_gone = probed.of_owner(owner).is_missing(config);
        if !is_gone || !is_movable(said.kind) || motions.iter().any(|m| m.owner == owner) {
            continue;
        }
        for (index, thing) in found.things.iter().enumerate() {
            if let Some(fitted) = elsewhere(surfaces, owner, &thing.places, scanned, config) {
                let away = distance(surfaces, owner, &fitted.motion);
                candidates.push((rank(&fitted), away, owner, index, fitted.motion));
            }
        }
    }
    candidates.sort_by(|a, b| {
        (a.0.cmp(&b.0)).then(a.1.total_cmp(&b.1)).then((a.2, a.3).cmp(&(b.2, b.3)))
    });
    let mut placed = BTreeSet::new();
    for (_, _, owner, index, there_from_meant) in candidates {
        if !taken.contains(&index) && placed.insert(owner) {
            taken.insert(index);
            let things = BTreeSet::from([index]);
            motions.push(Motion { owner, there_from_meant, things });
        }
    }
    motions
}

/// Fits in steps of a twentieth, best first; then the least turn.
fn rank(fitted: &Fitted) -> (i64, i64) {
    let misses = (20.0 * (1.0 - fitted.share)).round() as i64;
    (misses, (fitted.motion.heading().abs() / 0.1).round() as i64)
}

/// How far the middle of an object moves, metres.
pub(super) fn distance(surfaces: &Surfaces, owner: usize, motion: &Pose<Level, Level>) -> f64 {
    let middle = mean(surfaces.ends_of(owner));
    (motion.act(&middle) - middle).norm()
}

fn mean(places: impl Iterator<Item = Point>) -> Point {
    let (sum, count) = places.fold((Point::zeros(), 0.0), |(sum, n), p| (sum + p, n + 1.0));
    sum / f64::max(count, 1.0)
}

/// Which things have places near the surfaces of which objects.
fn things_near(surfaces: &Surfaces, found: &Found<'_>) -> Vec<(usize, BTreeSet<usize>)> {
    let mut pairs = BTreeSet::new();
    for (index, thing) in found.things.iter().enumerate() {
        for place in &thing.places {
            for (_, surface) in surfaces.near(&place.at) {
                pairs.insert((surface.owner, index));
            }
        }
    }
    let mut by_owner: Vec<(usize, BTreeSet<usize>)> = Vec::new();
    for (owner, thing) in pairs {
        match by_owner.last_mut() {
            Some((last, things)) if *last == owner => {
                things.insert(thing);
            }
            _ => by_owner.push((owner, BTreeSet::from([thing]))),
        }
    }
    by_owner
}

/// Whether all that was found of an object, in its place and near it, is the object at most so many metres aside.
fn aside(
    surfaces: &Surfaces,
    owner: usize,
    things: &BTreeSet<usize>,
    most: f64,
    found: &Found<'_>,
    scanned: &mut Scanned<'_>,
    config: &ChangeConfig,
) -> Option<Motion> {
    let is_of = |place: &Place| {
        surfaces.of_owner(owner).any(|(_, surface)| {
            let faces = place.normal.is_none_or(|normal| surface.faces(&normal));
            faces && (surface.nearest(&place.at) - place.at).norm() <= most
        })
    };
    let beside = things.iter().flat_map(|index| &found.things[*index].places);
    let mut places: Vec<Place> = beside.copied().filter(is_of).collect();
    let off = places.len();
    places.extend_from_slice(&found.in_place[owner]);
    if extent(places.iter().map(|p| p.at)) < config.length_min {
        return None;
    }
    let outline: Vec<Surface> = surfaces.of_owner(owner).map(|(_, surface)| *surface).collect();
    let fitted = fit(&outline, &places, Pose::identity())?;
    let motion = fitted.motion;
    let away = distance(surfaces, owner, &motion);
    let moves = away >= MOTION_MIN.0 || motion.heading().abs() >= MOTION_MIN.1;
    // Also of those that nothing else explains: something new before a wall is not the wall.
    let on = places[..off].iter().filter(|place| lies_on(&outline, &motion, place)).count();
    let share = fitted.share.min(on as f64 / off.max(1) as f64);
    let fits = share >= SHARE_MIN && away <= most && motion.heading().abs() <= FRAC_PI_4;
    if !moves || !fits {
        return None;
    }
    let [hit, through] = probed(&outline, &motion, scanned, config);
    let is_wall = surfaces.owners[owner].kind == Kind::Wall;
    let is_far = is_wall && away > WALL_ASIDE_MAX && hit < OUTLINE_SHARE_MIN * whole(&outline);
    if !is_there(hit, through, config) || is_far {
        return None;
    }
    let covered = |index: &&usize| {
        let thing = &found.things[**index];
        let on = thing.places.iter().filter(|place| lies_on(&outline, &motion, place)).count();
        on as f64 >= SHARE_MIN * thing.places.len() as f64
    };
    let things: BTreeSet<usize> = things.iter().filter(covered).copied().collect();
    (!things.is_empty()).then_some(Motion { owner, there_from_meant: motion, things })
}

/// How an object that is gone lies on a thing elsewhere, if it does.
fn elsewhere(
    surfaces: &Surfaces,
    owner: usize,
    places: &[Place],
    scanned: &mut Scanned<'_>,
    config: &ChangeConfig,
) -> Option<Fitted> {
    let ends = || surfaces.ends_of(owner);
    let (size, seen) = (extent(ends()), extent(places.iter().map(|place| place.at)));
    let is_wall = surfaces.owners[owner].kind == Kind::Wall;
    let seen_min = if is_wall { WALL_SEEN_MIN } else { 0.4 };
    if !(seen_min * size..=1.1 * size + config.slack).contains(&seen) {
        return None;
    }
    let (middle, there) = (mean(ends()), mean(places.iter().map(|place| place.at)));
    if (there - middle).norm() > config.move_max + size {
        return None;
    }
    let outline: Vec<Surface> = surfaces.of_owner(owner).map(|(_, surface)| *surface).collect();
    let (away_max, turn_max) = if is_wall { WALL_MOVE_MAX } else { (config.move_max, PI) };
    let fits = turns(&outline, places).into_iter().filter_map(|turn| {
        let turned = Pose::<Level, Level>::new(0.0, 0.0, turn);
        let shift = there - turned.act(&middle);
        let fitted = fit(&outline, places, Pose::new(shift.x, shift.y, turn))?;
        let turn = fitted.motion.heading().abs();
        (fitted.share >= SHARE_MIN && turn <= turn_max).then_some(fitted)
    });
    let mut fits: Vec<Fitted> = fits.collect();
    fits.sort_by_key(rank);
    let whole = whole(&outline);
    let is_told = |fitted: &Fitted, scanned: &mut Scanned<'_>| {
        let [hit, through] = probed(&outline, &fitted.motion, scanned, config);
        is_there(hit, through, config) && hit >= OUTLINE_SHARE_MIN * whole
    };
    let best = fits.into_iter().find(|fitted| is_told(fitted, scanned))?;
    (distance(surfaces, owner, &best.motion) <= away_max).then_some(best)
}

/// Metres of an outline.
fn whole(outline: &[Surface]) -> f64 {
    outline.iter().map(|surface| surface.length).sum()
}

/// Turns of the outline that bring one of its surfaces to face like one of the places.
fn turns(outline: &[Surface], places: &[Place]) -> Vec<f64> {
    let mut normals: Vec<f64> = Vec::new();
    for normal in places.iter().filter_map(|place| place.normal) {
        let angle = normal.y.atan2(normal.x);
        let is_new = normals.iter().all(|known| difference(angle, *known).abs() > 0.2);
        if is_new && normals.len() < NORMALS_MAX {
            normals.push(angle);
        }
    }
    let mut turns: Vec<f64> = Vec::new();
    let mut add = |turn: f64| {
        if turns.iter().all(|known| difference(turn, *known).abs() > 0.05) {
            turns.push(turn);
        }
    };
    for normal in &normals {
        for surface in outline {
            let out = surface.outward();
            add(difference(*normal, out.y.atan2(out.x)));
        }
    }
    if normals.is_empty() {
        (0..16).for_each(|k| add(f64::from(k) * TAU / 16.0));
    }
    turns
}

/// The place in the object's own frame beside the surface that is nearest to it and faces like it: the surface's
/// outward normal and the offset from it.
fn offset(
    outline: &[Surface],
    object_from_found: &Pose<Level, Level>,
    place: &Place,
    within: f64,
) -> Option<(Point, Point, f64)> {
    let p = object_from_found.act(&place.at);
    let (normal, heading) = (place.normal, object_from_found.heading());
    let turned = normal.map(|n| unit_normal(heading) * n.x + tangent(heading) * n.y);
    let facing = outline.iter().filter(|s| turned.is_none_or(|normal| s.faces(&normal)));
    let near = facing.map(|surface| {
        let nearest = surface.nearest(&p);
        ((nearest - p).norm_squared(), surface.outward(), nearest)
    });
    let (off, outward, nearest) = near.min_by(|a, b| a.0.total_cmp(&b.0))?;
    if off > within * within {
        return None;
    }
    // Beside an end the way to it counts, else the way across.
    let way = p - nearest;
    let across = way.dot(&outward);
    let off = off.sqrt();
    Some(if across.abs() > 0.7 * off || off < 1e-9 {
        (p, outward, across)
    } else {
        (p, way / off, off)
    })
}

fn lies_on(outline: &[Surface], motion: &Pose<Level, Level>, place: &Place) -> bool {
    offset(outline, &motion.inverse(), place, FITS).is_some()
}

/// The motion that lays an outline on places, from a guess on: Gauss-Newton on the offsets from the nearest surfaces,
/// which have to be ever nearer. What the places do not tell stays as guessed.
fn fit(outline: &[Surface], places: &[Place], guess: Pose<Level, Level>) -> Option<Fitted> {
    const ROUNDS: u32 = 20;
    /// Weight of the guess beside that of a place: 2 cm beside 30 cm, squared.
    const GUESS: f64 = 0.0044;
    let mut object_from_found: Pose<Level, Level> = guess.inverse();
    let size = extent(outline.iter().map(|surface| surface.from)).max(0.1);
    let middle = mean(outline.iter().map(|surface| surface.from));
    for round in 0..ROUNDS {
        let within = (NEAR * 0.8_f64.powi(round as i32)).max(2.0 * FITS);
        let mut information =
            Matrix3::from_diagonal(&Vector3::new(GUESS, GUESS, GUESS * size * size));
        let mut pull = Vector3::zeros();
        for place in places {
            let Some((p, n, off)) = offset(outline, &object_from_found, place, within) else {
                continue;
            };
            let arm = p - middle;
            let j = Vector3::new(n.x, n.y, arm.x * n.y - arm.y * n.x);
            information += j * j.transpose();
            pull -= j * off;
        }
        let step = information.cholesky()?.solve(&pull);
        let (s, c) = step[2].sin_cos();
        // Turned about the middle, then shifted.
        let shift = middle + Point::new(step[0], step[1])
            - Point::new(c * middle.x - s * middle.y, s * middle.x + c * middle.y);
        object_from_found =
            Pose::<Level, Level>::new(shift.x, shift.y, step[2]).compose(&object_from_found);
        if step.norm() < 1e-6 {
            break;
        }
    }
    let motion = object_from_found.inverse();
    let on = places.iter().filter(|place| lies_on(outline, &motion, place)).count();
    Some(Fitted { motion, share: on as f64 / places.len().max(1) as f64 })
}

/// What scanners say of a moved outline: metres of it that are hit, and that are seen through.
fn probed(
    outline: &[Surface],
    motion: &Pose<Level, Level>,
    scanned: &mut Scanned<'_>,
    config: &ChangeConfig,
) -> [f64; 2] {
    let (mut hit, mut through) = (0.0, 0.0);
    let turn = Pose::<Level, Level>::new(0.0, 0.0, motion.heading());
    for surface in outline {
        let outward = turn.act(&surface.outward());
        let probes = count(surface, config.resolution);
        let each = surface.length / probes as f64;
        for index in 0..probes {
            let p = motion.act(&surface.at(each * (index as f64 + 0.5)));
            match probe(scanned, &p, &outward, config.slack, config) {
                Met::Hit => hit += each,
                Met::Through => through += each,
                Met::Nothing => {}
            }
        }
    }
    [hit, through]
}

/// Whether something is wherever scanners looked.
fn is_there(hit: f64, through: f64, config: &ChangeConfig) -> bool {
    hit >= config.length_min && hit >= HIT_SHARE_MIN * (hit + through)
}
