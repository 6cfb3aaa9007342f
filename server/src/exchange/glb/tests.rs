//! Models in three dimensions: out and in again, read back by another reader, changed by others, and whatever must be refused.

use std::collections::BTreeMap;

use mapfold_map::gdb::{Severity, findings};
use mapfold_schema::v1::ObjectKind;
use proptest::prelude::*;
use serde_json::{Value, json};

use super::super::incoming::{FileFault, Incoming};
use super::super::sample::{FRAME, Sample, model_of, plans, words};
use super::container::{BINARY, JSON, MAGIC};
use super::*;

fn written(sample: &Sample) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(sample.outgoing(), &mut bytes).unwrap();
    bytes
}

fn import(bytes: &[u8]) -> Result<Incoming, FileFault> {
    read(bytes, FRAME, &BTreeMap::new())
}

/// A file of this JSON and this binary part.
fn packed(json: &str, binary: &[u8]) -> Vec<u8> {
    let mut text = json.as_bytes().to_vec();
    text.resize(text.len().next_multiple_of(4), b' ');
    let length = 28 + text.len() + binary.len();
    let mut bytes = Vec::new();
    for word in [MAGIC, 2, length as u32, text.len() as u32, JSON] {
        bytes.extend(word.to_le_bytes());
    }
    bytes.extend(text);
    bytes.extend((binary.len() as u32).to_le_bytes());
    bytes.extend(BINARY.to_le_bytes());
    bytes.extend(binary);
    bytes
}

/// The JSON and the binary part of a file.
fn unpacked(bytes: &[u8]) -> (Value, Vec<u8>) {
    let (json, binary) = container::open(bytes).unwrap();
    (serde_json::from_slice(json).unwrap(), binary.to_vec())
}

#[test]
fn a_model_comes_back_as_what_it_was() {
    let sample = Sample::new();
    let bytes = written(&sample);
    assert_eq!(bytes, written(&sample));
    let incoming = import(&bytes).unwrap();
    assert_eq!(incoming.objects, sample.objects);
    let mut used = sample.library.clone();
    used.remove("unused");
    assert_eq!(incoming.prototypes, used);
    assert_eq!(incoming.report.left_out, []);
    let empty = Sample {
        objects: BTreeMap::new(),
        library: BTreeMap::new(),
        model: mapfold_map::gdb::Model::default(),
    };
    assert_eq!(import(&written(&empty)).unwrap().objects.len(), 0);
}

#[test]
fn another_reader_finds_every_object_with_its_mesh_and_y_up() {
    let sample = Sample::new();
    let read = gltf::Gltf::from_slice(&written(&sample)).unwrap();
    let binary = read.blob.clone().unwrap();
    let scene = read.default_scene().unwrap();
    let root = scene.nodes().next().unwrap();
    assert_eq!(root.children().count(), sample.objects.len());
    assert_eq!(read.meshes().count(), 5 + 2);
    let (mut triangles, mut highest) = (0, f32::NEG_INFINITY);
    let up = nalgebra::Matrix4::from(root.transform().matrix());
    for node in root.children() {
        let extras: Value = serde_json::from_str(node.extras().as_ref().unwrap().get()).unwrap();
        assert!(sample.objects.contains_key(&extras["id"].as_str().unwrap().parse().unwrap()));
        let place = up * nalgebra::Matrix4::from(node.transform().matrix());
        for primitive in node.mesh().unwrap().primitives() {
            let reader = primitive.reader(|_| Some(&binary));
            let positions: Vec<[f32; 3]> = reader.read_positions().unwrap().collect();
            let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
            assert!(indices.iter().all(|index| (*index as usize) < positions.len()));
            let bounds = primitive.bounding_box();
            assert!(
                positions.iter().flatten().zip(bounds.min.iter().cycle()).all(|(p, min)| p >= min)
            );
            triangles += indices.len() / 3;
            for [x, y, z] in positions {
                highest = highest.max((place * nalgebra::Vector4::new(x, y, z, 1.0)).y);
            }
        }
    }
    let structure = mapfold_map::gdb::Structure::of(&sample.model);
    let [_, top] = structure.heights().unwrap();
    assert!((f64::from(highest) - top).abs() < 1e-5, "{highest} {top}");
    assert!(triangles > 100);
}

