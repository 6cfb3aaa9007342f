//! What robots found against the GDB, as it travels.

use mapfold_map::changes::{Change, ChangeId, Feature, What};
use mapfold_map::geometry::Point;

use super::features::feature_id;
use super::gdb::object_uuid;
use crate::instant::to_rfc3339;
use crate::v1;

/// The identity of a change: its kind, and the object or the first feature.
pub fn change_id(id: &ChangeId) -> String {
    match id {
        ChangeId::Missing(object) => format!("missing:{}", object_uuid(*object)),
        ChangeId::Opened(object) => format!("opened:{}", object_uuid(*object)),
        ChangeId::Moved(object) => format!("moved:{}", object_uuid(*object)),
        ChangeId::New(Feature::Segment(id)) => format!("new:segment:{}", feature_id(id)),
        ChangeId::New(Feature::Cluster(id)) => format!("new:cluster:{}", feature_id(id)),
    }
}

/// A change of which nobody has said anything yet; what the model calls the object is left out.
pub fn wire_change(change: &Change) -> v1::ModelChange {
    let (kind, object) = match change.id {
        ChangeId::Missing(object) => (v1::ModelChangeKind::Missing, Some(object)),
        ChangeId::Opened(object) => (v1::ModelChangeKind::Opened, Some(object)),
        ChangeId::Moved(object) => (v1::ModelChangeKind::Moved, Some(object)),
        ChangeId::New(_) => (v1::ModelChangeKind::New, None),
    };
    let pair = |p: &Point| [p.x, p.y];
    let motion = match &change.what {
        What::Moved { motion, distance } => Some(v1::Motion {
            x_m: motion.x,
            y_m: motion.y,
            heading_rad: motion.heading(),
            distance_m: *distance,
        }),
        _ => None,
    };
    let stretches = match &change.what {
        What::Opened { stretches } => stretches.as_slice(),
        _ => &[],
    };
    let stretch = |stretch: &mapfold_map::changes::Stretch| v1::OpenStretch {
        from_m: pair(&stretch.from),
        to_m: pair(&stretch.to),
        depth_m: stretch.depth,
    };
    let segment = |feature: &Feature| match feature {
        Feature::Segment(id) => Some(feature_id(id)),
        Feature::Cluster(_) => None,
    };
    let cluster = |feature: &Feature| match feature {
        Feature::Cluster(id) => Some(feature_id(id)),
        Feature::Segment(_) => None,
    };
    v1::ModelChange {
        id: change_id(&change.id),
        kind,
        state: v1::ModelChangeState::Open,
        object: object.map(object_uuid),
        object_kind: None,
        name: String::new(),
        hull_m: change.hull.iter().map(pair).collect(),
        motion,
        stretches: stretches.iter().map(stretch).collect(),
        probed_m: change.probed,
        through_m: change.through,
        segments: change.features.iter().filter_map(segment).collect(),
        clusters: change.features.iter().filter_map(cluster).collect(),
        looks: change.looks,
        robots: change.robots.iter().map(ToString::to_string).collect(),
        last_seen: change.last_seen_us.map(to_rfc3339),
        dismissal: None,
    }
}
