//! A model out of a file of another program: objects and prototypes, a report, or where the file is wrong.
//!
//! Knows no format: each format gathers what it finds in an [`Incoming`], which checks it as if it had been drawn by
//! hand.

use std::collections::{BTreeMap, BTreeSet};

use mapfold_map::gdb::{Kind, Model, Structure};
use mapfold_schema::border::Violation;
use mapfold_schema::border::gdb::{
    NAME_LENGTH_MAX, OBJECTS_MAX, PROTOTYPES_MAX, VERTICES_MAX, map_object, map_prototype,
    object_id, vertex_count,
};
use mapfold_schema::digest::{self, hexadecimal};
use mapfold_schema::v1::{
    Bounds, GdbObject, GdbPrototype, KindCount, LeftOut, ModelFormat, ModelReport, ObjectKind,
};
use sha2::{Digest, Sha256};
use uuid::Uuid;

/// Longest file of a model, bytes.
pub const FILE_BYTES_MAX: usize = 64 << 20;
/// Reasons for what is left out that are told.
const LEFT_OUT_MAX: usize = 64;

/// The place of what is wrong with a document as a whole.
pub(super) const DOCUMENT: &str = "the document";

/// Why a file is not taken: what is wrong, and where.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{place}: {fault}")]
pub struct FileFault {
    /// Where: a line, a byte, a path of names.
    pub place: String,
    /// What is wrong there, and what should be.
    pub fault: String,
    /// All that is wrong, of formats that say it place by place.
    pub errors: Vec<Violation>,
}

impl FileFault {
    /// One thing that is wrong.
    pub fn at(place: impl Into<String>, fault: impl Into<String>) -> Self {
        Self { place: place.into(), fault: fault.into(), errors: Vec::new() }
    }

    /// Things that are wrong place by place.
    pub fn of(errors: Vec<Violation>) -> Self {
        let first = errors.first().map(|v| (v.pointer.clone(), v.detail.clone()));
        let (pointer, fault) = first.unwrap_or_default();
        // The empty pointer is the whole of a document.
        let place = if pointer.is_empty() { DOCUMENT.to_owned() } else { pointer };
        Self { place, fault, errors }
    }
}

/// What was found in a file.
#[derive(Debug, Clone, PartialEq)]
pub struct Incoming {
    /// By identities that are the same for the same file.
    pub objects: BTreeMap<Uuid, GdbObject>,
    /// Prototypes that the site's library does not have.
    pub prototypes: BTreeMap<String, GdbPrototype>,
    /// In words and figures.
    pub report: ModelReport,
}

/// Gathers what a format finds.
#[derive(Debug)]
pub(super) struct Found {
    pub(super) format: ModelFormat,
    pub(super) scale_m: f64,
    pub(super) objects: BTreeMap<Uuid, GdbObject>,
    pub(super) prototypes: BTreeMap<String, GdbPrototype>,
    pub(super) warnings: Vec<String>,
    left_out: BTreeMap<(String, String), u32>,
    frame: Uuid,
    digest: [u8; 32],
}

impl Found {
    /// Nothing yet, in a file of `bytes` that is taken into the level of `frame`.
    ///
    /// # Errors
    /// The file is longer than any is.
    pub(super) fn new(format: ModelFormat, frame: Uuid, bytes: &[u8]) -> Result<Self, FileFault> {
        if bytes.len() > FILE_BYTES_MAX {
            let fault =
                format!("{} bytes; {FILE_BYTES_MAX} are the most that one has", bytes.len());
            return Err(FileFault::at("the file", fault));
        }
        Ok(Self {
            format,
            scale_m: 1.0,
            objects: BTreeMap::new(),
            prototypes: BTreeMap::new(),
            warnings: Vec::new(),
            left_out: BTreeMap::new(),
            frame,
            digest: Sha256::digest(bytes).into(),
        })
    }

    /// Puts an object, under the identity that the file gives it or one that is the same for the same file.
    ///
    /// # Errors
    /// It is none that a model may hold, or one too many.
    pub(super) fn put(
        &mut self,
        place: &str,
        id: Option<Uuid>,
        mut object: GdbObject,
    ) -> Result<(), FileFault> {
        object.name = short_name(&object.name);
        if let Err(wrong) = map_object(&object) {
            return Err(unfit(place, &wrong));
        }
        if self.objects.len() >= OBJECTS_MAX {
            return Err(FileFault::at(place, format!("a level has at most {OBJECTS_MAX} objects")));
        }
        let id = id.filter(|id| !self.objects.contains_key(id));
        self.objects.insert(id.unwrap_or_else(|| self.identity(place)), object);
        Ok(())
    }

    /// Puts a prototype.
    ///
    /// # Errors
    /// It is none that a library may hold.
    pub(super) fn put_prototype(
        &mut self,
        place: &str,
        name: &str,
        prototype: GdbPrototype,
    ) -> Result<(), FileFault> {
        if let Err(wrong) = map_prototype(&prototype) {
            return Err(unfit(place, &wrong));
        }
        self.prototypes.insert(name.to_owned(), prototype);
        Ok(())
    }

    /// Notes that something is not taken.
    pub(super) fn leave_out(&mut self, what: impl Into<String>, why: impl Into<String>) {
        let key = (what.into(), why.into());
        if self.left_out.len() < LEFT_OUT_MAX || self.left_out.contains_key(&key) {
            *self.left_out.entry(key).or_default() += 1;
        } else {
            let rest = ("other things".to_owned(), "there are too many kinds to tell".to_owned());
            *self.left_out.entry(rest).or_default() += 1;
        }
    }

