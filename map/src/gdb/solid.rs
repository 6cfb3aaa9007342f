//! Solids: free polyhedra, and the short forms of those that are drawn most.

use std::f64::consts::{PI, TAU};

use super::exact::micrometres;
use super::mesh::Mesh;
use super::{Placement, Point3, Polygon};
use crate::geometry::Point;

/// The most sides that a cylinder is approximated with.
const CYLINDER_SIDES_MAX: f64 = 256.0;
/// The fewest: with less it is no longer round in any sense.
const CYLINDER_SIDES_MIN: f64 = 8.0;

/// A plane polygon of a polyhedron: loops of indices into its vertices, counter-clockwise seen from
/// outside.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct Face {
    /// The outer loop; the first vertex is not repeated.
    pub outer: Vec<u32>,
    /// Loops of holes, clockwise seen from outside.
    pub holes: Vec<Vec<u32>>,
}

impl Face {
    /// A face without holes.
    pub fn simple(outer: impl Into<Vec<u32>>) -> Self {
        Self { outer: outer.into(), holes: Vec::new() }
    }

    /// All loops, the outer one first.
    pub fn loops(&self) -> impl Iterator<Item = &[u32]> {
        std::iter::once(self.outer.as_slice()).chain(self.holes.iter().map(Vec::as_slice))
    }
}

/// A free polyhedron: any number of faces, closed or open, convex or not, in one piece or several.
///
/// Closed, it is what its faces enclose. Open, it is the faces themselves: sheets without thickness, seen from
/// both sides.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Polyhedron {
    /// The vertices, metres.
    pub vertices: Vec<Point3>,
    /// The faces.
    pub faces: Vec<Face>,
}

/// An upright cylinder, approximated by an inscribed prism.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Cylinder {
    /// The axis, metres.
    pub centre: Point,
    /// Radius, metres.
    pub radius: f64,
    /// Height of the lower face, metres.
    pub lower: f64,
    /// Height of the upper face, metres.
    pub upper: f64,
    /// How far the sides of the prism may lie inside the cylinder, metres.
    pub chord_error: f64,
}

impl Cylinder {
    /// Sides of the prism: the fewest whose chords lie within the chord error, at least 8, at most 256.
    ///
    /// A chord over the angle `2 a` lies `r (1 - cos a)` inside its arc at most.
    pub fn sides(&self) -> usize {
        let half_angle = (1.0 - self.chord_error / self.radius).clamp(-1.0, 1.0).acos();
        let sides = (PI / half_angle).ceil();
        // NaN, from a radius or an error that is none, becomes 0 sides: such a cylinder has a finding and no mesh.
        sides.clamp(CYLINDER_SIDES_MIN, CYLINDER_SIDES_MAX) as usize
    }

    /// The polygon of the prism.
    pub fn base(&self) -> Polygon {
        let sides = self.sides();
        let corner = |k: usize| {
            let (s, c) = (TAU * k as f64 / sides as f64).sin_cos();
            self.centre + Point::new(c, s) * self.radius
        };
        Polygon { outer: (0..sides).map(corner).collect(), holes: Vec::new() }
    }
}

/// A primitive solid in the coordinates of its object, in metres.
#[derive(Debug, Clone, PartialEq)]
pub enum Solid {
    /// Any faces.
    Polyhedron(Polyhedron),
    /// A box along the object's axes, by two opposite corners: the smaller and the greater of each
    /// coordinate.
    Box {
        /// The smaller coordinates.
        from: Point3,
        /// The greater coordinates.
        to: Point3,
    },
    /// A polygon drawn up from one height to another.
    Prism {
        /// The polygon.
        base: Polygon,
        /// Height of the lower face, metres.
        lower: f64,
        /// Height of the upper face, metres.
        upper: f64,
    },
    /// An upright cylinder.
    Cylinder(Cylinder),
}

impl Solid {
    /// A box by two opposite corners, each smaller coordinate first.
    pub fn cuboid(from: [f64; 3], to: [f64; 3]) -> Self {
        Self::Box { from: from.into(), to: to.into() }
    }

    /// The same by its faces: short forms as the prisms that they stand for.
    pub fn polyhedron(&self) -> Polyhedron {
        match self {
            Self::Polyhedron(polyhedron) => polyhedron.clone(),
            Self::Box { from, to } => {
                let corners = [[from.x, from.y], [to.x, from.y], [to.x, to.y], [from.x, to.y]];
                drawn_up(&Polygon::simple(corners), from.z, to.z)
            }
            Self::Prism { base, lower, upper } => drawn_up(base, *lower, *upper),
            Self::Cylinder(cylinder) => drawn_up(&cylinder.base(), cylinder.lower, cylinder.upper),
        }
    }

    /// The solid placed on the grid; `None` if some vertex is out of reach or a face names a vertex
    /// that is not there. Short forms upside down (`lower` above `upper`) give none either.
    pub(super) fn mesh(&self, placement: &Placement) -> Option<Mesh> {
        match self {
            Self::Polyhedron(polyhedron) => polyhedron.mesh(placement),
            Self::Box { from, to } => {
                let ascending = from.x < to.x && from.y < to.y;
                let corners = [[from.x, from.y], [to.x, from.y], [to.x, to.y], [from.x, to.y]];
                ascending
                    .then(|| prism(&Polygon::simple(corners), from.z, to.z, placement))
                    .flatten()
            }
            Self::Prism { base, lower, upper } => prism(base, *lower, *upper, placement),
            Self::Cylinder(cylinder) => (cylinder.radius > 0.0 && cylinder.chord_error > 0.0)
                .then(|| prism(&cylinder.base(), cylinder.lower, cylinder.upper, placement))
                .flatten(),
        }
    }
}

