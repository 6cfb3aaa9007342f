//! The GDB on its way in: objects, edits and libraries, checked place by place.
//!
//! What gets in can be stored and drawn; whether it is right (closed, plane, not overlapping) is said by
//! findings, since a draft may hold faults.

mod document;
mod findings;
mod known;
mod place;
mod plan;
mod solids;

use std::collections::{BTreeMap, BTreeSet};

use mapfold_map::gdb::{Object, ObjectId, Placement, Point3, Prototype, PrototypeName, Shape};
use uuid::Uuid;

pub use document::{CheckedDocument, check_document};
pub use findings::{finding_code, wire_finding};
pub use known::{map_landmark, map_surfaces};
pub use plan::{landmark_id, learned_id, wire_gdb_landmark, wire_learned_landmark, wire_plan};
pub use solids::vertex_count;

use super::number::finite;
use super::violations::{Place, Violation, Violations};
use crate::v1;

/// Objects of one level.
pub const OBJECTS_MAX: usize = 50_000;
/// Prototypes of one site.
pub const PROTOTYPES_MAX: usize = 2_000;
/// Solids of one object or prototype.
pub const SOLIDS_MAX: usize = 1_024;
/// Vertices of all solids of a model, those of prototypes once for each instance.
pub const VERTICES_MAX: usize = 2_000_000;
/// Longest name of an object or a prototype, bytes.
pub const NAME_LENGTH_MAX: usize = 128;
/// Largest coordinate of anything, metres.
const COORDINATE_MAX_M: f64 = 100_000.0;
/// How far the length of a quaternion may be from 1: what rounding to a few digits leaves.
const UNIT_TOLERANCE: f64 = 1e-3;
/// Largest tolerance of an object, metres.
const TOLERANCE_MAX_M: f64 = 100.0;

/// The parts of JSON-FG that the GDB uses.
pub const CONFORMS_TO: [&str; 4] = [
    "http://www.opengis.net/spec/json-fg-1/1.0/conf/core",
    "http://www.opengis.net/spec/json-fg-1/1.0/conf/types-schemas",
    "http://www.opengis.net/spec/json-fg-1/1.0/conf/polyhedra",
    "http://www.opengis.net/spec/json-fg-1/1.0/conf/prisms",
];

/// The prototypes that instances may name.
pub type Library = BTreeMap<PrototypeName, Prototype>;

/// What an edit asks for.
#[derive(Debug, Clone, PartialEq)]
pub struct CheckedEdit {
    /// Objects to be put.
    pub put: BTreeMap<Uuid, v1::GdbObject>,
    /// Objects to be removed.
    pub removed: BTreeSet<Uuid>,
}

/// The frame of a level, as JSON-FG names it: metres, x to the right, y up, heights above the floor.
pub fn coord_ref_sys(frame: Uuid) -> serde_json::Value {
    let axis = |name: &str, letter: &str, direction: &str| {
        serde_json::json!({
            "name": name, "abbreviation": letter, "direction": direction, "unit": "metre",
        })
    };
    serde_json::json!({
        "type": "PROJJSON",
        "value": {
            "$schema": "https://proj.org/schemas/v0.7/projjson.schema.json",
            "type": "EngineeringCRS",
            "name": "level frame",
            "datum": {"type": "EngineeringDatum", "name": datum(frame)},
            "coordinate_system": {
                "subtype": "Cartesian",
                "axis": [
                    axis("right", "x", "unspecified"),
                    axis("ahead", "y", "unspecified"),
                    axis("height", "z", "up"),
                ],
            },
        },
    })
}

fn datum(frame: Uuid) -> String {
    format!("urn:uuid:{frame}")
}

/// A whole model, as it is put.
///
/// # Errors
/// What is wrong with it, place by place.
pub fn check_gdb(
    collection: &v1::GdbCollection,
    frame: Uuid,
    library: &Library,
) -> Result<BTreeMap<Uuid, v1::GdbObject>, Vec<Violation>> {
    let mut wrong = Violations::default();
    let root = Place::Root;
    if let Some(named) = &collection.coord_ref_sys {
        let name = named.pointer("/value/datum/name").and_then(serde_json::Value::as_str);
        if name != Some(datum(frame).as_str()) {
            let detail = format_args!(
                "this must be the frame of the level (its datum is {}), or be left out",
                datum(frame)
            );
            wrong.add(&root.field("coordRefSys"), "frame_mismatch", detail);
        }
    }
    let objects = features(&collection.features, &root.field("features"), library, &mut wrong);
    wrong.none_or(Some(objects))
}

