//! Solids as geometries of JSON-FG in the coordinates of the level, and back.

use std::collections::BTreeMap;

use mapfold_map::gdb::{Face, Placement, Point3, Polygon, Polyhedron, Solid};
use mapfold_map::geometry::Point;

use super::super::violations::{Place, Violations};
use crate::v1::{GdbPolyhedron, GdbPrism, GdbSolid, Geometry};

type Position = Vec<f64>;
type Rings = Vec<Vec<Position>>;

/// The solids where they stand: one geometry, or a collection of them; `None` without any.
pub(super) fn geometry_of(solids: &[Solid], placement: &Placement) -> Option<Geometry> {
    let mut geometries: Vec<Geometry> = solids.iter().map(|solid| one(solid, placement)).collect();
    match geometries.len() {
        0 => None,
        1 => geometries.pop(),
        _ => Some(Geometry::GeometryCollection { geometries }),
    }
}

fn one(solid: &Solid, placement: &Placement) -> Geometry {
    match solid {
        Solid::Box { from, to } => {
            let corners = [[from.x, from.y], [to.x, from.y], [to.x, to.y], [from.x, to.y]];
            drawn_up(&Polygon::simple(corners), [from.z, to.z], placement)
        }
        Solid::Prism { base, lower, upper } => drawn_up(base, [*lower, *upper], placement),
        Solid::Cylinder(cylinder) => {
            drawn_up(&cylinder.base(), [cylinder.lower, cylinder.upper], placement)
        }
        Solid::Polyhedron(polyhedron) => faces(polyhedron, placement),
    }
}

/// A prism as long as it stands upright, else its faces.
fn drawn_up(base: &Polygon, [lower, upper]: [f64; 2], placement: &Placement) -> Geometry {
    let placed = |p: &Point, z: f64| placement.point(&Point3::new(p.x, p.y, z));
    let rings: Vec<Vec<Point>> = base.rings().collect();
    if placement.is_upright() {
        let level = |p: &Point| placed(p, 0.0);
        let base =
            rings.iter().map(|ring| closed(ring.iter().map(|p| vec![level(p).x, level(p).y])));
        let base = Box::new(Geometry::Polygon { coordinates: base.collect() });
        let [lower, upper] = [lower, upper].map(|z| z + placement.position.z);
        return Geometry::Prism { base, lower, upper };
    }
    let at = |p: &Point, z: f64| position(&placed(p, z));
    let mut shell: Vec<Rings> = Vec::new();
    for ring in &rings {
        let next = ring.iter().cycle().skip(1);
        shell.extend(ring.iter().zip(next).map(|(p, q)| {
            vec![closed([at(p, lower), at(q, lower), at(q, upper), at(p, upper)].into_iter())]
        }));
    }
    let floor = rings.iter().map(|ring| closed(ring.iter().rev().map(|p| at(p, lower))));
    let ceiling = rings.iter().map(|ring| closed(ring.iter().map(|p| at(p, upper))));
    shell.extend([floor.collect::<Rings>(), ceiling.collect::<Rings>()]);
    Geometry::Polyhedron { coordinates: vec![shell] }
}

fn faces(polyhedron: &Polyhedron, placement: &Placement) -> Geometry {
    let Polyhedron { vertices, faces } = polyhedron;
    let at = |index: &u32| {
        let vertex = vertices.get(*index as usize);
        vertex.map(|p| position(&placement.point(p)))
    };
    let polygon =
        |face: &Face| face.loops().map(|ring| closed(ring.iter().filter_map(at))).collect();
    let coordinates: Vec<Rings> = faces.iter().map(polygon).collect();
    if is_closed(faces) {
        Geometry::Polyhedron { coordinates: vec![coordinates] }
    } else {
        Geometry::MultiPolygon { coordinates }
    }
}

/// Whether every edge is run through as often one way as the other.
fn is_closed(faces: &[Face]) -> bool {
    let mut runs: BTreeMap<(u32, u32), i64> = BTreeMap::new();
    for ring in faces.iter().flat_map(Face::loops) {
        for (from, to) in ring.iter().zip(ring.iter().cycle().skip(1)) {
            *runs.entry((*from.min(to), *from.max(to))).or_default() +=
                if from < to { 1 } else { -1 };
        }
    }
    runs.values().all(|sum| *sum == 0)
}

fn position(p: &Point3) -> Position {
    vec![p.x, p.y, p.z]
}

/// A ring that ends where it began.
fn closed(ring: impl Iterator<Item = Position>) -> Vec<Position> {
    let mut ring: Vec<Position> = ring.collect();
    ring.extend(ring.first().cloned());
    ring
}

