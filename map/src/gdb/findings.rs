//! What is wrong with a model, each with its place and what to do about it.

use std::fmt;

use super::overlaps::between_objects;
use super::shell::{Fault, faults};
use super::{Model, Object, ObjectId, Point3, PrototypeName, Shape, Solid};

/// How bad a finding is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Severity {
    /// Plans are made as if everything were right; somebody should have a look.
    Warning,
    /// Plans leave out what the finding is about; the model is not fit to be published.
    Error,
}

/// Where a finding is.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Place {
    /// In which object; for a finding in a prototype, none.
    pub object: Option<ObjectId>,
    /// In which prototype.
    pub prototype: Option<PrototypeName>,
    /// In which of its solids, from 0.
    pub solid: Option<usize>,
    /// In which face of the polyhedron, from 0.
    pub face: Option<usize>,
    /// Where: in the level for what is between objects, else in the coordinates of the object or prototype; metres.
    pub at: Option<Point3>,
}

/// What a finding says. Shown, it is a sentence that tells a person what to do.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum FindingKind {
    /// An instance of a prototype that the library has not.
    UnknownPrototype(PrototypeName),
    /// An object or prototype of no solids.
    NoSolids,
    /// A tolerance that is negative or no number.
    BadTolerance,
    /// A trust that is not within 0 and 1.
    BadTrust,
    /// A placement that is not made of numbers.
    BadPlacement,
    /// A coordinate further than 10 km from the origin, or no number.
    OutOfReach,
    /// A solid without extent in some direction, or upside down.
    NoExtent,
    /// A ring of fewer than three vertices.
    TooFewVertices,
    /// A face that names a vertex that is not there.
    UnknownVertex,
    /// A vertex that follows upon itself.
    RepeatedVertex,
    /// A ring that encloses nothing.
    NoArea,
    /// A ring that meets itself or another one of its face.
    MeetsItself,
    /// A ring whose edges run beside each other too often to be looked through.
    TooIntricate,
    /// A hole that is not within the outer ring, or within another hole.
    HoleOutside,
    /// A face whose vertices do not lie in one plane.
    NotPlane {
        /// How far the worst vertex lies off the plane, metres.
        off: f64,
    },
    /// A polyhedron with edges of one face only.
    OpenShell {
        /// How many such edges.
        edges: usize,
    },
    /// A face that runs the other way round than its neighbours.
    FlippedFace,
    /// A closed polyhedron whose faces all run the wrong way round.
    InsideOut,
    /// Two objects take up the same space.
    Overlap {
        /// The other one.
        other: ObjectId,
        /// The most that they share of any height looked at, square metres.
        area: f64,
    },
    /// So many objects lie over each other that not all of them were held against each other.
    TooCrowded,
    /// A doorway that meets no wall: it opens nothing.
    DoorwayOutsideWall,
    /// A doorway that opens one face of a wall but does not come out on another.
    DoorwayNotThrough,
}

impl FindingKind {
    /// How bad it is.
    pub fn severity(&self) -> Severity {
        match self {
            Self::NotPlane { .. }
            | Self::OpenShell { .. }
            | Self::Overlap { .. }
            | Self::TooCrowded
            | Self::DoorwayOutsideWall
            | Self::DoorwayNotThrough => Severity::Warning,
            _ => Severity::Error,
        }
    }
}

