//! Plans of the GDB, and landmarks of it and of the map, as they travel.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use mapfold_map::gdb::{Edge, LandmarkId, Plan, PlanPoint, PlannedLandmark};
use mapfold_map::landmarks::{Landmark, LandmarkKind, LearnedId, LearnedLandmark};

use super::super::features::feature_id;
use super::object_uuid;
use crate::v1;

/// A plan, made of the draft `draft` with the library `library`.
pub fn wire_plan(plan: &Plan, draft: i64, library: i64) -> v1::GdbPlan {
    let mut objects = BTreeMap::new();
    for edge in plan.edges() {
        objects.entry(edge.owner.id).or_insert(edge.owner);
    }
    let index: BTreeMap<_, u32> = objects.keys().copied().zip(0..).collect();
    let corner = |at: PlanPoint, edge: &Edge<'_>| v1::PlanCorner {
        at_m: metres(at),
        object: index.get(&edge.owner.id).copied().unwrap_or_default(),
    };
    let outline = |outline| plan.edges_of(outline).map(|edge| corner(edge.from, &edge)).collect();
    let sheet = |sheet| {
        let edges: Vec<Edge<'_>> = plan.edges_of_sheet(sheet).collect();
        let last = edges.last().map(|edge| corner(edge.to, edge));
        edges.iter().map(|edge| corner(edge.from, edge)).chain(last).collect()
    };
    v1::GdbPlan {
        height_m: plan.height(),
        draft,
        library,
        outlines: plan.outlines().iter().map(outline).collect(),
        sheets: plan.sheets().iter().map(sheet).collect(),
        openings: plan.openings().iter().map(opening).collect(),
        objects: objects
            .into_values()
            .map(|owner| v1::PlanObject {
                id: object_uuid(owner.id),
                kind: owner.kind.into(),
                tolerance_m: owner.tolerance,
                trust: owner.trust,
            })
            .collect(),
    }
}

fn opening(opening: &mapfold_map::gdb::Opening) -> v1::PlanOpening {
    let side = |side: &mapfold_map::gdb::OpeningSide| v1::PlanOpeningSide {
        wall: object_uuid(side.wall),
        from_m: metres(side.from),
        to_m: metres(side.to),
    };
    v1::PlanOpening {
        doorway: object_uuid(opening.doorway),
        width_m: opening.width(),
        sides: opening.sides.iter().map(side).collect(),
    }
}

fn metres(at: PlanPoint) -> [f64; 2] {
    let p = at.metres();
    [p.x, p.y]
}

/// The identity of a landmark of the GDB: kind, objects, and place in micrometres.
pub fn landmark_id(id: &LandmarkId) -> String {
    let [first, second] = id.objects.map(object_uuid);
    let mut text = format!("{}:{first}", kind(id.kind));
    if second != first {
        let _ = write!(text, ":{second}"); // writing to a String cannot fail
    }
    let _ = write!(text, ":{},{}", id.at.x, id.at.y);
    text
}

/// The identity of a landmark of the map: that it is learned, kind, segments, and which one of them.
pub fn learned_id(id: &LearnedId) -> String {
    let [first, second] = id.walls.map(|wall| feature_id(&wall));
    let mut text = format!("learned:{}:{first}", kind(id.kind));
    if id.walls[0] != id.walls[1] {
        let _ = write!(text, ":{second}"); // writing to a String cannot fail
    }
    let _ = write!(text, ":{}", id.place);
    text
}

fn kind(kind: LandmarkKind) -> &'static str {
    match kind {
        LandmarkKind::ConvexCorner => "convex",
        LandmarkKind::ConcaveCorner => "concave",
        LandmarkKind::WallEnd => "end",
        LandmarkKind::Doorway => "doorway",
    }
}

/// A landmark of the GDB.
pub fn wire_gdb_landmark(planned: &PlannedLandmark) -> v1::Landmark {
    let [first, second] = planned.id.objects.map(object_uuid);
    let mut objects = vec![first.to_string()];
    objects.extend((second != first).then(|| second.to_string()));
    wire(landmark_id(&planned.id), &planned.landmark, planned.extent, objects)
}

/// A landmark of the map.
pub fn wire_learned_landmark(learned: &LearnedLandmark) -> v1::Landmark {
    let objects = learned.walls.iter().map(feature_id).collect();
    let robots = learned.robots.iter().map(ToString::to_string).collect();
    v1::Landmark {
        source: v1::LandmarkSource::Learned,
        support: Some(v1::LandmarkSupport { looks: learned.looks, robots }),
        ..wire(learned_id(&learned.id), &learned.landmark, learned.extent, objects)
    }
}

fn wire(id: String, landmark: &Landmark, extent: f64, objects: Vec<String>) -> v1::Landmark {
    let [[xx, xy], [yx, yy]] = landmark.covariance.rows();
    let turn = landmark.direction_sd * landmark.direction_sd;
    v1::Landmark {
        id,
        kind: landmark.kind.into(),
        source: v1::LandmarkSource::Gdb,
        at_m: [landmark.at.x, landmark.at.y],
        heading_rad: landmark.direction,
        covariance: [[xx, xy, 0.0], [yx, yy, 0.0], [0.0, 0.0, turn]],
        extent,
        objects,
        support: None,
    }
}
