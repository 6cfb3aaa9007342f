//! Nodes as objects: those with an own mesh as solids of their own, those that share one as instances of a prototype.

use std::collections::BTreeMap;

use mapfold_map::gdb::Point3;
use mapfold_schema::border::gdb::VERTICES_MAX;
use mapfold_schema::codec::{self, DecodeError};
use mapfold_schema::v1::{Door, GdbPlacement, GdbPrototype, GdbSolid, ModelFormat, ObjectKind};
use serde::Deserialize;
use serde_json::value::RawValue;
use uuid::Uuid;

use super::super::affine::Affine;
use super::super::incoming::{FileFault, Found, Incoming, object};
use super::accessors::Numbers;
use super::container;
use super::document::{Gltf, Node};
use super::meshes::{Content, MeshExtras, solids};

/// Nodes within nodes.
const DEPTH_MAX: usize = 32;
/// How far a map may be off one that only turns and moves.
const RIGID: f64 = 1e-6;

/// What we, or others, write beside a node.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct NodeExtras {
    id: Option<Uuid>,
    name: Option<String>,
    kind: Option<ObjectKind>,
    prototype: Option<String>,
    solids: Option<Vec<GdbSolid>>,
    tolerance_m: Option<f64>,
    trust: Option<f64>,
    door: Option<Door>,
}

/// Reads a model. Prototypes get names of their own where `library` has others of theirs.
///
/// # Errors
/// What is wrong with it, and where.
pub fn read(
    bytes: &[u8],
    frame: Uuid,
    library: &BTreeMap<String, GdbPrototype>,
) -> Result<Incoming, FileFault> {
    let mut found = Found::new(ModelFormat::Glb, frame, bytes)?;
    let (json, binary) = container::open(bytes)?;
    let gltf: Gltf = codec::from_json(json).map_err(|error| match error {
        DecodeError::Shape(violation) => FileFault::of(vec![violation]),
        other => FileFault::at("the JSON of the file", other.to_string()),
    })?;
    if let Some(extension) = gltf.extensions_required.0.first() {
        let fault = format!("the extension {extension:?} is needed to read it: save it without");
        return Err(FileFault::at("/extensionsRequired", fault));
    }
    if let Some(index) = gltf.buffers.0.iter().position(|buffer| buffer.uri.is_some()) {
        let fault = "files outside of this one are not fetched: save all in one GLB";
        return Err(FileFault::at(format!("/buffers/{index}/uri"), fault));
    }
    let mut reading = Reading {
        gltf: &gltf,
        numbers: Numbers { gltf: &gltf, binary },
        meshes: BTreeMap::new(),
        uses: uses(&gltf),
        seen: vec![false; gltf.nodes.0.len()],
        budget: VERTICES_MAX,
        laid: 0,
        found: &mut found,
    };
    // From y up to z up.
    let upright =
        Affine { columns: [Point3::x(), Point3::z(), -Point3::y()], offset: Point3::zeros() };
    for node in roots(&gltf)? {
        reading.node(node, &upright, 0)?;
    }
    found.settled(library)
}

/// The nodes of the scene that is shown; of a file without scenes, all that no other node has.
fn roots(gltf: &Gltf) -> Result<Vec<usize>, FileFault> {
    if !gltf.scenes.0.is_empty() {
        let index = gltf.scene.unwrap_or(0);
        let scene = gltf.scenes.0.get(index);
        let scene = scene.ok_or_else(|| FileFault::at("/scene", "there is no such scene"))?;
        return Ok(scene.nodes.0.clone());
    }
    let mut is_root = vec![true; gltf.nodes.0.len()];
    for child in gltf.nodes.0.iter().flat_map(|node| &node.children.0) {
        if let Some(root) = is_root.get_mut(*child) {
            *root = false;
        }
    }
    Ok((0..is_root.len()).filter(|node| is_root[*node]).collect())
}

