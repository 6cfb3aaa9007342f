//! What is wrong with a solid by itself, wherever it stands.

use std::ops::ControlFlow;

use super::arrangement::touch;
use super::exact::{PlanPoint, micrometres};
use super::findings::{FindingKind, Severity};
use super::mesh::Mesh;
use super::snapping::Squares;
use super::structure::in_place;
use super::{Point3, Polygon, Polyhedron, Solid};

/// Places where rings meet that are looked at.
const MEETINGS_MAX: usize = 1_000;
/// How far a vertex may lie off the plane of its face, metres.
const FLAT: f64 = 1e-3;

/// A fault of a solid: what, at which face, and where in the coordinates of its object.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Fault {
    pub(super) kind: FindingKind,
    pub(super) face: Option<usize>,
    pub(super) at: Option<Point3>,
}

impl Fault {
    fn of(kind: FindingKind) -> Self {
        Self { kind, face: None, at: None }
    }
}

/// Whether a solid has no error, so that it can be cut.
pub(super) fn is_sound(solid: &Solid) -> bool {
    faults(solid).iter().all(|fault| fault.kind.severity() != Severity::Error)
}

/// All faults of a solid that can be told apart: those of faces hide those of the shell.
pub(super) fn faults(solid: &Solid) -> Vec<Fault> {
    match solid {
        Solid::Polyhedron(polyhedron) => of_polyhedron(polyhedron),
        Solid::Box { from, to } => {
            let ascending = (0..3).all(|k| from[k] < to[k]);
            let reach = [from, to].into_iter().flatten().all(|v| micrometres(*v).is_some());
            of_extent(ascending, reach)
        }
        Solid::Prism { base, lower, upper } => {
            let mut faults = of_extent(lower < upper, reaches(*lower) && reaches(*upper));
            faults.extend(of_polygon(base));
            faults
        }
        Solid::Cylinder(c) => {
            let lengths = [c.centre.x, c.centre.y, c.lower, c.upper, c.radius, c.chord_error];
            let positive = c.lower < c.upper && c.radius > 0.0 && c.chord_error > 0.0;
            of_extent(positive, lengths.into_iter().all(reaches))
        }
    }
}

fn reaches(metres: f64) -> bool {
    micrometres(metres).is_some()
}

fn of_extent(positive: bool, within_reach: bool) -> Vec<Fault> {
    if !within_reach {
        vec![Fault::of(FindingKind::OutOfReach)]
    } else if positive {
        Vec::new()
    } else {
        vec![Fault::of(FindingKind::NoExtent)]
    }
}

fn of_polygon(polygon: &Polygon) -> Vec<Fault> {
    let rings: Option<Vec<Vec<PlanPoint>>> = std::iter::once(&polygon.outer)
        .chain(&polygon.holes)
        .map(|ring| ring.iter().map(PlanPoint::nearest).collect())
        .collect();
    let Some(rings) = rings else { return vec![Fault::of(FindingKind::OutOfReach)] };
    let fault = |(kind, at): (FindingKind, PlanPoint)| {
        let p = at.metres();
        Fault { kind, face: None, at: Some(Point3::new(p.x, p.y, 0.0)) }
    };
    of_rings(&rings).map(fault).into_iter().collect()
}

/// The first thing wrong with the rings of one face in its plane, and a place of it.
fn of_rings(rings: &[Vec<PlanPoint>]) -> Option<(FindingKind, PlanPoint)> {
    for ring in rings {
        let first = ring.first().copied().unwrap_or_default();
        if ring.len() < 3 {
            return Some((FindingKind::TooFewVertices, first));
        }
        let twice: i128 = ring.windows(2).map(|w| super::exact::side(first, w[0], w[1])).sum();
        let next = ring.iter().cycle().skip(1);
        if let Some((p, _)) = ring.iter().zip(next).find(|(p, q)| p == q) {
            return Some((FindingKind::RepeatedVertex, *p));
        }
        if twice == 0 {
            return Some((FindingKind::NoArea, first));
        }
    }
    meeting(rings).or_else(|| misplaced_hole(rings).map(|p| (FindingKind::HoleOutside, p)))
}

