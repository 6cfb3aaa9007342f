//! What people edit: objects, and the prototypes that some of them are instances of.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::{Placement, Solid};

/// Identity of an object: the bytes of a UUID. Their order is the canonical order of a model; where two
/// objects share a surface, the smaller one owns it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ObjectId(pub [u8; 16]);

/// The name of a prototype in a site's library.
pub type PrototypeName = Arc<str>;

/// What an object is. Only walls and doorways are treated in a way of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Kind {
    /// Part of the building; doorways lead through it.
    Wall,
    /// An opening: its solids are the space that is free in walls.
    Doorway,
    /// A named stretch of floor to walk on. It has no substance: no plan shows it.
    Corridor,
    /// A machine-tool, conveyor or other plant.
    Machine,
    /// A table, shelf or other furniture.
    Furniture,
    /// Anything else that stands there.
    Other,
}

impl Kind {
    /// All kinds, in their canonical order.
    pub const ALL: [Self; 6] =
        [Self::Wall, Self::Doorway, Self::Corridor, Self::Machine, Self::Furniture, Self::Other];
}

/// What an object is made of, in its own coordinates.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Solids of its own; several make a compound object.
    Own(Vec<Solid>),
    /// Those of a prototype: the object is an instance of it.
    Instance(PrototypeName),
}

/// Something that stands in the level.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// What people call it; may be empty.
    pub name: String,
    /// What it is.
    pub kind: Kind,
    /// What it is made of.
    pub shape: Shape,
    /// Where it stands.
    pub placement: Placement,
    /// Standard deviation of where it stands, along any horizontal direction, metres.
    pub tolerance: f64,
    /// How far the model is to be believed that it is there, from 0 (not at all) to 1.
    pub trust: f64,
}

impl Object {
    /// Standard deviation of where an object stands if nobody says better, metres.
    pub const TOLERANCE: f64 = 0.03;
    /// Trust in an object if nobody says better: a few looks of sensors can overrule it.
    pub const TRUST: f64 = 0.5;

    /// An object of solids that are given in the level's coordinates.
    pub fn of(kind: Kind, solids: Vec<Solid>) -> Self {
        Self {
            name: String::new(),
            kind,
            shape: Shape::Own(solids),
            placement: Placement::identity(),
            tolerance: Self::TOLERANCE,
            trust: Self::TRUST,
        }
    }
}

/// A generic object of a site's library.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Prototype {
    /// What instances are made of, in their own coordinates.
    pub solids: Vec<Solid>,
}

/// The a-priori model of one level, faults included: a draft holds what a person drew.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Model {
    /// The library.
    pub prototypes: BTreeMap<PrototypeName, Prototype>,
    /// What stands in the level.
    pub objects: BTreeMap<ObjectId, Object>,
}

impl Model {
    /// The solids of an object; `None` if it is an instance of a prototype that the library has not.
    pub fn solids<'a>(&'a self, object: &'a Object) -> Option<&'a [Solid]> {
        match &object.shape {
            Shape::Own(solids) => Some(solids),
            Shape::Instance(name) => self.prototypes.get(name).map(|p| p.solids.as_slice()),
        }
    }
}
