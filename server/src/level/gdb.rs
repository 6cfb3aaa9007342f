//! The GDB of a level: drafts and publications as models, and what is made of them, kept for a while.
//!
//! A model is known by its version (draft and library), and never changes. The fold does not read it: its entries only
//! take their places in the log.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use mapfold_map::changes::TooMuchSurface;
use mapfold_map::gdb::{
    Finding, LandmarkConfig, Model, Plan, PlannedLandmark, PriorError, PrototypeName, Shape,
    Structure, TooCrowded, findings, landmarks,
};
use mapfold_schema::border::Violation;
use mapfold_schema::border::gdb::{
    OBJECTS_MAX, VERTICES_MAX, map_object, map_prototype, object_id, vertex_count,
};
use mapfold_schema::codec::EncodeError;
use mapfold_schema::{codec, v1};
use uuid::Uuid;

use super::LevelHandle;
use super::open::aside;
use super::recent::Recent;
use crate::store::gdb::{GdbChange, GdbOutcome, GdbState, GdbVersion, NewGdbEntry, Publication};
use crate::store::{Store, StoreError};

/// The height that landmarks are seen at, and a prior is made for, if nobody says another, metres: that of the scanners
/// of most floor robots.
pub const HEIGHT_M: f64 = 0.3;
/// Crossings and stretches of one plan.
const PLAN_MAX: usize = 8_000_000;
/// Models of one level that are kept: the draft, what is published, and one that is compared with it.
const MODELS_MAX: usize = 3;
/// Plans of one model that are kept.
const PLANS_MAX: usize = 6;

