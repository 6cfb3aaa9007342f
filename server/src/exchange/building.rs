//! A `building.yaml` of Open-RMF's traffic editor as objects of the GDB: walls, doorways and floors of one level.
//!
//! * `yaml`: a tree of bounded depth and size, with places.
//! * `document`: what the keys mean.
//! * `frame`: from the drawing's units to metres, by measurements or by fiducials of the reference level.
//! * `solids`: walls that close at corners, and doorways in walls.
//!
//! The drawing's origin becomes the level's, so that other files of the same building fit; in images y is turned to
//! point up. Lanes, lifts and textures are not of the building's shape and are left.

mod document;
mod frame;
mod solids;
mod yaml;

use std::collections::{BTreeMap, BTreeSet};

use mapfold_schema::border::gdb::map_object;
use mapfold_schema::digest;
use mapfold_schema::v1::{BuildingReport, GdbObject};
use sha2::{Digest, Sha256};
use uuid::Uuid;

use document::Level;
pub use document::{BUILDING_BYTES_MAX, Document};
use frame::Frame;
use solids::Drawing;

/// Why a building is not taken.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum BuildingError {
    /// Something in it is wrong.
    #[error("line {line}, column {column} of the building: {fault}")]
    At {
        /// From 1.
        line: usize,
        /// From 1.
        column: usize,
        /// What is wrong there, and what should be.
        fault: String,
    },
    /// Longer than any building is.
    #[error("the building has {bytes} bytes; {max} are the most that one has")]
    TooLong {
        /// How long it is.
        bytes: usize,
        /// How long it may be.
        max: usize,
    },
    /// The level that is asked for is not there, or none is named and there are several.
    #[error("name one of the building's levels: {known}; not {asked}")]
    NoSuchLevel {
        /// What was asked for.
        asked: String,
        /// What there is.
        known: String,
    },
    /// There is nothing that says how long a unit of the drawing is.
    #[error(
        "level {level:?} has no measurement, and fewer than two fiducials of the reference level: draw a measurement in \
         the traffic editor"
    )]
    NoScale {
        /// The level.
        level: String,
    },
    /// Something that no building has.
    #[error("{what} of the building cannot be taken: {fault}")]
    Unfit {
        /// Which wall, door, floor or model, from 0.
        what: String,
        /// What is wrong with it.
        fault: String,
    },
    /// Units of the drawing that are degrees on the earth.
    #[error(
        "coordinates in {0:?} are degrees on the earth: only `reference_image` and `cartesian_meters` are taken"
    )]
    OnEarth(String),
}

/// A level of a building as objects.
#[derive(Debug, Clone, PartialEq)]
pub struct Imported {
    /// The objects, by identities that are the same for the same file.
    pub objects: BTreeMap<Uuid, GdbObject>,
    /// In words and figures.
    pub report: BuildingReport,
}

impl Document {
    /// The objects of one level: of the one that is named, or the only one. Models become instances if `prototypes`
    /// has their names. Identities are derived from the level's `frame`.
    ///
    /// # Errors
    /// No such level, or no scale.
    pub fn import(
        &self,
        asked: Option<&str>,
        frame: Uuid,
        prototypes: &BTreeSet<&str>,
    ) -> Result<Imported, BuildingError> {
        let level = self.choose(asked)?;
        let placing = Frame::of(self, level)?;
        let drawing = Drawing::of(level, &placing, prototypes);
        let mut objects = BTreeMap::new();
        for (key, object) in drawing.objects {
            if let Err(wrong) = map_object(&object) {
                let fault = wrong.first().map(|v| format!("{}: {}", v.pointer, v.detail));
                let fault = fault.unwrap_or_default();
                return Err(BuildingError::Unfit { what: key, fault });
            }
            objects.insert(identity(frame, &self.name, &level.name, &key), object);
        }
        let report = BuildingReport {
            building: self.name.clone(),
            building_level: level.name.clone(),
            building_levels: self.levels.iter().map(|level| level.name.clone()).collect(),
            scale_m: placing.scale_m(),
            walls: drawing.walls,
            doorways: drawing.doorways,
            floors: drawing.floors,
            instances: drawing.instances,
            bounds: drawing.bounds,
            warnings: drawing.warnings,
        };
        Ok(Imported { objects, report })
    }

    fn choose(&self, asked: Option<&str>) -> Result<&Level, BuildingError> {
        let found = match (asked, &self.levels[..]) {
            (Some(name), levels) => levels.iter().find(|level| level.name == name),
            (None, [only]) => Some(only),
            (None, _) => None,
        };
        found.ok_or_else(|| {
            let names: Vec<String> = self.levels.iter().map(|l| format!("{:?}", l.name)).collect();
            let known = if names.is_empty() { "it has none".to_owned() } else { names.join(", ") };
            let asked = asked.map_or_else(|| "none".to_owned(), |asked| format!("{asked:?}"));
            BuildingError::NoSuchLevel { asked, known }
        })
    }
}

/// The identity of an object of a building: the same whenever the same file is taken into the same level.
fn identity(frame: Uuid, building: &str, level: &str, key: &str) -> Uuid {
    let mut digest = Sha256::new().chain_update("building").chain_update(frame);
    for part in [building, level, key] {
        digest = digest.chain_update((part.len() as u64).to_le_bytes()).chain_update(part);
    }
    digest::identity(&digest.finalize().into())
}

#[cfg(test)]
mod tests;
