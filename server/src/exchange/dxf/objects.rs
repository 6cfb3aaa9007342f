//! What is laid out, as objects of a model.

use std::collections::BTreeMap;

use mapfold_map::geometry::Point;
use mapfold_schema::v1::{Door, DoorKind, GdbBox, GdbObject, GdbPlacement, GdbSolid, ObjectKind};
use uuid::Uuid;

use super::super::incoming::{FileFault, Found, object};
use super::super::paired::{Wall, WallConfig, WallLine, walls};
use super::document::Tags;
use super::doors::{Swing, swing};
use super::placing::{Outline, Piece};
use super::prototypes::{area, cylinder, height_m, heights, prism};
use super::tagged::{self, Gathering};

/// Arcs that are looked at as swings of doors.
const SWINGS_MAX: usize = 5_000;
/// By how much a doorway is deeper than its wall on either side, metres.
const DEEPER_M: f64 = 0.05;
/// A wall over a doorway goes on into its neighbours by so much, metres, so that rounding leaves no slit.
const OVERLAP_M: f64 = 0.001;

/// A piece where it stands.
#[derive(Debug)]
pub(super) struct Laid<'a> {
    pub(super) line: usize,
    pub(super) kind: ObjectKind,
    pub(super) piece: Piece,
    pub(super) tags: &'a Tags,
    /// Counts pieces: one entity may be laid out many times.
    pub(super) copy: usize,
}

impl Laid<'_> {
    fn place(&self) -> String {
        format!("line {}, piece {}", self.line, self.copy)
    }
}

/// Makes objects of pieces.
pub(super) struct Objects<'f> {
    pub(super) found: &'f mut Found,
    pub(super) wall_height_m: f64,
}