/// An edit.
///
/// # Errors
/// What is wrong with it, place by place.
pub fn check_edit(edit: &v1::GdbEdit, library: &Library) -> Result<CheckedEdit, Vec<Violation>> {
    let mut wrong = Violations::default();
    let root = Place::Root;
    let put = features(&edit.put, &root.field("put"), library, &mut wrong);
    let mut removed = BTreeSet::new();
    let at = root.field("remove");
    if edit.remove.len() > OBJECTS_MAX {
        wrong.add(&at, "too_many", format_args!("a level has at most {OBJECTS_MAX} objects"));
    }
    for (index, id) in edit.remove.iter().take(OBJECTS_MAX).enumerate() {
        if !removed.insert(*id) || put.contains_key(id) {
            wrong.add(&at.index(index), "named_twice", "this object stands here twice");
        }
    }
    wrong.none_or(Some(CheckedEdit { put, removed }))
}

/// A whole library, as it is put.
///
/// # Errors
/// What is wrong with it, place by place.
pub fn check_library(
    collection: &v1::PrototypeCollection,
) -> Result<BTreeMap<String, v1::GdbPrototype>, Vec<Violation>> {
    let mut wrong = Violations::default();
    let library = prototypes(&collection.features, &Place::Root.field("features"), &mut wrong);
    wrong.none_or(Some(library))
}

fn prototypes(
    features: &[v1::PrototypeFeature],
    at: &Place<'_>,
    wrong: &mut Violations,
) -> BTreeMap<String, v1::GdbPrototype> {
    if features.len() > PROTOTYPES_MAX {
        wrong.add(at, "too_many", format_args!("a site has at most {PROTOTYPES_MAX} prototypes"));
    }
    let (mut library, mut vertices) = (BTreeMap::new(), 0);
    for (index, feature) in features.iter().take(PROTOTYPES_MAX).enumerate() {
        let at = at.index(index);
        name(&feature.id, &at.field("id"), wrong);
        if feature.id.trim().is_empty() {
            wrong.add(&at.field("id"), "bad_name", "a prototype has a name");
        }
        let properties = at.field("properties");
        let checked = prototype(&feature.properties, &properties, wrong);
        if let (Some(prototype), Some(given)) = (&checked, &feature.place) {
            let derived = place::geometry_of(&prototype.solids, &Placement::identity());
            same_place(given, derived.as_ref(), &at.field("place"), wrong);
        }
        vertices += checked.iter().flat_map(|p| &p.solids).map(vertex_count).sum::<usize>();
        if library.insert(feature.id.clone(), feature.properties.clone()).is_some() {
            wrong.add(&at.field("id"), "named_twice", "this name stands here twice");
        }
    }
    if vertices > VERTICES_MAX {
        wrong.add(at, "too_many", format_args!("{VERTICES_MAX} vertices are the most"));
    }
    library
}

/// An object as the map has it.
///
/// # Errors
/// What is wrong with it, place by place.
pub fn map_object(object: &v1::GdbObject) -> Result<Object, Vec<Violation>> {
    let mut wrong = Violations::default();
    let mapped = self::object(object, &Place::Root, &mut wrong);
    wrong.none_or(mapped)
}

/// A prototype as the map has it.
///
/// # Errors
/// What is wrong with it, place by place.
pub fn map_prototype(prototype: &v1::GdbPrototype) -> Result<Prototype, Vec<Violation>> {
    let mut wrong = Violations::default();
    let mapped = self::prototype(prototype, &Place::Root, &mut wrong);
    wrong.none_or(mapped)
}

/// An object as a feature; `mapped` is the same object, and `library` has the prototype that it names.
pub fn wire_feature(
    id: Uuid,
    object: &v1::GdbObject,
    mapped: &Object,
    library: &Library,
) -> v1::GdbFeature {
    v1::GdbFeature {
        kind: v1::FeatureWord::Feature,
        id,
        feature_type: Some(kind_word(object.kind).to_owned()),
        geometry: None,
        place: place_of(mapped, library),
        time: None,
        properties: object.clone(),
    }
}

