//! Walls that looks are held against: of the shared map, of the plan of the a-priori model, or of both.

use std::collections::BTreeMap;

use mapfold_map::gdb::{ObjectId, Plan, Surface};
use mapfold_map::geometry::{
    Covariance, Interval, Point, subtract_intervals, tangent, union_intervals, unit_normal, wrap,
};
use mapfold_map::level::{FeatureId, LevelMap};
use mapfold_map::vector::{Facing, Segment};
use nalgebra::{Matrix2, Matrix2x3};

use super::filter::{MapError, WallName};

/// Which walls are worth holding looks against, and how well they are known at best.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReferenceWallsConfig {
    /// Walls of the map that fewer looks support are left out.
    pub looks_min: u32,
    /// Shorter walls are left out, metres.
    pub length_min: f64,
    /// No wall is straighter, or known better, than this: standard deviation of its offset, metres.
    pub offset_sd_min: f64,
    /// The same for its direction, radians.
    pub angle_sd_min: f64,
    /// Objects of the model are at least this large when it is asked how far they may be turned, metres.
    pub object_min: f64,
    /// A surface of the model and a wall of the map that are no farther apart, and face the same way to within this
    /// cosine, are one, metres.
    pub apart: f64,
    /// See `apart`.
    pub same_cosine: f64,
    /// Surfaces are looked at in steps of this where robots may have seen through them, metres.
    pub step: f64,
}

impl ReferenceWallsConfig {
    /// The defaults.
    pub const STANDARD: Self = Self {
        looks_min: 2,
        length_min: 0.2,
        offset_sd_min: 0.005,
        angle_sd_min: 0.2 * std::f64::consts::PI / 180.0,
        object_min: 0.5,
        apart: 0.15,
        same_cosine: 0.94,
        step: 0.1,
    };
}

/// Edge of the squares that walls are found by, metres.
const SQUARE: f64 = 2.0;

/// One face of a wall.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ReferenceWall {
    pub(super) name: WallName,
    /// Direction of its normal, towards free space.
    pub(super) angle: f64,
    pub(super) normal: Point,
    pub(super) tangent: Point,
    /// What its coordinates count from.
    pub(super) middle: Point,
    /// Its solid parts, metres along the tangent from the middle, ascending.
    pub(super) parts: Vec<(f64, f64)>,
    /// What (offset at the middle along the normal, angle) owe to errors of the map.
    pub(super) errors: Vec<(MapError, Matrix2x3<f64>)>,
}

impl ReferenceWall {
    /// What (offset, angle) at a point of the line owe to errors of the map.
    pub(super) fn errors_at(&self, at: &Point) -> impl Iterator<Item = (MapError, Matrix2x3<f64>)> {
        let lever = self.tangent.dot(&(self.middle - at));
        let about = Matrix2::new(1.0, lever, 0.0, 1.0);
        self.errors.iter().map(move |(error, j)| (*error, about * j))
    }

    /// Coordinate of a point along it.
    pub(super) fn along(&self, p: &Point) -> f64 {
        self.tangent.dot(&(p - self.middle))
    }

    /// Distance of a point from its line, positive on the free side.
    pub(super) fn across(&self, p: &Point) -> f64 {
        self.normal.dot(&(p - self.middle))
    }

    /// Whether another wall lies on the same line, within these metres at a place.
    pub(super) fn continues(&self, other: &Self, at: &Point, off: f64) -> bool {
        self.normal.dot(&other.normal) > 0.99 && (self.across(at) - other.across(at)).abs() < off
    }
}

/// Walls of a level, found by place.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct ReferenceWalls {
    walls: Vec<ReferenceWall>,
    squares: BTreeMap<(i32, i32), Vec<u32>>,
}

fn square_of(p: &Point) -> (i32, i32) {
    ((p.x / SQUARE).floor() as i32, (p.y / SQUARE).floor() as i32)
}

impl ReferenceWalls {
    /// Those of a map: of the robot's mirror, say.
    pub fn of_map(map: &LevelMap) -> Self {
        Self::of_segments(map.segments.iter().map(|(id, segment)| (*id, &**segment)))
    }

