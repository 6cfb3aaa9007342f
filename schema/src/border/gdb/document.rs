//! A whole model as one document, with the prototypes that it is made of.

use std::collections::BTreeMap;

use uuid::Uuid;

use super::super::violations::{Place, Violation, Violations};
use super::{Library, features, map_prototype, prototypes};
use crate::v1;

/// What a document holds.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct CheckedDocument {
    /// By identity.
    pub objects: BTreeMap<Uuid, v1::GdbObject>,
    /// By name.
    pub prototypes: BTreeMap<String, v1::GdbPrototype>,
}

/// A document. Instances of what it does not hold are of `known`; of what is in neither, there is a finding.
///
/// # Errors
/// What is wrong with it, place by place.
pub fn check_document(
    document: &v1::GdbDocument,
    known: &Library,
) -> Result<CheckedDocument, Vec<Violation>> {
    let mut wrong = Violations::default();
    let root = Place::Root;
    if let Some(named) = &document.coord_ref_sys {
        let word = named.pointer("/value/type").and_then(serde_json::Value::as_str);
        if word != Some("EngineeringCRS") {
            let detail =
                "coordinates are metres of a building (an EngineeringCRS), not places on the earth";
            wrong.add(&root.field("coordRefSys"), "frame_mismatch", detail);
        }
    }
    let prototypes = prototypes(&document.prototypes, &root.field("prototypes"), &mut wrong);
    let mut library = known.clone();
    for (name, prototype) in &prototypes {
        // What is wrong with it is said already.
        if let Ok(mapped) = map_prototype(prototype) {
            library.insert(name.as_str().into(), mapped);
        }
    }
    let objects = features(&document.features, &root.field("features"), &library, &mut wrong);
    wrong.none_or(Some(CheckedDocument { objects, prototypes }))
}
