//! The room that the fleets map, and how far lines are from its walls.

use mapfold_map::geometry::{Covariance, difference, mahalanobis_sq, unit_normal};
use mapfold_map::vector::{Facing, ObservedSegment, Segment};
use nalgebra::{Matrix2, Vector2};

use crate::plane::{Piece, Point};
use crate::simulation::{Noise, World};

/// Position and heading of a robot, in truth.
pub(super) type Truth = (Point, f64);

/// A line in the level frame: the distance from the frame's origin along a normal that points to
/// free space (of either sign), and that normal's angle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Wall {
    /// Offset of the line along the normal.
    pub(super) offset: f64,
    /// Angle of the normal.
    pub(super) angle: f64,
    /// Its two ends.
    pub(super) piece: Piece,
}

impl Wall {
    pub(super) fn middle(&self) -> mapfold_map::geometry::Point {
        let Piece { a, b } = self.piece;
        mapfold_map::geometry::Point::new(f64::midpoint(a.x, b.x), f64::midpoint(a.y, b.y))
    }
}

/// How far a published line is from the wall, and how far it claims to be.
#[derive(Debug, Clone, Copy)]
pub(super) struct LineError {
    /// Normalised error squared of (offset, angle).
    pub(super) nees: f64,
    /// Claimed variances of offset (about the wall's middle) and angle.
    pub(super) claimed: [f64; 2],
    /// Squared errors of both.
    pub(super) actual: [f64; 2],
}

/// A room with a corner cut out, oblique and far from the level's origin.
#[derive(Debug)]
pub(super) struct Room {
    pub(super) world: World,
    pub(super) walls: Vec<Wall>,
}

const ORIGIN: (f64, f64) = (60.0, 25.0);
const TURN: f64 = 0.35;
/// Counter-clockwise, so that free space lies to the left.
const CORNERS: [(f64, f64); 6] =
    [(0.0, 0.0), (9.0, 0.0), (9.0, 4.0), (6.0, 4.0), (6.0, 7.0), (0.0, 7.0)];
/// Robots keep so far off the walls, metres.
const CLEARANCE: f64 = 0.8;

fn placed(x: f64, y: f64) -> Point {
    let (sin, cos) = TURN.sin_cos();
    Point::new(ORIGIN.0 + x * cos - y * sin, ORIGIN.1 + x * sin + y * cos)
}

impl Room {
    pub(super) fn new() -> Self {
        let corner = |i: usize| {
            let (x, y) = CORNERS[i % CORNERS.len()];
            placed(x, y)
        };
        let walls: Vec<Wall> = (0..CORNERS.len())
            .map(|i| {
                let piece = Piece { a: corner(i), b: corner(i + 1) };
                let along = (piece.b.y - piece.a.y).atan2(piece.b.x - piece.a.x);
                let angle = along + std::f64::consts::FRAC_PI_2;
                let offset = piece.a.x * angle.cos() + piece.a.y * angle.sin();
                Wall { offset, angle, piece }
            })
            .collect();
        let world =
            World { name: "room", walls: walls.iter().map(|w| w.piece).collect(), way: Vec::new() };
        Self { world, walls }
    }

    /// A place in the room, and a direction.
    pub(super) fn somewhere(&self, noise: &mut Noise) -> Truth {
        loop {
            let (x, y) = (9.0 * noise.share(), 7.0 * noise.share());
            let at = placed(x, y);
            let inside = x < 6.0 || y < 4.0;
            if inside && self.walls.iter().all(|wall| wall.piece.distance(at) > CLEARANCE) {
                return (at, std::f64::consts::TAU * noise.share());
            }
        }
    }

    /// The wall that an observed segment is of, if it is of one, by the robot's true pose.
    pub(super) fn seen(&self, truth: Truth, segment: &ObservedSegment) -> Option<usize> {
        let line = &segment.line.line;
        let end = |t: f64| {
            let p = line.at(t);
            let (sin, cos) = truth.1.sin_cos();
            Point::new(truth.0.x + p.x * cos - p.y * sin, truth.0.y + p.x * sin + p.y * cos)
        };
        let (a, b) = (end(segment.from), end(segment.to));
        self.walls.iter().position(|w| w.piece.distance(a) < 0.08 && w.piece.distance(b) < 0.08)
    }

    /// The error of a published line against the wall that it is of; `None` if it is of none.
    pub(super) fn error(&self, segment: &Segment) -> Option<LineError> {
        let turned = segment.facing == Facing::Origin;
        let (sign, turn) = if turned { (-1.0, std::f64::consts::PI) } else { (1.0, 0.0) };
        let (offset, angle) = (sign * segment.line.rho(), segment.line.alpha() + turn);
        let ends = segment.solid.first()?.span;
        let middle = segment.line.at(0.5 * (ends.from_m() + ends.to_m()));
        let wall = self.walls.iter().find(|wall| {
            difference(angle, wall.angle).abs() < 0.2
                && wall.piece.distance(Point::new(middle.x, middle.y)) < 0.4
        })?;
        let at = wall.middle();
        let delta = Vector2::new(
            offset - unit_normal(angle).dot(&at) - (wall.offset - unit_normal(wall.angle).dot(&at)),
            difference(angle, wall.angle),
        );
        // Moved from the level's origin to the wall's middle, in the published normal form.
        let lever = -segment.line.along(&at);
        let claimed: Covariance<2> = (segment.independent + segment.dependent)
            .transformed(&Matrix2::new(sign, sign * lever, 0.0, 1.0));
        Some(LineError {
            nees: mahalanobis_sq(&delta, &claimed),
            claimed: [claimed.matrix()[(0, 0)], claimed.matrix()[(1, 1)]],
            actual: [delta.x * delta.x, delta.y * delta.y],
        })
    }
}