#[test]
fn what_others_have_touched_is_taken_by_its_triangles_and_is_closed() {
    let (mut json, binary) = unpacked(&written(&Sample::new()));
    for mesh in json["meshes"].as_array_mut().unwrap() {
        mesh["extras"]["digest"] = json!("of something else");
    }
    let touched = import(&packed(&json.to_string(), &binary)).unwrap();
    let sample = Sample::new();
    assert_eq!(words(&touched.objects), words(&sample.objects));
    let model = model_of(&touched);
    let errors: Vec<_> =
        findings(&model).into_iter().filter(|f| f.kind.severity() == Severity::Error).collect();
    assert_eq!(errors, []);
    for (ours, theirs) in plans(&sample.model).iter().zip(plans(&model)) {
        let area = |plan: &mapfold_map::gdb::Plan| {
            plan.outlines().iter().map(mapfold_map::gdb::Outline::area).sum::<f64>()
        };
        assert!((area(ours) - area(&theirs)).abs() < 1e-4, "{} {}", area(ours), area(&theirs));
        assert_eq!(ours.outlines().len(), theirs.outlines().len());
    }
}

/// A cube of 1 m, as other programs write it: y up, feet scaled to metres by a node, shared by two nodes.
fn cubes() -> (Value, Vec<u8>) {
    let corner = |k: u32| [k & 1, k >> 1 & 1, k >> 2 & 1].map(|bit| bit as f32 / 0.5);
    let mut binary: Vec<u8> = (0..8).flat_map(corner).flat_map(f32::to_le_bytes).collect();
    let faces: [u8; 36] = [
        0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4, 2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2,
        1, 3, 7, 1, 7, 5,
    ];
    binary.extend(faces);
    let json = json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [
            {"children": [1, 2, 3], "scale": [0.5, 0.5, 0.5]},
            {"name": "Machine 1", "mesh": 0, "translation": [2.0, 0.0, -6.0]},
            {"name": "IfcWall:3", "mesh": 0, "scale": [4.0, 1.0, 1.0]},
            {"name": "lamp"},
        ],
        "meshes": [{"name": "cube", "primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "byteOffset": 0, "componentType": 5126, "count": 8, "type": "VEC3", "min": [0, 0, 0], "max": [2, 2, 2]},
            {"bufferView": 1, "componentType": 5121, "count": 36, "type": "SCALAR"},
        ],
        "bufferViews": [{"buffer": 0, "byteLength": 96}, {"buffer": 0, "byteOffset": 96, "byteLength": 36}],
        "buffers": [{"byteLength": 132}],
    });
    (json, binary)
}

#[test]
fn a_model_of_another_program_stands_upright_in_metres() {
    let (json, binary) = cubes();
    let incoming = import(&packed(&json.to_string(), &binary)).unwrap();
    let kinds: Vec<ObjectKind> = incoming.report.kinds.iter().map(|count| count.kind).collect();
    assert_eq!(kinds, [ObjectKind::Wall, ObjectKind::Machine]);
    let bounds = incoming.report.bounds.unwrap();
    // The machine at x 1 to 2 and y 3 to 2, for its z of -3 is 3 ahead; the wall 4 by 1.
    let found = [bounds.min_x_m, bounds.max_x_m, bounds.min_y_m, bounds.max_y_m];
    assert!(
        found.iter().zip([0.0, 4.0, -1.0, 3.0]).all(|(a, b)| (a - b).abs() < 1e-6),
        "{found:?}"
    );
    let model = model_of(&incoming);
    assert!(findings(&model).iter().all(|finding| finding.kind.severity() != Severity::Error));

    // Without the scale both are rigid but for the wall, and one is an instance.
    let mut rigid = json.clone();
    rigid["nodes"][0]["scale"] = json!([1, 1, 1]);
    rigid["nodes"][2]["scale"] = json!([1, 1, 1]);
    let incoming = import(&packed(&rigid.to_string(), &binary)).unwrap();
    assert_eq!(
        (incoming.report.instances, &incoming.report.prototypes[..]),
        (2, &["cube".to_owned()][..])
    );
}