/// Why there is no model, or no plan of it.
#[derive(Debug, thiserror::Error)]
pub enum GdbError {
    /// The store failed, or holds what it should not.
    #[error(transparent)]
    Store(#[from] StoreError),
    /// More than any building has.
    #[error(
        "the model has {vertices} vertices, those of prototypes once for each instance; {VERTICES_MAX} are the most"
    )]
    TooLarge {
        /// How many it has.
        vertices: usize,
    },
    /// There is no end to its crossings.
    #[error(transparent)]
    TooCrowded(#[from] TooCrowded),
    /// There is no raster of it.
    #[error(transparent)]
    NoPrior(#[from] PriorError),
    /// It has too much surface to be held against a map.
    #[error(transparent)]
    TooMuchSurface(#[from] TooMuchSurface),
}

/// Objects as they travel, by identity.
pub type WireObjects = BTreeMap<Uuid, v1::GdbObject>;
/// Prototypes as they travel, by name.
pub type WireLibrary = BTreeMap<String, v1::GdbPrototype>;

/// A plan, and the landmarks on it once somebody asks for them.
#[derive(Debug)]
struct Cut {
    plan: Plan,
    landmarks: OnceLock<Arc<Vec<PlannedLandmark>>>,
}

/// A model at one version.
#[derive(Debug)]
pub struct GdbModel {
    version: GdbVersion,
    objects: WireObjects,
    library: Arc<WireLibrary>,
    model: Model,
    structure: OnceLock<Structure>,
    findings: OnceLock<Vec<Finding>>,
    /// By the bits of their heights.
    cuts: Recent<u64, Cut>,
    /// Held while a cut is made: what several ask for is made once.
    making: Mutex<()>,
}

impl GdbModel {
    /// A model of checked objects.
    ///
    /// # Errors
    /// [`GdbError::TooLarge`], or what does not pass the border.
    fn new(
        version: GdbVersion,
        objects: WireObjects,
        library: Arc<WireLibrary>,
    ) -> Result<Self, GdbError> {
        let prototypes = library.iter().map(|(name, prototype)| {
            let mapped = map_prototype(prototype).map_err(|e| spoilt("prototypes", name, &e))?;
            Ok((PrototypeName::from(name.as_str()), mapped))
        });
        let prototypes = prototypes.collect::<Result<_, StoreError>>()?;
        let mapped = objects.iter().map(|(id, object)| {
            let mapped =
                map_object(object).map_err(|e| spoilt("gdb_objects", &id.to_string(), &e))?;
            Ok((object_id(*id), mapped))
        });
        let model = Model { prototypes, objects: mapped.collect::<Result<_, StoreError>>()? };
        let sizes: BTreeMap<&str, usize> = model
            .prototypes
            .iter()
            .map(|(name, p)| (&**name, p.solids.iter().map(vertex_count).sum()))
            .collect();
        let size = |object: &mapfold_map::gdb::Object| match &object.shape {
            Shape::Own(solids) => solids.iter().map(vertex_count).sum(),
            Shape::Instance(name) => sizes.get(&**name).copied().unwrap_or(0),
        };
        let vertices: usize = model.objects.values().map(size).sum();
        if vertices > VERTICES_MAX {
            return Err(GdbError::TooLarge { vertices });
        }
        Ok(Self {
            version,
            objects,
            library,
            model,
            structure: OnceLock::new(),
            findings: OnceLock::new(),
            cuts: Recent::new(PLANS_MAX),
            making: Mutex::default(),
        })
    }

    /// The model after an edit that is not in the log yet: it keeps the version of this one.
    ///
    /// # Errors
    /// [`GdbError::TooLarge`].
    pub fn with_objects(&self, objects: WireObjects) -> Result<Self, GdbError> {
        Self::new(self.version, objects, Arc::clone(&self.library))
    }

    /// The model after an edit that is not in the log yet, with a library that is not either.
    ///
    /// # Errors
    /// [`GdbError::TooLarge`].
    pub fn with_library(
        &self,
        objects: WireObjects,
        library: WireLibrary,
    ) -> Result<Self, GdbError> {
        Self::new(self.version, objects, Arc::new(library))
    }

    /// What taking objects in would make of this draft: its objects then, and the change that does it. With `replace`
    /// they are all that it holds.
    ///
    /// # Errors
    /// An object that CBOR cannot hold (none that was decoded).
    pub fn taking(
        &self,
        objects: WireObjects,
        replace: bool,
    ) -> Result<(WireObjects, GdbChange), EncodeError> {
        let put = columns(&objects)?;
        if replace {
            return Ok((objects, GdbChange::Replace(put)));
        }
        let mut after = self.objects.clone();
        after.extend(objects);
        Ok((after, GdbChange::Edit { put, removed: BTreeSet::new() }))
    }

    /// Which model it is.
    pub fn version(&self) -> GdbVersion {
        self.version
    }

    /// The objects as they travel.
    pub fn objects(&self) -> &WireObjects {
        &self.objects
    }

    /// The prototypes as they travel.
    pub fn library(&self) -> &WireLibrary {
        &self.library
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// What is wrong with it. Takes a processor for a while when first asked.
    pub fn findings(&self) -> &[Finding] {
        self.findings.get_or_init(|| findings(&self.model))
    }

    /// Its landmarks at a height, metres. Takes a processor for a while when first asked.
    ///
    /// # Errors
    /// [`GdbError::TooCrowded`].
    pub fn landmarks(&self, height_m: f64) -> Result<Arc<Vec<PlannedLandmark>>, GdbError> {
        let cut = self.cut(height_m)?;
        let made = || Arc::new(landmarks(&cut.plan, &LandmarkConfig::STANDARD));
        Ok(Arc::clone(cut.landmarks.get_or_init(made)))
    }

    /// Tells `read` of its plan at a height, metres. Takes a processor for a while when first asked.
    ///
    /// # Errors
    /// [`GdbError::TooCrowded`].
    pub fn plan<T>(&self, height_m: f64, read: impl FnOnce(&Plan) -> T) -> Result<T, GdbError> {
        Ok(read(&self.cut(height_m)?.plan))
    }

    fn cut(&self, height_m: f64) -> Result<Arc<Cut>, GdbError> {
        let key = height_m.to_bits();
        if let Some(cut) = self.cuts.get(&key) {
            return Ok(cut);
        }
        let _turn = self.making.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(cut) = self.cuts.get(&key) {
            return Ok(cut);
        }
        let structure = self.structure.get_or_init(|| Structure::of(&self.model));
        let plan = structure.plan_within(height_m, PLAN_MAX)?;
        let cut = Arc::new(Cut { plan, landmarks: OnceLock::new() });
        self.cuts.put(key, &cut);
        Ok(cut)
    }
}

/// The models of a level that were asked for last.
#[derive(Debug)]
pub(super) struct ModelCache(Recent<GdbVersion, GdbModel>);

impl Default for ModelCache {
    fn default() -> Self {
        Self(Recent::new(MODELS_MAX))
    }
}

fn spoilt(table: &'static str, key: &str, wrong: &[Violation]) -> StoreError {
    let first = wrong.first().map(|v| format!("{}: {}", v.pointer, v.detail));
    StoreError::Corrupt { table, key: key.to_owned(), detail: first.unwrap_or_default() }
}

fn decode<T: serde::de::DeserializeOwned>(
    table: &'static str,
    key: &str,
    bytes: &[u8],
) -> Result<T, StoreError> {
    codec::from_cbor(bytes).map_err(|error| StoreError::Corrupt {
        table,
        key: key.to_owned(),
        detail: error.to_string(),
    })
}

/// The library of a site at revision `until`, and its revision then.
///
/// # Errors
/// The store fails, or a row is spoilt.
pub async fn library(
    store: &Store,
    site: &str,
    until: i64,
) -> Result<(i64, WireLibrary), StoreError> {
    let (revision, rows) = store.library(site, until).await?;
    let prototype = |(name, bytes): (String, Vec<u8>)| {
        let prototype = decode("prototypes", &name, &bytes)?;
        Ok((name, prototype))
    };
    Ok((revision, rows.into_iter().map(prototype).collect::<Result<_, StoreError>>()?))
}

/// Reads a model of the store.
///
/// # Errors
/// The store fails, a row is spoilt, or the model is too large.
pub async fn read_model(
    store: &Store,
    site: &str,
    level: &str,
    version: GdbVersion,
) -> Result<GdbModel, GdbError> {
    let (_, library) = library(store, site, version.library).await?;
    let rows = store.gdb_objects(site, level, version.draft).await?;
    let made = aside(move || {
        let object = |(id, bytes): (Uuid, Vec<u8>)| {
            Ok((id, decode("gdb_objects", &id.to_string(), &bytes)?))
        };
        let objects = rows.into_iter().map(object).collect::<Result<_, StoreError>>()?;
        Ok(GdbModel::new(version, objects, Arc::new(library)))
    });
    made.await?
}

/// Looks whether the objects that the entry at `revision` put can be read.
///
/// # Errors
/// The store fails, or they cannot.
pub(crate) async fn check_entry(
    store: &Store,
    site: &str,
    level: &str,
    revision: i64,
) -> Result<(), StoreError> {
    let key = || format!("revision {revision}");
    let corrupt = |detail| StoreError::Corrupt { table: "gdb_entries", key: key(), detail };
    let entry = store.gdb_entry(site, level, revision).await?;
    let entry = entry.ok_or_else(|| corrupt("it is not there".to_owned()))?;
    let rows = store.gdb_objects_put(site, level, revision).await?;
    if rows.len() != entry.put as usize {
        return Err(corrupt(format!("it put {} objects; there are {}", entry.put, rows.len())));
    }
    let object = |(id, bytes): (Uuid, Vec<u8>)| {
        let id = id.to_string();
        let object: v1::GdbObject = decode("gdb_objects", &id, &bytes)?;
        map_object(&object).map(|_| ()).map_err(|wrong| spoilt("gdb_objects", &id, &wrong))
    };
    aside(move || rows.into_iter().try_for_each(object)).await
}

/// The columns of objects, or of a library.
///
/// # Errors
/// CBOR cannot hold one (none that was decoded).
pub fn columns<K: Ord + Clone, T: serde::Serialize>(
    things: &BTreeMap<K, T>,
) -> Result<BTreeMap<K, Vec<u8>>, EncodeError> {
    things.iter().map(|(name, thing)| Ok((name.clone(), codec::to_cbor(thing)?))).collect()
}

impl LevelHandle {
    /// How far the GDB has come, on disk.
    ///
    /// # Errors
    /// The store fails.
    pub async fn gdb_state(&self) -> Result<GdbState, StoreError> {
        self.shared.store.gdb_state(self.site(), self.level()).await
    }

    /// The latest publication at revision `until`.
    ///
    /// # Errors
    /// The store fails.
    pub async fn gdb_publication(&self, until: i64) -> Result<Option<Publication>, StoreError> {
        self.shared.store.gdb_publication(self.site(), self.level(), until).await
    }

    /// The newest revision of the log, on disk.
    ///
    /// # Errors
    /// The store fails.
    pub async fn log_revision(&self) -> Result<i64, StoreError> {
        let revisions = self.shared.store.revisions(self.site(), self.level()).await?;
        Ok(revisions.map_or(0, |revisions| revisions.log))
    }

    /// A model of the GDB.
    ///
    /// # Errors
    /// The store fails, or the model is too large.
    pub async fn gdb_model(&self, version: GdbVersion) -> Result<Arc<GdbModel>, GdbError> {
        let models = &self.shared.models.0;
        if let Some(found) = models.get(&version) {
            return Ok(found);
        }
        let read = read_model(&self.shared.store, self.site(), self.level(), version).await?;
        let model = Arc::new(read);
        models.put(version, &model);
        Ok(model)
    }

    /// Changes the draft; resolves when that is on disk.
    ///
    /// # Errors
    /// The store fails. After [`StoreError::Unavailable`] it is open whether it has happened; asking
    /// again does no harm.
    pub async fn edit_gdb(
        &self,
        new: &NewGdbEntry,
        change: &GdbChange,
    ) -> Result<GdbOutcome, StoreError> {
        let (site, level) = (self.site(), self.level());
        let edited = self.shared.store.edit_gdb(site, level, new, change, OBJECTS_MAX as i64).await;
        self.follow_gdb(edited)
    }

    /// Publishes the draft; resolves when that is on disk.
    ///
    /// # Errors
    /// As for [`Self::edit_gdb`].
    pub async fn publish_gdb(&self, new: &NewGdbEntry) -> Result<GdbOutcome, StoreError> {
        let published = self.shared.store.publish_gdb(self.site(), self.level(), new).await;
        self.follow_gdb(published)
    }

    fn follow_gdb(
        &self,
        outcome: Result<GdbOutcome, StoreError>,
    ) -> Result<GdbOutcome, StoreError> {
        let outcome = self.watched(outcome)?;
        if let GdbOutcome::Done(entry) = &outcome {
            metrics::counter!("mapfold_gdb_entries_total").increment(1);
            self.look_for(entry.revision);
        }
        Ok(outcome)
    }
}