/// A place where rings meet themselves or each other: the first of those that are looked at. Or one where they start, if they run
/// beside each other so often that this cannot be told.
fn meeting(rings: &[Vec<PlanPoint>]) -> Option<(FindingKind, PlanPoint)> {
    // Edges, and which one comes next along the ring.
    let (mut segments, mut next) = (Vec::new(), Vec::new());
    for ring in rings {
        let first = segments.len();
        for k in 0..ring.len() {
            segments.push([ring[k], ring[(k + 1) % ring.len()]]);
            next.push((first + (k + 1) % ring.len()) as u32);
        }
    }
    let mut met: Option<PlanPoint> = None;
    let mut count = 0;
    let looked_at = Squares::of(&segments).each_pair(&segments, |a, b| {
        let (s, t) = (segments[a as usize], segments[b as usize]);
        let meets = if next[a as usize] == b || next[b as usize] == a {
            // Neighbours share a vertex, and must not fold back on each other.
            let [[from, at], [_, to]] = if next[a as usize] == b { [s, t] } else { [t, s] };
            super::exact::side(from, at, to) == 0 && super::exact::along(at, from, to) > 0
        } else {
            touch(s, t)
        };
        if meets {
            let place = super::exact::crossing(s, t).unwrap_or(s[0]);
            met = Some(met.map_or(place, |other| other.min(place)));
            count += 1;
        }
        if count < MEETINGS_MAX { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
    });
    let unknown = || {
        let first = rings.first().and_then(|ring| ring.first()).copied().unwrap_or_default();
        looked_at.is_none().then_some((FindingKind::TooIntricate, first))
    };
    met.map(|place| (FindingKind::MeetsItself, place)).or_else(unknown)
}

/// A vertex of a hole that lies outside of the outer ring, or within another hole. The rings do not meet.
fn misplaced_hole(rings: &[Vec<PlanPoint>]) -> Option<PlanPoint> {
    let within = |ring: &[PlanPoint], p: PlanPoint| {
        let next = ring.iter().cycle().skip(1);
        let crossed = ring.iter().zip(next).filter(|(a, b)| {
            let (low, high) = if a.y <= b.y { (**a, **b) } else { (**b, **a) };
            low.y <= p.y && p.y < high.y && super::exact::side(low, high, p) > 0
        });
        crossed.count() % 2 == 1
    };
    let (outer, holes) = rings.split_first()?;
    for (index, hole) in holes.iter().enumerate() {
        let in_other =
            holes.iter().enumerate().any(|(k, other)| k != index && within(other, hole[0]));
        if in_other || !within(outer, hole[0]) {
            return Some(hole[0]);
        }
    }
    None
}

fn of_polyhedron(polyhedron: &Polyhedron) -> Vec<Fault> {
    if polyhedron.faces.is_empty() {
        return vec![Fault::of(FindingKind::NoExtent)];
    }
    let known = |v: &u32| (*v as usize) < polyhedron.vertices.len();
    for (index, face) in polyhedron.faces.iter().enumerate() {
        if !face.loops().flatten().all(known) {
            return vec![Fault { kind: FindingKind::UnknownVertex, face: Some(index), at: None }];
        }
    }
    let solid = Solid::Polyhedron(polyhedron.clone());
    let Some(mesh) = in_place(&solid) else { return vec![Fault::of(FindingKind::OutOfReach)] };
    let of_faces: Vec<Fault> =
        (0..mesh.faces.len()).filter_map(|face| of_face(&mesh, polyhedron, face)).collect();
    if of_faces.iter().any(|fault| fault.kind.severity() == Severity::Error) {
        return of_faces;
    }
    of_faces.into_iter().chain(of_shell(&mesh, polyhedron)).collect()
}

fn of_face(mesh: &Mesh, polyhedron: &Polyhedron, face: usize) -> Option<Fault> {
    let loops = &mesh.faces[face];
    let at = |v: u32| polyhedron.vertices[v as usize];
    let place = |v: u32| Some(at(v));
    let first = loops[0].first().copied();
    let fault = |kind, at| Some(Fault { kind, face: Some(face), at });
    if loops.iter().any(|ring| ring.len() < 3) {
        return fault(FindingKind::TooFewVertices, first.and_then(place));
    }
    // Newell's normal: twice the vector area of the outer loop.
    let origin = at(loops[0][0]);
    let normal: Point3 =
        Mesh::walk(&loops[0]).map(|(a, b)| (at(a) - origin).cross(&(at(b) - origin))).sum();
    let drop = normal.iamax();
    let flat = |v: u32| {
        let p = mesh.vertices[v as usize];
        let (x, y) = [(1, 2), (2, 0), (0, 1)][drop];
        PlanPoint { x: p[x], y: p[y] }
    };
    let rings: Vec<Vec<PlanPoint>> =
        loops.iter().map(|ring| ring.iter().map(|v| flat(*v)).collect()).collect();
    if let Some((kind, p)) = of_rings(&rings) {
        let vertex = loops.iter().flatten().copied().find(|v| flat(*v) == p);
        return fault(kind, vertex.or(first).and_then(place));
    }
    let unit = normal.normalize();
    let off = |v: &u32| (at(*v) - origin).dot(&unit).abs();
    let worst = loops.iter().flatten().copied().max_by(|a, b| off(a).total_cmp(&off(b)))?;
    if off(&worst) > FLAT {
        return fault(FindingKind::NotPlane { off: off(&worst) }, place(worst));
    }
    None
}

fn of_shell(mesh: &Mesh, polyhedron: &Polyhedron) -> Vec<Fault> {
    let mut faults = Vec::new();
    let mut open = 0;
    let mut open_at = None;
    let edges = mesh.edges();
    let same_way = |a: u32, b: u32| {
        let walks = edges[&(a.min(b), a.max(b))];
        walks.forward.abs_diff(walks.backward) > 1
    };
    for ((a, b), walks) in &edges {
        if walks.forward.abs_diff(walks.backward) == 1 {
            open += 1;
            let middle =
                (polyhedron.vertices[*a as usize] + polyhedron.vertices[*b as usize]) / 2.0;
            open_at = open_at.or(Some((walks.last_face, middle)));
        }
    }
    // A flipped face goes along all its edges the way its neighbours do; where neighbours are flipped too,
    // the edge says only that one of the two is.
    let flipped_wholly = |face: &Vec<Vec<u32>>| {
        face.iter().flat_map(|ring| Mesh::walk(ring)).all(|(a, b)| same_way(a, b))
    };
    let mut flipped: Vec<usize> =
        (0..mesh.faces.len()).filter(|index| flipped_wholly(&mesh.faces[*index])).collect();
    if flipped.is_empty() {
        let edge = edges.iter().find(|((a, b), _)| same_way(*a, *b));
        flipped.extend(edge.map(|(_, walks)| walks.last_face));
    }
    for face in flipped {
        let at = polyhedron.vertices[mesh.faces[face][0][0] as usize];
        faults.push(Fault { kind: FindingKind::FlippedFace, face: Some(face), at: Some(at) });
    }
    if let Some((face, at)) = open_at {
        let kind = FindingKind::OpenShell { edges: open };
        faults.push(Fault { kind, face: Some(face), at: Some(at) });
    }
    if mesh.closed && mesh.volume_sixfold() <= 0.0 {
        faults.push(Fault::of(FindingKind::InsideOut));
    }
    faults
}