/// A prototype as a feature; `mapped` is the same prototype.
pub fn wire_prototype(
    name: &str,
    prototype: &v1::GdbPrototype,
    mapped: &Prototype,
) -> v1::PrototypeFeature {
    v1::PrototypeFeature {
        kind: v1::FeatureWord::Feature,
        id: name.to_owned(),
        feature_type: Some("prototype".to_owned()),
        geometry: None,
        place: place::geometry_of(&mapped.solids, &Placement::identity()),
        properties: prototype.clone(),
    }
}

/// The identity of an object as the map has it.
pub fn object_id(id: Uuid) -> ObjectId {
    ObjectId(id.into_bytes())
}

/// The identity of an object on the wire.
pub fn object_uuid(id: ObjectId) -> Uuid {
    Uuid::from_bytes(id.0)
}

fn kind_word(kind: v1::ObjectKind) -> &'static str {
    match kind {
        v1::ObjectKind::Wall => "wall",
        v1::ObjectKind::Doorway => "doorway",
        v1::ObjectKind::Corridor => "corridor",
        v1::ObjectKind::Machine => "machine",
        v1::ObjectKind::Furniture => "furniture",
        v1::ObjectKind::Other => "other",
    }
}

fn features(
    features: &[v1::GdbFeature],
    at: &Place<'_>,
    library: &Library,
    wrong: &mut Violations,
) -> BTreeMap<Uuid, v1::GdbObject> {
    let (mut objects, mut vertices) = (BTreeMap::new(), 0_usize);
    if features.len() > OBJECTS_MAX {
        wrong.add(at, "too_many", format_args!("a level has at most {OBJECTS_MAX} objects"));
        return objects;
    }
    for (index, given) in features.iter().enumerate() {
        if wrong.is_full() {
            return objects;
        }
        let at = at.index(index);
        let Some((object, size)) = feature(given, &at, library, wrong) else { continue };
        vertices += size;
        if vertices > VERTICES_MAX {
            let detail = format_args!("a model has at most {VERTICES_MAX} vertices in all");
            wrong.add(&at, "too_many", detail);
            return objects;
        }
        if objects.insert(given.id, object).is_some() {
            wrong.add(&at.field("id"), "named_twice", "this object stands here twice");
        }
    }
    objects
}

/// The object of a feature, and how many vertices it has.
fn feature(
    feature: &v1::GdbFeature,
    at: &Place<'_>,
    library: &Library,
    wrong: &mut Violations,
) -> Option<(v1::GdbObject, usize)> {
    let mut wire = feature.properties.clone();
    if let Some(word) = &feature.feature_type
        && word != kind_word(wire.kind)
    {
        let detail = format_args!("this is {word:?}, but the object is a {}", kind_word(wire.kind));
        wrong.add(&at.field("featureType"), "kind_differs", detail);
    }
    if feature.geometry.is_some() {
        let detail = "this would be degrees on the earth: say it in `place`, in metres";
        wrong.add(&at.field("geometry"), "not_null", detail);
    }
    if feature.time.as_ref().is_some_and(|time| !time.is_null()) {
        wrong.add(&at.field("time"), "not_null", "the model is of no time: leave this out");
    }
    let place = at.field("place");
    let is_said = wire.solids.is_some() || wire.prototype.is_some();
    if !is_said && let Some(geometry) = &feature.place {
        if wire.placement.is_some() {
            let detail = "`place` is in the level's coordinates: leave the placement out";
            wrong.add(&at.field("properties").field("placement"), "not_null", detail);
        }
        wire.solids = Some(place::solids_of(geometry, &place, wrong)?);
    }
    let mapped = object(&wire, &at.field("properties"), wrong)?;
    if is_said && let Some(given) = &feature.place {
        same_place(given, place_of(&mapped, library).as_ref(), &place, wrong);
    }
    let size = match &mapped.shape {
        Shape::Own(solids) => solids.iter().map(vertex_count).sum(),
        Shape::Instance(name) => {
            library.get(name).map_or(0, |p| p.solids.iter().map(vertex_count).sum())
        }
    };
    Some((wire, size))
}

fn place_of(object: &Object, library: &Library) -> Option<v1::Geometry> {
    let solids = match &object.shape {
        Shape::Own(solids) => solids,
        Shape::Instance(name) => &library.get(name)?.solids,
    };
    place::geometry_of(solids, &object.placement)
}

