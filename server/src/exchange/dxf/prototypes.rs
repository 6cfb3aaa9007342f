//! Blocks as prototypes: what a block draws, as solids; and where it stands, as a placement.

use std::collections::BTreeMap;

use mapfold_map::gdb::Point3;
use mapfold_map::geometry::{Point, convex_hull};
use mapfold_schema::v1::{
    GdbCylinder, GdbPlacement, GdbPolyhedron, GdbPrism, GdbSolid, ObjectKind,
};

use super::super::affine::Affine;
use super::placing::{Outline, Piece};

/// How far what should be a right angle, or a length of 1, may be off.
const RIGID: f64 = 1e-6;
/// Smallest area of a solid's base, square metres.
const AREA_MIN_M2: f64 = 1e-6;

/// How high flat things of a kind are taken to be, metres; walls are as high as the request says.
pub(super) fn height_m(kind: ObjectKind, wall_height_m: f64) -> f64 {
    match kind {
        ObjectKind::Wall => wall_height_m,
        ObjectKind::Doorway => 2.1,
        ObjectKind::Corridor => 0.0,
        ObjectKind::Machine => 1.5,
        ObjectKind::Furniture => 0.8,
        ObjectKind::Other => 1.0,
    }
}

/// Heights of a flat thing: floors lie below the ground.
pub(in super::super) fn heights(kind: ObjectKind, wall_height_m: f64) -> [f64; 2] {
    if kind == ObjectKind::Corridor { [-0.1, 0.0] } else { [0.0, height_m(kind, wall_height_m)] }
}

/// A ring drawn up; `None` if it encloses nothing.
pub(in super::super) fn prism(ring: &[Point], [lower_m, upper_m]: [f64; 2]) -> Option<GdbSolid> {
    let corners = corners(ring);
    let enclosed = area(ring).abs() > AREA_MIN_M2 && corners.len() > 2;
    let prism = || GdbPrism { base_m: vec![corners], lower_m, upper_m };
    enclosed.then(|| GdbSolid::Prism(prism()))
}

/// A ring without corners that stand twice.
pub(in super::super) fn corners(ring: &[Point]) -> Vec<[f64; 2]> {
    let mut corners: Vec<[f64; 2]> = ring.iter().map(|p| [p.x, p.y]).collect();
    corners.dedup();
    while corners.len() > 1 && corners.first() == corners.last() {
        corners.pop();
    }
    corners
}

/// Signed area, square metres.
pub(in super::super) fn area(ring: &[Point]) -> f64 {
    let Some(origin) = ring.first() else { return 0.0 };
    let next = ring.iter().cycle().skip(1);
    ring.iter().zip(next).map(|(p, q)| (p - origin).perp(&(q - origin))).sum::<f64>() / 2.0
}

/// A circle drawn up.
pub(super) fn cylinder(centre: Point, radius_m: f64, [lower_m, upper_m]: [f64; 2]) -> GdbSolid {
    let centre_m = [centre.x, centre.y];
    GdbSolid::Cylinder(GdbCylinder { centre_m, radius_m, lower_m, upper_m, chord_error_m: None })
}

/// Gathers faces in space into one polyhedron.
#[derive(Debug, Default)]
pub(super) struct Faces {
    vertices_m: Vec<[f64; 3]>,
    /// Rings of each face, by number.
    rings: BTreeMap<usize, Vec<Vec<u32>>>,
    /// By the bits of the coordinates: what is the same point must be the same number.
    known: BTreeMap<[u64; 3], u32>,
}

impl Faces {
    pub(super) fn is_empty(&self) -> bool {
        self.rings.is_empty()
    }

    /// Adds a ring to a face: to the one of that number, or a new one.
    pub(super) fn add(&mut self, number: Option<usize>, corners: &[Point3]) {
        let mut ring: Vec<u32> = Vec::with_capacity(corners.len());
        for corner in corners {
            let vertex = [corner.x + 0.0, corner.y + 0.0, corner.z + 0.0];
            let vertices = &mut self.vertices_m;
            ring.push(*self.known.entry(vertex.map(f64::to_bits)).or_insert_with(|| {
                vertices.push(vertex);
                vertices.len() as u32 - 1
            }));
        }
        ring.dedup();
        while ring.len() > 1 && ring.first() == ring.last() {
            ring.pop();
        }
        if ring.len() > 2 {
            let next = self.rings.last_key_value().map_or(0, |(last, _)| last.saturating_add(1));
            self.rings.entry(number.unwrap_or(next)).or_default().push(ring);
        }
    }