impl Objects<'_> {
    pub(super) fn make(&mut self, laid: Vec<Laid<'_>>) -> Result<(), FileFault> {
        let (ours, others): (Vec<_>, Vec<_>) =
            laid.into_iter().partition(|laid| tagged::id(laid.tags).is_some());
        self.ours(&ours)?;
        let mut lines = Vec::new();
        let mut swings = Vec::new();
        for laid in &others {
            match laid.kind {
                ObjectKind::Wall => self.wall(laid, &mut lines)?,
                ObjectKind::Doorway if matches!(laid.piece.outline, Outline::Arc { .. }) => {
                    swings.push(laid);
                }
                _ => self.thing(laid)?,
            }
        }
        let drawn = walls(&lines, &WallConfig::STANDARD);
        drawn.tell(self.found);
        for (index, wall) in drawn.found.iter().enumerate() {
            let heights = self.heights(wall.heights, ObjectKind::Wall);
            let solid = upright_box(ObjectKind::Wall, wall.ends, wall.thickness, heights);
            let place = format!("line {}, wall {index}", wall.line);
            self.found.put(&place, None, solid)?;
        }
        for (index, laid) in swings.into_iter().enumerate() {
            let walls = if index < SWINGS_MAX { &drawn.found[..] } else { &[] };
            self.doorway(laid, walls)?;
        }
        Ok(())
    }

    fn heights(&self, drawn: Option<[f64; 2]>, kind: ObjectKind) -> [f64; 2] {
        drawn.unwrap_or_else(|| heights(kind, self.wall_height_m))
    }

    /// What we wrote ourselves, object by object.
    fn ours(&mut self, laid: &[Laid<'_>]) -> Result<(), FileFault> {
        let mut objects: BTreeMap<Uuid, (GdbObject, Gathering, String)> = BTreeMap::new();
        for piece in laid {
            let Some(id) = tagged::id(piece.tags) else { continue };
            let (_, gathering, _) = objects.entry(id).or_insert_with(|| {
                let mut object = object(piece.kind, "");
                tagged::complete(&mut object, piece.tags);
                (object, Gathering::default(), piece.place())
            });
            gathering.add(&piece.piece, piece.tags);
        }
        for (id, (mut object, gathering, place)) in objects {
            object.solids = Some(gathering.solids());
            self.found.put(&place, Some(id), object)?;
        }
        Ok(())
    }

    /// A solid wall, or lines of walls.
    fn wall(&mut self, laid: &Laid<'_>, lines: &mut Vec<WallLine>) -> Result<(), FileFault> {
        let (heights, line) = (laid.piece.heights, laid.line);
        let mut along = |points: &[Point], is_ring: bool| {
            let next = points.iter().skip(1).chain(points.first().filter(|_| is_ring));
            lines.extend(points.iter().zip(next).map(|(p, q)| WallLine {
                ends: [*p, *q],
                heights,
                line,
            }));
        };
        match &laid.piece.outline {
            Outline::Ring(ring) if heights.is_some() || is_strip(ring) => return self.thing(laid),
            Outline::Circle { .. } => return self.thing(laid),
            Outline::Ring(points) => along(points, true),
            Outline::Path(points) | Outline::Arc { points, .. } => along(points, false),
            Outline::Face(_) | Outline::Loop(_) => self.found.leave_out("3DFACE", NO_SOLID),
        }
        Ok(())
    }

    /// Something that its outline encloses.
    fn thing(&mut self, laid: &Laid<'_>) -> Result<(), FileFault> {
        let heights = self.heights(laid.piece.heights, laid.kind);
        let solid = match &laid.piece.outline {
            Outline::Ring(ring) => prism(ring, heights),
            Outline::Circle { centre, radius } => Some(cylinder(*centre, *radius, heights)),
            Outline::Path(_) | Outline::Arc { .. } | Outline::Face(_) | Outline::Loop(_) => {
                self.found.leave_out(format!("open lines of {}s", word(laid.kind)), NO_SOLID);
                return Ok(());
            }
        };
        let Some(solid) = solid else {
            self.found
                .leave_out(format!("outlines of {}s", word(laid.kind)), "they enclose nothing");
            return Ok(());
        };
        let mut made = object(laid.kind, "");
        made.solids = Some(vec![solid]);
        self.found.put(&laid.place(), None, made)
    }

    /// The doorway of a swing, and the wall over it.
    fn doorway(&mut self, laid: &Laid<'_>, walls: &[Wall]) -> Result<(), FileFault> {
        let Outline::Arc { centre, points } = &laid.piece.outline else { return Ok(()) };
        let Some(Swing { ends, thickness, opens }) = swing(*centre, points, walls) else {
            let why = "no wall is in line with the closed door, or it is no swing of one";
            self.found.leave_out("arcs of doors", why);
            return Ok(());
        };
        let top = height_m(ObjectKind::Doorway, self.wall_height_m);
        let depth = thickness + 2.0 * DEEPER_M;
        let mut doorway = upright_box(ObjectKind::Doorway, ends, depth, [0.0, top]);
        doorway.door = Some(Door { kind: DoorKind::Hinged, opens_rad: Some(opens) });
        self.found.put(&laid.place(), None, doorway)?;
        let step = ends[1] - ends[0];
        let reach = step / step.norm() * OVERLAP_M;
        let over = [ends[0] - reach, ends[1] + reach];
        let heights = self.heights(None, ObjectKind::Wall);
        let over = upright_box(ObjectKind::Wall, over, thickness, heights);
        self.found.put(&format!("{}, over it", laid.place()), None, over)
    }
}

const NO_SOLID: &str = "an open line or a single face encloses nothing";

/// Whether a ring is the outline of one wall, and not of a room: as long, but not wider than walls are.
fn is_strip(ring: &[Point]) -> bool {
    let next = ring.iter().cycle().skip(1);
    let round: f64 = ring.iter().zip(next).map(|(p, q)| (q - p).norm()).sum();
    2.0 * area(ring).abs() <= round * WallConfig::STANDARD.thickness_max_m
}

fn word(kind: ObjectKind) -> &'static str {
    match kind {
        ObjectKind::Wall => "wall",
        ObjectKind::Doorway => "doorway",
        ObjectKind::Corridor => "corridor",
        ObjectKind::Machine => "machine",
        ObjectKind::Furniture => "furniture piece",
        ObjectKind::Other => "other thing",
    }
}

/// A box along a line, as long as the line is.
pub(in super::super) fn upright_box(
    kind: ObjectKind,
    [from, to]: [Point; 2],
    depth_m: f64,
    [lower, upper]: [f64; 2],
) -> GdbObject {
    let (middle, step) = ((from + to) / 2.0, to - from);
    let half = step.y.atan2(step.x) / 2.0;
    let length = step.norm() / 2.0;
    let mut made = object(kind, "");
    made.solids = Some(vec![GdbSolid::Box(GdbBox {
        from_m: [-length, -depth_m / 2.0, lower],
        to_m: [length, depth_m / 2.0, upper],
    })]);
    made.placement = Some(GdbPlacement {
        position_m: [middle.x, middle.y, 0.0],
        rotation: Some([half.cos(), 0.0, 0.0, half.sin()]),
    });
    made
}
