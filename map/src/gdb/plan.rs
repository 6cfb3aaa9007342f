//! What a sensor at one height would see of a model: outlines, sheets and openings.

use super::arrangement::PlanWork;
use super::contours::Bordering;
use super::exact::PlanPoint;
use super::{Kind, ObjectId};
use crate::geometry::Point;

/// An object as far as a plan needs it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Owner {
    /// Which one.
    pub id: ObjectId,
    /// What it is.
    pub kind: Kind,
    /// Standard deviation of where it stands, metres.
    pub tolerance: f64,
    /// How far it is to be believed that it is there, from 0 to 1.
    pub trust: f64,
}

/// Which sides of an edge are free space.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Free {
    /// The left one, seen along the edge: on the right is something solid.
    Left,
    /// Both: a sheet without thickness.
    Both,
}

/// A straight stretch of surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Edge<'a> {
    /// Where it begins.
    pub from: PlanPoint,
    /// Where it ends.
    pub to: PlanPoint,
    /// Which sides of it are free.
    pub free: Free,
    /// Whose surface it is; a doorway's, for the jambs that it leaves in a wall.
    pub owner: &'a Owner,
}

/// A straight stretch of surface with what it belongs to: an [`Edge`] by itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Surface {
    /// Where it begins.
    pub from: PlanPoint,
    /// Where it ends.
    pub to: PlanPoint,
    /// Which sides of it are free.
    pub free: Free,
    /// Whose surface it is.
    pub owner: Owner,
}

impl Surface {
    /// Its sides, each from end to end with free space on the left, metres.
    pub fn sides(&self) -> impl Iterator<Item = (Point, Point)> {
        let (a, b) = (self.from.metres(), self.to.metres());
        let back = (self.free == Free::Both).then_some((b, a));
        std::iter::once((a, b)).chain(back)
    }
}

impl From<Edge<'_>> for Surface {
    fn from(edge: Edge<'_>) -> Self {
        Self { from: edge.from, to: edge.to, free: edge.free, owner: *edge.owner }
    }
}

/// A closed outline, with free space on its left: clockwise about something that stands in a room, counter-clockwise
/// within a room. It passes no vertex twice, and starts at its smallest vertex.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Outline {
    pub(super) edges: Vec<Bordering>,
}

impl Outline {
    /// The vertices in order, the first one not repeated.
    pub fn vertices(&self) -> impl Iterator<Item = PlanPoint> {
        self.edges.iter().map(|edge| edge.from)
    }

    /// Area that it encloses, square metres: positive for a room, negative for what stands in one.
    pub fn area(&self) -> f64 {
        let Some(origin) = self.edges.first().map(|edge| edge.from) else { return 0.0 };
        let twice = self.edges.iter().map(|edge| super::exact::side(origin, edge.from, edge.to));
        twice.sum::<i128>() as f64 / 2.0 / super::MICROMETRES.powi(2)
    }
}

/// A path of surface without thickness.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Sheet {
    pub(super) edges: Vec<Bordering>,
    /// Whether an end of the path is an end of the surface, and not hidden in something solid or where several
    /// meet.
    pub(super) ends_free: [bool; 2],
}

/// Where a doorway opens one face of a wall.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub struct OpeningSide {
    /// The wall whose face it is.
    pub wall: ObjectId,
    /// One jamb: where the wall's face begins to be open, with the wall on the right.
    pub from: PlanPoint,
    /// The other jamb.
    pub to: PlanPoint,
}

/// A doorway at the height of a plan.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Opening {
    /// The doorway.
    pub doorway: ObjectId,
    /// The stretches of walls' faces that it opens, sorted; two for a doorway through one straight wall.
    pub sides: Vec<OpeningSide>,
}

impl Opening {
    /// Width of its widest side, metres.
    pub fn width(&self) -> f64 {
        self.sides.iter().map(|side| side.from.distance(side.to)).fold(0.0, f64::max)
    }
}

/// The plan of a model at one height. The same set of objects gives the same bits.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub(super) height: i64,
    /// In the order of their ids; edges name them by position.
    pub(super) owners: Vec<Owner>,
    pub(super) outlines: Vec<Outline>,
    pub(super) sheets: Vec<Sheet>,
    pub(super) openings: Vec<Opening>,
    /// Outlines of what is solid if all doorways are walled up.
    pub(super) walled_up: Vec<Outline>,
    pub(super) work: PlanWork,
}

/// A plan of which not all can be made.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error(
    "so many edges lie over each other at this height that the plan has more than {most} crossings: \
     take away what stands in the same place"
)]
pub struct TooCrowded {
    /// The limit.
    pub most: usize,
}

impl Plan {
    /// Nothing.
    pub(super) fn empty(height: i64) -> Self {
        Self {
            height,
            owners: Vec::new(),
            outlines: Vec::new(),
            sheets: Vec::new(),
            openings: Vec::new(),
            walled_up: Vec::new(),
            work: PlanWork::default(),
        }
    }

    /// The height of the cut, metres. What ends at it is not met, what begins at it is.
    pub fn height(&self) -> f64 {
        self.height as f64 / super::MICROMETRES
    }

    /// Closed outlines, sorted.
    pub fn outlines(&self) -> &[Outline] {
        &self.outlines
    }

    /// Surfaces without thickness, sorted.
    pub fn sheets(&self) -> &[Sheet] {
        &self.sheets
    }

    /// Doorways that open something, in the order of their ids.
    pub fn openings(&self) -> &[Opening] {
        &self.openings
    }

    /// What making the plan took.
    pub fn work(&self) -> PlanWork {
        self.work
    }

    /// All surfaces: those of the outlines, then those of the sheets.
    pub fn edges(&self) -> impl Iterator<Item = Edge<'_>> {
        let solid = self.outlines.iter().flat_map(|o| &o.edges).map(|e| (e, Free::Left));
        let thin = self.sheets.iter().flat_map(|s| &s.edges).map(|e| (e, Free::Both));
        solid.chain(thin).map(|(edge, free)| self.edge(edge, free))
    }

    /// The edges of one outline.
    pub fn edges_of<'a>(&'a self, outline: &'a Outline) -> impl Iterator<Item = Edge<'a>> {
        outline.edges.iter().map(|edge| self.edge(edge, Free::Left))
    }

    /// The edges of one sheet, from one end to the other.
    pub fn edges_of_sheet<'a>(&'a self, sheet: &'a Sheet) -> impl Iterator<Item = Edge<'a>> {
        sheet.edges.iter().map(|edge| self.edge(edge, Free::Both))
    }

    fn edge(&self, edge: &Bordering, free: Free) -> Edge<'_> {
        Edge { from: edge.from, to: edge.to, free, owner: self.owner(edge.owner) }
    }

    pub(super) fn owner(&self, index: u32) -> &Owner {
        &self.owners[index as usize]
    }

    /// An object of the plan by its id.
    pub(super) fn owner_of(&self, id: ObjectId) -> Option<&Owner> {
        let index = self.owners.binary_search_by_key(&id, |owner| owner.id).ok()?;
        self.owners.get(index)
    }
}
