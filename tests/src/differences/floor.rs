//! A hall full of things, as its model has it and as it is.

use mapfold_map::gdb::{Kind, Model, Object, ObjectId, Placement, Point3, Solid};

use crate::plane::{Piece, Point};
use crate::simulation::{Noise, World};

/// Size of the hall, metres.
const HALL_M: (f64, f64) = (20.0, 14.0);
/// Thickness of its walls in the model, metres.
const WALL_M: f64 = 0.2;
/// Things that the model has.
const MODELLED: usize = 24;
/// Sizes of things, metres.
const SIZES_M: [(f64, f64); 6] =
    [(0.3, 0.3), (0.4, 0.6), (0.5, 1.0), (0.6, 2.0), (0.8, 1.2), (1.5, 1.5)];
/// Sizes of things that are added: none that the model has, or it would be the same as if another one had moved.
const ADDED_SIZES_M: [(f64, f64); 4] = [(0.35, 0.8), (0.7, 0.7), (1.0, 1.4), (0.45, 1.3)];
/// Least distance between things, and from them to walls, metres.
const APART_M: f64 = 0.9;
/// Standard deviation of where unchanged things stand beside where the model has them, metres; what the
/// model says of itself.
const TOLERANCE_M: f64 = 0.01;
/// Number of the first wall.
const WALLS: usize = 1000;

/// What was done to a thing since it was modelled.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fate {
    /// Taken away.
    Removed,
    /// Put there; the model does not know it.
    Added,
    /// Moved so many centimetres, turned a little from 1 m on.
    Moved(u32),
}

impl Fate {
    pub(super) const ALL: [Self; 7] = [
        Self::Removed,
        Self::Added,
        Self::Moved(5),
        Self::Moved(10),
        Self::Moved(20),
        Self::Moved(100),
        Self::Moved(400),
    ];

    pub(super) fn name(self) -> String {
        match self {
            Self::Removed => "removed".to_owned(),
            Self::Added => "added".to_owned(),
            Self::Moved(cm) => format!("moved {:.2} m", f64::from(cm) / 100.0),
        }
    }

    /// Whether it is more than the model may be wrong by.
    pub(super) fn must_be_noticed(self) -> bool {
        !matches!(self, Self::Moved(5 | 10))
    }
}

/// Where a thing is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Box2 {
    pub(super) x: f64,
    pub(super) y: f64,
    turn: f64,
    half: (f64, f64),
}

impl Box2 {
    /// Counter-clockwise.
    pub(super) fn corners(&self) -> [Point; 4] {
        let (s, c) = self.turn.sin_cos();
        [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(|(a, b): (f64, f64)| {
            let (u, v) = (a * self.half.0, b * self.half.1);
            Point::new(self.x + c * u - s * v, self.y + s * u + c * v)
        })
    }

    fn walls(&self) -> impl Iterator<Item = Piece> {
        let corners = self.corners();
        (0..4).map(move |k| Piece { a: corners[k], b: corners[(k + 1) % 4] })
    }

    fn radius(&self) -> f64 {
        self.half.0.hypot(self.half.1)
    }
}

/// A thing.
#[derive(Debug, Clone)]
pub(super) struct Thing {
    /// Where the model has it.
    pub(super) meant: Option<Box2>,
    /// Where it is.
    pub(super) there: Option<Box2>,
    fate: Option<Fate>,
}

/// A hall.
#[derive(Debug, Clone)]
pub(super) struct Floor {
    pub(super) objects: Vec<Thing>,
}

pub(super) fn id(index: usize) -> ObjectId {
    let mut bytes = [0; 16];
    bytes[8..].copy_from_slice(&(index as u64).to_be_bytes());
    ObjectId(bytes)
}

impl Floor {
    /// A floor on which each fate befalls two things; what is left over is as it was modelled.
    pub(super) fn of_chance(noise: &mut Noise) -> Self {
        let mut floor = Self { objects: Vec::new() };
        for index in 0..MODELLED {
            let Some(meant) = floor.free_place(&SIZES_M, noise) else { continue };
            let fate = Fate::ALL.iter().filter(|fate| **fate != Fate::Added).nth(index / 2);
            floor.objects.push(Thing {
                meant: Some(meant),
                there: Some(meant),
                fate: fate.copied(),
            });
        }
        for index in 0..floor.objects.len() {
            let Some(meant) = floor.objects[index].meant else { continue };
            let there = match floor.objects[index].fate {
                Some(Fate::Removed) => None,
                Some(Fate::Moved(cm)) => floor.moved(index, &meant, f64::from(cm) / 100.0, noise),
                _ => Some(Box2 {
                    x: meant.x + noise.normal(TOLERANCE_M),
                    y: meant.y + noise.normal(TOLERANCE_M),
                    ..meant
                }),
            };
            floor.objects[index].there = there;
        }
        for _ in 0..2 {
            if let Some(there) = floor.free_place(&ADDED_SIZES_M, noise) {
                let fate = Some(Fate::Added);
                floor.objects.push(Thing { meant: None, there: Some(there), fate });
            }
        }
        floor
    }

    fn free_place(&self, sizes: &[(f64, f64)], noise: &mut Noise) -> Option<Box2> {
        let size = sizes[(noise.share() * sizes.len() as f64) as usize % sizes.len()];
        (0..400).find_map(|_| {
            // Mostly along the walls, as things stand; some aslant.
            let quarter = (noise.share() * 2.0).floor() * std::f64::consts::FRAC_PI_2;
            let aslant = if noise.share() < 0.25 { noise.share() } else { 0.0 };
            let place = Box2 {
                x: noise.share() * HALL_M.0,
                y: noise.share() * HALL_M.1,
                turn: quarter + aslant,
                half: (0.5 * size.0, 0.5 * size.1),
            };
            self.is_free(&place, None).then_some(place)
        })
    }

