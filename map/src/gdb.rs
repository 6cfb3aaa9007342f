//! The Geometrical Data Base (GDB): the building as it was meant to be, and what a sensor would see of it.
//!
//! A [`Model`] is what people edit: objects of solids, or instances of prototypes, each placed in
//! three dimensions. It may hold faults, as drafts do: [`findings()`] names them with their places.
//! A [`Structure`] is the model placed, on a grid of micrometres; from there on all geometry is
//! exact, and what a [`Plan`] says about the same set of objects is the same to the bit.
//!
//! * Solids occupy heights from their lower face up to, and without, their upper one: a cut at a
//!   height is the cut just above it. So no cut is degenerate, and solids stacked on each other are
//!   met once at every height.
//! * Plans have free space on the left of their outlines, like the chains of the vector map.
//! * Doorways are objects with solids of their own; they take out what walls have inside them.
//!
//! Knows no file format, no log of edits and nothing that robots found.

mod arrangement;
mod contours;
mod exact;
mod findings;
mod footprint;
mod landmark;
mod mesh;
mod model;
mod overlaps;
mod placement;
mod plan;
mod polygon;
mod prior;
mod section;
mod shell;
mod snapping;
mod solid;
mod structure;
mod winding;

pub use arrangement::PlanWork;
pub use exact::{MICROMETRES, PlanPoint};
pub use findings::{Finding, FindingKind, Place, Severity, findings};
pub use footprint::{Footprint, footprints};
pub use landmark::{LandmarkConfig, LandmarkId, PlannedLandmark, landmarks};
pub use model::{Kind, Model, Object, ObjectId, Prototype, PrototypeName, Shape};
pub use placement::{Placement, Point3};
pub use plan::{
    Edge, Free, Opening, OpeningSide, Outline, Owner, Plan, Sheet, Surface, TooCrowded,
};
pub use polygon::Polygon;
pub use prior::{Prior, PriorConfig, PriorError, prior};
pub use solid::{Cylinder, Face, Polyhedron, Solid};
pub use structure::Structure;
