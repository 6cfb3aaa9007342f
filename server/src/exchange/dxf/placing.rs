//! Where entities stand: from coordinates of objects and of blocks, in the drawing's unit, to metres of the level.

use mapfold_map::gdb::Point3;
use mapfold_map::geometry::Point;

use super::super::affine::Affine;
use super::document::{Entity, Insert, Position, Shape};
use super::tagged;

/// Below this both of x and y, a normal counts as vertical in the rule for the axes of an object's coordinates.
const NEARLY_VERTICAL: f64 = 1.0 / 64.0;
/// Largest angle between neighbouring points on an arc, radians.
const ARC_STEP: f64 = std::f64::consts::PI / 18.0;
/// Corners that bent edges may come to in one path.
const BENT_MAX: usize = 100_000;

impl Affine {
    /// From the coordinates of objects with this normal (the arbitrary axis algorithm of the format).
    pub(super) fn of_normal(normal: Position) -> Self {
        let z = Point3::from(normal).normalize();
        let is_vertical = z.x.abs() < NEARLY_VERTICAL && z.y.abs() < NEARLY_VERTICAL;
        let other = if is_vertical { Point3::y() } else { Point3::z() };
        let x = other.cross(&z).normalize();
        Self { columns: [x, z.cross(&x), z], offset: Point3::zeros() }
    }

    /// From the coordinates of a block with this base to those of the drawing.
    pub(super) fn of_insert(
        insert: &Insert<'_>,
        base: Position,
        normal: Position,
        cell: [usize; 2],
    ) -> Self {
        let (sine, cosine) = insert.turn.to_radians().sin_cos();
        let (ahead, aside) = (Point3::new(cosine, sine, 0.0), Point3::new(-sine, cosine, 0.0));
        let [sx, sy, sz] = insert.scale;
        let columns = [ahead * sx, aside * sy, Point3::z() * sz];
        let step = ahead * (cell[0] as f64 * insert.spacing[0])
            + aside * (cell[1] as f64 * insert.spacing[1]);
        let turned = Self { columns, offset: Point3::from(insert.at) + step };
        let from_base = Self { offset: -Point3::from(base), ..Self::scaled(1.0) };
        Self::of_normal(normal).after(&turned.after(&from_base))
    }
}

impl Entity<'_> {
    /// Points that it comes to, or more.
    pub(super) fn size(&self) -> usize {
        match &self.shape {
            Shape::Path { corners, .. } => {
                1 + corners
                    .iter()
                    .map(|(_, bulge)| if *bulge == 0.0 { 1 } else { 36 })
                    .sum::<usize>()
            }
            Shape::Circle { .. } | Shape::Arc { .. } => 36,
            Shape::Face(_) => 4,
            _ => 1,
        }
    }
}

/// What an entity is, where it stands: in metres, seen from above.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Piece {
    pub(super) outline: Outline,
    /// Heights between which it is drawn up; `None` for what is flat.
    pub(super) heights: Option<[f64; 2]>,
}

/// A shape in the plane.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Outline {
    Path(Vec<Point>),
    Ring(Vec<Point>),
    Circle {
        centre: Point,
        radius: f64,
    },
    /// An arc about a centre, as points on it.
    Arc {
        centre: Point,
        points: Vec<Point>,
    },
    /// A face in space.
    Face(Vec<Point3>),
    /// A ring of a face that we wrote.
    Loop(Vec<Point3>),
}

impl Piece {
    /// The piece of an entity; `None` for one that has no outline.
    pub(super) fn of(entity: &Entity<'_>, place: &Affine) -> Option<Self> {
        let of_object = place.after(&Affine::of_normal(entity.normal));
        let (outline, place) = match &entity.shape {
            Shape::Line(ends) => {
                (Outline::Path(ends.iter().map(|p| above(place, *p)).collect()), place)
            }
            Shape::Path { corners, is_in_space: true, is_closed: true }
                if entity.tags.contains_key(tagged::FACE) =>
            {
                let points = corners.iter().map(|(p, _)| place.point(&Point3::from(*p)));
                (Outline::Loop(points.collect()), place)
            }
            Shape::Path { corners, is_closed, is_in_space } => {
                let place = if *is_in_space { place } else { &of_object };
                let mut points = bent(corners, *is_closed, place);
                let is_ring = *is_closed || (points.len() > 3 && points.first() == points.last());
                if is_ring && points.first() == points.last() {
                    points.pop();
                }
                (if is_ring { Outline::Ring(points) } else { Outline::Path(points) }, place)
            }
            Shape::Circle { centre, radius } => (circle(*centre, *radius, &of_object), &of_object),
            Shape::Arc { centre, radius, angles } => {
                let [from, to] = angles.map(f64::to_radians);
                let sweep = (to - from).rem_euclid(std::f64::consts::TAU);
                let points = around(*centre, *radius, from, sweep, &of_object);
                (Outline::Arc { centre: above(&of_object, *centre), points }, &of_object)
            }
            Shape::Face(corners) => {
                let mut points: Vec<Point3> =
                    corners.iter().map(|p| place.point(&Point3::from(*p))).collect();
                points.dedup();
                (Outline::Face(points), place)
            }
            Shape::Insert(_) | Shape::Other(_) => return None,
        };
        let elevation = match &entity.shape {
            Shape::Path { corners, .. } => corners.first().map_or(0.0, |(at, _)| at[2]),
            Shape::Circle { centre, .. } | Shape::Arc { centre, .. } => centre[2],
            Shape::Line([from, _]) => from[2],
            _ => 0.0,
        };
        let heights = (entity.thickness != 0.0).then(|| {
            let up = match entity.shape {
                Shape::Line(_) => Point3::from(entity.normal).normalize() * entity.thickness,
                _ => Point3::z() * entity.thickness,
            };
            let lower = place.point(&Point3::new(0.0, 0.0, elevation)).z;
            let upper = lower + place.vector(&up).z;
            [lower.min(upper), lower.max(upper)]
        });
        let heights = heights.filter(|[lower, upper]| upper > lower);
        Some(Self { outline, heights })
    }

