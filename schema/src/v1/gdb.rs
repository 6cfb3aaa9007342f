//! The Geometrical Data Base (GDB): objects and prototypes of the a-priori model of a level.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What an object is. Only walls and doorways are treated in a way of their own.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ObjectKind {
    /// Part of the building; doorways lead through it.
    Wall,
    /// An opening: its solids are the space that is free in walls.
    Doorway,
    /// A named stretch of floor to walk on; no plan shows it.
    Corridor,
    /// A machine-tool, conveyor or other plant.
    Machine,
    /// A table, shelf or other furniture.
    Furniture,
    /// Anything else that stands there.
    Other,
}

/// What closes a doorway.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum DoorKind {
    /// Nothing.
    Open,
    /// One leaf that turns.
    Hinged,
    /// Two leaves that turn.
    DoubleHinged,
    /// One leaf that slides.
    Sliding,
    /// Two leaves that slide apart.
    DoubleSliding,
    /// Leaves that slide behind each other, to one side.
    Telescope,
    /// Leaves that slide behind each other, to both sides.
    DoubleTelescope,
}

/// How a doorway is closed: kept and shown; plans take doorways as open.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Door {
    /// What closes it.
    #[serde(rename = "type")]
    pub kind: DoorKind,
    /// How far leaves that turn open.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub opens_rad: Option<f64>,
}

/// Where an object stands in the level.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GdbPlacement {
    /// The origin of the object's own coordinates, in the level; z is the height above its floor.
    pub position_m: [f64; 3],
    /// How it is turned: a unit quaternion, `[w, x, y, z]`; not turned if absent. Upright by the
    /// angle `a`: `[cos(a/2), 0, 0, sin(a/2)]`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<[f64; 4]>,
}

/// A box along the object's axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GdbBox {
    /// The smaller coordinates.
    pub from_m: [f64; 3],
    /// The greater coordinates.
    pub to_m: [f64; 3],
}

/// A polygon drawn up from one height to another.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GdbPrism {
    /// The rings of the polygon, the outer one first, then its holes; the first corner is not repeated.
    pub base_m: Vec<Vec<[f64; 2]>>,
    /// Height of the lower face.
    pub lower_m: f64,
    /// Height of the upper face.
    pub upper_m: f64,
}

/// An upright cylinder, taken as the inscribed prism with the fewest sides that keeps within
/// the chord error.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GdbCylinder {
    /// The axis.
    pub centre_m: [f64; 2],
    /// Radius.
    pub radius_m: f64,
    /// Height of the lower face.
    pub lower_m: f64,
    /// Height of the upper face.
    pub upper_m: f64,
    /// How far its sides may lie inside of it; 0.005 if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chord_error_m: Option<f64>,
}

/// Any faces: closed they enclose something, open they are sheets.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GdbPolyhedron {
    /// The vertices.
    pub vertices_m: Vec<[f64; 3]>,
    /// The faces: each a list of rings of indices into the vertices. The outer ring comes first, and
    /// runs counter-clockwise seen from outside.
    pub faces: Vec<Vec<Vec<u32>>>,
}

/// A primitive solid in the coordinates of its object.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum GdbSolid {
    /// A box along the object's axes.
    Box(GdbBox),
    /// A polygon drawn up.
    Prism(GdbPrism),
    /// An upright cylinder.
    Cylinder(GdbCylinder),
    /// Any faces.
    Polyhedron(GdbPolyhedron),
}

/// Something that stands in the level: solids of its own, or an instance of a prototype.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GdbObject {
    /// What people call it; may be empty.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// What it is.
    pub kind: ObjectKind,
    /// Solids of its own, in its own coordinates; several make a compound object.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub solids: Option<Vec<GdbSolid>>,
    /// The prototype that it is an instance of, instead of `solids`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prototype: Option<String>,
    /// Where it stands; its own coordinates are the level's if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub placement: Option<GdbPlacement>,
    /// Standard deviation of where it stands; 0.03 if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub tolerance_m: Option<f64>,
    /// How far it is to be believed that it is there, 0 to 1; 0.5 if absent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub trust: Option<f64>,
    /// Of a doorway: how it is closed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub door: Option<Door>,
}

/// A generic object of a site's library.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GdbPrototype {
    /// What instances are usually: a hint for the page.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub kind: Option<ObjectKind>,
    /// What instances are made of, in their own coordinates.
    pub solids: Vec<GdbSolid>,
}