    /// All that was found. A prototype whose name means another one in `library` gets a name of its own.
    ///
    /// # Errors
    /// The library would have too many prototypes.
    pub(super) fn settled(
        mut self,
        library: &BTreeMap<String, GdbPrototype>,
    ) -> Result<Incoming, FileFault> {
        let mut names: BTreeMap<String, String> = BTreeMap::new();
        let mut new = BTreeMap::new();
        for (name, prototype) in std::mem::take(&mut self.prototypes) {
            let mut settled = short_name(&name);
            if settled.trim().is_empty() {
                "unnamed".clone_into(&mut settled);
            }
            let is_other =
                |known: Option<&GdbPrototype>| known.is_some_and(|known| *known != prototype);
            if is_other(library.get(&settled)) || is_other(new.get(&settled)) {
                settled = other_name(&settled, &prototype);
                self.warnings.push(format!(
                    "the site has another prototype {name:?}; this one comes in as {settled:?}"
                ));
            }
            if !library.contains_key(&settled) {
                new.insert(settled.clone(), prototype);
            }
            names.insert(name, settled);
        }
        if library.len() + new.len() > PROTOTYPES_MAX {
            let fault = format!("a site has at most {PROTOTYPES_MAX} prototypes");
            return Err(FileFault::at("prototypes", fault));
        }
        for object in self.objects.values_mut() {
            if let Some(name) = object.prototype.as_mut()
                && let Some(settled) = names.get(name)
            {
                name.clone_from(settled);
            }
        }
        let structure = Structure::of(&self.model(&new, library)?);
        let report = self.report(&new, &structure);
        Ok(Incoming { objects: self.objects, prototypes: new, report })
    }

    fn report(
        &mut self,
        new: &BTreeMap<String, GdbPrototype>,
        structure: &Structure,
    ) -> ModelReport {
        let count =
            |kind| self.objects.values().filter(|object| object.kind == kind).count() as u32;
        let kinds =
            Kind::ALL.map(ObjectKind::from).map(|kind| KindCount { kind, count: count(kind) });
        let left_out = std::mem::take(&mut self.left_out);
        ModelReport {
            format: self.format,
            scale_m: self.scale_m,
            kinds: kinds.into_iter().filter(|kind| kind.count > 0).collect(),
            instances: self.objects.values().filter(|o| o.prototype.is_some()).count() as u32,
            prototypes: new.keys().cloned().collect(),
            bounds: structure.extent().map(|[from, to]| Bounds {
                min_x_m: from.x,
                min_y_m: from.y,
                max_x_m: to.x,
                max_y_m: to.y,
            }),
            left_out: left_out
                .into_iter()
                .map(|((what, why), count)| LeftOut { what, count, why })
                .collect(),
            warnings: std::mem::take(&mut self.warnings),
        }
    }

    /// What comes in, as the map has it.
    fn model(
        &self,
        new: &BTreeMap<String, GdbPrototype>,
        library: &BTreeMap<String, GdbPrototype>,
    ) -> Result<Model, FileFault> {
        let named = |o: &GdbObject| o.prototype.clone();
        let used: BTreeSet<String> = self.objects.values().filter_map(named).collect();
        let known = library.iter().filter(|(name, _)| used.contains(*name)).chain(new);
        let mapped =
            known.filter_map(|(name, p)| Some((name.as_str().into(), map_prototype(p).ok()?)));
        let prototypes = mapped.collect();
        let object =
            |(id, object): (&Uuid, &GdbObject)| Some((object_id(*id), map_object(object).ok()?));
        let objects = self.objects.iter().filter_map(object).collect();
        let model = Model { prototypes, objects };
        let mut vertices = 0_usize;
        for object in model.objects.values() {
            let solids = model.solids(object).unwrap_or_default();
            vertices += solids.iter().map(vertex_count).sum::<usize>();
            if vertices > VERTICES_MAX {
                let fault = format!(
                    "a model has at most {VERTICES_MAX} vertices in all, those of prototypes once for each instance"
                );
                return Err(FileFault::at("the model", fault));
            }
        }
        Ok(model)
    }

    fn identity(&self, place: &str) -> Uuid {
        let digest = Sha256::new()
            .chain_update("model file")
            .chain_update(self.frame)
            .chain_update(self.digest)
            .chain_update(place)
            .finalize();
        digest::identity(&digest.into())
    }
}

fn unfit(place: &str, wrong: &[Violation]) -> FileFault {
    let fault = wrong.first().map(|v| format!("cannot be taken: {}: {}", v.pointer, v.detail));
    FileFault::at(place, fault.unwrap_or_default())
}

/// A name without control characters, of at most the length that a name may have.
pub(super) fn short_name(name: &str) -> String {
    let mut short: String = name.chars().filter(|c| !c.is_control()).collect();
    while short.len() > NAME_LENGTH_MAX {
        short.pop();
    }
    short
}

/// The name of a prototype beside another one of that name: the same for the same prototype.
fn other_name(name: &str, prototype: &GdbPrototype) -> String {
    let content = serde_json::to_vec(prototype).unwrap_or_default();
    let digest = Sha256::digest(&content);
    let suffix = format!("~{}", hexadecimal(&digest[..4]));
    let mut other = name.to_owned();
    while other.len() + suffix.len() > NAME_LENGTH_MAX {
        other.pop();
    }
    other + &suffix
}

/// An object of a kind with nothing said of it yet.
pub(super) fn object(kind: ObjectKind, name: &str) -> GdbObject {
    GdbObject {
        name: short_name(name),
        kind,
        solids: None,
        prototype: None,
        placement: None,
        tolerance_m: None,
        trust: None,
        door: None,
    }
}