impl Polyhedron {
    fn mesh(&self, placement: &Placement) -> Option<Mesh> {
        let vertices =
            self.vertices.iter().map(|p| placement.grid_point(p)).collect::<Option<Vec<_>>>()?;
        let faces: Vec<Vec<Vec<u32>>> =
            self.faces.iter().map(|face| face.loops().map(<[u32]>::to_vec).collect()).collect();
        let known =
            |loops: &Vec<Vec<u32>>| loops.iter().flatten().all(|v| (*v as usize) < vertices.len());
        faces.iter().all(known).then(|| Mesh::new(vertices, faces))
    }
}

/// A polygon drawn up: side faces ring by ring, then the lower and the upper one.
fn drawn_up(base: &Polygon, lower: f64, upper: f64) -> Polyhedron {
    let mut drawn = Polyhedron::default();
    let (mut floor, mut ceiling) = (Vec::new(), Vec::new());
    for ring in base.rings() {
        let (first, count) = (drawn.vertices.len() as u32, ring.len() as u32);
        for p in &ring {
            drawn.vertices.push(Point3::new(p.x, p.y, lower));
            drawn.vertices.push(Point3::new(p.x, p.y, upper));
        }
        let at = |k: u32| first + 2 * (k % count);
        drawn
            .faces
            .extend((0..count).map(|k| Face::simple([at(k), at(k + 1), at(k + 1) + 1, at(k) + 1])));
        floor.push((0..count).rev().map(at).collect::<Vec<u32>>());
        ceiling.push((0..count).map(|k| at(k) + 1).collect::<Vec<u32>>());
    }
    for mut rings in [floor, ceiling] {
        if !rings.is_empty() {
            let holes = rings.split_off(1);
            drawn.faces.push(Face { outer: rings.swap_remove(0), holes });
        }
    }
    drawn
}

/// The faces of a polygon that is drawn up: side faces ring by ring, then the lower and the upper one.
fn prism(base: &Polygon, lower: f64, upper: f64, placement: &Placement) -> Option<Mesh> {
    if micrometres(lower)? >= micrometres(upper)? {
        return None;
    }
    let (mut vertices, mut sides) = (Vec::new(), Vec::new());
    let (mut floor, mut ceiling) = (Vec::new(), Vec::new());
    for ring in base.rings() {
        let first = vertices.len() as u32;
        let count = ring.len() as u32;
        for p in &ring {
            vertices.push(placement.grid_point(&Point3::new(p.x, p.y, lower))?);
            vertices.push(placement.grid_point(&Point3::new(p.x, p.y, upper))?);
        }
        let at = |k: u32| first + 2 * (k % count);
        sides.extend((0..count).map(|k| vec![vec![at(k), at(k + 1), at(k + 1) + 1, at(k) + 1]]));
        floor.push((0..count).rev().map(at).collect());
        ceiling.push((0..count).map(|k| at(k) + 1).collect());
    }
    sides.extend([floor, ceiling]);
    Some(Mesh::new(vertices, sides))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_chords_of_a_cylinder_lie_within_the_error_and_would_not_with_one_side_less() {
        for (radius, chord_error) in [(0.3, 0.01), (1.0, 0.005), (2.0, 0.001)] {
            let centre = Point::zeros();
            let cylinder = Cylinder { centre, radius, lower: 0.0, upper: 1.0, chord_error };
            let sagitta = |sides: f64| radius * (1.0 - (PI / sides).cos());
            let sides = cylinder.sides() as f64;
            assert!(sagitta(sides) <= chord_error * (1.0 + 1e-12), "{radius} {sides}");
            assert!(sagitta(sides - 1.0) > chord_error, "{radius} {sides}");
        }
    }

    #[test]
    fn the_faces_of_a_short_form_are_those_that_plans_are_cut_from() {
        let hole = [[1.0, 1.0], [2.0, 1.0], [2.0, 2.0]].map(Point::from).to_vec();
        let mut base = Polygon::simple([[0.0, 0.0], [4.0, 0.0], [4.0, 3.0], [0.0, 3.0]]);
        base.holes.push(hole);
        let placement = Placement::upright(Point3::new(1.0, 2.0, 0.5), 0.3);
        for solid in [
            Solid::cuboid([0.0, -1.0, 0.5], [2.0, 1.0, 2.5]),
            Solid::Prism { base, lower: 0.0, upper: 2.0 },
            Solid::Cylinder(Cylinder {
                centre: Point::new(1.0, 1.0),
                radius: 0.4,
                lower: 0.0,
                upper: 1.0,
                chord_error: 0.01,
            }),
        ] {
            let by_faces = Solid::Polyhedron(solid.polyhedron());
            assert_eq!(by_faces.mesh(&placement), solid.mesh(&placement));
            assert!(solid.mesh(&placement).is_some_and(|mesh| mesh.closed));
        }
    }

    #[test]
    fn a_hopeless_chord_error_neither_hangs_nor_fails() {
        let mut cylinder = Cylinder {
            centre: Point::zeros(),
            radius: 1.0,
            lower: 0.0,
            upper: 1.0,
            chord_error: 1e-300,
        };
        assert_eq!(cylinder.sides(), 256);
        cylinder.chord_error = f64::NAN;
        assert_eq!(cylinder.sides(), 0);
        assert_eq!(Solid::Cylinder(cylinder).mesh(&Placement::identity()), None);
        cylinder.chord_error = 5.0;
        assert_eq!(cylinder.sides(), 8);
    }
}
