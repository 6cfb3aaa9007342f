//! The surfaces of a plan, by object and by place.

use std::collections::BTreeMap;

use crate::gdb::{Free, Owner, Plan};
use crate::geometry::Point;

/// A straight stretch of surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Surface {
    pub(super) from: Point,
    /// Unit vector to the other end; what is solid is on the right.
    pub(super) along: Point,
    pub(super) length: f64,
    /// Whether it is seen from both sides.
    pub(super) both: bool,
    pub(super) owner: usize,
}

impl Surface {
    /// Unit vector into free space.
    pub(super) fn outward(&self) -> Point {
        Point::new(-self.along.y, self.along.x)
    }

    pub(super) fn at(&self, along: f64) -> Point {
        self.from + self.along * along
    }

    /// Coordinates of a place along the surface and out of it.
    pub(super) fn coordinates(&self, p: &Point) -> [f64; 2] {
        let to = p - self.from;
        [to.dot(&self.along), to.dot(&self.outward())]
    }

    /// Whether what is seen with this visible normal may be the surface: it looks the same way, within 20 degrees.
    pub(super) fn faces(&self, normal: &Point) -> bool {
        const COS_20_DEGREES: f64 = 0.94;
        let same = self.outward().dot(normal);
        (if self.both { same.abs() } else { same }) >= COS_20_DEGREES
    }

    /// The nearest place of the surface.
    pub(super) fn nearest(&self, p: &Point) -> Point {
        let [along, _] = self.coordinates(p);
        self.at(along.clamp(0.0, self.length))
    }
}

/// All surfaces of a plan.
#[derive(Debug)]
pub(super) struct Surfaces {
    pub(super) owners: Vec<Owner>,
    /// Those of one owner follow each other.
    pub(super) all: Vec<Surface>,
    /// Of each owner, where its surfaces begin; and their end.
    starts: Vec<usize>,
    squares: BTreeMap<(i64, i64), Vec<u32>>,
}

/// Edge of the squares that surfaces are found by, metres; more than any distance that is asked for.
const SQUARE: f64 = 2.0;
/// Surfaces are in the squares that they come this near to, metres.
pub(super) const NEAR: f64 = 0.6;

impl Surfaces {
    pub(super) fn of(plan: &Plan) -> Self {
        let mut by_owner: BTreeMap<_, (Owner, Vec<Surface>)> = BTreeMap::new();
        for edge in plan.edges() {
            let (from, to) = (edge.from.metres(), edge.to.metres());
            let length = (to - from).norm();
            if length <= 0.0 {
                continue;
            }
            let along = (to - from) / length;
            let both = edge.free == Free::Both;
            let surface = Surface { from, along, length, both, owner: 0 };
            let of_owner =
                by_owner.entry(edge.owner.id).or_insert_with(|| (*edge.owner, Vec::new()));
            of_owner.1.push(surface);
        }
        let (mut owners, mut all, mut starts) = (Vec::new(), Vec::new(), vec![0]);
        for (index, (owner, surfaces)) in by_owner.into_values().enumerate() {
            owners.push(owner);
            all.extend(surfaces.into_iter().map(|surface| Surface { owner: index, ..surface }));
            starts.push(all.len());
        }
        let mut squares: BTreeMap<_, Vec<u32>> = BTreeMap::new();
        for (index, surface) in all.iter().enumerate() {
            for square in touched(surface) {
                squares.entry(square).or_default().push(index as u32);
            }
        }
        Self { owners, all, starts, squares }
    }

    /// The surfaces of one object, and their numbers.
    pub(super) fn of_owner(&self, owner: usize) -> impl Iterator<Item = (usize, &Surface)> {
        let range = self.starts[owner]..self.starts[owner + 1];
        range.clone().zip(&self.all[range])
    }

    /// The ends of all surfaces of one object.
    pub(super) fn ends_of(&self, owner: usize) -> impl Iterator<Item = Point> {
        self.of_owner(owner).flat_map(|(_, surface)| [surface.from, surface.at(surface.length)])
    }

    /// All surfaces that come within [`NEAR`] of a place, and some more.
    pub(super) fn near(&self, p: &Point) -> impl Iterator<Item = (usize, &Surface)> {
        let found = self.squares.get(&square(p)).map_or(&[][..], Vec::as_slice);
        found.iter().map(|index| (*index as usize, &self.all[*index as usize]))
    }
}

fn square(p: &Point) -> (i64, i64) {
    ((p.x / SQUARE).floor() as i64, (p.y / SQUARE).floor() as i64)
}

/// The squares that come near a surface, walked along it in steps of half a square: what is long and aslant comes near few of
/// those that its bounds hold.
fn touched(surface: &Surface) -> Vec<(i64, i64)> {
    let steps = (surface.length / (0.5 * SQUARE)).ceil().max(1.0) as u32;
    // Between two steps the surface is no farther than a quarter of a square from one of them.
    let reach = NEAR + 0.25 * SQUARE;
    let mut squares = Vec::new();
    for step in 0..=steps {
        let p = surface.at(surface.length * f64::from(step) / f64::from(steps));
        let (low, high) = (square(&p.add_scalar(-reach)), square(&p.add_scalar(reach)));
        for x in low.0..=high.0 {
            squares.extend((low.1..=high.1).map(|y| (x, y)));
        }
    }
    squares.sort_unstable();
    squares.dedup();
    squares
}
