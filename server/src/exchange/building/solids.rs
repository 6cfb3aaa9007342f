//! Walls, doorways and floors of one level as objects.
//!
//! The traffic editor draws a wall as a line, and a door in the gap between two walls. Here walls have a thickness and reach
//! as far as it takes to close their corners; over each door there is a piece of wall, which the doorway opens.

use std::collections::{BTreeMap, BTreeSet};

use mapfold_map::geometry::Point;
use mapfold_schema::v1::{
    Bounds, Door, DoorKind, GdbBox, GdbObject, GdbPlacement, GdbPrism, GdbSolid, ObjectKind,
};

use super::document::{self, Level};
use super::frame::Frame;

/// Thickness of walls, metres: that of the traffic editor.
const THICKNESS_M: f64 = 0.1;
/// Height of doors, metres: that of the traffic editor.
const DOOR_HEIGHT_M: f64 = 2.2;
/// By how much a doorway is deeper than its wall on either side, metres.
const DEEPER_M: f64 = 0.1;
/// Thickness of floors, metres.
const FLOOR_M: f64 = 0.1;
/// Walls that go on straight overlap by so much, metres, so that rounding leaves no slit.
const OVERLAP_M: f64 = 0.001;
/// Shorter walls are points, metres.
const LENGTH_MIN_M: f64 = 0.001;
/// Sine of the most angle at which a wall goes on as itself.
const STRAIGHT: f64 = 0.02;
/// What is drawn by hand on a scan or a plan is as exact as this, metres.
const TOLERANCE_M: f64 = 0.05;
/// Walls that are looked at where walls meet; more tell nothing new.
const MEETING_MAX: usize = 64;
/// Longest name, bytes.
const NAME_MAX: usize = mapfold_schema::border::gdb::NAME_LENGTH_MAX;

/// What was made of a level.
pub(super) struct Drawing {
    /// With keys that are the same for the same file.
    pub(super) objects: Vec<(String, GdbObject)>,
    pub(super) walls: u32,
    pub(super) doorways: u32,
    pub(super) floors: u32,
    pub(super) instances: u32,
    pub(super) bounds: Option<Bounds>,
    pub(super) warnings: Vec<String>,
}

/// A stretch of wall between two vertices.
struct Stretch {
    ends: [usize; 2],
    height_m: f64,
    is_over_door: bool,
}

impl Drawing {
    pub(super) fn of(level: &Level, frame: &Frame, prototypes: &BTreeSet<&str>) -> Self {
        let mut drawing = Self {
            objects: Vec::new(),
            walls: 0,
            doorways: 0,
            floors: 0,
            instances: 0,
            bounds: None,
            warnings: Vec::new(),
        };
        let points: Vec<Point> = level.vertices.iter().map(|at| frame.point(*at)).collect();
        let walls = Walls::of(level, &points);
        drawing.draw_walls(level, &walls);
        drawing.draw_doors(level, &walls);
        drawing.draw_floors(level, &points);
        drawing.place_models(level, frame, prototypes);
        if level.holes > 0 {
            drawing.warnings.push(format!("{} holes of floors are not taken", level.holes));
        }
        drawing
    }

    fn add(&mut self, key: String, object: GdbObject, corners: impl IntoIterator<Item = Point>) {
        for p in corners {
            let here = Bounds { min_x_m: p.x, min_y_m: p.y, max_x_m: p.x, max_y_m: p.y };
            let bounds = self.bounds.get_or_insert(here);
            bounds.min_x_m = bounds.min_x_m.min(p.x);
            bounds.min_y_m = bounds.min_y_m.min(p.y);
            bounds.max_x_m = bounds.max_x_m.max(p.x);
            bounds.max_y_m = bounds.max_y_m.max(p.y);
        }
        self.objects.push((key, object));
    }

    fn draw_walls(&mut self, level: &Level, walls: &Walls<'_>) {
        let drawn = level.walls.len();
        let mut points = 0;
        for (index, stretch) in walls.stretches.iter().enumerate() {
            let Some([from, to]) = walls.reaching(stretch) else {
                points += 1;
                continue;
            };
            let (key, name) = match level.doors.get(index.wrapping_sub(drawn)) {
                Some(door) => {
                    (format!("over door {}", index - drawn), format!("over {}", door.name))
                }
                None => (format!("wall {index}"), String::new()),
            };
            let object =
                upright_box(ObjectKind::Wall, &name, [from, to], THICKNESS_M, stretch.height_m);
            self.add(key, object, [from, to]);
            self.walls += 1;
        }
        if points > 0 {
            self.warnings.push(format!("{points} walls without length are not taken"));
        }
    }

