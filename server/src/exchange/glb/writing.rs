//! A model as a GLB: a node for each object, a mesh for each prototype.

use std::collections::{BTreeMap, BTreeSet};
use std::io::{self, Write};

use earcut::Earcut;
use mapfold_map::gdb::{Face, Point3, Polyhedron, Shape, Solid};
use mapfold_schema::v1::{GdbObject, ObjectKind};
use serde_json::{Map, Value, json};
use uuid::Uuid;

use super::super::outgoing::Outgoing;
use super::accessors::{FLOAT, INT};
use super::container::{BINARY, JSON, MAGIC};
use super::meshes::{MeshExtras, digest};

/// Half of the root of two: a quarter turn about x, as a quaternion.
const HALF: f64 = std::f64::consts::FRAC_1_SQRT_2;
/// Corners of a face up to which all of them are looked for on the edges of its triangles.
const CLOSED_MAX: usize = 256;
/// Kinds with their colours, in the order of materials.
const COLOURS: [(ObjectKind, [f64; 4]); 6] = [
    (ObjectKind::Wall, [0.55, 0.55, 0.58, 1.0]),
    (ObjectKind::Doorway, [0.25, 0.65, 0.35, 0.35]),
    (ObjectKind::Corridor, [0.80, 0.78, 0.70, 1.0]),
    (ObjectKind::Machine, [0.20, 0.40, 0.70, 1.0]),
    (ObjectKind::Furniture, [0.70, 0.45, 0.20, 1.0]),
    (ObjectKind::Other, [0.45, 0.40, 0.50, 1.0]),
];

/// Writes a model.
///
/// # Errors
/// It is longer than a GLB may be (4 GB), or `to` cannot take it.
pub fn write(model: Outgoing<'_>, to: &mut impl Write) -> io::Result<()> {
    let mut scene = Scene::default();
    let mut prototypes: BTreeMap<&str, Option<usize>> = BTreeMap::new();
    for (name, wire) in model.used() {
        let Some(mapped) = model.model.prototypes.get(name) else { continue };
        let extras = MeshExtras {
            prototype: Some(name.to_owned()),
            kind: wire.kind,
            solids: Some(wire.solids.clone()),
            digest: None,
        };
        let kind = wire.kind.unwrap_or(ObjectKind::Other);
        prototypes.insert(name, scene.mesh(name, kind, &mapped.solids, extras)?);
    }
    for (id, wire, object) in model.pairs() {
        let mut node = node(id, wire)?;
        let mesh = match &object.shape {
            Shape::Own(solids) => {
                let extras = MeshExtras { solids: wire.solids.clone(), ..MeshExtras::default() };
                let mesh = scene.mesh(&wire.name, wire.kind, solids, extras)?;
                if mesh.is_none() {
                    node["extras"]["solids"] = json!(wire.solids);
                }
                mesh
            }
            Shape::Instance(name) => prototypes.get(&**name).copied().flatten(),
        };
        if let Some(mesh) = mesh {
            node["mesh"] = json!(mesh);
        }
        scene.nodes.push(node);
    }
    scene.write(model.frame, to)
}

/// A node with all that is said of an object.
fn node(id: Uuid, object: &GdbObject) -> io::Result<Value> {
    let mut node = Map::new();
    if !object.name.is_empty() {
        node.insert("name".to_owned(), json!(object.name));
    }
    if let Some(placement) = &object.placement {
        node.insert("translation".to_owned(), json!(placement.position_m));
        if let Some([w, x, y, z]) = placement.rotation {
            node.insert("rotation".to_owned(), json!([x, y, z, w]));
        }
    }
    let said = GdbObject { solids: None, placement: None, ..object.clone() };
    let mut extras = serde_json::to_value(said).map_err(io::Error::other)?;
    extras["id"] = json!(id);
    node.insert("extras".to_owned(), extras);
    Ok(Value::Object(node))
}

/// The parts of a file while they grow.
#[derive(Default)]
struct Scene {
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    accessors: Vec<Value>,
    positions: Vec<u8>,
    indices: Vec<u8>,
}