#[test]
fn hostile_files_are_refused_with_the_place() {
    let (json, binary) = cubes();
    let with = |pointer: &str, value: Value| {
        let mut json = json.clone();
        *json.pointer_mut(pointer).unwrap() = value;
        packed(&json.to_string(), &binary)
    };
    let whole = packed(&json.to_string(), &binary);
    let many = format!("{{\"nodes\": [{}{{}}]}}", "{},".repeat(300_000));
    let chain: Vec<Value> = (1..100).map(|k| json!({"children": [k]})).collect();
    let chain = json!({"nodes": chain.into_iter().chain([json!({})]).collect::<Vec<_>>()});
    for (bytes, words) in [
        (Vec::new(), "byte 0"),
        (b"glTFhello".to_vec(), "byte 4"),
        (whole[..whole.len() - 1].to_vec(), "byte 8"),
        (whole[..16].to_vec(), "byte 8"),
        (packed("{", &[]), "the JSON of the file"),
        (packed(&"[".repeat(100_000), &[]), "the JSON of the file"),
        (
            packed(&format!("{{\"nodes\": [{{\"extras\": {}}}]}}", "[".repeat(1000)), &[]),
            "the JSON",
        ),
        (packed(&many, &[]), "/nodes"),
        (
            packed("{\"nodes\": [{\"children\": [0]}], \"scenes\": [{\"nodes\": [0]}]}", &[]),
            "/nodes/0: this node stands in two",
        ),
        (packed("{\"scenes\": [{\"nodes\": [5]}]}", &[]), "/nodes/5: there is no such node"),
        (packed("{\"scene\": 3, \"scenes\": [{}]}", &[]), "/scene"),
        (packed(&chain.to_string(), &[]), "more than 32 deep"),
        (with("/nodes/1/mesh", json!(7)), "/meshes/7"),
        (with("/nodes/1/mesh", json!(-1)), "/nodes/1/mesh"),
        (with("/nodes/1/translation", json!([1e300, 0, 0])), "/nodes/1"),
        (with("/nodes/1/translation", json!([1e8, 0, 0])), "/nodes/1: cannot be taken"),
        (with("/nodes/0/scale", json!([1e5, 1e5, 1e5])), "/nodes/"),
        (with("/accessors/0/count", json!(4_294_967_296_u64)), "/meshes/0/primitives/0: more than"),
        (with("/accessors/0/count", json!(9)), "/accessors/0: it has more elements"),
        (with("/accessors/0/byteOffset", json!(u64::MAX)), "/accessors/0: it begins or ends"),
        (with("/accessors/0/componentType", json!(5123)), "/accessors/0: positions are"),
        (with("/accessors/1/type", json!("VEC2")), "/accessors/1: indices are single"),
        (with("/accessors/1/bufferView", json!(9)), "/accessors/1: it has no view"),
        (with("/bufferViews/0/byteLength", json!(1_u64 << 62)), "/accessors/0"),
        (
            with(
                "/bufferViews/1",
                json!({"buffer": 0, "byteOffset": 96, "byteLength": 36, "byteStride": 4}),
            ),
            "/accessors/1: it has more",
        ),
        (
            with("/buffers/0", json!({"uri": "file:///etc/passwd", "byteLength": 132})),
            "/buffers/0/uri",
        ),
        (with("/scenes/0", json!({"nodes": [0, 0]})), "/nodes/0"),
    ] {
        let fault = import(&bytes).expect_err(words).to_string();
        assert!(fault.contains(words), "{words}: {fault}");
    }
    let mut draco = json.clone();
    draco["extensionsRequired"] = json!(["KHR_draco_mesh_compression"]);
    assert!(import(&packed(&draco.to_string(), &binary)).unwrap_err().fault.contains("draco"));
    let mut bad = binary.clone();
    bad[0..4].copy_from_slice(&f32::NAN.to_le_bytes());
    assert!(import(&packed(&json.to_string(), &bad)).unwrap_err().fault.contains("position 0"));
    bad = binary;
    bad[100] = 8;
    let fault = import(&packed(&json.to_string(), &bad)).unwrap_err();
    assert_eq!(fault.to_string(), "/meshes/0/primitives/0: index 8 is none of 8 vertices");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    /// Whatever is changed in a file, it is read or refused with a place.
    #[test]
    fn changed_files_are_read_or_refused(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..3_u8), 1..6),
        is_ours: bool,
    ) {
        let (json, binary) = cubes();
        let mut bytes = if is_ours { written(&Sample::new()) } else { packed(&json.to_string(), &binary) };
        for (at, byte, what) in edits {
            let at = at.index(bytes.len());
            match what {
                0 => bytes[at] = byte,
                1 => bytes[at] = byte % 10 + b'0',
                _ => { bytes.remove(at); }
            }
        }
        match import(&bytes) {
            Ok(incoming) => { let _ = plans(&model_of(&incoming)); }
            Err(fault) => prop_assert!(!fault.fault.is_empty()),
        }
    }
}
