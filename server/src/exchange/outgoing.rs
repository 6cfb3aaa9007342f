//! A model on its way into a file: what all formats are written from.

use std::collections::BTreeMap;

use mapfold_map::gdb::{Model, Object};
use mapfold_schema::border::gdb::object_id;
use mapfold_schema::v1::{GdbObject, GdbPrototype};
use uuid::Uuid;

/// A model at one version, as it travels and as the map has it.
#[derive(Debug, Clone, Copy)]
pub struct Outgoing<'a> {
    /// The frame of its level.
    pub frame: Uuid,
    /// The draft and the library that it is of.
    pub version: [i64; 2],
    /// By identity.
    pub objects: &'a BTreeMap<Uuid, GdbObject>,
    /// All prototypes of the site.
    pub library: &'a BTreeMap<String, GdbPrototype>,
    /// The same as the map has it.
    pub model: &'a Model,
}

impl<'a> Outgoing<'a> {
    /// Prototypes that have instances.
    pub fn used(&self) -> BTreeMap<&'a str, &'a GdbPrototype> {
        let named = self.objects.values().filter_map(|object| object.prototype.as_deref());
        named.filter_map(|name| Some((name, self.library.get(name)?))).collect()
    }

    /// Each object as it travels and as the map has it.
    pub fn pairs(&self) -> impl Iterator<Item = (Uuid, &'a GdbObject, &'a Object)> {
        let (objects, model) = (self.objects, self.model);
        objects
            .iter()
            .filter_map(|(id, object)| Some((*id, object, model.objects.get(&object_id(*id))?)))
    }
}
