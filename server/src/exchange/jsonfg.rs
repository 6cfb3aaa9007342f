//! A model as one JSON-FG document, with its prototypes: the form that holds all of a model, out and in.

use std::collections::BTreeMap;
use std::io::{self, Write};

use mapfold_map::gdb::PrototypeName;
use mapfold_schema::border::gdb::{
    CONFORMS_TO, check_document, coord_ref_sys, map_prototype, wire_feature, wire_prototype,
};
use mapfold_schema::codec::{self, DecodeError};
use mapfold_schema::v1::{CollectionWord, GdbDocument, GdbPrototype, ModelFormat};
use uuid::Uuid;

use super::incoming::{DOCUMENT, FileFault, Found, Incoming};
use super::outgoing::Outgoing;

/// What it is sent as.
pub const MEDIA_TYPE: &str = "application/fg+json";

/// Writes a model.
///
/// # Errors
/// What `to` cannot take.
pub fn write(model: Outgoing<'_>, to: &mut impl Write) -> io::Result<()> {
    let prototype = |(name, wire): (&str, &GdbPrototype)| {
        let mapped = model.model.prototypes.get(name)?;
        Some(wire_prototype(name, wire, mapped))
    };
    let library = &model.model.prototypes;
    let [revision, library_revision] = model.version;
    let document = GdbDocument {
        kind: CollectionWord::FeatureCollection,
        conforms_to: CONFORMS_TO.map(ToOwned::to_owned).to_vec(),
        coord_ref_sys: Some(coord_ref_sys(model.frame)),
        revision: Some(revision),
        library: Some(library_revision),
        prototypes: model.used().into_iter().filter_map(prototype).collect(),
        features: model
            .pairs()
            .map(|(id, object, mapped)| wire_feature(id, object, mapped, library))
            .collect(),
    };
    to.write_all(&codec::to_json(&document).map_err(io::Error::other)?)
}

/// Reads a model.
///
/// # Errors
/// What is wrong with it, place by place.
pub fn read(
    bytes: &[u8],
    frame: Uuid,
    library: &BTreeMap<String, GdbPrototype>,
) -> Result<Incoming, FileFault> {
    let mut found = Found::new(ModelFormat::Jsonfg, frame, bytes)?;
    let document: GdbDocument = codec::from_json(bytes).map_err(|error| match error {
        DecodeError::Shape(violation) => FileFault::of(vec![violation]),
        other => FileFault::at(DOCUMENT, other.to_string()),
    })?;
    let known = library.iter().filter_map(|(name, prototype)| {
        Some((PrototypeName::from(name.as_str()), map_prototype(prototype).ok()?))
    });
    let checked = check_document(&document, &known.collect()).map_err(FileFault::of)?;
    let named = document.coord_ref_sys.as_ref();
    let named = named.and_then(|crs| crs.pointer("/value/datum/name"));
    if let Some(name) = named.and_then(serde_json::Value::as_str)
        && name != format!("urn:uuid:{frame}")
    {
        let words =
            format!("it was drawn in another frame ({name}); its metres are taken as this level's");
        found.warnings.push(words);
    }
    found.objects = checked.objects;
    found.prototypes = checked.prototypes;
    found.settled(library)
}

#[cfg(test)]
mod tests;