/// How many nodes have each mesh.
fn uses(gltf: &Gltf) -> BTreeMap<usize, usize> {
    let mut uses = BTreeMap::new();
    for mesh in gltf.nodes.0.iter().filter_map(|node| node.mesh) {
        *uses.entry(mesh).or_default() += 1;
    }
    uses
}

struct Reading<'a, 'f> {
    gltf: &'a Gltf,
    numbers: Numbers<'a>,
    /// Meshes that were read, with the prototype that each is.
    meshes: BTreeMap<usize, (Content, Option<String>)>,
    uses: BTreeMap<usize, usize>,
    seen: Vec<bool>,
    budget: usize,
    /// Vertices of solids that were laid out where they stand.
    laid: usize,
    found: &'f mut Found,
}

impl Reading<'_, '_> {
    fn node(&mut self, index: usize, parent: &Affine, depth: usize) -> Result<(), FileFault> {
        let place = format!("/nodes/{index}");
        let gltf = self.gltf;
        let Some(node) = gltf.nodes.0.get(index) else {
            return Err(FileFault::at(place, "there is no such node"));
        };
        if std::mem::replace(&mut self.seen[index], true) {
            return Err(FileFault::at(place, "this node stands in two places, or within itself"));
        }
        if depth > DEPTH_MAX {
            let fault = format!("nodes within nodes, more than {DEPTH_MAX} deep");
            return Err(FileFault::at(place, fault));
        }
        let own = local(node, &place)?;
        let below = tidy(&parent.after(&own));
        let extras: NodeExtras = extras(node.extras.as_deref(), &place)?;
        if node.mesh.is_some() || extras.id.is_some() {
            self.object(node, &place, parent, &below, extras)?;
        }
        node.children.0.iter().try_for_each(|child| self.node(*child, &below, depth + 1))
    }

    fn object(
        &mut self,
        node: &Node,
        place: &str,
        parent: &Affine,
        below: &Affine,
        extras: NodeExtras,
    ) -> Result<(), FileFault> {
        let name = extras.name.or_else(|| node.name.clone()).unwrap_or_default();
        let kind = extras.kind.unwrap_or_else(|| kind_of(&name));
        let mut made = object(kind, &name);
        made.tolerance_m = extras.tolerance_m;
        made.trust = extras.trust;
        made.door = extras.door.filter(|_| kind == ObjectKind::Doorway);
        let (content, prototype) = if let Some(mesh) = node.mesh {
            self.mesh(mesh, kind)?
        } else {
            let solids = extras.solids.unwrap_or_default();
            (Content { solids, skipped: 0, is_untouched: true }, extras.prototype)
        };
        if content.solids.is_empty() && prototype.is_none() && !content.is_untouched {
            self.found.leave_out("nodes", "their meshes have no triangles");
            return Ok(());
        }
        // Below our root, what a node says is where the object stands; else that comes from all that it stands in.
        let is_level =
            *parent == Affine::scaled(1.0) && node.scale.is_none() && node.matrix.is_none();
        let placement = if is_level { said(node) } else { placement(below) };
        let is_placed = is_level || placement.is_some();
        made.placement = placement.filter(|placement| *placement != nowhere());
        if is_level && said(node).is_some() {
            made.placement = said(node);
        }
        match prototype {
            Some(prototype) if is_placed => made.prototype = Some(prototype),
            _ => {
                let solids = content.solids;
                self.spend(place, &solids)?;
                made.solids = Some(if is_placed {
                    solids
                } else {
                    solids.into_iter().map(|solid| moved(solid, below)).collect()
                });
            }
        }
        self.found.put(place, extras.id, made)
    }