    /// Segments of a map by their ids.
    pub fn of_segments<'a>(segments: impl IntoIterator<Item = (FeatureId, &'a Segment)>) -> Self {
        let mut walls = Self::default();
        let config = ReferenceWallsConfig::STANDARD;
        for (id, segment) in segments {
            if let Some(wall) = mapped(id, segment, &config) {
                walls.add(wall);
            }
        }
        walls
    }

    /// Those of a plan of the a-priori model.
    pub fn of_plan(plan: &Plan) -> Self {
        let surfaces: Vec<Surface> = plan.edges().map(Surface::from).collect();
        let mut walls = Self::default();
        planned(&surfaces, &ReferenceWallsConfig::STANDARD).for_each(|wall| walls.add(wall));
        walls
    }

    /// Adds what the a-priori model tells besides: its surfaces where no wall of the map is, which robots have measured,
    /// and where they did not see through it (`is_free`: whether a place is known to be free).
    pub fn fill_up(&mut self, surfaces: &[Surface], is_free: impl Fn(&Point) -> bool) {
        let config = ReferenceWallsConfig::STANDARD;
        let all: Vec<ReferenceWall> = planned(surfaces, &config).collect();
        let left = all.into_iter().filter_map(|wall| self.untold(wall, &is_free, &config));
        let left: Vec<ReferenceWall> = left.collect();
        for wall in left {
            self.add(wall);
        }
    }

    /// What of a planned wall the others do not tell, and nobody has seen through.
    fn untold(
        &self,
        wall: ReferenceWall,
        is_free: impl Fn(&Point) -> bool,
        config: &ReferenceWallsConfig,
    ) -> Option<ReferenceWall> {
        let whole: Vec<Interval> =
            wall.parts.iter().map(|(from, to)| Interval::from_metres(*from, *to)).collect();
        let at = |t: f64| wall.middle + wall.tangent * t;
        let (first, last) = (wall.parts.first()?.0, wall.parts.last()?.1);
        let mut told = Vec::new();
        for other in self.near(&at(first), &at(last), config.apart) {
            if wall.normal.dot(&other.normal) < config.same_cosine {
                continue;
            }
            for (from, to) in &other.parts {
                let ends = [*from, *to].map(|t| other.middle + other.tangent * t);
                if ends.iter().all(|end| wall.across(end).abs() < config.apart) {
                    told.push(Interval::from_metres(wall.along(&ends[0]), wall.along(&ends[1])));
                }
            }
        }
        let steps = ((last - first) / config.step).ceil().max(1.0);
        for step in 0..steps as u32 {
            let [from, to] =
                [step, step + 1].map(|i| first + (last - first) * f64::from(i) / steps);
            let middle = at(f64::midpoint(from, to));
            let mut across = [-1.0, -0.5, 0.0, 0.5, 1.0].into_iter();
            if across.all(|share| is_free(&(middle + wall.normal * (share * config.apart)))) {
                told.push(Interval::from_metres(from, to));
            }
        }
        let told = union_intervals(&told, 0);
        let left = subtract_intervals(&whole, &told).into_iter();
        let left = left.map(|part| (part.from_m(), part.to_m()));
        let parts: Vec<(f64, f64)> =
            left.filter(|(from, to)| to - from >= config.length_min).collect();
        (!parts.is_empty()).then_some(ReferenceWall { parts, ..wall })
    }

    /// How many there are; what is seen from two sides counts twice.
    pub fn len(&self) -> usize {
        self.walls.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.walls.is_empty()
    }

    fn add(&mut self, wall: ReferenceWall) {
        let number = self.walls.len() as u32;
        for (from, to) in &wall.parts {
            let steps = ((to - from) / (0.5 * SQUARE)).ceil().clamp(1.0, 1e5);
            for i in 0..=steps as u32 {
                let t = from + (to - from) * f64::from(i) / steps;
                let of_square = self.squares.entry(square_of(&(wall.middle + wall.tangent * t)));
                let of_square = of_square.or_default();
                if of_square.last() != Some(&number) {
                    of_square.push(number);
                }
            }
        }
        self.walls.push(wall);
    }

    /// Those that pass within `reach` metres of a box, and some more, each once, in their order.
    pub(super) fn near(&self, a: &Point, b: &Point, reach: f64) -> Vec<&ReferenceWall> {
        let margin = Point::new(reach, reach);
        let ((x0, y0), (x1, y1)) =
            (square_of(&(a.inf(b) - margin)), square_of(&(a.sup(b) + margin)));
        let rows = (x0..=x1).flat_map(|x| self.squares.range((x, y0)..=(x, y1)));
        let mut numbers: Vec<u32> = rows.flat_map(|(_, of)| of).copied().collect();
        numbers.sort_unstable();
        numbers.dedup();
        numbers.into_iter().filter_map(|number| self.walls.get(number as usize)).collect()
    }

    /// What walls about a place owe to the error that all of the map shares: deviations of offset, metres, and
    /// angle, radians; the largest of them.
    pub(super) fn shared_near(&self, at: &Point) -> (f64, f64) {
        let shared = self.near(at, at, 0.5).into_iter().flat_map(|wall| &wall.errors);
        let shared = shared.filter(|(error, _)| *error == MapError::Shared);
        shared.fold((0.0, 0.0), |(offset, angle), (_, j)| {
            (f64::max(offset, j.row(0).norm()), f64::max(angle, j.row(1).norm()))
        })
    }
}