impl Scene {
    /// Adds a mesh and tells its number; `None` if the solids have no triangles.
    fn mesh(
        &mut self,
        name: &str,
        kind: ObjectKind,
        solids: &[Solid],
        mut extras: MeshExtras,
    ) -> io::Result<Option<usize>> {
        let parts: Vec<_> = solids.iter().map(|solid| triangles(&solid.polyhedron())).collect();
        if parts.is_empty() || parts.iter().any(|(_, indices)| indices.is_empty()) {
            return Ok(None);
        }
        extras.digest = Some(digest(&parts));
        let material = COLOURS.iter().position(|(of, _)| *of == kind);
        let primitives: Vec<Value> = parts
            .iter()
            .map(|(positions, indices)| {
                let position = self.put_positions(positions);
                let indices = self.put_indices(indices);
                json!({"attributes": {"POSITION": position}, "indices": indices, "material": material})
            })
            .collect();
        let mut mesh = json!({"primitives": primitives});
        if !name.is_empty() {
            mesh["name"] = json!(name);
        }
        mesh["extras"] = serde_json::to_value(extras).map_err(io::Error::other)?;
        self.meshes.push(mesh);
        Ok(Some(self.meshes.len() - 1))
    }

    fn put_positions(&mut self, positions: &[[f32; 3]]) -> usize {
        let offset = self.positions.len();
        let (mut least, mut most) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for position in positions {
            for k in 0..3 {
                least[k] = least[k].min(position[k]);
                most[k] = most[k].max(position[k]);
                self.positions.extend(position[k].to_le_bytes());
            }
        }
        self.accessors.push(json!({
            "bufferView": 0, "byteOffset": offset, "componentType": FLOAT, "count": positions.len(),
            "type": "VEC3", "min": least, "max": most,
        }));
        self.accessors.len() - 1
    }

    fn put_indices(&mut self, indices: &[u32]) -> usize {
        let offset = self.indices.len();
        self.indices.extend(indices.iter().flat_map(|index| index.to_le_bytes()));
        self.accessors.push(json!({
            "bufferView": 1, "byteOffset": offset, "componentType": INT, "count": indices.len(),
            "type": "SCALAR",
        }));
        self.accessors.len() - 1
    }

    fn write(mut self, frame: Uuid, to: &mut impl Write) -> io::Result<()> {
        let mut root = json!({
            "name": "level", "rotation": [-HALF, 0.0, 0.0, HALF],
            "extras": {"frame": frame, "unit": "m", "up": "z below this node"},
        });
        if !self.nodes.is_empty() {
            root["children"] = (1..=self.nodes.len()).collect();
        }
        let materials: Vec<Value> =
            COLOURS.iter().map(|(kind, colour)| material(*kind, *colour)).collect();
        let mut nodes = vec![root];
        nodes.append(&mut self.nodes);
        let mut gltf = json!({
            "asset": {"version": "2.0", "generator": "Mapfold"},
            "scene": 0, "scenes": [{"nodes": [0]}], "nodes": nodes, "materials": materials,
        });
        let split = self.positions.len();
        let mut binary = self.positions;
        binary.append(&mut self.indices);
        if !self.meshes.is_empty() {
            gltf["meshes"] = Value::Array(self.meshes);
            gltf["accessors"] = Value::Array(self.accessors);
            gltf["buffers"] = json!([{"byteLength": binary.len()}]);
            gltf["bufferViews"] = json!([
                {"buffer": 0, "byteOffset": 0, "byteLength": split, "target": 34962},
                {"buffer": 0, "byteOffset": split, "byteLength": binary.len() - split, "target": 34963},
            ]);
        }
        let mut text = serde_json::to_vec(&gltf).map_err(io::Error::other)?;
        text.resize(text.len().next_multiple_of(4), b' ');
        let with_binary = if binary.is_empty() { 0 } else { 8 + binary.len() };
        let word = |length: usize| u32::try_from(length).map_err(io::Error::other);
        for word in [MAGIC, 2, word(20 + text.len() + with_binary)?, word(text.len())?, JSON] {
            to.write_all(&word.to_le_bytes())?;
        }
        to.write_all(&text)?;
        if !binary.is_empty() {
            to.write_all(&word(binary.len())?.to_le_bytes())?;
            to.write_all(&BINARY.to_le_bytes())?;
            to.write_all(&binary)?;
        }
        Ok(())
    }
}

fn material(kind: ObjectKind, colour: [f64; 4]) -> Value {
    let mode = if colour[3] < 1.0 { "BLEND" } else { "OPAQUE" };
    json!({
        "name": kind, "doubleSided": true, "alphaMode": mode,
        "pbrMetallicRoughness": {"baseColorFactor": colour, "metallicFactor": 0.0, "roughnessFactor": 0.9},
    })
}

/// The triangles of a solid, counter-clockwise seen from outside.
fn triangles(solid: &Polyhedron) -> (Vec<[f32; 3]>, Vec<u32>) {
    let single = |p: &Point3| [p.x as f32, p.y as f32, p.z as f32];
    let positions = solid.vertices.iter().map(single).collect();
    let mut indices = Vec::new();
    let mut cutter = Earcut::new();
    for face in &solid.faces {
        cut(face, &solid.vertices, &mut cutter, &mut indices);
    }
    (positions, indices)
}

