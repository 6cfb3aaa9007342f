//! Findings about a model, as they travel.

use mapfold_map::gdb::{Finding, FindingKind, Severity};

use super::object_uuid;
use crate::v1::{FindingSeverity, GdbFinding};

/// Stable name of a kind of finding.
pub fn finding_code(kind: &FindingKind) -> &'static str {
    match kind {
        FindingKind::UnknownPrototype(_) => "unknown_prototype",
        FindingKind::NoSolids => "no_solids",
        FindingKind::BadTolerance => "bad_tolerance",
        FindingKind::BadTrust => "bad_trust",
        FindingKind::BadPlacement => "bad_placement",
        FindingKind::OutOfReach => "out_of_reach",
        FindingKind::NoExtent => "no_extent",
        FindingKind::TooFewVertices => "too_few_vertices",
        FindingKind::UnknownVertex => "unknown_vertex",
        FindingKind::RepeatedVertex => "repeated_vertex",
        FindingKind::NoArea => "no_area",
        FindingKind::MeetsItself => "meets_itself",
        FindingKind::TooIntricate => "too_intricate",
        FindingKind::HoleOutside => "hole_outside",
        FindingKind::NotPlane { .. } => "not_plane",
        FindingKind::OpenShell { .. } => "open_shell",
        FindingKind::FlippedFace => "flipped_face",
        FindingKind::InsideOut => "inside_out",
        FindingKind::Overlap { .. } => "overlap",
        FindingKind::TooCrowded => "too_crowded",
        FindingKind::DoorwayOutsideWall => "doorway_outside_wall",
        FindingKind::DoorwayNotThrough => "doorway_not_through",
        // The map may learn of more; they are told in words all the same.
        _ => "other",
    }
}

/// A finding as it travels.
pub fn wire_finding(finding: &Finding) -> GdbFinding {
    let place = &finding.place;
    let other = match &finding.kind {
        FindingKind::Overlap { other, .. } => Some(object_uuid(*other)),
        _ => None,
    };
    GdbFinding {
        severity: match finding.kind.severity() {
            Severity::Warning => FindingSeverity::Warning,
            Severity::Error => FindingSeverity::Error,
        },
        code: finding_code(&finding.kind).to_owned(),
        detail: finding.kind.to_string(),
        object: place.object.map(object_uuid),
        other,
        prototype: place.prototype.as_deref().map(ToOwned::to_owned),
        solid: place.solid.map(|index| index as u32),
        face: place.face.map(|index| index as u32),
        at_m: place.at.map(|p| [p.x, p.y, p.z]),
    }
}