/// A face from one end to the other, with free space on its left.
fn face(name: WallName, from: &Point, to: &Point) -> ReferenceWall {
    let length = (to - from).norm();
    let along = (to - from) / length;
    let normal = Point::new(-along.y, along.x);
    ReferenceWall {
        name,
        angle: normal.y.atan2(normal.x),
        normal,
        // A quarter turn left of the normal, as everywhere.
        tangent: -along,
        middle: (from + to) * 0.5,
        parts: vec![(-0.5 * length, 0.5 * length)],
        errors: Vec::new(),
    }
}

/// The faces of surfaces of the model. Where an object stands is one error of all of them.
fn planned<'a>(
    surfaces: &'a [Surface],
    config: &'a ReferenceWallsConfig,
) -> impl Iterator<Item = ReferenceWall> + 'a {
    let mut extents: BTreeMap<ObjectId, (Point, Point)> = BTreeMap::new();
    for surface in surfaces {
        let (a, b) = (surface.from.metres(), surface.to.metres());
        let extent = extents.entry(surface.owner.id).or_insert((a, a));
        *extent = (extent.0.inf(&a).inf(&b), extent.1.sup(&a).sup(&b));
    }
    let is_long = |surface: &&Surface| surface.from.distance(surface.to) >= config.length_min;
    surfaces.iter().filter(is_long).flat_map(move |surface| {
        let owner = &surface.owner;
        let start = surface.from.metres();
        let (low, high) = extents.get(&owner.id).copied().unwrap_or((start, start));
        surface.sides().map(move |(from, to)| {
            // Either side of a sheet by where it begins.
            let begin = if from == start { surface.from } else { surface.to };
            let name = WallName::Planned(owner.id, begin);
            let mut wall = face(name, &from, &to);
            // Both ends stand that far off, each for itself.
            let (sd, size) = (owner.tolerance, (high - low).norm().max(config.object_min));
            let turn = std::f64::consts::SQRT_2 * sd / size;
            let arm = wall.middle - (low + high) * 0.5;
            let lever = wall.normal.y * arm.x - wall.normal.x * arm.y;
            let of_object = Matrix2x3::new(
                wall.normal.x * sd,
                wall.normal.y * sd,
                lever * turn, //
                0.0,
                0.0,
                turn,
            );
            wall.errors = vec![
                (MapError::Object(owner.id), of_object),
                (MapError::Wall(name), own(&Covariance::zero(), config)),
            ];
            wall
        })
    })
}

/// A square root of a covariance of (offset, angle), which is at least what no wall is better than.
fn own(covariance: &Covariance<2>, config: &ReferenceWallsConfig) -> Matrix2x3<f64> {
    let least = [config.offset_sd_min.powi(2), config.angle_sd_min.powi(2)];
    let c = (*covariance + Covariance::from_variances(least)).rows();
    let offset = c[0][0].sqrt();
    let both = c[0][1] / offset;
    Matrix2x3::new(offset, 0.0, 0.0, both, (c[1][1] - both * both).max(0.0).sqrt(), 0.0)
}

fn mapped(
    id: FeatureId,
    segment: &Segment,
    config: &ReferenceWallsConfig,
) -> Option<ReferenceWall> {
    let (first, last) = (segment.solid.first()?, segment.solid.last()?);
    let (low, high) = (first.span.from_m(), last.span.to_m());
    if segment.looks < config.looks_min || high - low < config.length_min {
        return None;
    }
    let at = f64::midpoint(low, high);
    let alpha = segment.line.alpha();
    // Normals of the line point away from the level's origin, those of faces into free space.
    let (sign, turn) = match segment.facing {
        Facing::Origin => (-1.0, std::f64::consts::PI),
        Facing::Away => (1.0, 0.0),
    };
    let j = Matrix2::new(sign, -sign * at, 0.0, 1.0);
    let (independent, shared) =
        (segment.independent.transformed(&j), segment.dependent.transformed(&j));
    let normal = unit_normal(alpha) * sign;
    let (offset_sd, angle_sd) = (shared.sd(0), shared.sd(1));
    let of_all =
        Matrix2x3::new(normal.x * offset_sd, normal.y * offset_sd, 0.0, 0.0, 0.0, angle_sd);
    let part = |from: f64, to: f64| {
        let (a, b) = (sign * (from - at), sign * (to - at));
        (a.min(b), a.max(b))
    };
    let mut parts: Vec<(f64, f64)> =
        segment.solid.iter().map(|s| part(s.span.from_m(), s.span.to_m())).collect();
    if sign < 0.0 {
        parts.reverse();
    }
    let name = WallName::Mapped(id);
    Some(ReferenceWall {
        name,
        angle: wrap(alpha + turn),
        normal,
        tangent: tangent(alpha) * sign,
        middle: segment.line.at(at),
        parts,
        errors: vec![(MapError::Wall(name), own(&independent, config)), (MapError::Shared, of_all)],
    })
}