    /// The solids of a mesh, and the prototype that it is.
    fn mesh(
        &mut self,
        index: usize,
        kind: ObjectKind,
    ) -> Result<(Content, Option<String>), FileFault> {
        if let Some(known) = self.meshes.get(&index) {
            return Ok(known.clone());
        }
        let place = format!("/meshes/{index}");
        let gltf = self.gltf;
        let mesh = gltf.meshes.0.get(index);
        let mesh = mesh.ok_or_else(|| FileFault::at(&*place, "there is no such mesh"))?;
        let mut extras: MeshExtras = extras(mesh.extras.as_deref(), &place)?;
        let said = extras.prototype.take();
        let kind = if said.is_some() { extras.kind } else { Some(kind) };
        let read = solids(mesh, index, extras, self.numbers, &mut self.budget)?;
        for _ in 0..read.skipped {
            self.found.leave_out("parts of meshes", "points and lines enclose nothing");
        }
        let is_shared = self.uses.get(&index).is_some_and(|uses| *uses > 1);
        let mut prototype = said.or_else(|| {
            let name = || mesh.name.clone().unwrap_or_else(|| format!("mesh {index}"));
            (is_shared && !read.solids.is_empty()).then(name)
        });
        if let Some(name) = &mut prototype {
            if self.found.prototypes.contains_key(name) {
                *name = format!("{name} ({index})");
            }
            let solids = read.solids.clone();
            self.found.put_prototype(&place, name, GdbPrototype { kind, solids })?;
        }
        self.meshes.insert(index, (read.clone(), prototype.clone()));
        Ok((read, prototype))
    }

    /// Counts what is laid out: one mesh may be stretched in many ways.
    fn spend(&mut self, place: &str, solids: &[GdbSolid]) -> Result<(), FileFault> {
        let size = |solid: &GdbSolid| match solid {
            GdbSolid::Polyhedron(polyhedron) => {
                polyhedron.vertices_m.len() + 3 * polyhedron.faces.len()
            }
            GdbSolid::Prism(prism) => prism.base_m.iter().map(Vec::len).sum(),
            GdbSolid::Box(_) | GdbSolid::Cylinder(_) => 8,
        };
        self.laid = self.laid.saturating_add(solids.iter().map(size).sum());
        if self.laid > 4 * VERTICES_MAX {
            return Err(FileFault::at(
                place,
                "its meshes come to more vertices than any model has",
            ));
        }
        Ok(())
    }
}

/// What stands beside a node or a mesh. What others write there may mean anything.
fn extras<T: Default + for<'de> Deserialize<'de>>(
    raw: Option<&RawValue>,
    place: &str,
) -> Result<T, FileFault> {
    let Some(raw) = raw else { return Ok(T::default()) };
    match codec::from_json(raw.get().as_bytes()) {
        Ok(extras) => Ok(extras),
        Err(DecodeError::Shape(violation)) if raw.get().contains("\"kind\"") => {
            let place = format!("{place}/extras{}", violation.pointer);
            Err(FileFault::at(place, violation.detail))
        }
        Err(_) => Ok(T::default()),
    }
}

/// What a thing of this name is, if nobody says: by the words of IFC, and plain ones.
fn kind_of(name: &str) -> ObjectKind {
    let name = name.to_ascii_lowercase();
    let has = |words: &[&str]| words.iter().any(|word| name.contains(word));
    if has(&["ifcwall", "ifccolumn", "ifccurtainwall", "wall", "column"]) {
        ObjectKind::Wall
    } else if has(&["ifcfurnishing", "ifcfurniture", "table", "chair", "desk", "shelf", "cabinet"])
    {
        ObjectKind::Furniture
    } else if has(&["machine", "conveyor"]) {
        ObjectKind::Machine
    } else {
        ObjectKind::Other
    }
}