    fn draw_doors(&mut self, level: &Level, walls: &Walls<'_>) {
        for (index, door) in level.doors.iter().enumerate() {
            let Some([from, to]) = walls.clear(door.ends) else {
                self.warnings.push(format!("door {:?} has no width, and is not taken", door.name));
                continue;
            };
            let depth = THICKNESS_M + 2.0 * DEEPER_M;
            let name = &door.name;
            let mut object =
                upright_box(ObjectKind::Doorway, name, [from, to], depth, DOOR_HEIGHT_M);
            object.door = leaves(door);
            if object.door.is_none() {
                let words = format!("door {:?} is of the unknown type {:?}", door.name, door.kind);
                self.warnings.push(words);
            }
            self.add(format!("door {index}"), object, [from, to]);
            self.doorways += 1;
        }
    }

    fn draw_floors(&mut self, level: &Level, points: &[Point]) {
        for (index, corners) in level.floors.iter().enumerate() {
            if corners.len() < 3 {
                self.warnings.push(format!("floor {index} has fewer than three corners"));
                continue;
            }
            let ring: Vec<Point> = corners.iter().map(|corner| points[*corner]).collect();
            let base_m = vec![ring.iter().map(|p| [p.x, p.y]).collect()];
            let solid = GdbSolid::Prism(GdbPrism { base_m, lower_m: -FLOOR_M, upper_m: 0.0 });
            let object = object(ObjectKind::Corridor, &format!("floor {index}"), Some(vec![solid]));
            self.add(format!("floor {index}"), object, ring);
            self.floors += 1;
        }
    }

    fn place_models(&mut self, level: &Level, frame: &Frame, prototypes: &BTreeSet<&str>) {
        let mut unknown: BTreeMap<&str, u32> = BTreeMap::new();
        for (index, model) in level.models.iter().enumerate() {
            if !prototypes.contains(model.prototype.as_str()) {
                *unknown.entry(&model.prototype).or_default() += 1;
                continue;
            }
            let at = frame.point(model.at);
            let half = f64::midpoint(model.yaw, frame.yaw());
            let mut instance = object(ObjectKind::Furniture, &model.name, None);
            instance.prototype = Some(model.prototype.clone());
            instance.placement = Some(GdbPlacement {
                position_m: [at.x, at.y, model.z_m],
                rotation: Some([half.cos(), 0.0, 0.0, half.sin()]),
            });
            self.add(format!("model {index}"), instance, [at]);
            self.instances += 1;
        }
        if !unknown.is_empty() {
            let count: u32 = unknown.values().sum();
            let some: Vec<&str> = unknown.keys().take(5).copied().collect();
            self.warnings.push(format!(
                "{count} models of {} kinds have no prototype of their name in the site's library, and are not taken: \
                 {}{}",
                unknown.len(),
                some.join(", "),
                if unknown.len() > some.len() { ", ..." } else { "" }
            ));
        }
    }
}

/// All stretches of wall, and which of them meet at each vertex.
struct Walls<'a> {
    points: &'a [Point],
    /// Those that are drawn, then those over doors.
    stretches: Vec<Stretch>,
    /// The other ends of the stretches that end at each vertex, and whether these are over doors.
    at: BTreeMap<usize, Vec<(usize, bool)>>,
}

impl<'a> Walls<'a> {
    fn of(level: &Level, points: &'a [Point]) -> Self {
        let drawn = level.walls.iter().map(|w| Stretch {
            ends: w.ends,
            height_m: w.height_m,
            is_over_door: false,
        });
        let mut heights: BTreeMap<usize, f64> = BTreeMap::new();
        for wall in &level.walls {
            for end in wall.ends {
                let height = heights.entry(end).or_insert(DOOR_HEIGHT_M);
                *height = height.max(wall.height_m);
            }
        }
        let height = |end: usize| heights.get(&end).copied().unwrap_or(DOOR_HEIGHT_M);
        let over = level.doors.iter().map(|door| Stretch {
            ends: door.ends,
            height_m: height(door.ends[0]).max(height(door.ends[1])),
            is_over_door: true,
        });
        let stretches: Vec<Stretch> = drawn.chain(over).collect();
        let mut at: BTreeMap<usize, Vec<(usize, bool)>> = BTreeMap::new();
        for Stretch { ends: [from, to], is_over_door, .. } in &stretches {
            for (here, there) in [(*from, *to), (*to, *from)] {
                let meeting = at.entry(here).or_default();
                if meeting.len() < MEETING_MAX {
                    meeting.push((there, *is_over_door));
                }
            }
        }
        Self { points, stretches, at }
    }

    /// From end to end, and as far beyond as it takes to meet the neighbours; `None` for a point.
    fn reaching(&self, stretch: &Stretch) -> Option<[Point; 2]> {
        let [from, to] = stretch.ends;
        let (p, q) = (self.points[from], self.points[to]);
        let length = (q - p).norm();
        if length < LENGTH_MIN_M {
            return None;
        }
        let along = (q - p) / length;
        let beyond = |vertex, along| along * self.beyond(vertex, along, stretch.is_over_door);
        Some([p + beyond(from, -along), q + beyond(to, along)])
    }

