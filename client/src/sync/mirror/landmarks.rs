//! The level's landmark table, and the surfaces of the published model, beside the map.

use std::collections::BTreeMap;

use mapfold_map::gdb::Surface;
use mapfold_map::landmarks::Landmark;
use mapfold_schema::border::Violation;
use mapfold_schema::border::gdb::{map_landmark, map_surfaces};
use mapfold_schema::v1;
use serde::{Deserialize, Serialize};

/// What robots find themselves by, as the server told it at one revision.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct KnownLandmarks {
    /// The newest revision that they were asked for at.
    asked: i64,
    told: Told,
    landmarks: BTreeMap<String, Landmark>,
    surfaces: Vec<Surface>,
}

/// What was told, as it is kept on disk.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub(super) struct Told {
    /// The revision for which it holds; 0 before anything was told.
    revision: i64,
    /// The publication of the model that `plan` is of; 0 for none.
    publication: i64,
    landmarks: BTreeMap<String, v1::Landmark>,
    plan: Option<v1::GdbPlan>,
}

/// Something that cannot be a landmark or a plan, or is of no use.
pub(super) type Wrong = Vec<Violation>;

impl KnownLandmarks {
    /// Whether they are as of this revision or a later one, or cannot be had of it.
    pub(super) fn is_asked(&self, revision: i64) -> bool {
        self.asked >= revision
    }

    /// What is held is as of this revision; 0 for nothing.
    pub(super) fn since(&self) -> i64 {
        self.told.revision
    }

    /// In the order of their identities.
    pub(super) fn landmarks(&self) -> impl Iterator<Item = &Landmark> {
        self.landmarks.values()
    }

    pub(super) fn surfaces(&self) -> &[Surface] {
        &self.surfaces
    }

    /// Whether the plan of a publication is wanted.
    pub(super) fn needs_plan(&self, publication: i64) -> bool {
        publication != self.told.publication
    }

    /// Takes over what has changed, all of it or nothing. `plan` is that of the table's publication, if it is another than
    /// before.
    pub(super) fn take(
        &mut self,
        table: v1::LandmarkTable,
        plan: Option<v1::GdbPlan>,
    ) -> Result<(), Wrong> {
        let read: Vec<Landmark> =
            table.landmarks.iter().map(map_landmark).collect::<Result<_, _>>()?;
        if self.needs_plan(table.publication) {
            self.surfaces = surfaces_of(plan.as_ref())?;
            (self.told.plan, self.told.publication) = (plan, table.publication);
        }
        for id in &table.removed {
            self.landmarks.remove(id);
            self.told.landmarks.remove(id);
        }
        for (landmark, read) in table.landmarks.into_iter().zip(read) {
            self.landmarks.insert(landmark.id.clone(), read);
            self.told.landmarks.insert(landmark.id.clone(), landmark);
        }
        (self.told.revision, self.asked) = (table.revision, table.revision);
        Ok(())
    }

    /// Nothing: what the server has of a revision cannot be told.
    pub(super) fn untold(asked: i64) -> Self {
        Self { asked, ..Self::default() }
    }

    pub(super) fn told(&self) -> &Told {
        &self.told
    }

    pub(super) fn of_told(told: Told) -> Result<Self, Wrong> {
        let read =
            |(id, landmark): (&String, &v1::Landmark)| Ok((id.clone(), map_landmark(landmark)?));
        Ok(Self {
            asked: told.revision,
            landmarks: told.landmarks.iter().map(read).collect::<Result<_, Wrong>>()?,
            surfaces: surfaces_of(told.plan.as_ref())?,
            told,
        })
    }
}

fn surfaces_of(plan: Option<&v1::GdbPlan>) -> Result<Vec<Surface>, Wrong> {
    plan.map_or_else(|| Ok(Vec::new()), map_surfaces)
}
