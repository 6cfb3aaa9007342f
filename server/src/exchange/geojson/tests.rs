//! Plans out and in again, plans as others draw them, and whatever must be refused.

use std::collections::BTreeMap;

use mapfold_map::gdb::{LandmarkConfig, Model, Plan, Structure, landmarks};
use mapfold_schema::geojson::write;
use mapfold_schema::v1::ObjectKind;
use proptest::prelude::*;
use serde_json::{Value, json};

use super::super::incoming::{FileFault, Incoming};
use super::super::sample::{FRAME, Sample, mapped, model_of, plans};
use super::*;

const OPTIONS: Options = Options { unit_m: None, wall_height_m: 2.5 };

fn import(bytes: &[u8]) -> Result<Incoming, FileFault> {
    read(bytes, FRAME, &BTreeMap::new(), &OPTIONS)
}

/// Two rooms round a thin partition with a doorway, a machine in one, and a screen without thickness.
fn floor() -> Model {
    let block = |kind: &str, [x0, y0]: [f64; 2], [x1, y1]: [f64; 2]| json!({"kind": kind, "solids": [{"box": {"from_m": [x0, y0, 0.0], "to_m": [x1, y1, 2.4]}}]});
    let screen = json!({"kind": "other", "solids": [{"polyhedron": {
        "vertices_m": [[6.0, 1.0, 0.0], [7.5, 1.25, 0.0], [7.5, 1.25, 2.0], [6.0, 1.0, 2.0]],
        "faces": [[[0, 1, 2, 3]]]}}]});
    let half = (0.2_f64 / 2.0).sin_cos();
    let mut machine = block("machine", [-0.5, -0.3], [0.5, 0.3]);
    machine["placement"] =
        json!({"position_m": [2.0, 3.0, 0.0], "rotation": [half.1, 0.0, 0.0, half.0]});
    let objects = [
        block("wall", [-0.2, -0.2], [8.2, 0.0]),
        block("wall", [-0.2, 6.0], [8.2, 6.2]),
        block("wall", [-0.2, 0.0], [0.0, 6.0]),
        block("wall", [8.0, 0.0], [8.2, 6.0]),
        block("wall", [4.0, 0.0], [4.1, 6.0]),
        block("doorway", [3.9, 2.0], [4.2, 2.9]),
        machine,
        screen,
    ];
    let objects = objects.into_iter().zip(1_u128..);
    let objects = objects
        .map(|(value, n)| (uuid::Uuid::from_u128(n), serde_json::from_value(value).unwrap()));
    mapped(&objects.collect(), &BTreeMap::new())
}

fn written(plan: &Plan) -> Vec<u8> {
    let mut bytes = Vec::new();
    write(None, Some((plan, &landmarks(plan, &LandmarkConfig::STANDARD))), &mut bytes).unwrap();
    bytes
}

/// Outlines, sheets and openings as corners, and landmarks: a plan without what its things are called.
fn drawn(plan: &Plan) -> Vec<String> {
    // Without corners that are none: where one wall goes on as another.
    let ring = |ring: Vec<[i64; 2]>| {
        let bends = |k: usize| {
            let [before, at, after] = [k + ring.len() - 1, k, k + 1].map(|k| ring[k % ring.len()]);
            let [u, v] = [[before, at], [at, after]].map(|[p, q]| [q[0] - p[0], q[1] - p[1]]);
            i128::from(u[0]) * i128::from(v[1]) != i128::from(u[1]) * i128::from(v[0])
        };
        let mut ring: Vec<[i64; 2]> =
            (0..ring.len()).filter(|k| bends(*k)).map(|k| ring[k]).collect();
        let least = ring.iter().enumerate().min_by_key(|(_, p)| **p).map_or(0, |(k, _)| k);
        ring.rotate_left(least);
        format!("{ring:?}")
    };
    let at = |p: mapfold_map::gdb::PlanPoint| [p.x, p.y];
    let outlines = plan
        .outlines()
        .iter()
        .map(|o| format!("outline {}", ring(plan.edges_of(o).map(|edge| at(edge.from)).collect())));
    let sheets = plan.sheets().iter().map(|s| {
        let ends = plan.edges_of_sheet(s).flat_map(|edge| [at(edge.from), at(edge.to)]);
        let mut ends: Vec<[i64; 2]> = ends.collect();
        ends.sort_unstable();
        format!("sheet {ends:?}")
    });
    let openings = plan.openings().iter().map(|opening| {
        let mut sides: Vec<_> =
            opening.sides.iter().map(|side| [at(side.from), at(side.to)]).collect();
        sides.sort_unstable();
        format!("opening {sides:?}")
    });
    let landmarks = landmarks(plan, &LandmarkConfig::STANDARD).into_iter().map(|l| {
        let heading = (1e6 * l.landmark.direction).round();
        format!("{:?} {:?} {heading} {:.6}", l.id.kind, at(l.id.at), l.extent)
    });
    let mut all: Vec<String> = outlines.chain(sheets).chain(openings).chain(landmarks).collect();
    all.sort_unstable();
    all
}

#[test]
fn a_plan_that_went_out_comes_back_with_the_same_outlines_doorways_and_landmarks() {
    let plan = Structure::of(&floor()).plan(0.3);
    assert_eq!((plan.sheets().len(), plan.openings().len()), (1, 1));
    let incoming = import(&written(&plan)).unwrap();
    let back = Structure::of(&model_of(&incoming)).plan(0.3);
    assert_eq!(drawn(&back), drawn(&plan));
    let count = |kind| incoming.report.kinds.iter().find(|k| k.kind == kind).map_or(0, |k| k.count);
    // The walls with their rooms, the machine, the screen, and the wall over the door.
    assert_eq!([ObjectKind::Wall, ObjectKind::Doorway].map(count), [4, 1]);
    // The same file is the same model.
    assert_eq!(import(&written(&plan)).unwrap().objects, incoming.objects);
}

