//! What the keys of a `building.yaml` mean (`rmf_building_map_tools`, `building_map`).

use super::BuildingError;
use super::yaml::{self, Node};

/// Longest building that is read, bytes: the largest of the demonstrations has 100 kB.
pub const BUILDING_BYTES_MAX: usize = 8 << 20;
/// Walls' height if a wall names none, metres.
const WALL_HEIGHT_M: f64 = 2.5;

/// A building.
#[derive(Debug, Clone, PartialEq)]
pub struct Document {
    /// What it is called.
    pub(super) name: String,
    /// Whether coordinates are pixels of an image, y down; else metres, y up.
    pub(super) is_image: bool,
    /// The level that others are aligned to: the named one, or the first.
    pub(super) reference: String,
    /// By the order of the file.
    pub(super) levels: Vec<Level>,
}

/// A level of it, in units of the drawing.
#[derive(Debug, Clone, PartialEq, Default)]
pub(super) struct Level {
    pub(super) name: String,
    pub(super) vertices: Vec<[f64; 2]>,
    pub(super) walls: Vec<Wall>,
    pub(super) doors: Vec<Door>,
    /// Two vertices, and the metres between them.
    pub(super) measurements: Vec<([usize; 2], f64)>,
    /// Vertices of each polygon.
    pub(super) floors: Vec<Vec<usize>>,
    pub(super) fiducials: Vec<(String, [f64; 2])>,
    pub(super) models: Vec<Model>,
    /// Polygons cut out of floors, of which nothing is made.
    pub(super) holes: usize,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Wall {
    pub(super) ends: [usize; 2],
    pub(super) height_m: f64,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Door {
    pub(super) ends: [usize; 2],
    pub(super) name: String,
    pub(super) kind: String,
    pub(super) motion_degrees: Option<f64>,
}

#[derive(Debug, Clone, PartialEq)]
pub(super) struct Model {
    pub(super) name: String,
    /// What it is called in the library of models.
    pub(super) prototype: String,
    pub(super) at: [f64; 2],
    pub(super) z_m: f64,
    pub(super) yaw: f64,
}

impl Document {
    /// Reads a building.
    ///
    /// # Errors
    /// What is wrong, and where.
    pub fn read(bytes: &[u8]) -> Result<Self, BuildingError> {
        if bytes.len() > BUILDING_BYTES_MAX {
            return Err(BuildingError::TooLong { bytes: bytes.len(), max: BUILDING_BYTES_MAX });
        }
        let text = std::str::from_utf8(bytes).map_err(|error| {
            let before = &bytes[..error.valid_up_to()];
            let line = before.split(|byte| *byte == b'\n').count();
            let column = 1 + before.iter().rev().take_while(|byte| **byte != b'\n').count();
            BuildingError::At { line, column, fault: "a building is UTF-8 text".to_owned() }
        })?;
        let root = yaml::read(text)?;
        root.entries("a building")?;
        let is_image = match root.get("coordinate_system").map(|node| node.word("the system")) {
            None => true,
            Some(word) => match word? {
                "reference_image" => true,
                "cartesian_meters" => false,
                other => return Err(BuildingError::OnEarth(other.to_owned())),
            },
        };
        let levels = root.get("levels").ok_or_else(|| {
            root.fault("a building has `levels`: is this a building.yaml of the traffic editor?")
        })?;
        let levels = levels.entries("`levels`")?;
        let levels = levels.iter().map(|(name, node)| Level::read(name, node));
        let levels = levels.collect::<Result<Vec<_>, _>>()?;
        let name = root.get("building_name").or_else(|| root.get("name"));
        let name = name.map_or(Ok("building"), |node| node.word("the name"))?.to_owned();
        let first = levels.first().map(|level| level.name.clone()).unwrap_or_default();
        let reference = root.get("reference_level_name").map(|node| node.word("the level's name"));
        let reference = reference.transpose()?.map_or(first, ToOwned::to_owned);
        Ok(Self { name, is_image, reference, levels })
    }
}

/// The items of a list that may be missing.
fn list<'n, 'a>(node: &'n Node<'a>, key: &str) -> Result<&'n [Node<'a>], BuildingError> {
    node.get(key).map_or(Ok(&[]), |list| list.items(&format!("`{key}`")))
}

impl Level {
    fn read(name: &str, node: &Node<'_>) -> Result<Self, BuildingError> {
        let vertices =
            list(node, "vertices")?.iter().map(|vertex| match vertex.items("a vertex")? {
                [x, y, ..] => Ok([x.number("x")?, y.number("y")?]),
                _ => Err(vertex.fault("a vertex is [x, y, z, name]")),
            });
        let vertices = vertices.collect::<Result<Vec<_>, _>>()?;
        let count = vertices.len();
        let edge = |edge: &Node<'_>| match edge.items("an edge")? {
            [from, to, ..] => Ok([from.index("an end", count)?, to.index("an end", count)?]),
            _ => Err(edge.fault("an edge is [from, to, {...}]")),
        };
        let wall = |node: &Node<'_>| {
            let height = parameter(node, "texture_height").map(|n| n.number("a wall's height"));
            let height_m = height.transpose()?.unwrap_or(WALL_HEIGHT_M);
            if !(0.01..=1000.0).contains(&height_m) {
                return Err(node.fault(format!("a wall of {height_m} m height is none")));
            }
            Ok(Wall { ends: edge(node)?, height_m })
        };
        let door = |node: &Node<'_>| {
            let text = |key: &str| match parameter(node, key) {
                Some(value) => value.word(key).map(ToOwned::to_owned),
                None => Ok(String::new()),
            };
            let motion = parameter(node, "motion_degrees").map(|n| n.number("`motion_degrees`"));
            Ok(Door {
                ends: edge(node)?,
                name: text("name")?,
                kind: text("type")?,
                motion_degrees: motion.transpose()?,
            })
        };
        let measurement = |node: &Node<'_>| {
            let distance = parameter(node, "distance");
            let distance = distance.ok_or_else(|| node.fault("a measurement has a `distance`"))?;
            let metres = distance.number("a distance")?;
            if metres > 0.0 {
                Ok((edge(node)?, metres))
            } else {
                Err(distance.fault(format!("a distance is more than 0 m, not {metres}")))
            }
        };
        let floor = |node: &Node<'_>| {
            let corners = list(node, "vertices")?;
            corners.iter().map(|corner| corner.index("a corner", count)).collect()
        };
        let fiducial = |node: &Node<'_>| match node.items("a fiducial")? {
            [x, y, name, ..] => {
                Ok((name.word("a name")?.to_owned(), [x.number("x")?, y.number("y")?]))
            }
            _ => Err(node.fault("a fiducial is [x, y, name]")),
        };
        let model = |node: &Node<'_>| {
            let number = |key: &str| node.get(key).map_or(Ok(0.0), |value| value.number(key));
            let text = |key: &str| node.get(key).map_or(Ok(""), |value| value.word(key));
            Ok(Model {
                name: text("name")?.to_owned(),
                prototype: text("model_name")?.to_owned(),
                at: [number("x")?, number("y")?],
                z_m: number("z")?,
                yaw: number("yaw")?,
            })
        };
        Ok(Self {
            name: name.to_owned(),
            walls: all(node, "walls", wall)?,
            doors: all(node, "doors", door)?,
            measurements: all(node, "measurements", measurement)?,
            floors: all(node, "floors", floor)?,
            fiducials: all(node, "fiducials", fiducial)?,
            models: all(node, "models", model)?,
            holes: list(node, "holes")?.len(),
            vertices,
        })
    }
}

fn all<T>(
    node: &Node<'_>,
    key: &str,
    read: impl Fn(&Node<'_>) -> Result<T, BuildingError>,
) -> Result<Vec<T>, BuildingError> {
    list(node, key)?.iter().map(read).collect()
}

/// A parameter of an edge, `{name: [type, value]}`.
fn parameter<'n, 'a>(edge: &'n Node<'a>, name: &str) -> Option<&'n Node<'a>> {
    let parameters = edge.items("an edge").ok()?.get(2)?;
    match parameters.get(name)?.items("a parameter").ok()? {
        [_, value] => Some(value),
        _ => None,
    }
}
