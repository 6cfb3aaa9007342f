//! Rooms of 8 x 6 m with boxes in them: as models, and as maps that robots would have made.

use std::sync::Arc;

use mapfold_map::gdb::{Kind, Model, Object, ObjectId, Placement, Point3, Solid};
use mapfold_map::geometry::{Covariance, Interval, Line, Point};
use mapfold_map::level::{ContributionId, FeatureId, LevelMap};
use mapfold_map::raster::{Cell, LogOdds, SensorClass, TILE_CELLS, Tile, TileKey};
use mapfold_map::vector::{EndKind, Facing, Segment, SolidInterval};

const RESOLUTION: f64 = 0.05;
const ROOM: Point = Point::new(8.0, 6.0);

/// A box on the floor.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Thing {
    pub(crate) middle: Point,
    pub(crate) half: Point,
    pub(crate) turn: f64,
}

impl Thing {
    /// Counter-clockwise.
    fn corners(&self) -> [Point; 4] {
        let (s, c) = self.turn.sin_cos();
        [(1.0, 1.0), (-1.0, 1.0), (-1.0, -1.0), (1.0, -1.0)].map(|(a, b)| {
            let (u, v) = (a * self.half.x, b * self.half.y);
            self.middle + Point::new(c * u - s * v, s * u + c * v)
        })
    }

    /// How far inside a place is, metres; negative outside.
    fn depth(&self, p: &Point) -> f64 {
        let (s, c) = self.turn.sin_cos();
        let to = p - self.middle;
        let (u, v) = (c * to.x + s * to.y, c * to.y - s * to.x);
        (self.half.x - u.abs()).min(self.half.y - v.abs())
    }
}

pub(crate) fn id(number: u32) -> ObjectId {
    let mut bytes = [0; 16];
    bytes[12..].copy_from_slice(&number.to_be_bytes());
    ObjectId(bytes)
}

/// Objects numbered from 0.
pub(crate) fn model(objects: Vec<Object>) -> Model {
    let objects = objects.into_iter().enumerate().map(|(k, object)| (id(k as u32), object));
    Model { objects: objects.collect(), ..Model::default() }
}

pub(crate) fn solid(kind: Kind, thing: &Thing) -> Object {
    let Thing { middle, half, turn } = thing;
    let cuboid = Solid::cuboid([-half.x, -half.y, 0.0], [half.x, half.y, 2.0]);
    let mut object = Object::of(kind, vec![cuboid]);
    object.placement = Placement::upright(Point3::new(middle.x, middle.y, 0.0), *turn);
    object
}

pub(crate) fn door(from_x: f64, to_x: f64, from_y: f64, to_y: f64) -> Object {
    let cuboid = Solid::cuboid([from_x, from_y, 0.0], [to_x, to_y, 2.0]);
    Object::of(Kind::Doorway, vec![cuboid])
}

/// Four walls of 20 cm.
pub(crate) fn room() -> Vec<Object> {
    let wall = |from: [f64; 2], to: [f64; 2]| {
        let cuboid = Solid::cuboid([from[0], from[1], 0.0], [to[0], to[1], 2.0]);
        Object::of(Kind::Wall, vec![cuboid])
    };
    let (w, h) = (ROOM.x, ROOM.y);
    vec![
        wall([-0.2, -0.2], [w + 0.2, 0.0]),
        wall([-0.2, h], [w + 0.2, h + 0.2]),
        wall([-0.2, 0.0], [0.0, h]),
        wall([w, 0.0], [w + 0.2, h]),
    ]
}

/// The map of a room in which these boxes stand, every face of which was seen in so many looks.
pub(crate) fn painted(things: &[Thing], looks: u32) -> LevelMap {
    let mut map = LevelMap::default();
    let [low, high] =
        [Point::new(-0.3, -0.3), ROOM.add_scalar(0.3)].map(|p| Cell::holding(&p, RESOLUTION));
    for row in low.row..=high.row {
        for column in low.column..=high.column {
            let cell = Cell { column, row };
            let evidence = evidence(&cell.centre(RESOLUTION), things) * looks as i32;
            let (tile, offset) = cell.tile();
            let key = TileKey { class: SensorClass::Scanner, tile };
            let tile = map.tiles.entry(key).or_default();
            let mut cells = Box::new([0; TILE_CELLS]);
            cells.copy_from_slice(tile.cells());
            cells[offset] = evidence;
            *tile = Arc::new(Tile::new(cells));
        }
    }
    let (w, h) = (ROOM.x, ROOM.y);
    // The room's own faces, with what is free on the left.
    let room = [[0.0, 0.0], [w, 0.0], [w, h], [0.0, h]].map(Point::from);
    let faces = (0..4).map(|k| (room[k], room[(k + 1) % 4]));
    let of_things = things.iter().flat_map(|thing| {
        let corners = thing.corners();
        (0..4).map(move |k| (corners[(k + 1) % 4], corners[k])).collect::<Vec<_>>()
    });
    for (index, (from, to)) in faces.chain(of_things).enumerate() {
        // What is as narrow as a board's edge is no wall to a scanner.
        if (to - from).norm() > 0.2 {
            let contribution = ContributionId([1; 16]);
            let id = FeatureId { contribution, index: index as u16 };
            map.segments.insert(id, Arc::new(segment(from, to, looks)));
        }
    }
    map
}

/// Of one look, as scanners say it: 0.4 nat for free, 0.85 for a hit, nothing inside.
fn evidence(p: &Point, things: &[Thing]) -> i32 {
    let of_room = p.x.min(p.y).min(ROOM.x - p.x).min(ROOM.y - p.y);
    let depth = things.iter().map(|thing| thing.depth(p)).fold(-of_room, f64::max);
    if depth < 0.0 {
        -40
    } else if depth < RESOLUTION {
        85
    } else {
        0
    }
}

/// A wall with free space on the left of the way from `from` to `to`.
fn segment(from: Point, to: Point, looks: u32) -> Segment {
    let along = (to - from).normalize();
    let free = Point::new(-along.y, along.x);
    let (line, turned) = Line::normal_form(from.dot(&free), free.y.atan2(free.x));
    let [a, b] = [from, to].map(|p| line.along(&p));
    // The normal points from the origin; it was turned round if the origin lies in free space.
    let facing = if turned { Facing::Origin } else { Facing::Away };
    Segment {
        line,
        independent: Covariance::from_variances([1e-6, 1e-6]),
        dependent: Covariance::from_variances([1e-6, 1e-6]),
        facing,
        solid: vec![SolidInterval {
            span: Interval::from_metres(a.min(b), a.max(b)),
            ends: [EndKind::Corner; 2],
            existence: LogOdds(400),
        }],
        looks,
        robots: vec!["ada".into()],
        first_seen_us: 0,
        last_seen_us: 1,
    }
}