    pub(super) fn polyhedron(self) -> GdbPolyhedron {
        GdbPolyhedron { vertices_m: self.vertices_m, faces: self.rings.into_values().collect() }
    }
}

/// The solids of a block: what it draws up, its faces; or, of a flat symbol, what it covers.
pub(super) fn solids(pieces: &[Piece], height_m: f64) -> Vec<GdbSolid> {
    let mut solids = Vec::new();
    let mut faces = Faces::default();
    for piece in pieces {
        match (&piece.outline, piece.heights) {
            (Outline::Ring(ring), Some(heights)) => solids.extend(prism(ring, heights)),
            (Outline::Circle { centre, radius }, Some(heights)) => {
                solids.push(cylinder(*centre, *radius, heights));
            }
            (Outline::Face(corners), _) => faces.add(None, corners),
            _ => {}
        }
    }
    if !faces.is_empty() {
        solids.push(GdbSolid::Polyhedron(faces.polyhedron()));
    }
    if solids.is_empty() {
        let points: Vec<Point> = pieces.iter().flat_map(Piece::points).collect();
        solids.extend(prism(&convex_hull(&points), [0.0, height_m]));
    }
    solids
}

/// How an insert places its block.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Placing {
    /// Where, in the level.
    pub(super) placement: GdbPlacement,
    /// How the block is stretched and mirrored before, in the unit of the level.
    pub(super) stretch: Affine,
    /// That in words; empty for a block as it was drawn.
    pub(super) words: String,
}

/// A placement, and what is left of the insert's map once it is taken out; `None` for what is sheared, or lies on edge
/// without being rigid.
///
/// A drawing that is turned over, as those of a plan seen from below are, is flat; what we wrote is taken as it stands.
pub(super) fn placing(place: &Affine, unit_m: f64, is_ours: bool) -> Option<Placing> {
    let [x, y, z] = place.columns.map(|column| column / unit_m);
    let position_m = [place.offset.x, place.offset.y, place.offset.z];
    let is = |value: f64, wanted: f64| (value - wanted).abs() <= RIGID;
    let is_unit = [x, y, z].iter().all(|column| is(column.norm(), 1.0));
    let is_square = is(x.dot(&y), 0.0) && is(y.dot(&z), 0.0) && is(z.dot(&x), 0.0);
    let is_right = x.cross(&y).dot(&z) > 0.0;
    let is_flipped = is(z.z, -1.0) && is(x.z, 0.0);
    if is_unit && is_square && is_right && (is_ours || !is_flipped) {
        let rotation = Some(Affine { columns: [x, y, z], ..*place }.quaternion());
        let placement = GdbPlacement { position_m, rotation };
        return Some(Placing { placement, stretch: Affine::scaled(unit_m), words: String::new() });
    }
    // A symbol in the plane: turned, stretched along its own axes, and perhaps mirrored.
    let (a, b) = (Point::new(x.x, x.y), Point::new(y.x, y.y));
    let (sx, sy) = (a.norm(), b.norm());
    let is_plane = is(x.z, 0.0) && is(y.z, 0.0) && sx > RIGID && sy > RIGID;
    if !is_plane || a.dot(&b).abs() > RIGID * sx * sy {
        return None;
    }
    let mirrored = a.perp(&b) < 0.0;
    let sy = if mirrored { -sy } else { sy };
    let half = a.y.atan2(a.x) / 2.0;
    let rotation = Some([half.cos(), 0.0, 0.0, half.sin()]);
    let sz = z.z.abs();
    let stretch = Affine {
        columns: [
            Point3::x() * (sx * unit_m),
            Point3::y() * (sy * unit_m),
            Point3::z() * (sz * unit_m),
        ],
        offset: Point3::zeros(),
    };
    let mut words = String::new();
    if !(is(sx, 1.0) && is(sy.abs(), 1.0) && is(sz, 1.0)) {
        words = format!(" {sx:.4} by {:.4} by {sz:.4}", sy.abs());
    }
    if mirrored {
        words.push_str(" mirrored");
    }
    Some(Placing { placement: GdbPlacement { position_m, rotation }, stretch, words })
}