    /// All its corners, seen from above.
    pub(super) fn points(&self) -> Vec<Point> {
        match &self.outline {
            Outline::Path(points) | Outline::Ring(points) | Outline::Arc { points, .. } => {
                points.clone()
            }
            Outline::Circle { centre, radius } => {
                let turn = |k: u32| f64::from(k) * std::f64::consts::TAU / 16.0;
                (0..16)
                    .map(|k| centre + Point::new(turn(k).cos(), turn(k).sin()) * *radius)
                    .collect()
            }
            Outline::Face(points) | Outline::Loop(points) => {
                points.iter().map(|p| Point::new(p.x, p.y)).collect()
            }
        }
    }
}

fn above(place: &Affine, p: Position) -> Point {
    let p = place.point(&Point3::from(p));
    Point::new(p.x, p.y)
}

/// A circle; turned or stretched it is a ring.
fn circle(centre: Position, radius: f64, place: &Affine) -> Outline {
    let [x, y, _] = place.columns;
    let is_round = x.z == 0.0
        && y.z == 0.0
        && (x.norm() - y.norm()).abs() <= 1e-9 * x.norm()
        && x.dot(&y).abs() <= 1e-9 * x.norm_squared();
    if is_round {
        return Outline::Circle { centre: above(place, centre), radius: radius * x.norm() };
    }
    let mut points = around(centre, radius, 0.0, std::f64::consts::TAU, place);
    points.pop();
    Outline::Ring(points)
}

/// Points on an arc, both ends included.
fn around(centre: Position, radius: f64, from: f64, sweep: f64, place: &Affine) -> Vec<Point> {
    let steps = (sweep / ARC_STEP).ceil().max(1.0) as u32;
    let at = |k: u32| {
        let (sine, cosine) = (from + sweep * f64::from(k) / f64::from(steps)).sin_cos();
        above(place, [centre[0] + radius * cosine, centre[1] + radius * sine, centre[2]])
    };
    (0..=steps).map(at).collect()
}

/// The corners of a path, bent edges as points on them. A bulge is the tangent of a quarter of the arc's angle.
fn bent(corners: &[(Position, f64)], is_closed: bool, place: &Affine) -> Vec<Point> {
    let mut points: Vec<Point> = Vec::with_capacity(corners.len());
    let count = corners.len();
    for (k, (from, bulge)) in corners.iter().enumerate() {
        points.push(above(place, *from));
        let is_last = k + 1 == count;
        if *bulge == 0.0 || (is_last && !is_closed) || points.len() > BENT_MAX {
            continue;
        }
        let to = corners[(k + 1) % count].0;
        let chord = Point::new(to[0] - from[0], to[1] - from[1]);
        if chord.norm() == 0.0 {
            continue;
        }
        let sweep = 4.0 * bulge.atan();
        // From the middle of the chord to the centre, to the left of a counter-clockwise arc.
        let to_centre = (1.0 - bulge * bulge) / (4.0 * bulge);
        let centre = Point::new(
            f64::midpoint(from[0], to[0]) - chord.y * to_centre,
            f64::midpoint(from[1], to[1]) + chord.x * to_centre,
        );
        let arm = Point::new(from[0], from[1]) - centre;
        let steps = (sweep.abs() / ARC_STEP).ceil().max(1.0) as u32;
        for step in 1..steps {
            let (sine, cosine) = (sweep * f64::from(step) / f64::from(steps)).sin_cos();
            let turned = Point::new(arm.x * cosine - arm.y * sine, arm.x * sine + arm.y * cosine);
            points.push(above(place, [centre.x + turned.x, centre.y + turned.y, from[2]]));
        }
    }
    points
}