    /// Whether a thing has room there, leaving out one that it is.
    fn is_free(&self, place: &Box2, itself: Option<usize>) -> bool {
        let r = place.radius();
        let within = |v: f64, most: f64| v >= r + APART_M && v <= most - r - APART_M;
        let others = self.objects.iter().enumerate().filter(|(index, _)| Some(*index) != itself);
        let mut stands = others.flat_map(|(_, thing)| [thing.meant, thing.there]).flatten();
        within(place.x, HALL_M.0)
            && within(place.y, HALL_M.1)
            && stands.all(|s| (s.x - place.x).hypot(s.y - place.y) >= s.radius() + r + APART_M)
    }

    /// The thing so far away in a direction in which there is room; a little less apart from others if need be.
    fn moved(&self, index: usize, meant: &Box2, by: f64, noise: &mut Noise) -> Option<Box2> {
        let place = |noise: &mut Noise| {
            let direction = noise.share() * std::f64::consts::TAU;
            let turn = if by >= 1.0 { 0.3 * noise.share() } else { 0.0 };
            Box2 {
                x: meant.x + by * direction.cos(),
                y: meant.y + by * direction.sin(),
                turn: meant.turn + turn,
                ..*meant
            }
        };
        for _ in 0..400 {
            let place = place(noise);
            if by < APART_M || self.is_free(&place, Some(index)) {
                return Some(place);
            }
        }
        None
    }

    /// The objects that are not as modelled, by index.
    pub(super) fn cases(&self) -> impl Iterator<Item = (usize, Fate)> {
        let all = self.objects.iter().enumerate();
        // What should have moved and found no room is gone.
        all.filter_map(|(index, thing)| match (thing.fate, thing.there) {
            (Some(Fate::Moved(_)), None) => Some((index, Fate::Removed)),
            (fate, _) => fate.map(|fate| (index, fate)),
        })
    }

    /// How many objects of the model are as modelled, walls included.
    pub(super) fn unchanged(&self) -> u32 {
        self.objects.iter().filter(|thing| thing.fate.is_none()).count() as u32 + 4
    }

    /// As it was modelled.
    pub(super) fn model(&self) -> Model {
        let mut model = Model::default();
        for (index, thing) in self.objects.iter().enumerate() {
            let Some(Box2 { x, y, turn, half: (a, b) }) = thing.meant else { continue };
            let solid = Solid::cuboid([-a, -b, 0.0], [a, b, 1.0]);
            let mut object = Object::of(Kind::Furniture, vec![solid]);
            object.placement = Placement::upright(Point3::new(x, y, 0.0), turn);
            object.tolerance = TOLERANCE_M;
            model.objects.insert(id(index), object);
        }
        let (w, h, t) = (HALL_M.0, HALL_M.1, WALL_M);
        let walls = [
            ([-t, -t], [w + t, 0.0]),
            ([-t, h], [w + t, h + t]),
            ([-t, 0.0], [0.0, h]),
            ([w, 0.0], [w + t, h]),
        ];
        for (index, ([x0, y0], [x1, y1])) in walls.into_iter().enumerate() {
            let solid = Solid::cuboid([x0, y0, 0.0], [x1, y1, 3.0]);
            let mut object = Object::of(Kind::Wall, vec![solid]);
            object.tolerance = TOLERANCE_M;
            model.objects.insert(id(WALLS + index), object);
        }
        model
    }

    /// As it is.
    pub(super) fn world(&self) -> World {
        let (w, h) = HALL_M;
        let corners = [(0.0, 0.0), (w, 0.0), (w, h), (0.0, h), (0.0, 0.0)];
        let corners = corners.map(|(x, y)| Point::new(x, y));
        let mut walls: Vec<Piece> =
            corners.windows(2).map(|ends| Piece { a: ends[0], b: ends[1] }).collect();
        walls.extend(
            self.objects
                .iter()
                .filter_map(|t| t.there)
                .flat_map(|there| there.walls().collect::<Vec<_>>()),
        );
        World { name: "things", walls, way: Vec::new() }
    }

    /// A place where a robot has room.
    pub(super) fn stand(&self, noise: &mut Noise) -> Point {
        let mut at = Point::new(0.0, 0.0);
        for _ in 0..400 {
            at = Point::new(noise.share() * HALL_M.0, noise.share() * HALL_M.1);
            let has_room = self
                .objects
                .iter()
                .flat_map(|t| [t.there, t.meant])
                .flatten()
                .all(|s| (s.x - at.x).hypot(s.y - at.y) >= s.radius() + 0.3);
            let within = |v: f64, most: f64| v >= 0.5 && v <= most - 0.5;
            if has_room && within(at.x, HALL_M.0) && within(at.y, HALL_M.1) {
                break;
            }
        }
        at
    }

    /// How many beams of a look meet a thing where it is, or, of one that is gone, pass where it should be.
    pub(super) fn beams(&self, index: usize, world: &World, at: Point, heading: f64) -> u32 {
        let thing = &self.objects[index];
        let Some(place) = thing.there.or(thing.meant) else { return 0 };
        let mut beams = 0;
        for degrees in -90..=90 {
            let angle = heading + f64::from(degrees).to_radians();
            let range = world.cast(at, angle, 30.0).map_or(30.0, |(range, _)| range);
            let beam = Piece { a: at, b: at.towards(angle, range + 0.01) };
            beams += u32::from(place.walls().any(|wall| beam.crossing(&wall).is_some()));
        }
        beams
    }
}