/// What other programs drew, as solids in the coordinates of the level.
pub(super) fn solids_of(
    geometry: &Geometry,
    at: &Place<'_>,
    wrong: &mut Violations,
) -> Option<Vec<GdbSolid>> {
    let Geometry::GeometryCollection { geometries } = geometry else {
        return Some(vec![solid_of(geometry, at, wrong)?]);
    };
    let at = at.field("geometries");
    let solids =
        geometries.iter().enumerate().map(|(index, g)| solid_of(g, &at.index(index), wrong));
    solids.collect()
}

fn solid_of(geometry: &Geometry, at: &Place<'_>, wrong: &mut Violations) -> Option<GdbSolid> {
    let coordinates_at = at.field("coordinates");
    let mut shape = Gathering::default();
    match geometry {
        Geometry::Polygon { coordinates } => {
            shape.face(coordinates, &coordinates_at, wrong)?;
        }
        Geometry::MultiPolygon { coordinates } => {
            for (index, polygon) in coordinates.iter().enumerate() {
                shape.face(polygon, &coordinates_at.index(index), wrong)?;
            }
        }
        Geometry::Polyhedron { coordinates } => {
            for (index, shell) in coordinates.iter().enumerate() {
                let at = coordinates_at.index(index);
                for (index, polygon) in shell.iter().enumerate() {
                    shape.face(polygon, &at.index(index), wrong)?;
                }
            }
        }
        Geometry::Prism { base, lower, upper } => {
            return prism(base, [*lower, *upper], &at.field("base"), wrong);
        }
        Geometry::GeometryCollection { .. } => {
            wrong.add(at, "unknown_geometry", "a collection within a collection is not taken");
            return None;
        }
    }
    Some(GdbSolid::Polyhedron(shape.polyhedron))
}

fn prism(
    base: &Geometry,
    [lower_m, upper_m]: [f64; 2],
    at: &Place<'_>,
    wrong: &mut Violations,
) -> Option<GdbSolid> {
    let Geometry::Polygon { coordinates } = base else {
        wrong.add(at, "unknown_geometry", "the base of a prism must be a Polygon");
        return None;
    };
    let at = at.field("coordinates");
    let mut base_m = Vec::with_capacity(coordinates.len());
    for (index, ring) in coordinates.iter().enumerate() {
        let at = at.index(index);
        let ring = opened(ring, &at, wrong)?;
        let corners = ring.iter().map(|p| <[f64; 2]>::try_from(p.as_slice()).ok());
        let Some(corners) = corners.collect::<Option<Vec<_>>>() else {
            wrong.add(&at, "bad_position", "the base of a prism has positions of two numbers");
            return None;
        };
        base_m.push(corners);
    }
    Some(GdbSolid::Prism(GdbPrism { base_m, lower_m, upper_m }))
}

/// The ring without the repetition of its first position.
fn opened<'a>(
    ring: &'a [Position],
    at: &Place<'_>,
    wrong: &mut Violations,
) -> Option<&'a [Position]> {
    match ring {
        [first, .., last] if first == last => Some(&ring[..ring.len() - 1]),
        _ => {
            wrong.add(at, "not_closed", "the last position of a ring repeats the first");
            None
        }
    }
}

/// Faces with the vertices that they share.
#[derive(Default)]
struct Gathering {
    polyhedron: GdbPolyhedron,
    /// By the bits of the coordinates: what is the same point must be the same number.
    known: BTreeMap<[u64; 3], u32>,
}

impl Gathering {
    fn face(&mut self, rings: &Rings, at: &Place<'_>, wrong: &mut Violations) -> Option<()> {
        let mut face = Vec::with_capacity(rings.len());
        for (index, ring) in rings.iter().enumerate() {
            let at = at.index(index);
            let mut indices = Vec::with_capacity(ring.len());
            for (index, position) in opened(ring, &at, wrong)?.iter().enumerate() {
                let Ok(vertex) = <[f64; 3]>::try_from(position.as_slice()) else {
                    let detail = "a position has three numbers here: x, y and height";
                    wrong.add(&at.index(index), "bad_position", detail);
                    return None;
                };
                indices.push(self.vertex(vertex));
            }
            face.push(indices);
        }
        self.polyhedron.faces.push(face);
        Some(())
    }

    fn vertex(&mut self, vertex: [f64; 3]) -> u32 {
        let vertices = &mut self.polyhedron.vertices_m;
        *self.known.entry(vertex.map(f64::to_bits)).or_insert_with(|| {
            vertices.push(vertex);
            vertices.len() as u32 - 1
        })
    }
}
