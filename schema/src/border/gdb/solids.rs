//! Solids from the wire, number by number.

use mapfold_map::gdb::{Cylinder, Face, Polygon, Polyhedron, Solid};
use mapfold_map::geometry::Point;

use super::super::violations::{Place, Violations};
use super::{SOLIDS_MAX, coordinate, position};
use crate::v1;

/// How far the sides of a cylinder may lie inside of it if nobody says, metres.
const CHORD_ERROR_M: f64 = 0.005;
/// Vertices of one ring, and rings of one polygon.
const RING_MAX: usize = 100_000;

/// How many vertices a solid has, or more: what cutting it costs grows with them.
pub fn vertex_count(solid: &Solid) -> usize {
    match solid {
        Solid::Box { .. } => 8,
        Solid::Prism { base, .. } => {
            2 * (base.outer.len() + base.holes.iter().map(Vec::len).sum::<usize>())
        }
        Solid::Cylinder(cylinder) => 2 * cylinder.sides(),
        Solid::Polyhedron(Polyhedron { vertices, faces }) => {
            let named: usize = faces.iter().flat_map(Face::loops).map(<[u32]>::len).sum();
            vertices.len().max(named)
        }
    }
}

pub(super) fn solids(
    solids: &[v1::GdbSolid],
    at: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Vec<Solid>> {
    if solids.len() > SOLIDS_MAX {
        wrong.add(at, "too_many", format_args!("an object has at most {SOLIDS_MAX} solids"));
        return None;
    }
    let mut all = Vec::with_capacity(solids.len());
    for (index, given) in solids.iter().enumerate() {
        all.push(solid(given, &at.index(index), wrong)?);
    }
    Some(all)
}

fn solid(solid: &v1::GdbSolid, at: &Place<'_>, wrong: &mut Violations) -> Option<Solid> {
    match solid {
        v1::GdbSolid::Box(given) => {
            let at = at.field("box");
            let from = position(&given.from_m, &at.field("from_m"), wrong)?;
            let to = position(&given.to_m, &at.field("to_m"), wrong)?;
            Some(Solid::Box { from, to })
        }
        v1::GdbSolid::Prism(given) => {
            let at = at.field("prism");
            let mut rings = polygon(&given.base_m, &at.field("base_m"), wrong)?.into_iter();
            let outer = rings.next().unwrap_or_default();
            let base = Polygon { outer, holes: rings.collect() };
            let lower = coordinate(given.lower_m, &at.field("lower_m"), wrong)?;
            let upper = coordinate(given.upper_m, &at.field("upper_m"), wrong)?;
            Some(Solid::Prism { base, lower, upper })
        }
        v1::GdbSolid::Cylinder(given) => {
            let at = at.field("cylinder");
            Some(Solid::Cylinder(Cylinder {
                centre: point(given.centre_m, &at.field("centre_m"), wrong)?,
                radius: coordinate(given.radius_m, &at.field("radius_m"), wrong)?,
                lower: coordinate(given.lower_m, &at.field("lower_m"), wrong)?,
                upper: coordinate(given.upper_m, &at.field("upper_m"), wrong)?,
                chord_error: coordinate(
                    given.chord_error_m.unwrap_or(CHORD_ERROR_M),
                    &at.field("chord_error_m"),
                    wrong,
                )?,
            }))
        }
        v1::GdbSolid::Polyhedron(given) => {
            polyhedron(given, &at.field("polyhedron"), wrong).map(Solid::Polyhedron)
        }
    }
}

fn polygon(
    rings: &[Vec<[f64; 2]>],
    at: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Vec<Vec<Point>>> {
    if rings.is_empty() || rings.len() > RING_MAX {
        wrong.add(at, "no_ring", "a polygon has an outer ring, and perhaps some of holes");
        return None;
    }
    let mut all = Vec::with_capacity(rings.len());
    for (index, given) in rings.iter().enumerate() {
        let at = at.index(index);
        if given.len() > RING_MAX {
            wrong.add(&at, "too_many", format_args!("a ring has at most {RING_MAX} corners"));
            return None;
        }
        let mut ring = Vec::with_capacity(given.len());
        for (index, corner) in given.iter().enumerate() {
            ring.push(point(*corner, &at.index(index), wrong)?);
        }
        all.push(ring);
    }
    Some(all)
}

fn point(metres: [f64; 2], at: &Place<'_>, wrong: &mut Violations) -> Option<Point> {
    let x = coordinate(metres[0], &at.index(0), wrong);
    let y = coordinate(metres[1], &at.index(1), wrong);
    Some(Point::new(x?, y?))
}

fn polyhedron(
    given: &v1::GdbPolyhedron,
    at: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Polyhedron> {
    let mut vertices = Vec::with_capacity(given.vertices_m.len());
    let place = at.field("vertices_m");
    for (index, vertex) in given.vertices_m.iter().enumerate() {
        vertices.push(position(vertex, &place.index(index), wrong)?);
    }
    let mut faces = Vec::with_capacity(given.faces.len());
    let place = at.field("faces");
    for (index, loops) in given.faces.iter().enumerate() {
        let Some((outer, holes)) = loops.split_first() else {
            wrong.add(&place.index(index), "no_ring", "a face has an outer ring");
            return None;
        };
        faces.push(Face { outer: outer.clone(), holes: holes.to_vec() });
    }
    Some(Polyhedron { vertices, faces })
}