    /// How far a wall that comes to a vertex in the direction `along` goes beyond it.
    ///
    /// Two walls that turn by an angle a meet at their outer corner t/2 tan(a/2) beyond the vertex; from a right angle on,
    /// their square ends would come out of each other's outer faces there, and stop at t/2 cot(a/2). Where others go on to
    /// both sides, the wall ends within them. A wall that goes on over a door ends there: what the door opens is the
    /// piece over it, which overlaps its neighbours.
    fn beyond(&self, vertex: usize, along: Point, is_over_door: bool) -> f64 {
        let here = self.points[vertex];
        let (mut reach, mut left, mut right) = (0.0_f64, false, false);
        for (other, leads_over_door) in self.at.get(&vertex).into_iter().flatten() {
            let away = self.points[*other] - here;
            let length = away.norm();
            if length < LENGTH_MIN_M {
                continue;
            }
            let (sine, cosine) = (along.perp(&away) / length, along.dot(&away) / length);
            if cosine < -1.0 + STRAIGHT * STRAIGHT {
                // The wall itself, or another one on the same line.
                continue;
            }
            if *leads_over_door && !is_over_door && sine.abs() <= STRAIGHT {
                continue;
            }
            (left, right) = (left || sine > STRAIGHT, right || sine < -STRAIGHT);
            let turn = sine.abs().atan2(cosine);
            let half = (turn / 2.0).tan();
            let miter = half.min(1.0 / half);
            reach = reach.max((THICKNESS_M / 2.0 * miter).max(OVERLAP_M));
        }
        if left && right { 0.0 } else { reach }
    }

    /// The clear stretch of a door: from vertex to vertex, less what walls that stand across take of it; `None` if
    /// nothing is left.
    fn clear(&self, [from, to]: [usize; 2]) -> Option<[Point; 2]> {
        let (p, q) = (self.points[from], self.points[to]);
        let length = (q - p).norm();
        if length < LENGTH_MIN_M {
            return None;
        }
        let along = (q - p) / length;
        // A wall that goes on straight takes nothing, one at a right angle half of its thickness.
        let taken = |vertex: usize| {
            let others = self.at.get(&vertex).into_iter().flatten();
            let sines = others.map(|(other, _)| {
                let away = self.points[*other] - self.points[vertex];
                let length = away.norm();
                if length < LENGTH_MIN_M { 0.0 } else { along.perp(&away).abs() / length }
            });
            THICKNESS_M / 2.0 * sines.fold(0.0, f64::max)
        };
        let (first, last) = (taken(from), taken(to));
        (length - first - last > LENGTH_MIN_M).then(|| [p + along * first, q - along * last])
    }
}

fn leaves(door: &document::Door) -> Option<Door> {
    let kind = match door.kind.as_str() {
        "hinged" => DoorKind::Hinged,
        "double_hinged" => DoorKind::DoubleHinged,
        "sliding" => DoorKind::Sliding,
        "double_sliding" => DoorKind::DoubleSliding,
        "single_telescope" => DoorKind::Telescope,
        "double_telescope" => DoorKind::DoubleTelescope,
        _ => return None,
    };
    let turns = matches!(kind, DoorKind::Hinged | DoorKind::DoubleHinged);
    let opens_rad = door.motion_degrees.map(|degrees| degrees.abs().to_radians());
    let opens_rad = opens_rad.filter(|angle| turns && *angle <= std::f64::consts::TAU);
    Some(Door { kind, opens_rad })
}

/// A box along a line, upright, as long as the line is.
fn upright_box(
    kind: ObjectKind,
    name: &str,
    [from, to]: [Point; 2],
    depth_m: f64,
    height_m: f64,
) -> GdbObject {
    let (middle, step) = ((from + to) / 2.0, to - from);
    let half = step.y.atan2(step.x) / 2.0;
    let length = step.norm() / 2.0;
    let solid = GdbSolid::Box(GdbBox {
        from_m: [-length, -depth_m / 2.0, 0.0],
        to_m: [length, depth_m / 2.0, height_m],
    });
    let mut object = object(kind, name, Some(vec![solid]));
    object.placement = Some(GdbPlacement {
        position_m: [middle.x, middle.y, 0.0],
        rotation: Some([half.cos(), 0.0, 0.0, half.sin()]),
    });
    object
}

fn object(kind: ObjectKind, name: &str, solids: Option<Vec<GdbSolid>>) -> GdbObject {
    let mut name: String = name.chars().filter(|c| !c.is_control()).collect();
    while name.len() > NAME_MAX {
        name.pop();
    }
    GdbObject {
        name,
        kind,
        solids,
        prototype: None,
        placement: None,
        tolerance_m: Some(TOLERANCE_M),
        trust: None,
        door: None,
    }
}