fn collection(frame: &str, features: &[Value]) -> Vec<u8> {
    let mut collection = json!({"type": "FeatureCollection", "features": features});
    if !frame.is_empty() {
        collection["coordinate_frame"] = json!({"unit": frame});
    }
    collection.to_string().into_bytes()
}

fn feature(kind: &str, coordinates: &Value, properties: &Value) -> Value {
    let geometry = json!({"type": kind, "coordinates": coordinates});
    json!({"type": "Feature", "geometry": geometry, "properties": properties})
}

#[test]
fn lines_are_walls_polygons_are_what_they_are_said_to_be_and_points_are_left_out() {
    let square = json!([[[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0], [0.0, 0.0]]]);
    let features = [
        // The two faces of a wall of 20 cm.
        feature("LineString", &json!([[0, 5], [4, 5, 1.5]]), &json!(null)),
        feature("MultiLineString", &json!([[[4, 5.2], [0, 5.2]]]), &json!({"kind": "wall"})),
        feature("Polygon", &square, &json!({"kind": "machine", "name": "mill"})),
        feature("MultiPolygon", &json!([square]), &json!({"kind": "Bürostuhl"})),
        feature("Point", &json!([1, 2]), &json!({})),
        feature("LineString", &json!([[0, 9], [1, 9]]), &json!({"kind": "furniture"})),
    ];
    let incoming = import(&collection("m", &features)).unwrap();
    let count = |kind| incoming.report.kinds.iter().find(|k| k.kind == kind).map_or(0, |k| k.count);
    // One of two faces, and four round the polygon of which nobody knows what it is.
    assert_eq!([ObjectKind::Wall, ObjectKind::Machine].map(count), [5, 1]);
    assert!(incoming.objects.values().any(|object| object.name == "mill"));
    let left: Vec<&str> = incoming.report.left_out.iter().map(|l| l.what.as_str()).collect();
    assert_eq!(left, ["open lines of other things than walls", "points"]);
    let unit = Options { unit_m: Some(0.5), ..OPTIONS };
    let half = read(&collection("", &features), FRAME, &BTreeMap::new(), &unit).unwrap();
    let bounds = [&half, &incoming].map(|incoming| incoming.report.bounds.unwrap().max_x_m);
    assert!((2.0 * bounds[0] - bounds[1]).abs() < 1e-6, "{bounds:?}");
}

#[test]
fn degrees_are_metres_about_the_middle_and_what_is_none_is_refused() {
    let line = |from: [f64; 2], to: [f64; 2]| feature("LineString", &json!([from, to]), &json!({}));
    let degrees = collection("", &[line([-2.978, 56.4600], [-2.978, 56.4609])]);
    let incoming = import(&degrees).unwrap();
    let bounds = incoming.report.bounds.unwrap();
    // A degree of latitude is 111 343 m there.
    assert!((bounds.max_y_m - bounds.min_y_m - 100.2).abs() < 0.1, "{bounds:?}");
    assert!((bounds.max_y_m + bounds.min_y_m).abs() < 1e-3);
    assert!(incoming.report.warnings[0].contains("longitude -2.978"), "{:?}", incoming.report);
    let fault = import(&collection("", &[line([0.0, 0.0], [30.0, 20.0])])).unwrap_err();
    assert!(fault.fault.contains("unit_m"), "{fault}");
}

#[test]
fn json_fg_under_the_name_of_geojson_is_the_model_that_it_holds() {
    let sample = Sample::new();
    let mut bytes = Vec::new();
    super::super::jsonfg::write(sample.outgoing(), &mut bytes).unwrap();
    let incoming = import(&bytes).unwrap();
    assert_eq!(plans(&model_of(&incoming)), plans(&sample.model));
}

#[test]
fn what_is_no_plan_is_refused_with_its_place() {
    let bad = |coordinates: Value| feature("LineString", &coordinates, &json!({}));
    let ring = json!({"type": "Circle", "coordinates": [0, 0]});
    for (bytes, place) in [
        (b"[1, 2]".to_vec(), "line 1"),
        (b"{\"type\": \"FeatureCollection\"".to_vec(), "line 1"),
        (br#"{"type": "Feature", "features": []}"#.to_vec(), "/type"),
        (collection("m", &[bad(json!([[0, 0], [1]]))]), "/features/0/geometry/coordinates"),
        (collection("m", &[bad(json!([0, 1]))]), "/features/0/geometry/coordinates"),
        (collection("m", &[json!({"geometry": ring})]), "/features/0/geometry/type"),
        (collection("m", &[bad(json!([[0, 0], [1e300, 0]]))]), "/features/0, wall 0"),
        (vec![b'['; 1 << 20], "line 1"),
    ] {
        let fault = import(&bytes).unwrap_err();
        assert!(fault.place.starts_with(place), "{place}: {fault}");
        assert!(!fault.fault.is_empty());
    }
    let many = vec![json!({}); 200_001];
    assert!(import(&collection("m", &many)).unwrap_err().fault.contains("200000"));
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 96, ..ProptestConfig::default() })]

    /// Whatever is changed in a plan, it is read or refused with a place.
    #[test]
    fn changed_plans_are_read_or_refused(
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0..5_u8), 1..6),
    ) {
        let mut bytes = written(&Structure::of(&floor()).plan(0.3));
        super::super::sample::changed(&mut bytes, &edits);
        match import(&bytes) {
            Ok(incoming) => { let _ = plans(&model_of(&incoming)); }
            Err(fault) => prop_assert!(!fault.place.is_empty() && !fault.fault.is_empty()),
        }
    }
}