/// From a node's coordinates to those of what it stands in.
fn local(node: &Node, place: &str) -> Result<Affine, FileFault> {
    let numbers = node.matrix.iter().flatten().chain(node.translation.iter().flatten());
    let mut numbers =
        numbers.chain(node.rotation.iter().flatten()).chain(node.scale.iter().flatten());
    if numbers.any(|number| number.is_nan() || number.abs() > 1e9) {
        return Err(FileFault::at(place, "it stands nowhere: a number is too large"));
    }
    if let Some(m) = node.matrix {
        let column = |k: usize| Point3::new(m[4 * k], m[4 * k + 1], m[4 * k + 2]);
        return Ok(Affine { columns: [column(0), column(1), column(2)], offset: column(3) });
    }
    let mut columns = Affine::scaled(1.0).columns;
    if let Some(q) = node.rotation {
        let length = q.iter().map(|part| part * part).sum::<f64>().sqrt();
        if (length - 1.0).abs() > 1e-2 {
            return Err(FileFault::at(format!("{place}/rotation"), "a rotation has the length 1"));
        }
        let [x, y, z, w] = q.map(|part| part / length);
        columns = [
            Point3::new(1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)),
            Point3::new(2.0 * (x * y - z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + x * w)),
            Point3::new(2.0 * (x * z + y * w), 2.0 * (y * z - x * w), 1.0 - 2.0 * (x * x + y * y)),
        ];
    }
    if let Some(scale) = node.scale {
        for (column, by) in columns.iter_mut().zip(scale) {
            *column *= by;
        }
    }
    let offset = node.translation.map_or_else(Point3::zeros, Point3::from);
    Ok(Affine { columns, offset })
}

/// Nothing but rounding away from the level itself is the level itself.
fn tidy(map: &Affine) -> Affine {
    let level = Affine::scaled(1.0);
    let off = map.columns.iter().zip(level.columns).map(|(a, b)| (a - b).norm());
    let is_level = off.chain([map.offset.norm()]).all(|off| off <= 1e-9);
    if is_level { level } else { *map }
}

/// Where a node says that it stands.
fn said(node: &Node) -> Option<GdbPlacement> {
    let rotation = node.rotation.map(|[x, y, z, w]| [w, x, y, z]);
    let position_m = node.translation.or(rotation.map(|_| [0.0; 3]))?;
    Some(GdbPlacement { position_m, rotation })
}

fn nowhere() -> GdbPlacement {
    GdbPlacement { position_m: [0.0; 3], rotation: Some([1.0, 0.0, 0.0, 0.0]) }
}

/// A placement that does what a map does; `None` if it stretches or mirrors.
fn placement(map: &Affine) -> Option<GdbPlacement> {
    let is = |value: f64, wanted: f64| (value - wanted).abs() <= RIGID;
    let [x, y, z] = map.columns;
    let is_rigid = is(x.norm(), 1.0)
        && is(y.norm(), 1.0)
        && is(z.norm(), 1.0)
        && is(x.dot(&y), 0.0)
        && is(y.dot(&z), 0.0)
        && is(x.cross(&y).dot(&z), 1.0);
    let position_m = [map.offset.x, map.offset.y, map.offset.z];
    is_rigid.then(|| GdbPlacement { position_m, rotation: Some(map.quaternion()) })
}

/// A solid by its faces, moved; mirrored, its faces are turned.
fn moved(solid: GdbSolid, map: &Affine) -> GdbSolid {
    let mapped = mapfold_schema::border::gdb::map_prototype(&GdbPrototype {
        kind: None,
        solids: vec![solid.clone()],
    });
    let Some(solid) = mapped.ok().and_then(|mut p| p.solids.pop()) else { return solid };
    let faces = solid.polyhedron();
    let [x, y, z] = map.columns;
    let is_mirrored = x.cross(&y).dot(&z) < 0.0;
    let ring = |ring: &[u32]| {
        let mut ring = ring.to_vec();
        if is_mirrored {
            ring.reverse();
        }
        ring
    };
    GdbSolid::Polyhedron(mapfold_schema::v1::GdbPolyhedron {
        vertices_m: faces.vertices.iter().map(|p| map.point(p).into()).collect(),
        faces: faces.faces.iter().map(|face| face.loops().map(ring).collect()).collect(),
    })
}
