//! What is wrong between objects: space taken up twice, doorways without a wall.

use std::collections::BTreeSet;

use super::arrangement::{Drawn, Part, area, arrange};
use super::findings::{Finding, FindingKind, Place};
use super::section::plan;
use super::structure::Standing;
use super::{Kind, MICROMETRES, Model, ObjectId, Point3, Structure};

/// Objects that share less than this at every height only touch, square metres.
const SHARED_MIN: f64 = 1e-4;
/// The most pairs of objects that are held against each other.
const PAIRS_MAX: usize = 1_000_000;
/// The most heights that a pair is looked at.
const HEIGHTS_MAX: usize = 64;

/// The findings of pairs, by the ids of the first and the second object.
pub(super) fn between_objects(model: &Model) -> Vec<Finding> {
    let structure = Structure::of(model);
    let standing = &structure.standing;
    let mut findings = Vec::new();
    // For each doorway, the walls whose boxes meet its own.
    let mut walls_at: Vec<Vec<usize>> = vec![Vec::new(); standing.len()];
    let pairs = meeting_boxes(standing);
    if pairs.len() >= PAIRS_MAX {
        findings.push(Finding { kind: FindingKind::TooCrowded, place: Place::default() });
    }
    for (a, b) in pairs {
        match (standing[a].kind, standing[b].kind) {
            (Kind::Doorway, Kind::Wall) => walls_at[a].push(b),
            (Kind::Wall, Kind::Doorway) => walls_at[b].push(a),
            // Walls overlap where they meet; what people walk on and through is not solid.
            (Kind::Wall, Kind::Wall)
            | (Kind::Doorway | Kind::Corridor, _)
            | (_, Kind::Doorway | Kind::Corridor) => {}
            _ => findings.extend(overlap(&standing[a], &standing[b])),
        }
    }
    for (index, doorway) in standing.iter().enumerate() {
        if doorway.kind == Kind::Doorway {
            let walls: Vec<&Standing> =
                walls_at[index].iter().map(|wall| &standing[*wall]).collect();
            findings.extend(of_doorway(doorway, &walls));
        }
    }
    let order = |finding: &Finding| {
        let other =
            if let FindingKind::Overlap { other, .. } = finding.kind { Some(other) } else { None };
        (finding.place.object, other)
    };
    findings.sort_by_key(order);
    findings
}

/// Pairs of objects whose boxes meet, each once, the one with the smaller id first.
fn meeting_boxes(standing: &[Standing]) -> BTreeSet<(usize, usize)> {
    let mut boxes: Vec<([[i64; 3]; 2], usize)> = standing
        .iter()
        .enumerate()
        .filter_map(|(index, object)| Some((object.bounds()?, index)))
        .collect();
    boxes.sort_unstable();
    let mut open: Vec<([[i64; 3]; 2], usize)> = Vec::new();
    let mut pairs = BTreeSet::new();
    for (bounds, index) in boxes {
        open.retain(|([_, upper], _)| upper[0] >= bounds[0][0]);
        for (other, second) in &open {
            if pairs.len() >= PAIRS_MAX {
                return pairs;
            }
            if (1..3).all(|k| bounds[0][k] <= other[1][k] && other[0][k] <= bounds[1][k]) {
                pairs.insert((index.min(*second), index.max(*second)));
            }
        }
        open.push((bounds, index));
    }
    pairs
}

/// The two objects arranged just above `height`, each a layer.
fn together(a: &Standing, b: &Standing, height: i64) -> Vec<Part<2>> {
    let drawn = [a, b].into_iter().enumerate().flat_map(|(layer, object)| {
        let [closed, _] = object.cut(height);
        closed.into_iter().map(move |ends| Drawn { ends, layer: Some(layer), owner: layer as u32 })
    });
    arrange::<2>(drawn.collect()).0
}

/// Heights between two neighbouring vertices of either object, at which both stand.
fn common_heights(a: &Standing, b: &Standing) -> Vec<i64> {
    let meshes = || a.solids.iter().chain(&b.solids).map(|(_, mesh)| mesh);
    let heights: BTreeSet<i64> = meshes().flat_map(|mesh| &mesh.vertices).map(|v| v[2]).collect();
    let heights: Vec<i64> = heights.into_iter().collect();
    let middles: Vec<i64> = heights.windows(2).map(|w| i64::midpoint(w[0], w[1])).collect();
    let stands = |object: &Standing, z: i64| {
        object.solids.iter().any(|(_, mesh)| mesh.lower <= z && z < mesh.upper)
    };
    let common: Vec<i64> = middles.into_iter().filter(|z| stands(a, *z) && stands(b, *z)).collect();
    let step = common.len().div_ceil(HEIGHTS_MAX).max(1);
    common.into_iter().step_by(step).collect()
}

/// The height at which two objects share most, and how many square metres.
fn most_shared(a: &Standing, b: &Standing) -> Option<(f64, Point3)> {
    let shared = |cover: &[i32; 2]| cover[0] > 0 && cover[1] > 0;
    let at_height = |height: i64| {
        let parts = together(a, b, height);
        let area = area(&parts, shared) / MICROMETRES.powi(2);
        let border = parts.iter().find(|part| shared(&part.above) || shared(&part.below))?;
        let p = border.left.metres();
        Some((area, Point3::new(p.x, p.y, height as f64 / MICROMETRES)))
    };
    let heights = common_heights(a, b).into_iter().filter_map(at_height);
    heights.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(area, _)| *area >= SHARED_MIN)
}

fn overlap(a: &Standing, b: &Standing) -> Option<Finding> {
    let (area, at) = most_shared(a, b)?;
    Some(Finding { kind: FindingKind::Overlap { other: b.id, area }, place: place(a.id, Some(at)) })
}

fn place(object: ObjectId, at: Option<Point3>) -> Place {
    Place { object: Some(object), at, ..Place::default() }
}

fn of_doorway(doorway: &Standing, walls: &[&Standing]) -> Option<Finding> {
    doorway.bounds()?;
    let wall = walls.iter().find_map(|wall| Some((*wall, most_shared(doorway, wall)?)));
    let Some((_, (_, at))) = wall else {
        return Some(Finding {
            kind: FindingKind::DoorwayOutsideWall,
            place: place(doorway.id, None),
        });
    };
    let mut objects: Vec<&Standing> = walls.to_vec();
    objects.push(doorway);
    objects.sort_by_key(|object| object.id);
    let height = (at.z * MICROMETRES).round() as i64;
    let plan = plan(objects.into_iter(), height);
    let through = plan
        .openings
        .iter()
        .any(|opening| opening.doorway == doorway.id && opening.sides.len() > 1);
    let kind = FindingKind::DoorwayNotThrough;
    (!through).then(|| Finding { kind, place: place(doorway.id, Some(at)) })
}