/// Cuts a face into triangles, in the plane that it lies in best.
fn cut(face: &Face, vertices: &[Point3], cutter: &mut Earcut<f64>, indices: &mut Vec<u32>) {
    let all: Vec<u32> = face.loops().flatten().copied().collect();
    let corner = |k: u32| vertices.get(k as usize).copied();
    let Some(corners) = all.iter().map(|k| corner(*k)).collect::<Option<Vec<Point3>>>() else {
        return;
    };
    if let ([a, b, c], true) = (&all[..], face.holes.is_empty()) {
        indices.extend([a, b, c]);
        return;
    }
    // Newell: the sum of what the edges sweep about the first corner.
    let outer = &corners[..face.outer.len().min(corners.len())];
    let Some(origin) = outer.first() else { return };
    let next = outer.iter().cycle().skip(1);
    let normal = outer.iter().zip(next).map(|(p, q)| (p - origin).cross(&(q - origin)));
    let normal: Point3 = normal.fold(Point3::zeros(), |sum, part| sum + part);
    // Leave out the axis that the normal points along most, so that the outline stays the right way round.
    let [x, y, z] = [normal.x.abs(), normal.y.abs(), normal.z.abs()];
    let (axes, sign) = if z >= x && z >= y {
        ([0, 1], normal.z)
    } else if x >= y {
        ([1, 2], normal.x)
    } else {
        ([2, 0], normal.y)
    };
    let flat = corners.iter().map(|p| [p[axes[0]], p[axes[1]]]);
    let holes: Vec<u32> = face
        .holes
        .iter()
        .scan(face.outer.len() as u32, |at, hole| {
            let here = *at;
            *at += hole.len() as u32;
            Some(here)
        })
        .collect();
    let mut found: Vec<u32> = Vec::new();
    cutter.earcut(flat, &holes, &mut found);
    let side = |p: Point3, q: Point3| p[axes[0]] * q[axes[1]] - p[axes[1]] * q[axes[0]];
    let turned = |t: &[u32]| {
        let [a, b, c] = [t[0], t[1], t[2]];
        let place = |k: u32| corners[k as usize];
        let turn = side(place(b) - place(a), place(c) - place(a));
        if (turn > 0.0) == (sign > 0.0) { [a, b, c] } else { [a, c, b] }
    };
    let found: Vec<[u32; 3]> = found.chunks_exact(3).map(turned).collect();
    let outline = outline(face);
    for triangle in closed(found, &outline, &corners) {
        indices.extend(triangle.map(|k| all[k as usize]));
    }
}

/// The edges of a face, by positions among its corners.
fn outline(face: &Face) -> BTreeSet<(u32, u32)> {
    let mut edges = BTreeSet::new();
    let mut first = 0;
    for ring in face.loops() {
        let count = ring.len() as u32;
        edges.extend((0..count).map(|k| (first + k, first + (k + 1) % count)));
        first += count;
    }
    edges
}

/// Cutting passes over corners that lie on a straight line with others. Triangles that pass over one are split there, so that
/// what was closed is closed.
fn closed(
    mut triangles: Vec<[u32; 3]>,
    outline: &BTreeSet<(u32, u32)>,
    corners: &[Point3],
) -> Vec<[u32; 3]> {
    if corners.len() > CLOSED_MAX {
        return triangles;
    }
    let edges_of = |t: &[u32; 3]| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])];
    // Each split takes in one corner more.
    for _ in 0..corners.len() {
        let edges: BTreeSet<(u32, u32)> = triangles.iter().flat_map(edges_of).collect();
        let between = |(a, b): (u32, u32)| {
            let is_met = outline.contains(&(a, b)) || edges.contains(&(b, a));
            let (p, step) = (corners[a as usize], corners[b as usize] - corners[a as usize]);
            let lies = |v: &u32| {
                let (length, from) = (step.norm_squared(), corners[*v as usize] - p);
                let along = step.dot(&from) / length;
                let off = (from - step * along).norm_squared();
                along > 1e-9 && along < 1.0 - 1e-9 && off <= 1e-18 * length.max(1.0)
            };
            (0..corners.len() as u32).find(|v| !is_met && *v != a && *v != b && lies(v))
        };
        let split = triangles.iter().enumerate().find_map(|(index, triangle)| {
            let [a, b, c] = *triangle;
            let turns = [[a, b, c], [b, c, a], [c, a, b]];
            turns.into_iter().find_map(|t| Some((index, t, between((t[0], t[1]))?)))
        });
        let Some((index, [a, b, c], v)) = split else { break };
        triangles[index] = [a, v, c];
        triangles.push([v, b, c]);
    }
    triangles
}