fn same_place(
    given: &v1::Geometry,
    derived: Option<&v1::Geometry>,
    at: &Place<'_>,
    wrong: &mut Violations,
) {
    if derived != Some(given) {
        let detail = "this differs from what the properties say: change these, and leave `place` out; \
            or leave `solids`, `prototype` and `placement` out";
        wrong.add(at, "place_differs", detail);
    }
}

fn object(object: &v1::GdbObject, at: &Place<'_>, wrong: &mut Violations) -> Option<Object> {
    name(&object.name, &at.field("name"), wrong);
    let shape = match (&object.solids, &object.prototype) {
        (Some(solids), None) => solids::solids(solids, &at.field("solids"), wrong).map(Shape::Own),
        (None, Some(prototype)) => {
            name(prototype, &at.field("prototype"), wrong);
            Some(Shape::Instance(prototype.as_str().into()))
        }
        _ => {
            let detail = "an object has either `solids` of its own or a `prototype`";
            wrong.add(at, "no_shape", detail);
            None
        }
    };
    let placement = object.placement.as_ref();
    let placement =
        placement.map_or(Some(Placement::identity()), |p| placed(p, &at.field("placement"), wrong));
    let tolerance = object.tolerance_m.unwrap_or(Object::TOLERANCE);
    if !(0.0..=TOLERANCE_MAX_M).contains(&tolerance) {
        let detail = format_args!("a tolerance is 0 to {TOLERANCE_MAX_M} m");
        wrong.add(&at.field("tolerance_m"), "out_of_range", detail);
    }
    let trust = object.trust.unwrap_or(Object::TRUST);
    if !(0.0..=1.0).contains(&trust) {
        wrong.add(&at.field("trust"), "out_of_range", "trust is 0 to 1");
    }
    if let Some(door) = &object.door {
        let at = at.field("door");
        if object.kind != v1::ObjectKind::Doorway {
            wrong.add(&at, "no_doorway", "only a doorway has a door");
        }
        let turn = 0.0..=std::f64::consts::TAU;
        if door.opens_rad.is_some_and(|angle| !turn.contains(&angle)) {
            let detail = "a leaf opens by at most a full turn, in radians";
            wrong.add(&at.field("opens_rad"), "out_of_range", detail);
        }
    }
    Some(Object {
        name: object.name.clone(),
        kind: object.kind.into(),
        shape: shape?,
        placement: placement?,
        tolerance,
        trust,
    })
}

fn prototype(
    prototype: &v1::GdbPrototype,
    at: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Prototype> {
    let solids = solids::solids(&prototype.solids, &at.field("solids"), wrong)?;
    Some(Prototype { solids })
}

fn placed(
    placement: &v1::GdbPlacement,
    at: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Placement> {
    let position = position(&placement.position_m, &at.field("position_m"), wrong);
    let Some(q) = placement.rotation else {
        return Some(Placement { position: position?, ..Placement::identity() });
    };
    let at = at.field("rotation");
    for (index, value) in q.into_iter().enumerate() {
        finite(value, &at.index(index), wrong)?;
    }
    let length = q.iter().map(|part| part * part).sum::<f64>().sqrt();
    if (length - 1.0).abs() > UNIT_TOLERANCE {
        let detail = format_args!("[w, x, y, z] has the length 1, not {length}");
        wrong.add(&at, "not_unit", detail);
        return None;
    }
    Placement::turned(position?, q)
}

fn position(metres: &[f64; 3], at: &Place<'_>, wrong: &mut Violations) -> Option<Point3> {
    let mut p = Point3::zeros();
    let mut all = true;
    for (index, value) in metres.iter().enumerate() {
        match coordinate(*value, &at.index(index), wrong) {
            Some(value) => p[index] = value,
            None => all = false,
        }
    }
    all.then_some(p)
}

fn coordinate(metres: f64, at: &Place<'_>, wrong: &mut Violations) -> Option<f64> {
    let metres = finite(metres, at, wrong)?;
    if metres.abs() <= COORDINATE_MAX_M {
        return Some(metres);
    }
    wrong.add(at, "out_of_range", format_args!("{metres} m: {COORDINATE_MAX_M} m is the most"));
    None
}

fn name(name: &str, at: &Place<'_>, wrong: &mut Violations) {
    if name.len() > NAME_LENGTH_MAX || name.chars().any(char::is_control) {
        let detail = format_args!("at most {NAME_LENGTH_MAX} bytes without control characters");
        wrong.add(at, "bad_name", detail);
    }
}
