//! What we write beside an entity (extended data), so that it comes back as what it was: identity, name, and whatever the
//! format has no place for.

use std::collections::BTreeMap;

use mapfold_schema::v1::{Door, DoorKind, GdbObject, GdbPrism, GdbSolid, ObjectKind};
use serde::de::DeserializeOwned;
use uuid::Uuid;

use super::super::affine::Affine;
use super::document::{Entity, Tags};
use super::placing::{Outline, Piece};
use super::prototypes::{Faces, corners, cylinder};

pub(super) const ID: &str = "id";
pub(super) const KIND: &str = "kind";
pub(super) const NAME: &str = "name";
pub(super) const TOLERANCE: &str = "tolerance_m";
pub(super) const TRUST: &str = "trust";
pub(super) const DOOR: &str = "door";
pub(super) const OPENS: &str = "opens_rad";
pub(super) const SOLID: &str = "solid";
pub(super) const FACE: &str = "face";
pub(super) const CHORD: &str = "chord_error_m";
pub(super) const PROTOTYPE: &str = "prototype";

pub(super) fn id(tags: &Tags) -> Option<Uuid> {
    tags.get(ID)?.parse().ok()
}

fn word<T: DeserializeOwned>(tags: &Tags, key: &str) -> Option<T> {
    serde_json::from_value(tags.get(key)?.as_str().into()).ok()
}

fn number(tags: &Tags, key: &str) -> Option<f64> {
    tags.get(key)?.parse().ok().filter(|value: &f64| value.is_finite())
}

pub(super) fn kind(tags: &Tags) -> Option<ObjectKind> {
    word(tags, KIND)
}

/// Gives an object what its tags say of it.
pub(super) fn complete(object: &mut GdbObject, tags: &Tags) {
    if let Some(name) = tags.get(NAME) {
        object.name.clone_from(name);
    }
    object.tolerance_m = number(tags, TOLERANCE);
    object.trust = number(tags, TRUST);
    object.door =
        word::<DoorKind>(tags, DOOR).map(|kind| Door { kind, opens_rad: number(tags, OPENS) });
}

/// Gathers the solids of one object or prototype.
#[derive(Debug, Default)]
pub(super) struct Gathering {
    solids: BTreeMap<usize, Gathered>,
}

#[derive(Debug)]
enum Gathered {
    Prism(GdbPrism),
    Whole(GdbSolid),
    Faces(Faces),
}

impl Gathering {
    pub(super) fn add(&mut self, piece: &Piece, tags: &Tags) {
        let solid = tags.get(SOLID).and_then(|word| word.parse().ok()).unwrap_or(0);
        match (&piece.outline, piece.heights) {
            (Outline::Ring(ring), Some([lower_m, upper_m])) => {
                let prism = || GdbPrism { base_m: Vec::new(), lower_m, upper_m };
                let entry = self.solids.entry(solid).or_insert_with(|| Gathered::Prism(prism()));
                if let Gathered::Prism(prism) = entry {
                    prism.base_m.push(corners(ring));
                }
            }
            (Outline::Circle { centre, radius }, Some(heights)) => {
                let mut whole = cylinder(*centre, *radius, heights);
                if let GdbSolid::Cylinder(cylinder) = &mut whole {
                    cylinder.chord_error_m = number(tags, CHORD);
                }
                self.solids.entry(solid).or_insert(Gathered::Whole(whole));
            }
            (Outline::Face(face) | Outline::Loop(face), _) => {
                let number = tags.get(FACE).and_then(|word| word.parse().ok());
                let faces = || Gathered::Faces(Faces::default());
                if let Gathered::Faces(faces) = self.solids.entry(solid).or_insert_with(faces) {
                    faces.add(number, face);
                }
            }
            _ => {}
        }
    }

    pub(super) fn solids(self) -> Vec<GdbSolid> {
        let solid = |gathered| match gathered {
            Gathered::Prism(prism) => GdbSolid::Prism(prism),
            Gathered::Whole(solid) => solid,
            Gathered::Faces(faces) => GdbSolid::Polyhedron(faces.polyhedron()),
        };
        self.solids.into_values().map(solid).collect()
    }
}

/// The solids of a block that we wrote.
pub(super) fn solids(entities: &[Entity<'_>], place: &Affine) -> Vec<GdbSolid> {
    let mut gathering = Gathering::default();
    for entity in entities {
        if let Some(piece) = Piece::of(entity, place) {
            gathering.add(&piece, &entity.tags);
        }
    }
    gathering.solids()
}