impl fmt::Display for FindingKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnknownPrototype(name) => write!(
                f,
                "the library has no prototype \"{name}\": add it, or choose another for this object"
            ),
            Self::NoSolids => f.write_str("there is nothing in it: add a solid, or delete it"),
            Self::BadTolerance => f.write_str("the tolerance must be 0 m or more: say how exactly the place is known"),
            Self::BadTrust => f.write_str("the trust must lie between 0 and 1"),
            Self::BadPlacement => f.write_str("the placement has a number that is none: place the object anew"),
            Self::OutOfReach => f.write_str(
                "it reaches further than 10 km from the origin: check the unit, or move it nearer",
            ),
            Self::NoExtent => f.write_str(
                "it has no extent: give it a size above 0, and an upper height above the lower one",
            ),
            Self::TooFewVertices => f.write_str("a polygon needs three corners: add some, or delete it"),
            Self::UnknownVertex => f.write_str("the face names a vertex that is not there: draw it anew"),
            Self::RepeatedVertex => f.write_str("two corners in a row are the same: delete one"),
            Self::NoArea => f.write_str("the polygon encloses nothing: pull its corners apart, or delete it"),
            Self::MeetsItself => f.write_str("the outline meets itself here: move a corner so that it does not"),
            Self::TooIntricate => f.write_str(
                "the edges run beside each other too often to be looked through: draw it with fewer corners, or in parts",
            ),
            Self::HoleOutside => f.write_str("the hole does not lie in its polygon: move it inside, or delete it"),
            Self::NotPlane { off } => write!(
                f,
                "a corner lies {:.1} mm off the plane of its face: move it, or cut the face in two",
                off * 1e3
            ),
            Self::OpenShell { edges } => write!(
                f,
                "{edges} edges have a face on one side only, so this is taken as thin sheets: close it if it is solid"
            ),
            Self::FlippedFace => f.write_str("the face is seen from inside: flip it"),
            Self::InsideOut => f.write_str("all faces are seen from inside: flip the solid"),
            Self::Overlap { area, .. } => write!(
                f,
                "two objects take up the same {:.0} cm2 of floor at one height: move one of them",
                area * 1e4
            ),
            Self::TooCrowded => f.write_str(
                "more than a million pairs of objects lie over each other, and not all were looked at: take away what stands in the same place",
            ),
            Self::DoorwayOutsideWall => f.write_str("the doorway stands in no wall: move it into one"),
            Self::DoorwayNotThrough => f.write_str(
                "the doorway does not go through the wall: make it deeper, or move it away from the wall's end",
            ),
        }
    }
}

/// One thing that is wrong with a model.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// What.
    pub kind: FindingKind,
    /// Where.
    pub place: Place,
}

/// All findings of a model: those in prototypes, those in objects, then those between objects, each in
/// the order of names and ids.
pub fn findings(model: &Model) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (name, prototype) in &model.prototypes {
        let place = Place { prototype: Some(name.clone()), ..Place::default() };
        findings.extend(in_solids(&prototype.solids, &place));
    }
    for (id, object) in &model.objects {
        let place = Place { object: Some(*id), ..Place::default() };
        let found = |kind| Finding { kind, place: place.clone() };
        findings.extend(in_object(object).into_iter().map(found));
        match &object.shape {
            Shape::Own(solids) => findings.extend(in_solids(solids, &place)),
            Shape::Instance(name) if !model.prototypes.contains_key(name) => {
                findings.push(found(FindingKind::UnknownPrototype(name.clone())));
            }
            Shape::Instance(_) => {}
        }
        let placed =
            object.placement.position.iter().chain(object.placement.rotation.coords.iter());
        if placed.into_iter().all(|v| v.is_finite()) {
            let solids = model.solids(object).unwrap_or_default();
            let away = |solid: &&Solid| {
                faults(solid).is_empty() && solid.mesh(&object.placement).is_none()
            };
            if solids.iter().any(|solid| away(&solid)) {
                findings.push(found(FindingKind::OutOfReach));
            }
        } else {
            findings.push(found(FindingKind::BadPlacement));
        }
    }
    findings.extend(between_objects(model));
    findings
}

fn in_object(object: &Object) -> Vec<FindingKind> {
    let mut kinds = Vec::new();
    if !(object.tolerance.is_finite() && object.tolerance >= 0.0) {
        kinds.push(FindingKind::BadTolerance);
    }
    if !(0.0..=1.0).contains(&object.trust) {
        kinds.push(FindingKind::BadTrust);
    }
    kinds
}

fn in_solids(solids: &[Solid], place: &Place) -> Vec<Finding> {
    if solids.is_empty() {
        return vec![Finding { kind: FindingKind::NoSolids, place: place.clone() }];
    }
    let of_each = solids.iter().enumerate().flat_map(|(solid, shape)| {
        faults(shape).into_iter().map(move |Fault { kind, face, at }| Finding {
            kind,
            place: Place { solid: Some(solid), face, at, ..place.clone() },
        })
    });
    of_each.collect()
}
